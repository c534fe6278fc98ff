"""Orders that are asked for: the nearest that leads on is kept, against all orders tried one by one; plans pass."""

from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from armtempo.agents.coordination import ExecutionPolicy
from armtempo.agents.evaluation import play
from armtempo.envs import (
    BatchSimulation,
    CoordinationEnv,
    CoordinationOptions,
    CoordinationSimulation,
    Shield,
    ShieldParallelWrapper,
)
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, benchmark_instances, execution_of, load_cell, schedule

FULL = np.ones(1, dtype=np.float32)


@pytest.fixture(scope="module")
def four() -> CoordinationCell:
    return load_cell("planar-four")


def leads_on(shield: Shield, orders: NDArray[np.int8], lam: NDArray[np.float64]) -> bool:
    """Whether arms at rest at ``lam`` obey these orders and all arrive, by the planners' own limits."""
    meant = shield.regions.precedence(orders)
    for i, j in meant.limits:
        if lam[i] > float(meant.farthest(i, j, lam[j])) - 1e-6:
            return False
    try:
        meant.check_deadlock_free(lam)
    except InfeasibleError:
        return False
    return True


def test_the_nearest_order_that_leads_on_is_kept(four: CoordinationCell) -> None:
    """From many places, against all orders; what is asked for twice, or leads on, is kept as it is."""
    simulation = CoordinationSimulation(four, CoordinationOptions(physics="ideal"))
    shield = Shield(four, simulation.world)
    rng = np.random.default_rng(0)
    lengths, R, refused = np.array([path.length for path in four.paths]), len(shield.orders), 0
    for place in range(6):
        lam, still = (0.0 if place == 0 else 0.35) * rng.random(4) * lengths, np.zeros(4)
        try:
            shield.reset(lam)
        except InfeasibleError:
            continue
        good = [np.array(row, dtype=np.int8) for row in product((0, 1), repeat=R)]
        good = [row for row in good if leads_on(shield, row, lam)]
        assert any((row == shield.orders).all() for row in good)
        for _ in range(20):
            wanted = rng.integers(0, 2, R).astype(np.int8)
            before = shield.orders.copy()
            kept = shield.ask(wanted, lam, still)
            assert leads_on(shield, kept, lam)
            np.testing.assert_array_equal(kept, shield.orders)
            nearest = min(int((row != wanted).sum()) for row in good)
            assert (kept != wanted).sum() == nearest
            refused += nearest > 0
            if (before != wanted).sum() == nearest:
                np.testing.assert_array_equal(kept, before)  # not to and fro between equals
            np.testing.assert_array_equal(shield.ask(kept, lam, still), kept)
    assert refused > 20


def test_commands_do_not_turn_what_was_asked_for(four: CoordinationCell) -> None:
    plan = schedule(four, "optimal")
    env = CoordinationEnv(four, physics="ideal", shield=True)
    env.reset(seed=0)
    assert env.shield is not None
    kept = env.shield.ask(plan.precedence)
    np.testing.assert_array_equal(kept, env.shield.regions.of_precedence(plan.precedence))
    while env.agents:
        _, _, _, _, infos = env.step(dict.fromkeys(env.agents, FULL))
        assert all(info["shield"]["orders"] == tuple(kept.tolist()) for info in infos.values())
    assert not env.simulation.violated
    assert env.simulation.arrival.max() < 1.25 * plan.makespan
    env.reset(seed=0)
    assert tuple(env.shield.orders.tolist()) != tuple(kept.tolist())  # an episode of its own


def test_what_is_free_is_left_to_commands(four: CoordinationCell) -> None:
    """Asking for nothing changes nothing."""
    plain, asked = (CoordinationEnv(four, physics="ideal", shield=True) for _ in range(2))
    plain.reset(seed=1)
    asked.reset(seed=1)
    assert asked.shield is not None
    asked.shield.ask(np.full(len(asked.shield.orders), 2))
    while plain.agents:
        _, _, _, _, infos = plain.step(dict.fromkeys(plain.agents, FULL))
        assert infos == asked.step(dict.fromkeys(asked.agents, FULL))[4]


def test_wrong_orders_are_refused(four: CoordinationCell) -> None:
    env = CoordinationEnv(four, physics="ideal", shield=True)
    env.reset(seed=0)
    assert env.shield is not None
    for wrong in ([0, 1], np.full(len(env.shield.orders), 3), [[0], [1, 2]], "ab", None, np.nan):
        with pytest.raises(InputError, match="order must be"):
            env.shield.ask(wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="other paths"):
        env.shield.ask(schedule(load_cell("lee1991"), "delay").precedence)


@pytest.mark.parametrize("wrapped", [False, True])
@pytest.mark.parametrize("method", ["optimal", "vci", "sequential"])
def test_a_plan_of_another_order_passes_unchanged(four: CoordinationCell, method: str, wrapped: bool) -> None:
    plan = schedule(four, method, order=(1, 0, 2, 3))
    policy = ExecutionPolicy(partial(execution_of, plan))
    bare = CoordinationEnv(four, physics="ideal")
    env = CoordinationEnv(four, physics="ideal", shield=not wrapped)
    play(bare, policy, 0)
    _, infos = play(ShieldParallelWrapper(env) if wrapped else env, policy, 0)
    if method == "vci":  # it guards its commands by rules of its own: the shield may take a thousandth off one
        np.testing.assert_allclose(env.simulation.arrival, bare.simulation.arrival, rtol=1e-3)
        assert sum(info["shield_change"] for info in infos.values()) < 2e-3
        return
    np.testing.assert_array_equal(env.simulation.arrival, bare.simulation.arrival)
    assert not any(info["shield_changed"] for info in infos.values())


@pytest.mark.parametrize("policy", ["vci", "delay", "optimal"])
def test_planned_policies_arrive_behind_an_arm_that_stops(policy: str) -> None:
    """The order was turned for a slave that slipped through, and then waited for its master, as that for it."""
    cell = next(one for one in benchmark_instances() if one.name == "planar-1991-0040").build()
    plan = schedule(cell, policy)
    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance="stop-and-go")
    for seed in (4, 14):
        play(env, ExecutionPolicy(partial(execution_of, plan)), seed)
        assert np.isfinite(env.simulation.arrival).all()
        assert not env.simulation.violated


def test_a_plan_gives_way_where_the_order_it_needs_is_past(four: CoordinationCell) -> None:
    """Arms that do not start where it was planned: the shield keeps another order, and all arrive."""
    policy = ExecutionPolicy(partial(execution_of, schedule(four, "sequential", order=(3, 2, 1, 0))))
    env = CoordinationEnv(four, physics="ideal", shield=True, start_phase=(0.0, 0.6))
    for seed in range(4):
        play(env, policy, seed)
        assert np.isfinite(env.simulation.arrival).all()
        assert not env.simulation.violated


def test_the_state_has_the_order_that_was_asked_for(four: CoordinationCell) -> None:
    plan = schedule(four, "optimal")
    env, other = (CoordinationEnv(four, physics="ideal", shield=True) for _ in range(2))
    env.reset(seed=0)
    other.reset(seed=0)
    assert env.shield is not None
    env.shield.ask(plan.precedence)
    for _ in range(20):
        env.step(dict.fromkeys(env.agents, FULL))
    other.set_state(env.get_state())
    while env.agents:
        assert env.step(dict.fromkeys(env.agents, FULL))[4] == other.step(dict.fromkeys(other.agents, FULL))[4]


def test_many_episodes_take_orders_too(four: CoordinationCell) -> None:
    """One of two episodes is asked; it has the bits of an environment that is, the other those of one that is not."""
    plan = schedule(four, "optimal")
    batch = BatchSimulation(four, 2, shield=True)
    batch.seed(5)
    batch.reset()
    kept = batch.ask(plan.precedence, np.array([True, False]))
    np.testing.assert_array_equal(kept, batch.orders)
    for e in range(2):
        env = CoordinationEnv(four, physics="ideal", shield=True)
        env.reset(seed=5 + e)
        assert env.shield is not None
        if e == 0:
            np.testing.assert_array_equal(env.shield.ask(plan.precedence), kept[0])
        other = BatchSimulation(four, 2, shield=True)
        other.set_state(batch.get_state())
        while env.agents:
            env.step(dict.fromkeys(env.agents, FULL))
            other.step(np.ones((2, 4)))
            np.testing.assert_array_equal(other.lam[e], env.simulation.lam)
            np.testing.assert_array_equal(other.orders[e], env.shield.orders)
    with pytest.raises(InputError, match="without a shield"):
        BatchSimulation(four, 1).ask(plan.precedence)
