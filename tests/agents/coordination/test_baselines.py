"""Baseline policies in PyBullet: no collision, no torque above its limit, in time, behind any master."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.agents import COORDINATION_POLICIES, Actions, Observations, Policy, make_policy, run_episode, to_action
from armtempo.agents.coordination._order_policies import ORDER_POLICIES
from armtempo.envs import MODES, PHYSICS, CoordinationEnv, CoordinationTrace, Physics
from armtempo.errors import UnknownNameError
from armtempo.planners import METHODS, CoordinationCell, benchmark_instances, build_cell, schedule
from armtempo.planners.topp import Mode

SAFE = ("vci", "delay", "optimal", "sequential")
LATE = (0.0, 0.03, 0.1, 0.15)


def _run(
    cell: CoordinationCell,
    name: str,
    *,
    physics: Physics = "bullet",
    mode: Mode = "speed",
    late: float = 0.0,
    seed: int = 0,
) -> CoordinationTrace:
    env = CoordinationEnv(cell, physics=physics, mode=mode, master_late_s=late, record=True)
    try:
        return run_episode(env, make_policy(name, cell), seed)[0]
    finally:
        env.close()


@pytest.fixture(scope="module")
def coarse(lee1991: CoordinationCell) -> CoordinationCell:
    """The same cell at the usual 240 Hz."""
    return build_cell(lee1991.config.model_copy(update={"physics_tick_s": 1 / 240, "control_period_s": 1 / 240}))


def _is_safe(trace: CoordinationTrace, cell: CoordinationCell, path_error: float) -> None:
    assert trace.violations == 0
    assert np.isfinite(trace.makespan)
    assert trace.clearance.min() >= cell.d_min
    assert trace.torque_ratio_max <= 1.0
    assert trace.path_error.max() < path_error


@pytest.mark.parametrize("late", LATE)
@pytest.mark.parametrize("name", SAFE)
def test_at_1_khz(lee1991: CoordinationCell, name: str, late: float) -> None:
    trace = _run(lee1991, name, late=late)
    _is_safe(trace, lee1991, 2e-4)
    planned = schedule(lee1991, name).makespan
    if late == 0.0:
        assert trace.makespan == pytest.approx(planned, rel=0.01)
    else:  # what the master is late is the most that it costs, and some periods to notice and to catch up
        assert planned < trace.makespan <= planned + late + 5.0 * lee1991.control_period


@pytest.mark.parametrize("late", LATE)
@pytest.mark.parametrize("name", SAFE)
def test_at_240_hz(coarse: CoordinationCell, name: str, late: float) -> None:
    trace = _run(coarse, name, late=late)
    _is_safe(trace, coarse, 5e-4)
    if late == 0.0:
        assert trace.makespan == pytest.approx(schedule(coarse, name).makespan, rel=0.03)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", SAFE)
def test_in_both_modes_and_without_physics(lee1991: CoordinationCell, name: str, mode: Mode) -> None:
    for late in (0.0, 0.1):
        trace = _run(lee1991, name, physics="ideal", mode=mode, late=late)
        assert trace.violations == 0
        assert trace.makespan == pytest.approx(
            schedule(lee1991, name).makespan + late, abs=5.0 * lee1991.control_period
        )
    _is_safe(_run(lee1991, name, mode=mode), lee1991, 2e-4)


@pytest.mark.parametrize("physics", PHYSICS)
def test_full_speed_for_both_collides(lee1991: CoordinationCell, physics: Physics) -> None:
    """The tests above can fail."""
    trace = _run(lee1991, "phase-plane", physics=physics)
    assert trace.violations == 1
    assert trace.clearance.min() < lee1991.d_min


@pytest.mark.parametrize("name", ["constant-speed", "constant-acceleration"])
def test_the_papers_other_profiles_finish(lee1991: CoordinationCell, name: str) -> None:
    trace = _run(lee1991, name)
    _is_safe(trace, lee1991, 2e-4)
    assert trace.makespan == pytest.approx(schedule(lee1991, name).makespan, rel=0.01)


def test_the_papers_order_of_methods(lee1991: CoordinationCell) -> None:
    """Velocity control and delay save more than 40 % of the sequential time; the paper's 45 % is 0.33 s."""
    makespan = {name: _run(lee1991, name).makespan for name in METHODS}
    assert makespan["delay"] == pytest.approx(0.328, abs=0.003)
    assert makespan["optimal"] == pytest.approx(makespan["delay"], abs=1e-9)
    assert makespan["delay"] <= makespan["vci"] <= 0.352
    assert makespan["vci"] < makespan["constant-speed"] < makespan["constant-acceleration"] < makespan["sequential"]
    assert 0.38 < 1.0 - makespan["vci"] / lee1991.sequential_makespan < 0.45


class _Disturbed:
    """A policy whose master is held: it brakes for some periods, whatever the policy asks of it."""

    def __init__(self, policy: Policy[Observations, Actions], periods: range, command: float = 0.0) -> None:
        self.policy, self.periods, self.command = policy, periods, command
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        self.policy.reset(seed)
        self.period = 0

    def act(self, observations: Observations, env: CoordinationEnv) -> dict[str, np.ndarray]:
        actions = self.policy.act(observations, env)
        if self.period in self.periods and "arm_0" in actions:
            actions["arm_0"] = to_action(self.command)
        self.period += 1
        return actions


@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize("name", SAFE)
@pytest.mark.parametrize(
    ("periods", "command"),
    [(range(10, 60), 0.0), (range(25, 90), 0.0), (range(40, 100), 0.0), (range(5, 300), 0.35), (range(0, 150, 2), 0.0)],
)
def test_a_master_that_stops_or_dawdles_costs_time_only(
    lee1991: CoordinationCell, name: str, periods: range, command: float, physics: Physics
) -> None:
    env = CoordinationEnv(lee1991, physics=physics, record=True)
    trace, _ = run_episode(env, _Disturbed(make_policy(name, lee1991), periods, command))
    env.close()
    assert trace.violations == 0
    assert np.isfinite(trace.makespan)
    assert trace.makespan > schedule(lee1991, name).makespan


@pytest.mark.parametrize("mode", MODES)
def test_vci_behind_any_master(lee1991: CoordinationCell, mode: Mode) -> None:
    """Random masters: never a collision, whatever they do."""
    env = CoordinationEnv(lee1991, physics="ideal", mode=mode, record=True)
    policy = make_policy("vci", lee1991)
    for seed in range(5):
        random = np.random.default_rng(seed)
        observations, _ = env.reset(seed=seed)
        policy.reset(seed)
        command, temper = 1.0, random.uniform(0.2, 0.9)
        while env.agents:
            if random.uniform() < 0.1:
                command = random.choice(
                    [0.0, 1.0, random.uniform()], p=[0.4 * (1 - temper), temper, 0.6 * (1 - temper)]
                )
            actions = policy.act({agent: observations[agent] for agent in env.agents}, env)
            if "arm_0" in actions:
                actions["arm_0"] = to_action(command)
            observations, *_ = env.step(actions)
        assert env.trace.violations == 0
        assert np.isfinite(env.trace.arrival[1])
    env.close()


def test_random_is_seeded(lee1991: CoordinationCell) -> None:
    traces = [_run(lee1991, "random", physics="ideal", seed=seed) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(traces[0].lam, traces[1].lam)
    assert traces[0].lam.shape != traces[2].lam.shape or (traces[0].lam != traces[2].lam).any()


@pytest.mark.parametrize("name", COORDINATION_POLICIES)
def test_a_policy_forgets_the_last_episode(lee1991: CoordinationCell, name: str) -> None:
    shield = name in ORDER_POLICIES  # whom would they ask?
    env = CoordinationEnv(lee1991, physics="ideal", master_late_s=0.05, record=True, shield=shield)
    policy = make_policy(name, lee1991)
    first, reward = run_episode(env, policy, 3)
    observations, _ = env.reset()
    for _ in range(20):  # an episode that is broken off
        observations, *_ = env.step(policy.act(observations, env))
    again, reward_again = run_episode(env, policy, 3)
    np.testing.assert_array_equal(first.lam, again.lam)
    assert reward == reward_again
    env.close()


@pytest.mark.parametrize("name", COORDINATION_POLICIES)
def test_actions_are_in_the_action_space(lee1991: CoordinationCell, name: str) -> None:
    env = CoordinationEnv(lee1991, physics="ideal", shield=name in ORDER_POLICIES)
    policy = make_policy(name, lee1991)
    observations, _ = env.reset(seed=0)
    policy.reset(0)
    while env.agents:
        actions = policy.act({agent: observations[agent] for agent in env.agents}, env)
        assert list(actions) == env.agents
        for agent, action in actions.items():
            assert action.dtype == np.float32
            assert env.action_space(agent).contains(action), action
        observations, *_ = env.step(actions)
    env.close()


def test_an_unknown_policy(lee1991: CoordinationCell) -> None:
    with pytest.raises(UnknownNameError, match=r"policy 'vcy'.*did you mean 'vci'.*known: "):
        make_policy("vcy", lee1991)


@pytest.mark.parametrize("late", [0.03, 0.1, 0.15])
def test_velocity_control_waits_at_the_very_border(late: float) -> None:
    """The slave stops a hair from a region that begins where the master still stands."""
    cell = next(one for one in benchmark_instances("train", family="planar") if one.index == 60).build()
    trace = _run(cell, "vci", physics="ideal", late=late)
    assert trace.violations == 0
    assert trace.makespan <= schedule(cell, "vci").makespan + late + 5.0 * cell.control_period
