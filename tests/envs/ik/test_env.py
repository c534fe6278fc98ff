"""FeedbackIK-v0: what actions mean, which limits always hold, rewards, ends, what is seen, refusals."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats32
from armtempo.envs import ACTION_MODES, PHYSICS, FeedbackIKEnv, Physics, ik_entries
from armtempo.envs.ik._kernels import allowed_speeds, rotation_vector
from armtempo.errors import ActionError, UnknownNameError
from armtempo.planners import IKCell
from armtempo.planners.cells import TARGET_FAMILIES, TargetFamilyName

STILL = np.zeros(6, dtype=np.float32)
PLAIN = np.zeros(4, dtype=np.float32)
NAMES = [entry.name for entry in ik_entries(6)]


def run(env: FeedbackIKEnv, *actions: Floats32, **reset: Any) -> tuple[dict[str, float], dict[str, Any]]:
    """To the end, the last action over and over: sums of the reward's terms, and the last info."""
    env.reset(**reset)
    sums: dict[str, float] = {}
    total, k = 0.0, 0
    while True:
        observation, reward, terminated, truncated, info = env.step(actions[min(k, len(actions) - 1)])
        assert env.observation_space.contains(observation)
        assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-15)
        for name, value in info["reward_terms"].items():
            assert type(value) is float
            assert value <= 0.0
            sums[name] = sums.get(name, 0.0) + value
        total += reward
        k += 1
        if terminated or truncated:
            return {**sums, "total": total}, {**info, "terminated": terminated, "truncated": truncated}


@pytest.mark.parametrize("physics", PHYSICS)
def test_the_law_at_its_own_gains_is_the_eulers_run(chung: IKCell, physics: Physics) -> None:
    env = FeedbackIKEnv(chung, action_mode="gains", physics=physics, record=True)
    sums, info = run(env, PLAIN)
    trace = env.trace
    env.close()
    oracle = chung.solver.track(chung.target, chung.start, integrator="euler")
    np.testing.assert_allclose(trace.reference, oracle.q, atol=1e-12)
    np.testing.assert_allclose(trace.q, oracle.q, atol=1e-8)
    assert trace.position_error.max() == pytest.approx(3.04e-6, abs=2e-8)  # the figure for Euler at 1 ms
    np.testing.assert_allclose(trace.position_error, oracle.position_error, atol=1e-8)
    assert info["terminated"]
    assert info["is_success"]
    assert info["time_s"] == pytest.approx(chung.duration) == pytest.approx(4.0 * math.pi, abs=0.01)
    assert not trace.capped.any()
    assert sums["caps"] == 0.0
    assert sums["total"] > -0.01


def test_actions_multiply_the_gains(chung: IKCell) -> None:
    """Without feed-forward the error is the target's speed over K_p: four times less of it at an action of 1."""
    config = chung.config.model_copy(update={"law": chung.config.law.model_copy(update={"feed_forward": False})})
    cell = IKCell.of(config, chung.arm)
    largest = {}
    for action in (-1.0, 0.0, 1.0):
        env = FeedbackIKEnv(cell, action_mode="gains", physics="ideal", max_episode_s=3.5, record=True)
        run(env, action * np.array([1, 0, 0, 0], dtype=np.float32))
        largest[action] = float(env.trace.position_error.max())
        env.close()
    assert largest[0.0] == pytest.approx(6.7162e-3, rel=3e-3)
    assert largest[0.0] / largest[1.0] == pytest.approx(4.0, rel=0.02)
    assert largest[-1.0] / largest[0.0] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("physics", PHYSICS)
def test_speeds_are_reached_at_the_end_of_the_period(chung: IKCell, physics: Physics) -> None:
    env = FeedbackIKEnv(chung, physics=physics, record=True)
    env.reset(seed=0)
    wanted = np.array([0.01, -0.02, 0.03, 0.01, 0.0, -0.01], dtype=np.float32)
    *_, info = env.step(wanted)
    trace, speeds = env.trace, wanted * chung.arm.speed_max
    assert not info["capped"]
    np.testing.assert_allclose(env.simulation.joint_speeds, speeds, atol=1e-15)
    ramp = (np.arange(10) + 0.5) / 10.0
    np.testing.assert_allclose(trace.joint_speed[1:], ramp[:, None] * speeds, atol=1e-11)
    np.testing.assert_allclose(trace.q[-1] - chung.start, 0.5 * chung.control_period * speeds, atol=1e-8)
    *_, info = env.step(np.ones(6, dtype=np.float32))  # 143 times what the accelerations allow
    assert info["capped"]
    np.testing.assert_allclose(
        env.simulation.joint_speeds, speeds + chung.arm.acceleration_max * chung.control_period, atol=1e-12
    )
    shares = np.minimum((chung.arm.speed_max - env.simulation.joint_speeds) / chung.arm.speed_max, 1.0)
    expected = -shares.mean() * chung.control_period / chung.duration
    assert info["reward_terms"]["caps"] == pytest.approx(expected)
    env.close()


@given(seed=st.integers(0, 10_000), unlimited=st.booleans())
@hypothesis_settings(max_examples=60)
def test_no_actions_break_a_cap_or_a_limit(seed: int, unlimited: bool) -> None:
    """Whatever is asked for, ramps and steps of speed keep speeds, accelerations and positions, for ever."""
    random = np.random.default_rng(seed)
    n, period = 3, 0.01
    speed, acceleration = random.uniform(0.5, 5.0, n), random.uniform(1.0, 50.0, n)
    if unlimited:
        acceleration[0] = np.inf
    low, high = -random.uniform(0.05, 1.0, n), random.uniform(0.05, 1.0, n)
    low[2] = -np.inf
    for late in (0.5, 1.0):
        q, v, after = np.zeros(n), np.zeros(n), np.empty(n)
        for k in range(400):
            asked = random.uniform(-1.5, 1.5, n) * speed if k % 100 < 50 else np.full(n, random.choice([-2, 2])) * speed
            allowed_speeds(q, v, asked, period, late, speed, acceleration, low, high, after)
            assert (np.abs(after) <= speed * (1 + 1e-12)).all()
            assert (np.abs(after - v) <= acceleration * period * (1 + 1e-12)).all()
            q = q + period * ((1.0 - late) * v + late * after)
            assert (q >= low - 1e-12).all()
            assert (q <= high + 1e-12).all()
            v = after.copy()


def test_a_joint_stops_at_its_limit_in_the_simulation(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, physics="bullet", max_episode_s=5.0, record=True)
    action = np.array([0, 0, 0, 0, 0, -1], dtype=np.float32)
    _, info = run(env, action)
    trace = env.trace
    env.close()
    low = chung.arm.position_min[5]
    assert trace.reference[:, 5].min() >= low
    assert trace.reference[-1, 5] == pytest.approx(low, abs=1e-3)
    assert trace.q[:, 5].min() > low - 1e-4
    assert info["truncated"]
    assert not info["is_success"]


def held_signs(random: np.random.Generator, joints: int, periods: int) -> list[Floats32]:
    """Full speeds, whose signs change every so many periods."""
    return [a for signs in random.choice([-1.0, 1.0], (12, joints)) for a in [signs.astype(np.float32)] * periods]


@pytest.mark.parametrize("name", ["panda-poses", "chung"])
@pytest.mark.parametrize("periods", [1, 30])
def test_whatever_the_actions_the_arm_keeps_to_its_reference(name: str, periods: int) -> None:
    """The Panda's accelerations together take 4 times its torques, and at full speeds its wrist cannot even coast."""
    env = FeedbackIKEnv(name, max_episode_s=3.5 if periods > 1 else 0.5, record=True)
    joints = env.cell.arm.dof
    run(env, *held_signs(np.random.default_rng(0), joints, periods), *[np.ones(joints, np.float32)] * 40, seed=0)
    trace, arm = env.trace, env.cell.arm
    env.close()
    assert (np.abs(trace.demand) <= trace.torque_max).all()
    assert (np.abs(trace.joint_speed) <= 1.01 * arm.speed_max).all()
    assert (trace.q >= arm.position_min - 1e-5).all()
    assert (trace.q <= arm.position_max + 1e-5).all()
    np.testing.assert_allclose(trace.q, trace.reference, atol=1e-5)
    if periods > 1:
        assert (np.abs(trace.joint_speed) / arm.speed_max).max() > 0.9  # and it is not for want of moving


def test_heavier_bodies_are_not_lost() -> None:
    """Torques planned to the limit are clipped then; the reference starts over from the arm."""
    env = FeedbackIKEnv("panda-poses", model_error=0.2, max_episode_s=3.0, record=True)
    run(env, *held_signs(np.random.default_rng(0), 7, 30), seed=0)
    trace, arm = env.trace, env.cell.arm
    env.close()
    assert (np.abs(trace.demand) > trace.torque_max).any()
    assert (np.abs(trace.joint_speed) <= 1.01 * arm.speed_max).all()
    assert (trace.q >= arm.position_min - 1e-3).all()
    assert (trace.q <= arm.position_max + 1e-3).all()
    np.testing.assert_allclose(trace.q, trace.reference, atol=1e-3)


def test_an_episode_cut_off_is_no_success_and_its_rms_is_over_all_ticks(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, action_mode="gains", physics="ideal", max_episode_s=0.3, record=True)
    _, info = run(env, PLAIN)
    assert info["truncated"]
    assert info["position_error_rms_m"] < 1e-3
    assert not info["is_success"]
    rms = np.sqrt(np.mean(env.trace.position_error[1:] ** 2))
    assert info["position_error_rms_m"] == pytest.approx(rms)
    assert info["position_error_rms_mm"] == 1e3 * info["position_error_rms_m"]
    env.close()


def test_effort_and_caps_go_to_their_bounds(chung: IKCell) -> None:
    """Signs that change every period are nearly all cut; an arm stretched out works harder than one at its start."""
    env = FeedbackIKEnv(chung, max_episode_s=1.0)
    share = 1.0 / chung.duration
    flips = [np.full(6, (-1) ** k, dtype=np.float32) for k in range(100)]
    sums, info = run(env, *flips)
    assert info["capped"]
    assert -share <= sums["caps"] < -0.9 * share
    assert -0.1 * share <= sums["effort"] < 0.0
    still, _ = run(env, STILL)
    assert still["caps"] == 0.0
    assert sums["effort"] < 1.2 * still["effort"] < 0.0
    env.close()


@pytest.mark.parametrize("mode", ACTION_MODES)
def test_rewards_keep_their_bounds(chung: IKCell, mode: str) -> None:
    size = 6 if mode == "speeds" else 4
    random = np.random.default_rng(1)
    env = FeedbackIKEnv(chung, action_mode=mode, family="partly-unreachable")  # type: ignore[arg-type]
    actions = [random.uniform(-1.0, 1.0, size).astype(np.float32) for _ in range(300)]
    sums, info = run(env, *actions, seed=0)
    env.close()
    assert info["terminated"]
    for name, bound in (("position", 1.0), ("orientation", 1.0), ("effort", 0.1), ("caps", 1.0)):
        assert -bound - 1e-9 <= sums[name] <= 0.0
    assert sums["effort"] < 0.0


def test_the_reward_is_what_the_trace_says(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, physics="bullet", max_episode_s=1.0, record=True)
    sums, info = run(env, STILL)
    trace, config = env.trace, chung.config
    env.close()
    x, y = trace.position_error[1:] / config.error_scale_m, trace.orientation_error[1:] / config.error_scale_rad
    share = 1.0 / chung.duration
    assert sums["position"] == pytest.approx(-(x / (1 + x)).mean() * share)
    assert sums["orientation"] == pytest.approx(-(y / (1 + y)).mean() * share)
    assert sums["effort"] == pytest.approx(-0.1 * ((trace.torque[1:] / trace.torque_max) ** 2).mean() * share)
    assert info["position_error_m"] == pytest.approx(trace.position_error[-1])
    assert info["position_error_mm"] == 1e3 * info["position_error_m"]
    assert info["singular_value"] == pytest.approx(trace.singular_value[-1])
    assert info["truncated"]


def test_errors_are_those_of_forward_kinematics(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, family="near-singular", max_episode_s=1.0, record=True)
    random = np.random.default_rng(0)
    run(env, *(random.uniform(-1, 1, 6).astype(np.float32) for _ in range(100)), seed=4)
    trace = env.trace
    env.close()
    assert trace.cell is not chung
    T, target = chung.arm.tip_pose(trace.q), trace.cell.target
    rows = slice(0, 2 * len(trace.q), 2)
    np.testing.assert_allclose(trace.error[:, :3], target.position[rows] - T[:, :3, 3], atol=1e-12)
    turn = Rotation.from_matrix(target.rotation[rows] @ T[:, :3, :3].transpose(0, 2, 1)).as_rotvec()
    np.testing.assert_allclose(trace.error[:, 3:], turn, atol=1e-9)


@pytest.mark.parametrize("axis", [[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0, -0.8], [1, 2, 3]])
@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, math.pi - 1e-7, math.pi])
def test_rotation_vectors_at_every_angle(axis: list[float], angle: float) -> None:
    wanted = angle * np.array(axis) / np.linalg.norm(axis)
    vector = np.empty(3)
    rotation_vector(Rotation.from_rotvec(wanted).as_matrix(), vector)
    off = min(np.abs(vector - wanted).max(), np.abs(vector + wanted).max() if angle > 3.0 else math.inf)
    assert off < 1e-6


def test_a_model_error_shows_as_a_pose_error(chung: IKCell) -> None:
    worst = {}
    for error in (0.0, 0.1):
        env = FeedbackIKEnv(chung, action_mode="gains", model_error=error, max_episode_s=2.0, record=True)
        run(env, PLAIN)
        worst[error] = float(env.trace.position_error.max())
        env.close()
    assert worst[0.0] < 1e-5
    assert 1e-3 > worst[0.1] > 5.0 * worst[0.0]


def test_observations_say_what_the_table_says(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung)
    assert env.observation_space.shape == (46,) == (3 * 6 + 28,)
    first, info = env.reset(seed=0)
    assert info["position_error_m"] < 1e-12
    seen = dict(zip(NAMES, first.tolist(), strict=True))
    assert (seen["progress"], seen["torque_use"], seen["joint_speed_0"], seen["target_velocity_x"]) == (-1, -1, 0, 0)
    assert seen["joint_0"] == pytest.approx(chung.start[0] / (2.0 * math.pi), abs=1e-6)
    value = float(chung.singular_value(chung.start))
    assert value == pytest.approx(0.1906, abs=1e-4)
    assert seen["singular_value"] == pytest.approx(2.0 * value / (value + 0.02) - 1.0, abs=1e-6)
    room = (2.0 * math.pi - np.abs(chung.start).max()) / (2.0 * math.pi)
    assert seen["margin"] == pytest.approx(2.0 * room - 1.0, abs=1e-6)
    for _ in range(50):
        observation, *_, info = env.step(STILL)
    seen = dict(zip(NAMES, observation.tolist(), strict=True))
    simulation, target = env.simulation, chung.target
    q, row = simulation.joint_positions()[0], 1000
    error = (target.position[row] - chung.arm.tip_pose(q)[:3, 3]) / 0.01
    assert seen["position_error_y"] == pytest.approx(error[1] / (1.0 + abs(error[1])), abs=1e-6)
    ahead = (target.position[row + 200] - chung.arm.tip_pose(q)[:3, 3]) / 0.1
    assert seen["ahead_10_position_z"] == pytest.approx(ahead[2] / (1.0 + abs(ahead[2])), abs=1e-6)
    v = target.velocity[row, 2] / chung.solver.length
    assert seen["target_velocity_z"] == pytest.approx(v / (1.0 + abs(v)), abs=1e-6)
    assert seen["progress"] == pytest.approx(2.0 * 0.5 / chung.duration - 1.0, abs=1e-6)
    env.close()


@pytest.mark.parametrize("family", TARGET_FAMILIES[1:])
def test_every_seed_draws_another_target_on_which_the_arm_starts(chung: IKCell, family: TargetFamilyName) -> None:
    env = FeedbackIKEnv(chung, family=family, physics="ideal")
    starts = []
    for seed in range(3):
        _, info = env.reset(seed=seed)
        starts.append(tuple(env.simulation.cell.start))
        assert info["position_error_m"] < 1e-12
        assert env.reset(seed=seed)[1] == info
    assert len(set(starts)) == 3
    assert env.reset(options={"family": "given"})[1]["duration_s"] == chung.duration
    assert env.simulation.cell is chung
    env.close()


def test_pictures_show_the_target(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, render_mode="rgb_array", physics="ideal")
    pictures = []
    for seed, family in ((0, "given"), (1, "smooth")):
        env.reset(seed=seed, options={"family": family})
        for _ in range(2):
            picture = env.render()
            assert picture is not None
            assert picture.shape == (480, 640, 3)
            assert picture.dtype == np.uint8
            pictures.append(picture)
            env.simulation._ticks += 1000  # the target moves on, the arm does not
    assert (pictures[0] != pictures[1]).any()
    assert (pictures[0] != pictures[2]).any()
    red, green, blue = (
        (pictures[0][..., k].astype(int) - pictures[0][..., [i for i in range(3) if i != k]].max(axis=-1) > 80).sum()
        for k in range(3)
    )
    assert min(red, green, blue) > 5  # rods of the target's axes
    env.close()


def test_wrong_actions_and_families_are_refused(chung: IKCell) -> None:
    env = FeedbackIKEnv(chung, physics="ideal")
    env.reset(seed=0)
    for action in (np.full(6, math.nan), np.ones(5), np.ones((1, 6)), 0.5, "fast", None):
        with pytest.raises(ActionError, match=r"action of puma must be 6 finite numbers in an array of shape \(6,\)"):
            env.step(action)  # type: ignore[arg-type]
    assert env.simulation.time == 0.0
    env.step(9.0 * np.ones(6, dtype=np.float32))  # clipped
    with pytest.raises(UnknownNameError, match=r"unknown family of targets 'smoth' \(did you mean 'smooth'"):
        env.reset(options={"family": "smoth"})
    env.close()


def test_wrong_names_of_options_are_refused(chung: IKCell) -> None:
    for options, known in (
        ({"action_mode": "torques"}, "gains, speeds"),
        ({"family": "zigzag"}, "near-singular"),
    ):
        with pytest.raises(UnknownNameError, match=known):
            FeedbackIKEnv(chung, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("action", [[0.5, -0.25, 0.75, 0.4], [0.0, 0.0, 0.0, 1.0]])
def test_gains_are_those_of_a_cell_that_has_them(chung: IKCell, action: list[float]) -> None:
    """Also where the damping would be more than it can be: it ends at 0.9."""
    law = chung.config.law.model_copy(update={"damping": 0.3})
    base = (law.position_gain_1_s, law.approach_gain_1_s, law.normal_gain_1_s, law.damping)
    values = [4.0**power * gain for power, gain in zip(action, base, strict=True)]
    names = ("position_gain_1_s", "approach_gain_1_s", "normal_gain_1_s", "damping")
    changed = law.model_copy(update=dict(zip(names, [*values[:3], min(values[3], 0.9)], strict=True)))
    seen = []
    for one, asked in ((law, action), (changed, [0.0] * 4)):
        cell = IKCell.of(chung.config.model_copy(update={"law": one}), chung.arm)
        env = FeedbackIKEnv(cell, action_mode="gains", physics="ideal", max_episode_s=0.5)
        run(env, np.array(asked, dtype=np.float32))
        seen.append(env.simulation.joint_positions())
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-9)
    assert np.abs(seen[0] - chung.start).max() > 0.01
