"""Corners: what it means in time that one arm passes a collision region first."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.charts import CollisionRegion
from armtempo.planners.coordination._passing_orders import Orders, PassingOrders


class Corners(NamedTuple):
    """Arm ``second`` may come to ``enters`` once arm ``first`` is past ``leaves``; (E,) each, region by region."""

    region: Ints
    first: Ints
    leaves: Floats  # [lambda]
    second: Ints
    enters: Floats  # [lambda]


def staircase(region: CollisionRegion, order: int) -> tuple[Ints, Ints]:
    """(E,) borders between cells that the first arm must be past, and (E,) those that the second may pass then.

    ``order``: 0, arm a passes first, or 1, arm b. Only where the latter rises: the rest follows. Somebody's end is in
    the way where the first one has to get past its last cell, and somebody's start where a border to pass is 0.
    """
    cells = region.cells.T if order else region.cells
    begin, enter = (region.begin_b, region.begin_a) if order else (region.begin_a, region.begin_b)
    ends = np.where(cells.any(axis=0), len(cells) - np.argmax(cells[::-1], axis=0), 0)  # joined regions have gaps
    last = np.maximum.accumulate(ends)
    rises = np.flatnonzero(np.diff(last, prepend=0))
    return begin + last[rises], enter + rises


def can_be(region: CollisionRegion, left: Ints, entered: Ints) -> bool:
    """Whether nobody's start or end is in the way at the corners of a ``staircase``."""
    return bool(left[-1] < region.resolution and entered[0] > 0)


def corners_of(passing: PassingOrders, orders: Orders) -> Corners | None:
    """The corners of all regions, each passed as ``orders`` say; None if an arm's start or end is in the way."""
    empty = np.empty(0, dtype=np.int64)
    columns: list[tuple[Ints, Ints, Floats, Ints, Floats]] = [(empty, empty, np.empty(0), empty, np.empty(0))]
    for r, ((a, b, region), order) in enumerate(zip(passing.regions, orders, strict=True)):
        first, second = (b, a) if order else (a, b)
        left, entered = staircase(region, int(order))
        if not can_be(region, left, entered):
            return None
        leaves, enters = (
            np.asarray(cells * (passing.lengths[arm] / region.resolution), dtype=np.float64)
            for arm, cells in ((first, left), (second, entered))
        )
        one = np.ones(len(left), dtype=np.int64)
        columns.append((r * one, first * one, leaves, second * one, enters))
    return Corners(*(np.concatenate(column) for column in zip(*columns, strict=True)))
