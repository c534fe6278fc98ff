"""The graphs of running episodes: arrays that are filled anew after every control period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, final

import numpy as np

from armtempo.arrays import Bools, Floats32
from armtempo.envs.coordination.graph._entries import EDGE_ENTRIES, GRAPH_ARMS, NODE_ENTRIES, NODE_PLACES
from armtempo.envs.coordination.graph._kernels import fill_graphs
from armtempo.envs.coordination.shield import EpisodeShield, OrderKeeper, Orders, OrderWork
from armtempo.envs.coordination.world import Episodes, World
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell

Graph = dict[str, Floats32]
"""``nodes`` (GRAPH_ARMS, N), ``edges`` (GRAPH_ARMS, GRAPH_ARMS, K) and, for one arm, ``own`` (GRAPH_ARMS,)."""


ONE: Bools = np.ones(1, dtype=np.bool_)


class Graphs(NamedTuple):
    """Of E episodes."""

    nodes: Floats32  # (E, GRAPH_ARMS, N)
    edges: Floats32  # (E, GRAPH_ARMS, GRAPH_ARMS, K)


@final
class GraphView:
    """What the arms of E episodes see.

    Args:
        cell: The cell.
        keeper: Who watches the episodes.

    Raises:
        InputError: The cell has more arms than a graph.
    """

    def __init__(self, cell: CoordinationCell, keeper: OrderKeeper) -> None:
        if len(cell.arms) > GRAPH_ARMS:
            raise InputError(
                f"cell {cell.name!r} has {len(cell.arms)} arms, a graph has room for {GRAPH_ARMS}",
                remedy='use observation="local"',
            )
        self._keeper, self._period = keeper, cell.control_period
        episodes = len(keeper.seen.waited)
        self.graphs = Graphs(
            nodes=np.zeros((episodes, GRAPH_ARMS, len(NODE_ENTRIES)), dtype=np.float32),
            edges=np.zeros((episodes, GRAPH_ARMS, GRAPH_ARMS, len(EDGE_ENTRIES)), dtype=np.float32),
        )

    def fill(
        self, world: World, episodes: Episodes, first: int, last: int, active: Bools, orders: Orders, work: OrderWork
    ) -> None:
        """See the active ones (E,) of episodes first..last - 1 as they are now, in the ``orders`` (E, R) that hold."""
        keeper = self._keeper
        fill_graphs(
            world, keeper.prices, keeper.seen, episodes, first, last, active, orders, keeper.expected, keeper.unit,
            self._period, work, *self.graphs,
        )  # fmt: skip

    def show(self, shield: EpisodeShield) -> None:
        """See the episode of a shield as it is now."""
        self.fill(shield.world, shield.episodes, 0, 1, ONE, shield.shield.orders[None], shield.order_work)

    @property
    def delays(self) -> Floats32:
        """(E, GRAPH_ARMS) how much later than at full speed arms arrive by the orders that hold, in units."""
        return self.graphs.nodes[..., NODE_PLACES["delay"]]

    def seen_by(self, i: int, e: int = 0) -> Graph:
        """What arm i of episode e sees; new arrays."""
        own = np.zeros(GRAPH_ARMS, dtype=np.float32)
        own[i] = 1.0
        return {"nodes": self.graphs.nodes[e].copy(), "edges": self.graphs.edges[e].copy(), "own": own}

    def seen_by_all(self, arms: Sequence[int]) -> Graph:
        """What these L arms of every episode see: (E L, ...); new arrays."""
        return seen_by_all(self.graphs._asdict(), arms)


def seen_by_all(graphs: Mapping[str, Floats32], arms: Sequence[int]) -> Graph:
    """What these L arms of E episodes see, of their ``nodes`` and ``edges`` (E, ...): (E L, ...); new arrays."""
    own = np.tile(np.eye(GRAPH_ARMS, dtype=np.float32)[list(arms)], (len(graphs["nodes"]), 1))
    return {name: np.repeat(values, len(arms), axis=0) for name, values in graphs.items()} | {"own": own}
