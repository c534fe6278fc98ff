"""The network over arms and pairs of ``agents.policies`` in torch: for stable-baselines3 here, or any other trainer."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import torch
from torch import Tensor, nn

from armtempo.agents.policies import NODE_NUMBERS, graph_shapes
from armtempo.envs import EDGE_ENTRIES, EDGE_PLACES, GRAPH_ARMS, NODE_ENTRIES, NODE_PLACES

NODES, EDGES = len(NODE_ENTRIES), len(EDGE_ENTRIES)
PRESENT, AHEAD = NODE_PLACES["present"], EDGE_PLACES["ahead"]
LEAST = -1e9  # less than any message


def to_graph(rows: Tensor) -> tuple[Tensor, Tensor]:
    """Nodes (B, A, N) and edges (B, A, A, K) of rows (B, FLAT_SIZE); A as many as the row with the most arms has."""
    nodes = rows[:, :NODE_NUMBERS].reshape(-1, GRAPH_ARMS, NODES)
    edges = rows[:, NODE_NUMBERS:].reshape(-1, GRAPH_ARMS, GRAPH_ARMS, EDGES)
    most = max(int(nodes[..., PRESENT].sum(dim=1).max()), 1)
    return nodes[:, :most], edges[:, :most, :most]


@final
class GraphNetwork(nn.Module):
    """Actions, or whatever is asked for, of all arms from a graph that they see, in torch.

    Messages along pairs with a collision region ahead, the same weights for all arms and pairs: the network that agent
    files with ``observation="graph"`` hold, for a training loop of your own. numpy runs it in an agent file.

    Args:
        sizes: Widths of the rounds of messages.
        out: Numbers for each arm.
        activation: Between layers, such as ``torch.nn.ReLU``.
    """

    def __init__(self, sizes: Sequence[int], out: int, activation: type[nn.Module] = nn.ReLU) -> None:
        super().__init__()
        self.layers = nn.ModuleList([nn.Linear(inputs, outputs) for outputs, inputs in graph_shapes(sizes, out)])
        self.activation = activation()

    def forward(self, nodes: Tensor, edges: Tensor) -> Tensor:
        """(B, A, out) of nodes (B, A, N) and edges (B, A, A, K); what absent arms get means nothing."""
        bend, layers = self.activation, list(self.layers)
        present = nodes[..., PRESENT : PRESENT + 1]
        ahead = edges[..., AHEAD : AHEAD + 1]
        heard, arms = ahead.sum(dim=2).clamp(min=1.0), present.sum(dim=1, keepdim=True).clamp(min=1.0)
        any_ahead = (ahead.sum(dim=2) > 0.0).to(nodes.dtype)
        h = bend(layers[0](nodes)) * present
        for to_message, to_update in zip(layers[1:-2:2], layers[2:-2:2], strict=True):
            width = h.shape[-1]
            own, other, pair = torch.split(weight_of(to_message), [width, width, EDGES], dim=1)
            told = edges @ pair.T + bias_of(to_message)
            message = bend((h @ own.T).unsqueeze(2) + (h @ other.T).unsqueeze(1) + told)
            mean = (message * ahead).sum(dim=2) / heard
            largest = torch.where(ahead > 0.0, message, LEAST).amax(dim=2) * any_ahead
            everyone = (h.sum(dim=1, keepdim=True) / arms).expand_as(h)
            h = bend(to_update(torch.cat([h, mean, largest, everyone], dim=2))) * present
        result: Tensor = layers[-1](bend(layers[-2](h)))
        return result


def weight_of(layer: Any) -> Tensor:
    """(out, in)."""
    weight: Tensor = layer.weight
    return weight


def bias_of(layer: Any) -> Tensor:
    """(out,)."""
    bias: Tensor = layer.bias
    return bias
