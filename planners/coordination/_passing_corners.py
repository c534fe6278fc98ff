"""Corners: what it means in time that one arm passes a collision region first, and the earliest times they allow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.coordination._passing_orders import Orders, PassingOrders


class Corners(NamedTuple):
    """Arm ``second`` may come to ``enters`` once arm ``first`` is past ``leaves``; (E,) each, region by region."""

    region: Ints
    first: Ints
    leaves: Floats  # [lambda]
    second: Ints
    enters: Floats  # [lambda]


def corners_of(passing: PassingOrders, orders: Orders) -> Corners | None:
    """The corners of all regions, each passed as ``orders`` say; None if an arm's start or end is in the way."""
    empty = np.empty(0, dtype=np.int64)
    columns: list[tuple[Ints, Ints, Floats, Ints, Floats]] = [(empty, empty, np.empty(0), empty, np.empty(0))]
    for r, ((a, b, region), order) in enumerate(zip(passing.regions, orders, strict=True)):
        first, second = (b, a) if order else (a, b)
        limit, begin = (region.limit_a, region.begin_b) if order else (region.limit_b, region.begin_a)
        if limit[0] <= 0.0 or begin + len(limit) >= region.resolution:
            return None
        cells = np.flatnonzero(np.append(limit[1:] > limit[:-1], True))  # the last before each rise
        leaves = np.asarray((begin + cells + 1) * (passing.lengths[first] / region.resolution), dtype=np.float64)
        one = np.ones(len(cells), dtype=np.int64)
        columns.append((r * one, first * one, leaves, second * one, limit[cells]))
    return Corners(*(np.concatenate(column) for column in zip(*columns, strict=True)))
