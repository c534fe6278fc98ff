"""The fastest motion through the controllable sets, the motions along their edges, and which limits are active."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.topp._rows import Edges, Rows, beside, fill_steps, reach
from armtempo.robots import njit

GREEDY_ROUNDING = 1e-6  # of x: what rounding may keep the fastest motion from the controllable set


@njit
def greedy_profile(rows: Rows, sets: Floats, counts: Ints, x_start: float, slowest: bool, x: Floats) -> int:
    """The fastest motion: at every station the largest ``u`` that stays in the controllable set.

    ``slowest``: the smallest one, where every motion from ``x_start`` is at least as fast: it brakes as hard as it can.
    Returns -1, or the station from which more than rounding keeps the motion out of the next set.
    """
    bands = np.empty((rows.a.shape[1], 2))
    x[0] = x_start
    for i in range(rows.station.shape[0] - 1):
        if rows.station[i + 1] == rows.station[i]:
            x[i + 1] = x[i]
            continue
        best, least = -1.0, np.inf
        for k in range(counts[i + 1]):
            m = k if slowest else counts[i + 1] - 1 - k
            low, high = sets[i + 1, m, 0], sets[i + 1, m, 1]
            first, last, taken = reach(rows, i, x[i], low, high, bands)
            y = beside(first if slowest else last, slowest, bands, taken)
            if first <= y <= last:
                best, least = y, 0.0
                break
            if first - last < least:  # rounding closed it: the interval that lacks least
                best, least = min(max(first if slowest else last, low), high), first - last
        if least > GREEDY_ROUNDING * (1.0 + best):
            return i
        x[i + 1] = best
    return -1


@njit
def follow_edges(rows: Rows, sets: Floats, edges: Edges) -> None:
    """Fill the edges of the lowest interval at every station, and where the motions along them arrive."""
    bands = np.empty((rows.a.shape[1], 2))
    last = rows.station.shape[0] - 1
    for i in range(last + 1):
        edges.low[i], edges.high[i] = sets[i, 0, 0], sets[i, 0, 1]
    for i in range(last):
        low, high = edges.low[i + 1], edges.high[i + 1]
        if rows.station[i + 1] == rows.station[i]:
            edges.low_next[i], edges.high_next[i] = edges.low[i], edges.high[i]
            continue
        _, final, taken = reach(rows, i, edges.high[i], low, high, bands)
        edges.high_next[i] = min(max(beside(final, False, bands, taken), low), high)
        first, _, taken = reach(rows, i, edges.low[i], low, high, bands)
        edges.low_next[i] = min(max(beside(first, True, bands, taken), low), high)
    fill_steps(rows, edges)


@njit
def active_rows(rows: Rows, x: Floats, u: Floats, row: Ints, side: Ints) -> None:
    """For every interval the row nearest to a limit at either end, and which: 1 upper, -1 lower (N,)."""
    for i in range(u.shape[0]):
        nearest = np.inf
        for e in range(2):
            k = i + e
            for j in range(rows.a.shape[1]):
                value = rows.a[k, j] * u[i] + rows.b[k, j] * x[k] + rows.r[k, j] * np.sqrt(x[k])
                width = max(min(rows.high[k, j] - rows.low[k, j], 1e12), 1e-300)  # a missing limit is far away
                above, below = (rows.high[k, j] - value) / width, (value - rows.low[k, j]) / width
                if min(above, below) < nearest:
                    nearest, row[i], side[i] = min(above, below), j, 1 if above < below else -1
        if nearest > 1e-4:
            row[i], side[i] = -1, 0
