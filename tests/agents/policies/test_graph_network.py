"""The network over arms and pairs: numpy as torch, arms in any order and number, files that say what is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.agents.policies import GRAPH_NAMES, Agent, AgentHeader, flat_rows, graph_shapes, load_agent, save_agent
from armtempo.agents.training._graph_module import GraphNetwork, to_graph
from armtempo.arrays import Floats32
from armtempo.envs import EDGE_ENTRIES, GRAPH_ARMS, NODE_ENTRIES
from armtempo.errors import InputError

pytestmark = pytest.mark.rl

HEADER = AgentHeader(
    name="graph", algorithm="ppo", activation="relu", network="graph", environment="coordination", settings={},
    learners="all", entries=GRAPH_NAMES, cells=[], steps=0, seed=0, command="", config="", curve=[], armtempo="0",
)  # fmt: skip


def drawn_graph(arms: int, seed: int) -> tuple[Floats32, Floats32]:
    """Nodes and edges of so many arms, some pairs without a region ahead."""
    random = np.random.default_rng(seed)
    nodes = np.zeros((GRAPH_ARMS, len(NODE_ENTRIES)), dtype=np.float32)
    edges = np.zeros((GRAPH_ARMS, GRAPH_ARMS, len(EDGE_ENTRIES)), dtype=np.float32)
    nodes[:arms] = random.uniform(-1.0, 1.0, (arms, len(NODE_ENTRIES)))
    nodes[:arms, 0] = 1.0
    for i in range(arms):
        for j in range(i):
            if random.random() < 0.7:
                edges[i, j], edges[j, i] = random.uniform(-2.0, 2.0, (2, len(EDGE_ENTRIES)))
                edges[i, j, 0] = edges[j, i, 0] = 1.0
    return nodes, edges


def network(activation: str, out: int, seed: int) -> tuple[GraphNetwork, Agent]:
    torch.manual_seed(seed)
    made = GraphNetwork((16, 24), out, {"relu": torch.nn.ReLU, "tanh": torch.nn.Tanh}[activation])
    layers = tuple(
        (layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy())  # type: ignore[operator]
        for layer in made.layers
    )
    return made, Agent(header=replace(HEADER, activation=activation), layers=layers)


@settings(max_examples=40, deadline=None)
@given(st.integers(1, GRAPH_ARMS), st.integers(0, 10**6), st.sampled_from(["relu", "tanh"]), st.integers(1, 2))
def test_numpy_has_the_numbers_of_torch(arms: int, seed: int, activation: str, out: int) -> None:
    made, agent = network(activation, out, seed)
    graphs = [drawn_graph(arms, seed), drawn_graph(GRAPH_ARMS, seed + 1)]  # in one batch with more arms than it has
    rows = np.concatenate([flat_rows(nodes[None], edges[None]) for nodes, edges in graphs])
    with torch.no_grad():
        found = made(*to_graph(torch.as_tensor(rows))).numpy()
    for (nodes, edges), row in zip(graphs, found, strict=True):
        actions = agent.act_on_graph(nodes, edges)
        np.testing.assert_allclose(actions, np.clip(row[: len(actions)], -1.0, 1.0), atol=1e-6)
    assert agent.act_on_graph(*graphs[0]).shape == (arms, out)


@settings(max_examples=40, deadline=None)
@given(st.integers(2, GRAPH_ARMS), st.integers(0, 10**6))
def test_arms_in_another_order_get_the_same_actions_in_that_order(arms: int, seed: int) -> None:
    _, agent = network("relu", 2, seed)
    nodes, edges = drawn_graph(arms, seed)
    order = np.concatenate([np.random.default_rng(seed).permutation(arms), np.arange(arms, GRAPH_ARMS)])
    turned = agent.act_on_graph(nodes[order], edges[np.ix_(order, order)])
    np.testing.assert_allclose(turned, agent.act_on_graph(nodes, edges)[order[:arms]], atol=1e-6)


def test_arms_that_meet_nobody_do_not_hear_of_others_but_in_the_mean() -> None:
    _, agent = network("relu", 1, 3)
    nodes, edges = drawn_graph(3, 0)
    edges[2], edges[:, 2] = 0.0, 0.0
    other = edges.copy()
    other[2, 0, 1:] = 0.5  # not ahead: whatever it says
    np.testing.assert_array_equal(agent.act_on_graph(nodes, edges), agent.act_on_graph(nodes, other))


def test_a_file_gives_the_same_agent_again(tmp_path: Path) -> None:
    _, agent = network("relu", 1, 0)
    save_agent(tmp_path / "graph.npz", agent)
    again = load_agent(tmp_path / "graph.npz")
    assert again.header == agent.header
    graph = drawn_graph(5, 1)
    np.testing.assert_array_equal(again.act_on_graph(*graph), agent.act_on_graph(*graph))


@pytest.mark.parametrize("damage", ["entries", "layer", "bias", "nan", "sac"])
def test_what_is_no_graph_agent_is_refused(tmp_path: Path, damage: str) -> None:
    _, agent = network("relu", 1, 0)
    header, layers = agent.header, [(weight.copy(), bias.copy()) for weight, bias in agent.layers]
    if damage == "entries":
        header = replace(header, entries=GRAPH_NAMES[:-1])
    elif damage == "sac":
        header = replace(header, algorithm="sac")
    elif damage == "layer":
        del layers[2]
    elif damage == "bias":
        layers[1] = (layers[1][0], layers[1][1][:-1])
    else:
        layers[3][0][0, 0] = np.nan
    save_agent(tmp_path / "graph.npz", Agent(header=header, layers=tuple(layers)))
    with pytest.raises(InputError, match="damaged agent file"):
        load_agent(tmp_path / "graph.npz")


def test_shapes_of_layers() -> None:
    nodes, edges = len(NODE_ENTRIES), len(EDGE_ENTRIES)
    assert graph_shapes((8, 6), 2) == [(8, nodes), (8, 16 + edges), (8, 32), (8, 16 + edges), (6, 32), (6, 6), (2, 6)]
