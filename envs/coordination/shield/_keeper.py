"""What is seen of episodes under a shield, and the orders of passing that are decided from it."""

from __future__ import annotations

from functools import cached_property
from typing import final

import numpy as np

from armtempo.arrays import Bools
from armtempo.envs.coordination.shield._deciding import OrderWork, order_work
from armtempo.envs.coordination.shield._stops_seen import EXPECTED_REST_SHARE, StopsSeen, forget
from armtempo.envs.coordination.world import OrderRule
from armtempo.planners import CoordinationCell
from armtempo.planners.coordination import PassingOrders, order_tables
from armtempo.planners.coordination.kernels import OrderTables
from armtempo.state import Stateful


@final
class OrderKeeper(Stateful):
    """Watches E episodes, and knows how their orders are decided.

    Args:
        cell: The cell.
        regions: Of its shield.
        seen: Of E episodes: who stands.
        rule: Who decides the orders, see ``CoordinationOptions.orders``.

    Attributes:
        seen: As given.
        rule: As given.
        expected: How long a stop lasts before one was seen [s].
        unit: The longest minimum time, of which times are told [s].
    """

    changing = ("seen",)

    def __init__(self, cell: CoordinationCell, regions: PassingOrders, seen: StopsSeen, rule: OrderRule) -> None:
        self._cell, self._regions, self.rule, self.seen = cell, regions, rule, seen
        times = [motion.duration for motion in cell.fastest]
        self.expected = EXPECTED_REST_SHARE * float(np.mean(times))
        self.unit = max(times)

    @cached_property
    def prices(self) -> OrderTables:
        """The regions in time."""
        return order_tables(self._regions, self._cell.planes)

    @property
    def decides(self) -> bool:
        """Whether orders are decided here."""
        return self.rule != "asked"

    def expects(self, rule: OrderRule | None = None) -> float:
        """How long arms that stand are expected to, before a stop was seen [s]; 0 where the rule does not ask."""
        return self.expected if (self.rule if rule is None else rule) == "search+stop" else 0.0

    def work(self) -> OrderWork:
        """Scratch for one thread."""
        return order_work(self._cell, len(self._regions.regions))

    def forget(self, active: Bools) -> None:
        """The active ones (E,) of the episodes begin anew."""
        forget(self.seen, active)
