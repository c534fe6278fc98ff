r"""Limits along a path as rows for compiled loops, and what motions of constant ``u`` over one interval may do.

State ``(lambda, x)`` with ``x = mu^2``, constant ``u = mu_dot`` per interval. Between two stations at distance D the
motion is exact: ``x_next = x + 2 D u``. Limits are rows ``low <= a u + b x + r sqrt(x) <= high`` (``a = M, b = Q,
r = R``, ``S`` folded into the limits), asked for at *both* ends of every interval: that also bounds the speed at
zero-inertia points (``a = 0``), where the rows at one end alone say nothing of ``u``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots import njit

ROW_SLACK = 1e-10  # rounding allowed when rows are divided by a small inertia, relative to the width of the limits
SMALLEST_INERTIA = 1e-14  # a row whose ``a`` is not larger does not bound ``u``

# Columns of ``Edges.steps``. A header of every station:
STATION = 0  # where it is
TWICE_LENGTH = 1  # of the interval that begins there; nan: friction in it, or empty
END_LOWEST = 2  # the lowest ``x`` at the interval's end; -inf: any
EDGE_LOW, EDGE_LOW_NEXT, EDGE_HIGH, EDGE_HIGH_NEXT = 3, 4, 5, 6
STATION_BEFORE = 7  # number of the station at or before this one's share of the path, for ``interval_at``
STEP_HEADER_COLUMNS = 8
# Then per end of the interval and row: a motion of constant ``u`` that begins with x ends in
# ``[least + slope x, most + slope x]``.
WHOLE_LEAST, WHOLE_SLOPE, WHOLE_MOST = 0, 1, 2
WHOLE_COLUMNS = 3
# Then per row:
ROW_A, ROW_B, ROW_LOW, ROW_HIGH, ROW_R = 0, 1, 2, 3, 4
ROW_COLUMNS = 5
COLUMNS_PER_ROW = 2 * WHOLE_COLUMNS + ROW_COLUMNS


class Rows(NamedTuple):
    """Limits along the path: stations (N+1,), rows (N+1, n), cap of ``x = mu^2`` (N+1,)."""

    station: Floats
    a: Floats
    b: Floats
    r: Floats
    low: Floats
    high: Floats
    x_cap: Floats


class Edges(NamedTuple):
    """One interval of the controllable set per station: the lowest and highest ``x`` (N+1,).

    ``*_next`` (N,): where the motion along the edge from station i arrives at station i + 1. Inside an interval the
    edge is the straight line between the two: a motion, so every point of it can be continued.

    ``steps`` (N+1, 8 + 11 n): the rows and edges once more, all of a station side by side, and what intervals
    do as a whole: one array, because loops over many cost more (their reference counts) than what they do.
    """

    low: Floats
    high: Floats
    low_next: Floats
    high_next: Floats
    steps: Floats


@njit
def _fill_whole(row: Floats, d2: float, a: float, b: float, low: float, high: float) -> None:
    """Fill what one row at one end lets an interval do as a whole (3,)."""
    if a < 0.0:
        a, b, low, high = -a, -b, -high, -low
    row[WHOLE_LEAST], row[WHOLE_SLOPE], row[WHOLE_MOST] = -np.inf, 0.0, np.inf
    if a > SMALLEST_INERTIA:
        row[WHOLE_LEAST], row[WHOLE_SLOPE], row[WHOLE_MOST] = d2 * low / a, 1.0 - d2 * b / a, d2 * high / a


@njit
def fill_steps(rows: Rows, edges: Edges) -> None:
    """Fill ``edges.steps`` from the rows and the other edges."""
    n, last = rows.a.shape[1], rows.station.shape[0] - 1
    lines = STEP_HEADER_COLUMNS + 2 * WHOLE_COLUMNS * n
    before = 0
    for i in range(last + 1):
        step, k = edges.steps[i], min(i, last - 1)
        d2 = 2.0 * (rows.station[k + 1] - rows.station[k])
        share = rows.station[last] * (i / last) * (1.0 - 1e-12)
        while before < last - 1 and rows.station[before + 1] < share:
            before += 1
        step[STATION], step[STATION_BEFORE] = rows.station[i], before
        step[TWICE_LENGTH] = d2 if d2 > 0.0 and i < last else np.nan
        step[END_LOWEST] = edges.low_next[k] if edges.low_next[k] > 0.0 else -np.inf
        step[EDGE_LOW], step[EDGE_LOW_NEXT] = edges.low[i], edges.low_next[k]
        step[EDGE_HIGH], step[EDGE_HIGH_NEXT] = edges.high[i], edges.high_next[k]
        for j in range(n):
            row = step[lines + ROW_COLUMNS * j :]
            row[ROW_A], row[ROW_B], row[ROW_R] = rows.a[i, j], rows.b[i, j], rows.r[i, j]
            row[ROW_LOW], row[ROW_HIGH] = rows.low[i, j], rows.high[i, j]
            for e in range(2):
                if rows.r[k + e, j] != 0.0:
                    step[TWICE_LENGTH] = np.nan
                whole = step[STEP_HEADER_COLUMNS + WHOLE_COLUMNS * (e * n + j) :]
                a = rows.a[k + e, j] + (d2 * rows.b[k + e, j] if e == 1 else 0.0)
                _fill_whole(whole, d2, a, rows.b[k + e, j], rows.low[k + e, j], rows.high[k + e, j])


@njit
def end_row(
    a: float, b: float, r: float, low: float, high: float, d2: float, x: float
) -> tuple[float, float, float, float]:
    """A row at the end of a piece of length ``d2 / 2`` as the interval of ``y = x + d2 u`` it allows.

    With ``v = sqrt(y)`` the row is ``P v^2 + d2 r v`` within two bounds. The last two numbers are a band that it takes
    out of the interval (empty: 0, 0); an empty interval is returned with its ends crossed.
    """
    P, R = a + d2 * b, d2 * r
    L, H = d2 * low + a * x, d2 * high + a * x
    if P < 0.0:
        P, R, L, H = -P, -R, -H, -L
    if R == 0.0:
        if SMALLEST_INERTIA * abs(a) >= P:
            return (-np.inf, np.inf, 0.0, 0.0) if L <= 0.0 <= H else (np.inf, -np.inf, 0.0, 0.0)
        return L / P, H / P, 0.0, 0.0
    first, last, band_low, band_high = 0.0, np.inf, 0.0, 0.0
    root = R * R + 4.0 * P * H
    if root < 0.0:
        last = root / (4.0 * P * P)
    else:
        half = -0.5 * (R + (np.sqrt(root) if R > 0.0 else -np.sqrt(root)))
        if R > 0.0:
            far = -H / half
            last = far * far if far > 0.0 else -far * far
        else:
            far = half / P if P > 0.0 else np.inf
            near = -H / half if half > 0.0 else 0.0
            last = far * far
            if near > 0.0:
                first = near * near
    root = R * R + 4.0 * P * L
    if root > 0.0:
        half = -0.5 * (R + (np.sqrt(root) if R > 0.0 else -np.sqrt(root)))
        if R > 0.0:
            far = -L / half
            if far > 0.0:
                first = max(first, far * far)
        else:
            far = half / P if P > 0.0 else np.inf
            near = -L / half if half > 0.0 else 0.0
            if near > 0.0:
                band_low, band_high = near * near, far * far
            elif far > 0.0:
                first = max(first, far * far)
    return first, last, band_low, band_high


@njit
def _slack(low: float, high: float) -> float:
    """What rounding may take off a row; nothing where one side has no limit."""
    width = high - low
    return ROW_SLACK * width if width < np.inf else 0.0


@njit
def reach(rows: Rows, i: int, x: float, low: float, high: float, bands: Floats) -> tuple[float, float, int]:
    """The part of [low, high] that the interval from station i can end in, if it begins with ``x``; exact.

    Less the bands (B, 2) of which the number is returned. Empty: the first number is larger than the second.
    """
    k = i + 1
    d2 = 2.0 * (rows.station[k] - rows.station[i])
    mu, taken = np.sqrt(x), 0
    for j in range(rows.a.shape[1]):
        a, used = rows.a[i, j], rows.b[i, j] * x + rows.r[i, j] * mu
        slack = _slack(rows.low[i, j], rows.high[i, j])
        least, most = rows.low[i, j] - slack - used, rows.high[i, j] + slack - used
        if a < 0.0:
            a, least, most = -a, -most, -least
        if a > SMALLEST_INERTIA:
            low, high = max(low, x + d2 * least / a), min(high, x + d2 * most / a)
        slack = _slack(rows.low[k, j], rows.high[k, j])
        first, last, band_low, band_high = end_row(
            rows.a[k, j], rows.b[k, j], rows.r[k, j], rows.low[k, j] - slack, rows.high[k, j] + slack, d2, x
        )
        low, high = max(low, first), min(high, last)
        if band_high > band_low and taken < bands.shape[0]:
            bands[taken, 0], bands[taken, 1] = band_low, band_high
            taken += 1
    return low, high, taken


@njit
def beside(value: float, up: bool, bands: Floats, taken: int) -> float:
    """The value itself, or where it leaves the bands that it is in, upwards or downwards."""
    moved = True
    while moved:
        moved = False
        for k in range(taken):
            if bands[k, 0] < value < bands[k, 1]:
                value, moved = bands[k, 1 if up else 0], True
    return value
