"""A network over arms and pairs of arms, by numpy alone: messages along the pairs, one action for every arm.

Its layers, (weight (out, in), bias (out,)) each, in their order, for the widths w_1, w_2, ... of its rounds:

    embed     nodes (19) -> w_1, then in every round, with h_i of arm i and e_ij of its pair with arm j:
    message   (h_i, h_j, e_ij) -> w: of all j with which i has a collision region ahead, mean and largest are heard
    update    (h_i, mean, largest, mean of h over all arms) -> the width of the round
    head      w -> w, and out to the numbers of an action

Weights are the same for all arms and pairs: arms in another order get the same actions in that order, and one network
drives any number of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armtempo.arrays import Floats32
from armtempo.envs import EDGE_ENTRIES, EDGE_PLACES, GRAPH_ARMS, NODE_ENTRIES, NODE_PLACES

NODES, EDGES = len(NODE_ENTRIES), len(EDGE_ENTRIES)
PRESENT, AHEAD = NODE_PLACES["present"], EDGE_PLACES["ahead"]
GRAPH_NAMES = [f"node.{entry.name}" for entry in NODE_ENTRIES] + [f"edge.{entry.name}" for entry in EDGE_ENTRIES]
"""Names of the entries of a graph."""

LEAST = np.float32(-1e9)
"""Less than any message."""

NODE_NUMBERS, FLAT_SIZE = GRAPH_ARMS * NODES, GRAPH_ARMS * NODES + GRAPH_ARMS**2 * EDGES
"""Of a graph in one row: numbers of its nodes, which come first, and of all of it."""

Layers = Sequence[tuple[Floats32, Floats32]]


def flat_rows(nodes: Floats32, edges: Floats32) -> Floats32:
    """(E, FLAT_SIZE) graphs (E, ...) in one row each: their nodes, then their edges."""
    return np.concatenate([nodes.reshape(len(nodes), -1), edges.reshape(len(edges), -1)], axis=1)


def graph_shapes(sizes: Sequence[int], out: int) -> list[tuple[int, int]]:
    """(out, in) of the layers of rounds of these widths, with ``out`` numbers for each arm."""
    width, shapes = sizes[0], [(sizes[0], NODES)]
    for size in sizes:
        shapes += [(width, 2 * width + EDGES), (size, 4 * width)]
        width = size
    return [*shapes, (width, width), (out, width)]


def graph_sizes(shapes: Sequence[tuple[int, ...]]) -> list[int] | None:
    """The widths of the rounds of layers of these shapes; None if no such network has them."""
    if len(shapes) < 5 or len(shapes) % 2 == 0 or any(len(shape) != 2 for shape in shapes):
        return None
    sizes = [shape[0] for shape in shapes[2:-2:2]]
    fits = shapes[0][0] == sizes[0] and list(shapes) == graph_shapes(sizes, shapes[-1][0])
    return sizes if fits else None


def run_graph(layers: Layers, activation: str, nodes: Floats32, edges: Floats32) -> Floats32:
    """What the network gives for the arms that are there.

    Args:
        layers: As above.
        activation: Between layers: ``tanh`` or ``relu``.
        nodes: (M, N) of the graph, A arms first.
        edges: (M, M, K).

    Returns:
        (A, out).
    """
    arms = int(nodes[:, PRESENT].sum())
    pairs = edges[:arms, :arms]
    ahead = pairs[..., AHEAD : AHEAD + 1]
    meet = ahead.sum(axis=1)
    share, some = np.float32(1.0) / np.maximum(meet, 1.0), np.minimum(meet, 1.0)
    absent = LEAST * (np.float32(1.0) - ahead)

    def bend(x: Floats32) -> Floats32:
        return np.tanh(x) if activation == "tanh" else np.maximum(x, np.float32(0.0))

    weight, bias = layers[0]
    h: Floats32 = bend(nodes[:arms] @ weight.T + bias)
    for k in range(1, len(layers) - 2, 2):
        (to_message, bias), (to_update, bias_update) = layers[k], layers[k + 1]
        w = h.shape[1]
        told = pairs @ to_message[:, 2 * w :].T + bias
        message = bend((h @ to_message[:, :w].T)[:, None] + h @ to_message[:, w : 2 * w].T + told)
        mean, largest = (message * ahead).sum(axis=1) * share, (message + absent).max(axis=1) * some
        heard = np.concatenate([h, mean, largest], axis=1) @ to_update[:, : 3 * w].T
        h = bend(heard + (h.mean(axis=0) @ to_update[:, 3 * w :].T + bias_update))
    (hidden, bias), (out, bias_out) = layers[-2], layers[-1]
    actions: Floats32 = bend(h @ hidden.T + bias) @ out.T + bias_out
    return actions
