"""Policies that decide who passes first on the way, run under the shield."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo.agents import evaluate, make_policy
from armtempo.agents.coordination._order_policies import ORDER_POLICIES, OrderPolicy
from armtempo.agents.evaluation import play
from armtempo.envs import CoordinationEnv, Disturbance
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, benchmark_instances, generate_cell, load_cell
from armtempo.planners.topp import Mode


@pytest.fixture(scope="module")
def ring() -> CoordinationCell:
    """Four arms, which the order of the file makes wait."""
    return generate_cell("ring", 777, 3, arms=4).cell


def makespan(env: CoordinationEnv, name: str, seed: int = 0) -> float:
    play(env, OrderPolicy(name, env.cell), seed)
    assert not env.simulation.violated
    return float(env.simulation.arrival.max())


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_they_are_quicker_than_the_order_of_the_file(ring: CoordinationCell, mode: Mode) -> None:
    env = CoordinationEnv(ring, physics="ideal", shield=True, mode=mode)
    env.reset(seed=0)
    while env.agents:
        env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
    full_speed = float(env.simulation.arrival.max())
    found = {name: makespan(env, name) for name in ORDER_POLICIES}
    assert found["search"] == found["search+stop"]  # nobody stops
    assert min(found.values()) >= ring.lower_bound
    assert max(found.values()) < 0.999 * full_speed


def test_running_ahead_tells_when_arms_will_arrive_and_changes_nothing(ring: CoordinationCell) -> None:
    env = CoordinationEnv(ring, physics="ideal", shield=True)
    env.reset(seed=0)
    shield = env.shield
    assert shield is not None
    turned = 1 - shield.orders
    before = shield.get_state()
    kept, other = (shield.run_ahead(orders, stands=np.zeros(4)) for orders in (shield.orders, turned))
    late = shield.run_ahead(shield.orders, stands=np.full(4, 0.1))
    assert not np.isfinite(shield.run_ahead(shield.orders, stands=np.zeros(4), horizon=0.5 * kept.makespan).makespan)
    np.testing.assert_equal(shield.get_state(), before)
    assert (kept.orders == shield.orders).all()
    assert late.makespan == pytest.approx(kept.makespan + 0.1, abs=ring.control_period)
    shield.ask(other.orders)
    while env.agents:
        env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
    np.testing.assert_allclose(env.simulation.arrival, other.arrival, rtol=1e-9)


@pytest.mark.parametrize("wrong", [-0.1, np.nan, [0.0, 0.1], np.zeros((2, 4)), "x", None])
def test_times_that_are_none_are_refused(ring: CoordinationCell, wrong: Any) -> None:
    env = CoordinationEnv(ring, physics="ideal", shield=True)
    env.reset(seed=0)
    shield = env.shield
    assert shield is not None
    with pytest.raises(InputError, match="times must be 4 numbers"):
        shield.run_ahead(shield.orders, stands=wrong)
    with pytest.raises(InputError, match="times must be 1 numbers"):
        shield.run_ahead(shield.orders, horizon=wrong)
    with pytest.raises(InputError, match="order must be"):
        shield.run_ahead([0, 7])


def test_rollouts_hold_arms_back_instead_of_letting_them_run_into_a_limit() -> None:
    cell = generate_cell("ring", 778, 0, arms=3).cell
    env = CoordinationEnv(cell, physics="ideal", shield=True)
    assert cell.lower_bound <= makespan(env, "rollout") < 0.95 * makespan(env, "search")


@pytest.mark.parametrize("name", ORDER_POLICIES)
def test_all_arrive_whoever_stops_and_the_same_seed_gives_the_same(ring: CoordinationCell, name: str) -> None:
    env = CoordinationEnv(ring, physics="ideal", shield=True, disturbance="all-any", action="speed+priority")
    for seed in range(3):
        first = makespan(env, name, seed)
        assert np.isfinite(first)
        assert makespan(env, name, seed) == first


def test_an_arm_that_stands_is_seen_and_how_long_it_stood() -> None:
    cell = load_cell("lee1991")
    stop = Disturbance(stops=(1, 1), stop_s=(0.1, 0.1), arms=(0,))
    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance=stop)
    policy = OrderPolicy("search+stop", cell)
    observations, infos = env.reset(seed=0)
    while not 0.02 < infos["arm_0"]["disturbance"]["stops_s"][0][0][0] < 0.1:  # while it is not braking anyway
        observations, infos = env.reset()
    (begin, end), seen = infos["arm_0"]["disturbance"]["stops_s"][0][0], []
    policy.reset()
    while env.agents:
        actions = policy.act({agent: observations[agent] for agent in env.agents}, env)
        assert env.shield is not None
        if env.shield.stands[0]:
            seen.append(float(env.simulation.time))
        assert not env.shield.stands[1]
        observations, *_ = env.step(actions)
    period = cell.control_period
    assert begin < seen[0] <= begin + 2.0 * period + 1e-9
    assert end - 1e-9 <= seen[-1] <= end + 2.0 * period
    assert env.shield is not None
    assert env.shield.keeper.seen.rested[0].tolist() == [pytest.approx(end - begin, abs=2.0 * period), 0.0]


@pytest.mark.parametrize("policy", ["search+hold", "rollout"])
def test_arms_that_hold_back_for_each_other_do_not_wait_for_ever(policy: str) -> None:
    """All five are late behind another one here once all have stopped: who decides to wait must go some time."""
    (cell,) = [one.build() for one in benchmark_instances("test", family="ring") if one.name == "ring5-1991-0023"]
    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance="all-stop-and-go")
    decides = make_policy(policy, cell)
    observations, _ = env.reset(seed=100_000)
    decides.reset()
    while env.agents:
        observations, *_ = env.step(decides.act(observations, env))
    assert env.simulation.arrival.max() < 2.0  # full speed in the same orders: 1.30 s
    env.close()


def test_without_a_shield_they_are_not_offered_and_say_what_they_need() -> None:
    cell = load_cell("lee1991")
    with pytest.raises(InputError, match="search decides whom a shield lets pass"):
        evaluate(cell, ["search"], physics="ideal")
    results = evaluate(cell, ["search", "phase-plane"], physics="ideal", shield=True).results
    assert results["search"].makespan_s == results["phase-plane"].makespan_s  # both orders are as good here
