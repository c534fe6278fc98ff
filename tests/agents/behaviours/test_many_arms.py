"""Three and four arms: execution by precedence and velocity control, with arms that are late, slow, or stop and go."""

from __future__ import annotations

from functools import partial
from itertools import permutations

import numpy as np
import pytest

from armtempo.agents import (
    COORDINATION_POLICIES,
    Actions,
    ExecutionPolicy,
    Observations,
    PhasePlanePolicy,
    Policy,
    make_policy,
    run_episode,
    to_action,
)
from armtempo.agents.evaluation import play
from armtempo.envs import MODES, PHYSICS, CoordinationEnv, CoordinationTrace, Physics, YieldingEnv
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, Schedule
from armtempo.planners.coordination import plan_vci
from armtempo.planners.schedules import ScheduleExecution, VciExecution
from armtempo.planners.topp import Mode


def planned(cell: CoordinationCell, order: tuple[int, ...] | None = None) -> Schedule:
    """Velocity control in an order of priority; some regions are passed by the lower one first."""
    order = tuple(range(len(cell.arms))) if order is None else order
    motions, _ = plan_vci(cell.planes, cell.chart_between, order, cell.control_period)
    return Schedule(method="vci", cell=cell, trajectories=motions, order=order)


@pytest.fixture(params=["trio", "three_arms", "four_arms"])
def cell(request: pytest.FixtureRequest) -> CoordinationCell:
    found: CoordinationCell = request.getfixturevalue(request.param)
    return found


class Disturbed:
    """A policy whose arms are held, each with its own pattern, whatever the policy asks of them."""

    def __init__(self, policy: Policy[Observations, Actions], seed: int) -> None:
        self.policy, self.seed = policy, seed

    def reset(self, seed: int | None = None) -> None:
        self.policy.reset(seed)
        self.random = np.random.default_rng(self.seed)
        self.held: dict[str, float] = {}

    def act(self, observations: dict[str, np.ndarray], env: CoordinationEnv) -> dict[str, np.ndarray]:
        actions = self.policy.act(observations, env)
        for agent in env.possible_agents:
            if self.random.uniform() < 0.06:  # hold it, slow it down, or let it go
                self.held[agent] = self.random.choice([0.0, 0.4, 1.0], p=[0.3, 0.2, 0.5])
            if agent in actions:  # never faster than it is told: that is what being held means
                command = 0.5 * (float(actions[agent][0]) + 1.0)
                actions[agent] = to_action(command * self.held.get(agent, 1.0))
        return actions


def run(
    cell: CoordinationCell,
    policy: Policy[Observations, Actions],
    *,
    physics: Physics = "ideal",
    mode: Mode = "speed",
    late: float = 0.0,
) -> CoordinationTrace:
    env = CoordinationEnv(cell, physics=physics, mode=mode, master_late_s=late, record=True)
    try:
        return run_episode(env, policy, 0)[0]
    finally:
        env.close()


@pytest.mark.parametrize(("physics", "mode"), [("bullet", "speed"), ("ideal", "acceleration")])
def test_every_order_that_can_be_planned_can_be_executed(cell: CoordinationCell, physics: Physics, mode: Mode) -> None:
    done = 0
    for order in permutations(range(len(cell.arms))):
        try:
            plan = planned(cell, order)
        except InfeasibleError:
            continue
        done += 1
        if done > 2:
            break
        trace = run(cell, ExecutionPolicy(partial(ScheduleExecution, plan)), physics=physics, mode=mode)
        assert trace.violations == 0
        assert plan.makespan - 1e-3 < trace.makespan < 1.08 * plan.makespan  # the price of being able to brake
        assert trace.torque_ratio_max <= 1.0 + 1e-3
    assert done >= 2


def test_full_speed_for_all_collides(cell: CoordinationCell) -> None:
    """The tests here can fail."""
    assert run(cell, PhasePlanePolicy()).violations == 1


@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize("late", [0.03, 0.15])
def test_late_first_arm(cell: CoordinationCell, late: float, physics: Physics) -> None:
    plan = planned(cell)
    trace = run(cell, ExecutionPolicy(partial(ScheduleExecution, plan)), physics=physics, late=late)
    assert trace.violations == 0
    assert trace.makespan <= 1.08 * plan.makespan + late + 5.0 * cell.control_period


@pytest.mark.parametrize("physics", PHYSICS)
@pytest.mark.parametrize("late", [0.03, 0.15])
def test_velocity_control_behind_a_late_first_arm(trio: CoordinationCell, late: float, physics: Physics) -> None:
    trace = run(trio, ExecutionPolicy(partial(VciExecution, trio)), physics=physics, late=late)
    assert trace.violations == 0
    assert trace.makespan <= 1.08 * planned(trio).makespan + late + 5.0 * trio.control_period


@pytest.mark.parametrize("seed", range(2))
def test_velocity_control_behind_arms_that_stop_and_go(trio: CoordinationCell, seed: int) -> None:
    trace = run(trio, Disturbed(ExecutionPolicy(partial(VciExecution, trio)), seed))
    assert trace.violations == 0
    assert np.isfinite(trace.makespan)


@pytest.mark.parametrize("seed", range(3))
def test_arms_that_stop_and_go_cost_time_only(cell: CoordinationCell, seed: int) -> None:
    """Any of them, also those that the others wait for: no collision, no deadlock."""
    plan = planned(cell)
    trace = run(cell, Disturbed(ExecutionPolicy(partial(ScheduleExecution, plan)), seed))
    assert trace.violations == 0
    assert np.isfinite(trace.makespan)
    assert trace.makespan >= plan.makespan - 1e-3


@pytest.mark.parametrize("name", [name for name in COORDINATION_POLICIES if name != "random"])
def test_everybody_arrives_under_the_shield_whatever_happens(four_arms: CoordinationCell, name: str) -> None:
    policy = make_policy(name, four_arms)
    for disturbance in ("all-any", "all-stop-and-go"):
        env = CoordinationEnv(four_arms, physics="ideal", shield=True, disturbance=disturbance)
        for seed in range(3):
            play(env, policy, seed)
            assert not env.simulation.violated
            assert np.isfinite(env.simulation.arrival).all()
        env.close()


@pytest.mark.parametrize("mode", MODES)
def test_velocity_control_on_line(cell: CoordinationCell, mode: Mode) -> None:
    trace = run(cell, ExecutionPolicy(partial(VciExecution, cell)), mode=mode)
    assert trace.violations == 0
    assert trace.makespan == pytest.approx(planned(cell).makespan, rel=0.1)


@pytest.mark.parametrize("others", [None, "vci"])
def test_yielding_beside_several_arms(trio: CoordinationCell, others: str | None) -> None:
    """A learner that stays where it is does not keep the others, of higher priority, from arriving."""
    env = YieldingEnv(trio, physics="ideal", others=others, record=True)
    env.reset(seed=0)
    while not np.isfinite(env.simulation.arrival[:-1]).all():
        _, _, terminated, truncated, _ = env.step(-np.ones(1, dtype=np.float32))
        assert not terminated
        assert not truncated
    alone = max(motion.duration for motion in planned(trio).trajectories[:-1])
    assert env.trace.arrival[:-1].max() == pytest.approx(alone, rel=0.08)
    env.close()


def test_yielding_with_an_execution_of_ones_own(trio: CoordinationCell) -> None:
    """Others that follow a plan in which the learner has its part."""
    env = YieldingEnv(trio, physics="ideal", others=ScheduleExecution(planned(trio)), learner="slave", record=True)
    env.reset(seed=0)
    own = ScheduleExecution(planned(trio))
    done = False
    info: dict[str, object] = {}
    while not done:
        action = to_action(float(own.commands(env.simulation.lam, env.simulation.mu)[1]))
        _, _, terminated, truncated, info = env.step(action)
        done = terminated or truncated
    assert info["is_success"]
    env.close()


def test_one_agent_acts_alone(cell: CoordinationCell) -> None:
    """A policy that is asked for one arm takes the places of the others from the simulation."""
    env = CoordinationEnv(cell, physics="ideal")
    observations, _ = env.reset(seed=0)
    for policy in (
        ExecutionPolicy(partial(ScheduleExecution, planned(cell))),
        ExecutionPolicy(partial(VciExecution, cell)),
    ):
        policy.reset(0)
        whole = policy.act(observations, env)
        policy.reset(0)
        for agent in env.agents[-1:]:
            alone = policy.act({agent: observations[agent]}, env)
            assert alone.keys() == {agent}
            np.testing.assert_allclose(alone[agent], whole[agent], atol=1e-3)
    env.close()
