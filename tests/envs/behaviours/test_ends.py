"""How episodes end: arrival, violation, time-out, and arms that arrive before others."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.envs import PHYSICS, CoordinationEnv, Physics, YieldingEnv
from armtempo.planners import CoordinationCell

FULL = np.ones(1, dtype=np.float32)
STOP = -FULL
FAR_APART = 0.15  # [s] the master late: both at full speed pass without a violation


def _all(env: CoordinationEnv, action: np.ndarray = FULL) -> dict[str, np.ndarray]:
    return dict.fromkeys(env.agents, action)


def test_ideal_arrives_at_the_minimum_time_inside_the_tick(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal", master_late_s=FAR_APART, record=True)
    env.reset()
    while env.agents:
        env.step(_all(env))
    for plane, late, arrival in zip(lee1991.planes, (FAR_APART, 0.0), env.trace.arrival, strict=True):
        lam, mu, clock = 0.0, 0.0, 0.0
        while lam < plane.length:  # the same periods, by the planner
            lam, mu, used = plane.advance(lam, mu, 1.0, lee1991.control_period)
            clock += used
        assert arrival - late == pytest.approx(clock, abs=2e-5)
        assert arrival - late == pytest.approx(plane.fastest().duration, abs=5e-5)  # cut into periods
    assert (env.trace.arrival % lee1991.physics_tick > 1e-6).all()  # not rounded to ticks
    np.testing.assert_array_equal(env.simulation.lam, [path.length for path in lee1991.paths])
    np.testing.assert_array_equal(env.simulation.mu, 0.0)
    env.close()


def test_bullet_arrives_within_one_percent_of_the_plan(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="bullet", master_late_s=FAR_APART, record=True)
    env.reset()
    while env.agents:
        env.step(_all(env))
    trace = env.trace
    planned = np.array([motion.duration for motion in lee1991.fastest])
    took = trace.arrival - [FAR_APART, 0.0]
    assert (took >= planned - 1e-9).all()
    assert (took <= 1.01 * planned).all()
    assert trace.torque_ratio_max <= 1.0
    assert trace.path_error.max() < 2e-4
    assert trace.violations == 0
    env.close()


def test_bullet_arrival_is_the_first_tick_of_lasting_rest(lee1991: CoordinationCell) -> None:
    """By hand from the recorded joint positions: within 1 mm, below 10 mm/s, for 20 ms."""
    env = CoordinationEnv(lee1991, physics="bullet", master_late_s=FAR_APART, record=True)
    env.reset()
    while env.agents:
        env.step(_all(env))
    trace, tick = env.trace, lee1991.physics_tick
    for i, (arm, path) in enumerate(zip(lee1991.arms, lee1991.paths, strict=True)):
        tips = arm.tip_pose(trace.q[i])[:, :3, 3]
        goal = arm.tip_pose(path.evaluate(path.length)[0])[:3, 3]
        speed = np.append(0.0, np.linalg.norm(np.diff(tips, axis=0), axis=1) / tick)
        calm = (np.linalg.norm(tips - goal, axis=1) < 1e-3) & (speed < 1e-2)
        ended = np.flatnonzero(trace.lam[:, i] >= path.length)[0]
        settled = next(k for k in range(ended, len(calm)) if calm[k : k + 21].all())
        assert trace.arrival[i] == pytest.approx(trace.time[settled], abs=1e-9)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_time_out_is_a_truncation_at_five_sequential_times(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics)
    env.reset()
    while env.agents:
        _, _, terminations, truncations, infos = env.step(_all(env, STOP))
        assert not any(terminations.values())
    assert truncations == {"arm_0": True, "arm_1": True}
    limit = 5.0 * lee1991.sequential_makespan
    assert limit <= env.simulation.time < limit + lee1991.control_period + 1e-9
    assert infos["arm_0"]["is_success"] is False
    np.testing.assert_array_equal(env.simulation.lam, 0.0)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_own_time_limit(lee1991: CoordinationCell, physics: Physics) -> None:
    env = YieldingEnv(lee1991, physics=physics, max_episode_s=0.02)
    env.reset()
    steps = [env.step(STOP)[2:4] for _ in range(5)]
    assert steps == [(False, False)] * 4 + [(False, True)]
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_violation_ends_the_episode_for_all(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, record=True)
    env.reset()
    while env.agents:
        _, _, terminations, truncations, infos = env.step(_all(env))
    assert terminations == {"arm_0": True, "arm_1": True}
    assert not any(truncations.values())
    assert all(info["violation"] and not info["is_success"] and "arrival_s" not in info for info in infos.values())
    trace = env.trace
    assert trace.violations == 1
    assert trace.clearance[-1] < lee1991.d_min <= trace.clearance[:-1].min()
    assert infos["arm_1"]["min_clearance_m"] == trace.clearance[-1]
    assert np.isnan(trace.makespan)
    env.close()


def test_both_physics_find_the_violation_at_the_same_tick(lee1991: CoordinationCell) -> None:
    instants = []
    for physics in PHYSICS:
        env = CoordinationEnv(lee1991, physics=physics)
        env.reset()
        while env.agents:
            env.step(_all(env))
        instants.append(env.simulation.time)
        env.close()
    assert instants[0] == pytest.approx(instants[1], abs=1.5 * lee1991.physics_tick)


@pytest.mark.parametrize("physics", PHYSICS)
def test_the_clearance_of_the_trace_is_fcl_at_every_tick(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, master_late_s=0.07, record=True)
    env.reset()
    while env.agents:
        env.step(_all(env, np.array([0.8], dtype=np.float32)))
    trace = env.trace
    true = np.array([lee1991.clearance.arms(q).distance for q in zip(*trace.q, strict=True)])
    if physics == "bullet":  # where it is not a new minimum, a lower bound
        assert (trace.clearance <= true + 1e-9).all()
        np.testing.assert_allclose(np.minimum.accumulate(trace.clearance), np.minimum.accumulate(true), atol=1e-9)
    else:  # bilinear in a table
        np.testing.assert_allclose(trace.clearance, true, atol=3e-4)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_one_arm_arrives_early_and_the_other_goes_on(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, master_late_s=0.3)
    env.reset()
    while env.agents == ["arm_0", "arm_1"]:
        _, _, terminations, _, infos = env.step(_all(env))
    assert env.agents == ["arm_0"]
    assert terminations == {"arm_0": False, "arm_1": True}
    assert infos["arm_1"]["is_success"] is True
    parked = env.simulation.joint_positions()[1]
    while env.agents:
        observations, *_, infos = env.step(_all(env))
        assert list(observations) == ["arm_0"]
    assert infos["arm_0"]["is_success"] is True
    np.testing.assert_allclose(env.simulation.joint_positions()[1], parked, atol=1e-4)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_late_master_stands_still_until_then(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, record=True)
    env.reset(options={"master_late_s": 0.1015})
    for _ in range(30):
        env.step(_all(env))
    trace = env.trace
    standing = trace.time <= 0.1015
    assert (trace.lam[standing, 0] == 0.0).all()
    assert (trace.lam[~standing, 0] > 0.0).all()
    env.reset()
    env.step(_all(env))
    assert env.simulation.lam[0] > 0.0  # the option was for one episode
    env.close()


def test_yielding_draws_how_late_the_master_is(lee1991: CoordinationCell) -> None:
    env = YieldingEnv(lee1991, physics="ideal", master_late_s=(0.02, 0.15))
    drawn = [env.reset(seed=0)[1]["master_late_s"], *(env.reset()[1]["master_late_s"] for _ in range(30))]
    assert len(set(drawn)) == len(drawn)
    assert min(drawn) >= 0.02
    assert max(drawn) <= 0.15
    assert env.reset(options={"master_late_s": 0.5})[1]["master_late_s"] == 0.5
    assert env.reset(seed=0)[1]["master_late_s"] == drawn[0]
    env.close()


def test_yielding_may_learn_the_master(lee1991: CoordinationCell) -> None:
    env = YieldingEnv(lee1991, learner="master", physics="ideal")
    env.reset()
    terminated = False
    while not terminated:
        _, _, terminated, truncated, info = env.step(STOP if env.simulation.time < 0.2 else FULL)
        assert not truncated
    assert info["is_success"]
    assert env.simulation.arrival[1] < env.simulation.arrival[0]
    env.close()
