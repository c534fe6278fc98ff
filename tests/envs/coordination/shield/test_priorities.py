"""Priorities: the higher number passes first where that leads on, in every form of environment, to the last bit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo.agents import evaluate
from armtempo.envs import (
    CoordinationEnv,
    CoordinationOptions,
    CoordinationSimulation,
    CoordinationVectorEnv,
    Shield,
    ShieldParallelWrapper,
)
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, load_cell

PRIORITY: dict[str, Any] = {"shield": True, "action": "speed+priority"}


@pytest.fixture(scope="module")
def four() -> CoordinationCell:
    return load_cell("planar-four")


def actions(env: Any, speed: Any, priority: Any) -> dict[str, Any]:
    """For those who are on their way, of (A,) each."""
    rows = np.stack(np.broadcast_arrays(speed, priority), axis=-1).astype(np.float32)
    return {agent: rows[env.possible_agents.index(agent)] for agent in env.agents}


def test_the_higher_number_passes_first_where_that_leads_on(four: CoordinationCell) -> None:
    """At the start: as ``ask`` finds it for the order of their ranks (which is held against all orders elsewhere)."""
    rng = np.random.default_rng(0)
    env, asked = CoordinationEnv(four, physics="ideal", **PRIORITY), CoordinationEnv(four, physics="ideal", shield=True)
    obeyed = 0
    for _ in range(8):
        env.reset(seed=0)
        asked.reset(seed=0)
        assert env.shield is not None
        assert asked.shield is not None
        priority = rng.permutation(4) / 4.0
        wanted = env.shield.regions.of_ranks(np.argsort(-priority).tolist())
        kept = asked.shield.ask(wanted)
        _, _, _, _, infos = env.step(actions(env, -np.ones(4), priority))
        assert infos["arm_0"]["shield"]["orders"] == tuple(kept.tolist())
        obeyed += int((kept == wanted).all())
    assert obeyed > 0


def test_equal_numbers_change_nothing(four: CoordinationCell) -> None:
    plain, equal = (
        CoordinationEnv(four, physics="ideal", shield=True),
        CoordinationEnv(four, physics="ideal", **PRIORITY),
    )
    plain.reset(seed=2)
    equal.reset(seed=2)
    rng = np.random.default_rng(2)
    while plain.agents:
        speed = rng.uniform(-0.2, 1.0, 4)
        one = plain.step({a: np.array([speed[plain.possible_agents.index(a)]], dtype=np.float32) for a in plain.agents})
        two = equal.step(actions(equal, speed, 0.3))
        assert one[4] == two[4]


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_all_forms_have_the_same_bits(four: CoordinationCell, mode: Any) -> None:
    """One environment, one with the shield in front, and many at once; priorities held, changed, and of who arrived."""
    options: dict[str, Any] = {"mode": mode, "start_phase": (0.0, 0.2)}
    inside = CoordinationEnv(four, physics="ideal", **PRIORITY, **options)
    outside = ShieldParallelWrapper(CoordinationEnv(four, physics="ideal", **options), action="speed+priority")
    many = CoordinationVectorEnv(four, 3, threads=2, **PRIORITY, **options)
    rng = np.random.default_rng(5)
    many.reset(seed=11)
    inside.reset(seed=12)
    outside.reset(seed=12)
    priority, turned = np.zeros((3, 4)), set()
    while inside.agents:
        priority = np.where(rng.random((3, 4)) < 0.1, rng.uniform(-1.0, 1.0, (3, 4)), priority)
        given = np.stack([rng.uniform(-0.2, 1.0, (3, 4)), priority], axis=-1).astype(np.float32)
        seen, rewards, *_ = many.step(given)
        one = inside.step(actions(inside, given[1, :, 0], given[1, :, 1]))
        two = outside.step(actions(outside, given[1, :, 0], given[1, :, 1]))
        assert one[1] == two[1]
        assert one[4] == two[4]
        for agent, reward in one[1].items():
            i = inside.possible_agents.index(agent)
            assert reward == rewards[1, i]
            if inside.agents:
                np.testing.assert_array_equal(one[0][agent], seen[1, i])
        if inside.agents and inside.shield is not None:
            np.testing.assert_array_equal(many.simulations[0].orders[1], inside.shield.orders)
            turned.add(tuple(inside.shield.orders.tolist()))
    assert not inside.simulation.violated
    assert len(turned) > 2


def test_physics_lets_the_same_commands_through(four: CoordinationCell) -> None:
    """Beside torque control, a shield over the arms without physics in the same states: the same bits."""
    bullet = CoordinationEnv(four, physics="bullet", **PRIORITY)
    world = CoordinationSimulation(four, CoordinationOptions(physics="ideal")).world
    shield, simulation, cut = Shield(four, world), bullet.simulation, 0
    bullet.reset(seed=0)
    shield.reset(simulation.lam, simulation.uncertain)
    rng = np.random.default_rng(0)
    for _ in range(40):
        given = rng.uniform(-0.5, 1.0, (2, 4)).astype(np.float32)
        shield.prefer(given[1])
        asked = 0.5 * (given[0].astype(np.float64) + 1.0)
        change = asked - shield.admit(simulation.lam, simulation.mu, asked)
        infos = bullet.step(actions(bullet, *given))[4]
        for i, agent in enumerate(infos):
            assert infos[agent]["shield"]["change"] == change[i]
            assert infos[agent]["shield"]["orders"] == tuple(shield.orders.tolist())
        cut += int((change > 0.0).sum())
    assert cut > 0
    bullet.close()


def test_going_on_from_a_state(four: CoordinationCell) -> None:
    env, other = (CoordinationEnv(four, physics="ideal", **PRIORITY) for _ in range(2))
    env.reset(seed=0)
    other.reset(seed=0)
    for _ in range(15):
        env.step(actions(env, np.ones(4), [0.1, 0.9, -0.3, 0.4]))
    other.set_state(env.get_state())
    np.testing.assert_array_equal(env.state(), other.state())
    for _ in range(15):
        assert env.step(actions(env, np.ones(4), 0.0))[4] == other.step(actions(other, np.ones(4), 0.0))[4]


def test_baselines_act_with_two_numbers_as_with_one(four: CoordinationCell) -> None:
    for policy in ("phase-plane", "vci", "random"):
        one = evaluate(four, [policy], physics="ideal", shield=True).results[policy]
        two = evaluate(four, [policy], physics="ideal", **PRIORITY).results[policy]
        if policy == "random":
            assert two.finished == 1
        else:
            assert one.makespans_s == two.makespans_s


def test_a_shield_is_not_put_before_another(four: CoordinationCell) -> None:
    with pytest.raises(InputError, match="shield of its own"):
        ShieldParallelWrapper(CoordinationEnv(four, physics="ideal", shield=True))
