r"""Who passes first, region by region: what is decided of a precedence (see ``_precedence``), one bit per region.

Monotone walks that keep out of a region pass it on one side: one of the two arms first. Limits of a region (see
``CollisionRegion``) never fall along the path of the arm that passes first; the limit of a pair is the least of its
regions', so the proofs of ``_precedence`` hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, brief
from armtempo.planners.charts import CollisionRegion, CoordinationChart
from armtempo.planners.coordination._precedence import Precedence

Orders = NDArray[np.int8]


class PassingRegion(NamedTuple):
    """A collision region of a pair of arms a < b."""

    a: int
    b: int
    region: CollisionRegion


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PassingOrders:
    """The collision regions of several arms. Orders (R,) int8 say of each: 0, arm a passes first, or 1, arm b.

    Attributes:
        lengths: (A,) lengths of the paths.
        resolutions: (A, A) cells along each path in the pair's chart; 0 where they never meet.
        regions: All regions, pair by pair.
    """

    lengths: tuple[float, ...]
    resolutions: Ints
    regions: tuple[PassingRegion, ...]

    @classmethod
    def of_charts(cls, lengths: Sequence[float], charts: Mapping[tuple[int, int], CoordinationChart]) -> PassingOrders:
        """``charts`` by pair a < b, first index along arm a's path; pairs that are left out never meet.

        Raises:
            InputError: A pair is not one of two arms in rising order.
        """
        arms = len(lengths)
        resolutions = np.zeros((arms, arms), dtype=np.int64)
        regions: list[PassingRegion] = []
        for (a, b), chart in charts.items():
            if not 0 <= a < b < arms:
                raise InputError(f"there is no pair of arms {(a, b)} with a < b < {arms}")
            resolutions[a, b] = resolutions[b, a] = chart.resolution
            regions += [PassingRegion(a, b, region) for region in chart.components]
        resolutions.setflags(write=False)
        return cls(lengths=tuple(lengths), resolutions=resolutions, regions=tuple(regions))

    def of_ranks(self, order: Sequence[int]) -> Orders:
        """The earlier arm in ``order`` passes first everywhere."""
        rank = {arm: place for place, arm in enumerate(order)}
        return np.array([rank[region.a] > rank[region.b] for region in self.regions], dtype=np.int8)

    @cached_property
    def ruled(self) -> Orders:
        """(R,) which arm a rule (``after``, ``with``) lets pass first, as orders say it; 2: either."""
        return np.array([_ruled(region) for _, _, region in self.regions], dtype=np.int8)

    def of_precedence(self, precedence: Precedence) -> Orders:
        """Who passes first in a precedence of the same arms, or of charts with less clearance."""
        out = np.zeros(len(self.regions), dtype=np.int8)
        for r, (a, b, region) in enumerate(self.regions):
            # Where arm b's last cell of the region still holds arm a back before it, b passes first.
            last = (region.begin_b + len(region.limit_a)) * self.lengths[b] / self.resolutions[a, b]
            held = float(precedence.farthest(a, b, last * (1.0 - 1e-9)))
            out[r] = held < (region.begin_a + len(region.limit_b)) * self.lengths[a] / self.resolutions[a, b]
        return out

    def precedence(self, orders: ArrayLike) -> Precedence:
        """The limits that these orders mean; 2: nobody waits.

        Raises:
            InputError: ``orders`` are not (R,) of 0, 1 and 2.
        """
        orders = np.asarray(orders)
        if orders.shape != (len(self.regions),) or not np.isin(orders, (0, 1, 2)).all():
            raise InputError(f"orders must be {len(self.regions)} numbers 0, 1 or 2, got {brief(orders)}")
        limits: dict[tuple[int, int], Floats] = {}
        for (a, b, region), order in zip(self.regions, orders, strict=True):
            if order == 2:
                continue
            pair, limit = ((a, b), region.whole_limit_a) if order else ((b, a), region.whole_limit_b)
            limits[pair] = np.minimum(limits[pair], limit) if pair in limits else limit
        return Precedence(lengths=self.lengths, limits=limits)


def _ruled(region: CollisionRegion) -> int:
    """A region from the start of one path to the end of the other is passed first by the former."""
    last_a, last_b = (
        begin + cells for begin, cells in zip((region.begin_a, region.begin_b), region.cells.shape, strict=True)
    )
    if region.begin_a == 0 and last_b == region.resolution and last_a < region.resolution and region.begin_b > 0:
        return 0
    if region.begin_b == 0 and last_a == region.resolution and last_b < region.resolution and region.begin_a > 0:
        return 1
    return 2
