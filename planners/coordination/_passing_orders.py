r"""Who passes first, region by region: what is decided of a precedence (see ``_precedence``), one bit per region.

A region is a connected set (corners count) of cells of a chart that are not free. Monotone walks that keep out of it
pass it on one side: one of the two arms first. While arm j, which passes first, is in cell c of its path, arm i must
not be past

    limit_i(c) = min over cells c' >= c of arm j that the region has: begin of its cells of arm i in row c'

and anywhere once arm j has left the region. Limits of a region never fall along arm j's path; the limit of a pair is
the least of its regions', so the proofs of ``_precedence`` hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.coordination._precedence import Precedence

Orders = NDArray[np.int8]


class PassingRegion(NamedTuple):
    """One collision region of a pair of arms a < b and how far each may go if the other one passes first.

    ``limit_a`` holds from cell ``begin_b`` of arm b's path on, one entry per cell up to the region's last; before it,
    the first entry holds, behind it nothing. ``limit_b``: the same with the arms exchanged.
    """

    a: int
    b: int
    begin_a: int
    begin_b: int
    limit_a: Floats  # [lambda of a] over arm b's cells
    limit_b: Floats  # [lambda of b] over arm a's cells


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
        regions = []
        for (a, b), chart in charts.items():
            if not 0 <= a < b < arms:
                raise InputError(f"there is no pair of arms {(a, b)} with a < b < {arms}")
            resolutions[a, b] = resolutions[b, a] = chart.resolution
            for label, (rows, columns) in enumerate(ndimage.find_objects(chart.labels), start=1):
                inside = chart.labels[rows, columns] == label
                regions.append(
                    PassingRegion(
                        a, b, rows.start, columns.start,
                        _limit(inside, rows.start, chart.step_a), _limit(inside.T, columns.start, chart.step_b),
                    )
                )  # fmt: skip
        resolutions.setflags(write=False)
        return cls(lengths=tuple(lengths), resolutions=resolutions, regions=tuple(regions))

    def of_ranks(self, order: Sequence[int]) -> Orders:
        """The earlier arm in ``order`` passes first everywhere."""
        rank = {arm: place for place, arm in enumerate(order)}
        return np.array([rank[region.a] > rank[region.b] for region in self.regions], dtype=np.int8)

    def of_precedence(self, precedence: Precedence) -> Orders:
        """Who passes first in a precedence of the same arms, or of charts with less clearance."""
        out = np.zeros(len(self.regions), dtype=np.int8)
        for r, region in enumerate(self.regions):
            # Where arm b's last cell of the region still holds arm a back before it, b passes first.
            last = (
                (region.begin_b + len(region.limit_a)) * self.lengths[region.b] / self.resolutions[region.a, region.b]
            )
            held = float(precedence.farthest(region.a, region.b, last * (1.0 - 1e-9)))
            widest = (region.begin_a + len(region.limit_b)) * self.lengths[region.a]
            out[r] = held < widest / self.resolutions[region.a, region.b]
        return out

    def precedence(self, orders: ArrayLike) -> Precedence:
        """The limits that these orders mean.

        Raises:
            InputError: ``orders`` are not (R,) of 0 and 1.
        """
        orders = np.asarray(orders)
        if orders.shape != (len(self.regions),) or not np.isin(orders, (0, 1)).all():
            raise InputError(f"orders must be {len(self.regions)} numbers 0 or 1, got {orders!r}")
        limits: dict[tuple[int, int], Floats] = {}
        for region, order in zip(self.regions, orders, strict=True):
            first, second = (region.b, region.a) if order else (region.a, region.b)
            begin, limit = (region.begin_b, region.limit_a) if order else (region.begin_a, region.limit_b)
            whole = limits.setdefault((second, first), np.full(int(self.resolutions[first, second]), np.inf))
            end = begin + len(limit)
            whole[begin:end] = np.minimum(whole[begin:end], limit)
            whole[:begin] = np.minimum(whole[:begin], limit[0])
        return Precedence(lengths=self.lengths, limits=limits)


def _limit(inside: Bools, begin: int, step: float) -> Floats:
    """(C,) over the columns of a region: the least begin of its cells in this column or a later one."""
    first = np.where(inside.any(axis=0), np.argmax(inside, axis=0), inside.shape[0])
    limit = (begin + np.minimum.accumulate(first[::-1])[::-1]) * step
    limit.setflags(write=False)
    return np.asarray(limit, dtype=np.float64)
