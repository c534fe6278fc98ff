r"""Collision regions: the connected sets of cells of a chart that are not free, and the limits that they mean.

Arms never go back, so they pass a region on one side of it: one of the two first. While arm j, which passes first, is
in cell c of its path, arm i must not be past

    limit_i(c) = min over cells c' >= c of arm j that the region has: begin of its cells of arm i in row c'

and may go anywhere once arm j has left the region. A limit never falls as arm j goes on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from armtempo.arrays import Bools, Floats, Ints
from armtempo.robots import inlined

TOUCHING = np.ones((3, 3), dtype=np.bool_)  # at corners at least
CELL_BORDER_ROUNDING = 1e-9  # of a cell: an arm on the border of two cells counts as in the earlier one


@dataclass(frozen=True, kw_only=True, eq=False)
class CollisionRegion:
    """One collision region of a chart, and how far each arm may go if the other one passes it first.

    Attributes:
        resolution: Cells along each side of the chart.
        begin_a: First cell of the region along path a.
        begin_b: First cell of it along path b.
        cells: (a, b) from there on, to its last ones: which cells belong to it.
        lam_a: Where on path a it begins and ends.
        lam_b: Where on path b it does.
        limit_a: (b,) lambda of arm a, over the region's cells along path b; before them the first one holds, behind
            them nothing.
        limit_b: (a,) lambda of arm b, over the region's cells along path a; likewise.
        end_b: (a,) lambda at which arm b has left the region's cells while arm a is in that one; infinite where they
            reach to the end of path b.
    """

    resolution: int
    begin_a: int
    begin_b: int
    cells: Bools
    lam_a: tuple[float, float]
    lam_b: tuple[float, float]
    limit_a: Floats
    limit_b: Floats
    end_b: Floats

    def __post_init__(self) -> None:
        for array in (self.cells, self.limit_a, self.limit_b, self.end_b):
            array.setflags(write=False)

    @property
    def whole_limit_a(self) -> Floats:
        """(R,) ``limit_a`` over all of path b; infinite behind the region."""
        return _over_whole_path(self.limit_a, self.begin_b, self.resolution)

    @property
    def whole_limit_b(self) -> Floats:
        """(R,) ``limit_b`` over all of path a; infinite behind the region."""
        return _over_whole_path(self.limit_b, self.begin_a, self.resolution)


def _over_whole_path(limit: Floats, begin: int, cells: int) -> Floats:
    whole = np.full(cells, np.inf)
    whole[:begin] = limit[0]
    whole[begin : begin + len(limit)] = limit
    return whole


def collision_regions(
    occupied: Bools, step_a: float, step_b: float, joined: Ints | None = None
) -> tuple[CollisionRegion, ...]:
    """The regions of a chart, in the order in which they begin along path a.

    Args:
        occupied: (R, R) which cells are not free, first index along path a. Those that touch, at a corner at least,
            are of one region.
        step_a: Side of a cell along path a.
        step_b: Side of a cell along path b.
        joined: (L, 4) cells (a, b, a', b') of which each two are of one region, too, though they do not touch.
    """
    rows, columns = (np.flatnonzero(occupied.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return ()
    first_a, first_b = int(rows[0]), int(columns[0])
    # Sought in the box that holds all of them: labels of a whole chart are many.
    labels, _ = ndimage.label(occupied[first_a : rows[-1] + 1, first_b : columns[-1] + 1], structure=TOUCHING)
    for a, b, other_a, other_b in [] if joined is None else joined - np.array([first_a, first_b] * 2):
        one, other = sorted((labels[a, b], labels[other_a, other_b]))
        labels[labels == other] = one
    regions = []
    for label, box in enumerate(ndimage.find_objects(labels), start=1):
        if not box:  # none: joined to another
            continue
        a, b = box
        cells = np.asarray(labels[a, b] == label)
        begin_a, begin_b = first_a + a.start, first_b + b.start
        stop_a, stop_b = begin_a + len(cells), begin_b + cells.shape[1]
        end_b = np.where(cells.any(axis=1), stop_b - np.argmax(cells[:, ::-1], axis=1), begin_b)
        regions.append(
            CollisionRegion(
                resolution=len(occupied),
                begin_a=begin_a,
                begin_b=begin_b,
                cells=cells,
                lam_a=(float(begin_a * step_a), float(stop_a * step_a)),
                lam_b=(float(begin_b * step_b), float(stop_b * step_b)),
                limit_a=_limit(cells.T, begin_a, step_a),
                limit_b=_limit(cells, begin_b, step_b),
                end_b=np.where(end_b < len(occupied), end_b * step_b, np.inf),
            )
        )
    return tuple(regions)


def _limit(cells: Bools, begin: int, step: float) -> Floats:
    """(C,) over the rows of a region: the least begin of its cells in this row or a later; only joined have gaps."""
    first = np.where(cells.any(axis=1), np.argmax(cells, axis=1), cells.shape[1])
    return np.asarray((begin + np.minimum.accumulate(first[::-1])[::-1]) * step, dtype=np.float64)


def cells_at(lam: Floats, length: float, cells: int) -> Ints:
    """In which of the equal ``cells`` of a path of ``length`` places ``lam`` (any shape) are."""
    return np.clip((lam * (cells / length) - CELL_BORDER_ROUNDING).astype(np.int64), 0, cells - 1)


@inlined
def cell_at(place: float, cells_per_length: float, cells: int) -> int:
    """``cells_at`` for one place, compiled."""
    return min(max(int(place * cells_per_length - CELL_BORDER_ROUNDING), 0), cells - 1)


def limit_at(limit: Floats, length: float, lam: Floats) -> Floats:
    """A limit over the cells of a path of ``length`` at places ``lam`` (any shape)."""
    return limit[cells_at(lam, length, len(limit))]
