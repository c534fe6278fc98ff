"""The graph of arms and pairs: its spaces and tables, what it says of a cell, and its bits in every environment."""

from __future__ import annotations

from inspect import cleandoc
from typing import Any

import gymnasium
import numpy as np
import pytest

from armtempo.agents import make_policy
from armtempo.envs import (
    EDGE_ENTRIES,
    EDGE_PLACES,
    GRAPH_ARMS,
    NODE_ENTRIES,
    NODE_PLACES,
    BatchSimulation,
    CoordinationEnv,
    CoordinationVectorEnv,
    ShieldParallelWrapper,
    YieldingEnv,
    graph_space,
    observation_table,
)
from armtempo.errors import InputError, UnknownNameError
from armtempo.planners import CoordinationCell, generate_cell
from armtempo.planners.coordination import OrderSearch

NODE, EDGE = NODE_PLACES, EDGE_PLACES
GRAPH: Any = {"physics": "ideal", "shield": True, "observation": "graph"}


@pytest.fixture(scope="module")
def ring() -> CoordinationCell:
    return generate_cell("ring", 1, 0, arms=3).cell


def full_speed(env: CoordinationEnv) -> dict[str, Any]:
    return {agent: np.ones(1, dtype=np.float32) for agent in env.agents}


def test_the_docstring_has_both_tables() -> None:
    text = cleandoc(graph_space.__doc__ or "")
    assert observation_table(NODE_ENTRIES) in text
    assert observation_table(EDGE_ENTRIES) in text
    assert f"({GRAPH_ARMS}, {len(NODE_ENTRIES)})" in text
    assert f"({GRAPH_ARMS}, {GRAPH_ARMS}, {len(EDGE_ENTRIES)})" in text


@pytest.mark.parametrize("physics", ["ideal", "bullet"])
def test_what_is_seen_is_in_the_space_all_along(physics: Any) -> None:
    env = CoordinationEnv(
        "lee1991", shield=True, observation="graph", orders="search+stop", disturbance="all-any", physics=physics
    )
    for seed in range(2):
        observations, _ = env.reset(seed=seed)
        while env.agents:
            for agent in env.agents:
                assert env.observation_space(agent).contains(observations[agent])
            observations, *_ = env.step(full_speed(env))
    env.close()


def test_what_it_says_of_arms_at_the_start(ring: CoordinationCell) -> None:
    env = CoordinationEnv(ring, **GRAPH, orders="search")
    observations, _ = env.reset(seed=0)
    assert env.shield is not None
    nodes, edges = observations["arm_1"]["nodes"], observations["arm_1"]["edges"]
    assert observations["arm_1"]["own"].tolist() == [0, 1, 0, 0, 0, 0, 0, 0]
    unit = max(motion.duration for motion in ring.fastest)
    minimum = [motion.duration / unit for motion in ring.fastest]
    np.testing.assert_allclose(nodes[:3, NODE["minimum_time"]], minimum, rtol=1e-6)
    np.testing.assert_allclose(nodes[:3, NODE["time_to_go"]], minimum, rtol=1e-3)
    assert not nodes[3:].any()
    assert not edges[3:].any()
    assert not edges[:, 3:].any()
    # The last arm arrives when the search says that its order ends.
    search = OrderSearch(env.shield.regions, ring.planes)
    to_go = search.times_to_go(np.zeros(3), np.zeros(3))
    price = search.price(np.zeros(3), to_go, env.shield.orders)
    arrival = nodes[:3, NODE["time_to_go"]] + nodes[:3, NODE["delay"]]
    assert unit * arrival.max() == pytest.approx(price, rel=2e-3)  # a price has a little of the mean arrival
    np.testing.assert_allclose(arrival.max() - arrival, nodes[:3, NODE["slack"]], atol=1e-6)
    # Who passes first is told by both, and who leads one way waits the other.
    first = edges[:3, :3, EDGE["first"]]
    np.testing.assert_array_equal(first, -first.T)
    met = {(region.a, region.b) for region in env.shield.regions.regions}
    assert {(i, j) for i in range(3) for j in range(i) if edges[i, j, EDGE["ahead"]]} == {(b, a) for a, b in met}
    env.close()


def test_who_is_told_to_pass_first_is_the_order_of_the_shield(ring: CoordinationCell) -> None:
    env = CoordinationEnv(ring, **GRAPH)
    env.reset(seed=0)
    assert env.shield is not None
    single = {(r.a, r.b) for r in env.shield.regions.regions}
    for orders in (np.zeros(len(env.shield.orders)), np.ones(len(env.shield.orders))):
        held = env.shield.ask(orders)
        observations, *_ = env.step(full_speed(env))
        edges = observations["arm_0"]["edges"]
        for pair in single:
            said = {1 - 2 * int(held[r]) for r, one in enumerate(env.shield.regions.regions) if (one.a, one.b) == pair}
            assert edges[pair][EDGE["first"]] in said
    env.close()


def test_an_arm_that_stands_shows(ring: CoordinationCell) -> None:
    env = CoordinationEnv(ring, **GRAPH, orders="search+stop", disturbance="all-stop-and-go")
    shown = False
    for seed in range(4):
        observations, infos = env.reset(seed=seed)
        stops = infos["arm_0"]["disturbance"]["stops_s"]
        while env.agents:
            observations, *_ = env.step(full_speed(env))
            time = float(env.simulation.time)
            for i in [int(agent[-1]) for agent in env.agents]:
                nodes = observations[f"arm_{i}"]["nodes"]
                if nodes[i, NODE["stands"]]:
                    shown = True
                    assert any(begin - 1e-9 <= time <= end + 2.0 * ring.control_period for begin, end in stops[i])
                    assert nodes[i, NODE["expected_rest"]] > 0.0
                    assert nodes[i, NODE["obeyed"]] == pytest.approx(0.0, abs=1e-3)
    assert shown
    env.close()


def test_a_slow_arm_shows_how_much_it_obeys() -> None:
    env = CoordinationEnv("lee1991", **GRAPH, disturbance="slow")
    observations, infos = env.reset(seed=3)
    speed = infos["arm_0"]["disturbance"]["speed"][0]
    seen = []
    while "arm_0" in env.agents:
        observations, *_ = env.step(full_speed(env))
        seen.append(observations["arm_0"]["nodes"][:2, NODE["obeyed"]])
    assert speed < 1.0
    assert min(row[0] for row in seen) < 1.0
    assert [row[1] for row in seen] == [1.0] * len(seen)
    env.close()


@pytest.mark.parametrize("orders", ["asked", "search", "search+stop"])
def test_batches_and_vectors_have_the_bits_of_single_environments(ring: CoordinationCell, orders: Any) -> None:
    options: Any = {**GRAPH, "orders": orders, "disturbance": "all-any"}
    env = CoordinationEnv(ring, **options)
    batch = BatchSimulation(ring, 3, **options)
    vector = CoordinationVectorEnv(ring, 3, **options)
    batch.seed(5)
    batch.reset()
    together: Any = vector.reset(seed=5)[0]
    observations, _ = env.reset(seed=7)
    assert batch.graph is not None
    random = np.random.default_rng(0)
    while env.agents:
        for name in ("nodes", "edges"):
            one = observations[env.agents[0]][name]
            np.testing.assert_array_equal(getattr(batch.graph.graphs, name)[2], one)
            np.testing.assert_array_equal(together[name][2], one)
        actions = random.uniform(-0.5, 1.0, (3, 3)).astype(np.float32)
        running = np.asarray(np.isnan(batch.arrival).any(axis=1))
        batch.step(0.5 * (actions.astype(np.float64) + 1.0), running)
        observations, *_ = env.step({agent: actions[2, int(agent[-1]), None] for agent in env.agents})
        together, _, _, _, _ = vector.step(actions[..., None])
    np.testing.assert_array_equal(batch.arrival[2], env.simulation.arrival)
    env.close()
    batch.close()
    vector.close()


def test_an_episode_goes_on_from_its_state(ring: CoordinationCell) -> None:
    options: Any = {**GRAPH, "orders": "search+stop", "disturbance": "all-stop-and-go"}
    first, second = CoordinationEnv(ring, **options), CoordinationEnv(ring, **options)
    first.reset(seed=1)
    for _ in range(60):
        first.step(full_speed(first))
    second.set_state(first.get_state())
    second.agents = first.agents[:]
    while first.agents:
        seen: Any = first.step(full_speed(first))[0]
        again: Any = second.step(full_speed(second))[0]
        for agent in first.agents:
            for name, values in seen[agent].items():
                np.testing.assert_array_equal(values, again[agent][name])
    np.testing.assert_array_equal(first.simulation.arrival, second.simulation.arrival)
    first.close()
    second.close()


def test_one_learning_arm_and_many_at_once_see_it() -> None:
    options: Any = {"shield": True, "observation": "graph", "disturbance": "stop-and-go"}
    env = YieldingEnv("lee1991", physics="ideal", **options)
    many = gymnasium.make_vec("armtempo/Yielding-v0", num_envs=2, cell="lee1991", **options)
    one: Any = env.reset(seed=4)[0]
    both: Any = many.reset(seed=3)[0]
    over = False
    while not over:
        assert env.observation_space.contains(one)
        for name, values in one.items():
            np.testing.assert_array_equal(both[name][1], values)
        one, _, over, _, _ = env.step(np.ones(1, dtype=np.float32))
        both, *_ = many.step(np.ones((2, 1), dtype=np.float32))
    env.close()
    many.close()


def test_full_speed_under_a_rule_is_the_policy_of_that_name(ring: CoordinationCell) -> None:
    for rule in ("search", "search+stop"):
        told = CoordinationEnv(ring, physics="ideal", shield=True, disturbance="all-stop-and-go")
        kept = CoordinationEnv(ring, physics="ideal", shield=True, disturbance="all-stop-and-go", orders=rule)
        policy = make_policy(rule, ring)
        observations, _ = told.reset(seed=2)
        kept.reset(seed=2)
        policy.reset()
        while told.agents:
            observations, *_ = told.step(policy.act(observations, told))
        while kept.agents:
            kept.step(full_speed(kept))
        np.testing.assert_array_equal(told.simulation.arrival, kept.simulation.arrival)
        told.close()
        kept.close()


def test_a_policy_sees_who_stands_through_a_wrapped_shield_too(ring: CoordinationCell) -> None:
    arrivals = []
    for wrapped in (False, True):
        options: Any = {"physics": "ideal", "disturbance": "all-stop-and-go"}
        inner = CoordinationEnv(ring, shield=not wrapped, **options)
        env: Any = ShieldParallelWrapper(inner) if wrapped else inner
        policy = make_policy("search+hold", ring)
        observations, _ = env.reset(seed=2)
        policy.reset()
        while env.agents:
            observations, *_ = env.step(policy.act(observations, env))
        arrivals.append(inner.simulation.arrival.copy())
        env.close()
    np.testing.assert_array_equal(arrivals[0], arrivals[1])


def test_the_rest_of_each_row_of_seen_arms_is_its_own(ring: CoordinationCell) -> None:
    vector = CoordinationVectorEnv(ring, 2, **GRAPH)
    rows = vector.to_rows(vector.reset(seed=0)[0])
    assert {name: values.shape[0] for name, values in rows.items()} == {"nodes": 6, "edges": 6, "own": 6}
    np.testing.assert_array_equal(rows["own"].argmax(axis=1), [0, 1, 2] * 2)
    assert vector.row_spaces[0].contains({name: values[4] for name, values in rows.items()})
    vector.close()


def test_what_cannot_be_asked_for() -> None:
    with pytest.raises(UnknownNameError, match="observation"):
        CoordinationEnv("lee1991", observation="map")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="orders"):
        CoordinationEnv("lee1991", orders="mine")  # type: ignore[arg-type]
    for options in ({"observation": "graph"}, {"orders": "search"}):
        with pytest.raises(InputError, match="without a shield there are no orders"):
            CoordinationEnv("lee1991", **options)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="priorities ask for others"):
        CoordinationEnv("lee1991", shield=True, orders="search", action="speed+priority")
    with pytest.raises(InputError, match="noise is for what agents see locally"):
        CoordinationEnv("lee1991", shield=True, observation="graph", observation_noise=0.1)
    with pytest.raises(InputError, match="nobody watches"):
        BatchSimulation("lee1991", 1, shield=True).hold_back()


@pytest.mark.parametrize("kind", ["single", "batch", "vector"])
@pytest.mark.parametrize(
    ("name", "value"), [("lam", 8.8e160), ("lam", -1e-300), ("lam", np.nan), ("mu", -1.0), ("mu", np.inf)]
)
def test_a_state_with_arms_off_their_paths_is_refused(kind: str, name: str, value: float) -> None:
    """Compiled loops would read what is not theirs."""
    make: Any = {"single": CoordinationEnv, "batch": BatchSimulation, "vector": CoordinationVectorEnv}[kind]
    env = make("lee1991", **GRAPH) if kind == "single" else make("lee1991", 2, **GRAPH)
    env.reset()
    state = env.get_state()
    (key,) = [one for one in state if one.endswith(f"episodes.{name}")]
    wrong = state[key].copy()
    wrong[0, 1] = value
    with pytest.raises(InputError, match="not on their paths"):
        env.set_state({**state, key: wrong})
    env.set_state(state)
    env.close()


def test_a_state_with_orders_that_there_are_not_is_refused(ring: CoordinationCell) -> None:
    batch = BatchSimulation(ring, 2, **GRAPH)
    state = batch.get_state()
    for name in ("orders", "asked"):
        with pytest.raises(InputError, match="orders are none"):
            batch.set_state({**state, name: np.full_like(state[name], 7)})
    batch.close()
