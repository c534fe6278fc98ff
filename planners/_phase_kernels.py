r"""Compiled loops of the phase plane. State ``(lambda, x)`` with ``x = mu^2``, constant ``u = mu_dot`` per interval.

Between two stations at distance D the motion is exact: ``x_end = x + 2 D u``. Torque limits are linear rows
``low <= a u + b x <= high`` (``a = M, b = Q``, ``S`` folded into the limits), asked for at *both* ends of every
interval: that also bounds the speed at zero-inertia points (``a = 0``), where the rows at one end alone say nothing
of ``u``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.robots import njit

Array = NDArray[np.float64]
ROW_SLACK = 1e-10  # rounding allowed when rows are divided by a small inertia, relative to the width of the limits


class Rows(NamedTuple):
    """Limits along the path: stations (N+1,), rows (N+1, n), cap of ``x = mu^2`` (N+1,)."""

    station: Array
    a: Array
    b: Array
    r: Array
    low: Array
    high: Array
    x_cap: Array


class Edges(NamedTuple):
    """The controllable set: per station the lowest and highest ``x`` from which the end can be met (N+1,).

    ``*_next`` (N,): where the motion along the edge from station i arrives at station i + 1. Inside an interval the
    edge is the straight line between the two: a motion, so every point of it can be continued.
    """

    low: Array
    high: Array
    low_next: Array
    high_next: Array


@njit
def _pair(a: float, b: float, low: float, high: float) -> tuple[float, float, float, float]:
    """The same row with ``a >= 0``."""
    if a < 0.0:
        return -a, -b, -high, -low
    return a, b, low, high


@njit
def _stage_rows(rows: Rows, i: int, next_low: float, next_high: float, out: Array) -> int:
    """Collect the rows (a, b, low, high) on ``(u, x)`` of the interval from station i; returns their number."""
    n = rows.a.shape[1]
    d2 = 2.0 * (rows.station[i + 1] - rows.station[i])
    for j in range(n):
        out[j, 0], out[j, 1], out[j, 2], out[j, 3] = _pair(rows.a[i, j], rows.b[i, j], rows.low[i, j], rows.high[i, j])
        k = i + 1
        out[n + j, 0], out[n + j, 1], out[n + j, 2], out[n + j, 3] = _pair(
            rows.a[k, j] + d2 * rows.b[k, j], rows.b[k, j], rows.low[k, j], rows.high[k, j]
        )
    out[2 * n, 0], out[2 * n, 1], out[2 * n, 2], out[2 * n, 3] = d2, 1.0, next_low, next_high
    return int(2 * n + 1)


@njit
def _accelerations(stage: Array, count: int, x: float) -> tuple[float, float]:
    """The interval of ``u`` that all rows allow at ``x``."""
    lowest, highest = -np.inf, np.inf
    for k in range(count):
        a = stage[k, 0]
        slack = ROW_SLACK * (stage[k, 3] - stage[k, 2])
        if a > 1e-14:
            lowest = max(lowest, (stage[k, 2] - slack - stage[k, 1] * x) / a)
            highest = min(highest, (stage[k, 3] + slack - stage[k, 1] * x) / a)
    return lowest, highest


@njit
def controllable_sets(rows: Rows, x_end: float, low: Array, high: Array, low_next: Array, high_next: Array) -> int:
    """Fill the controllable set backwards from ``x_end``; returns -1, or the station whose set is empty.

    Eliminates ``u`` from every pair of rows: ``x (b_q a_p - b_p a_q) <= high_q a_p - low_p a_q``; no division by an
    inertia, so zero-inertia rows need no special case.
    """
    n = rows.a.shape[1]
    last = rows.station.shape[0] - 1
    stage = np.empty((2 * n + 1, 4))
    low[last] = high[last] = x_end
    if x_end > rows.x_cap[last]:
        return int(last)
    for i in range(last - 1, -1, -1):
        if rows.station[i + 1] == rows.station[i]:
            low[i], high[i] = low[i + 1], min(high[i + 1], rows.x_cap[i])
            low_next[i], high_next[i] = low[i], high[i]
            if low[i] > high[i]:
                return i
            continue
        count = _stage_rows(rows, i, low[i + 1], high[i + 1], stage)
        x_low, x_high = 0.0, rows.x_cap[i]
        for p in range(count):
            for q in range(count):
                slope = stage[q, 1] * stage[p, 0] - stage[p, 1] * stage[q, 0]
                room = stage[q, 3] * stage[p, 0] - stage[p, 2] * stage[q, 0]
                scale = abs(stage[q, 1] * stage[p, 0]) + abs(stage[p, 1] * stage[q, 0])
                if slope > 1e-13 * scale:
                    x_high = min(x_high, room / slope)
                elif slope < -1e-13 * scale:
                    x_low = max(x_low, room / slope)
                elif room < -1e-9 * (abs(stage[q, 3] * stage[p, 0]) + abs(stage[p, 2] * stage[q, 0])):
                    return i
        if x_low > x_high:
            if x_low > x_high + 1e-12 * (1.0 + x_high):
                return i
            x_low = x_high
        low[i], high[i] = x_low, x_high
        u_low, u_high = _accelerations(stage, count, x_high)
        high_next[i] = min(
            max(x_high + 2.0 * (rows.station[i + 1] - rows.station[i]) * max(u_low, u_high), low[i + 1]), high[i + 1]
        )
        u_low, u_high = _accelerations(stage, count, x_low)
        low_next[i] = min(
            max(x_low + 2.0 * (rows.station[i + 1] - rows.station[i]) * min(u_low, u_high), low[i + 1]), high[i + 1]
        )
    return -1


@njit
def greedy_profile(rows: Rows, edges: Edges, x_start: float, x: Array, u: Array) -> None:
    """The fastest motion: at every station the largest ``u`` that stays in the controllable set."""
    n = rows.a.shape[1]
    stage = np.empty((2 * n + 1, 4))
    x[0] = min(max(x_start, edges.low[0]), edges.high[0])
    for i in range(rows.station.shape[0] - 1):
        d2 = 2.0 * (rows.station[i + 1] - rows.station[i])
        if d2 == 0.0:
            x[i + 1], u[i] = x[i], 0.0
            continue
        count = _stage_rows(rows, i, edges.low[i + 1], edges.high[i + 1], stage)
        u_low, u_high = _accelerations(stage, count, x[i])
        x[i + 1] = min(max(x[i] + d2 * max(u_low, u_high), edges.low[i + 1]), edges.high[i + 1])
        u[i] = (x[i + 1] - x[i]) / d2


def can_hold(rows: Rows, edges: Edges) -> NDArray[np.bool_]:
    """(N+1,) stations where the arm can stand still for as long as it likes, and go on from there to the end."""
    held: NDArray[np.bool_] = ((rows.low <= 0.0) & (rows.high >= 0.0)).all(axis=1) & (edges.low <= 0.0)
    return held


@njit
def locate(station: Array, lam: float) -> int:
    """The interval that begins at or before ``lam`` (the last one at the end)."""
    first, last = 0, station.shape[0] - 1
    while last - first > 1:
        middle = (first + last) // 2
        if station[middle] <= lam:
            first = middle
        else:
            last = middle
    return first


@njit
def edge_speed(rows: Rows, edges: Edges, lam: float) -> float:
    """``mu*``, the upper edge of the controllable set at ``lam``."""
    i = locate(rows.station, lam)
    w = (lam - rows.station[i]) / (rows.station[i + 1] - rows.station[i])
    return float(np.sqrt(max(edges.high[i] + w * (edges.high_next[i] - edges.high[i]), 0.0)))


@njit
def acceleration_bounds(rows: Rows, lam: float, x: float) -> tuple[float, float]:
    """LB and UB (Lee1991 eq. 9): what the torque limits at ``(lam, x)`` alone allow."""
    i = locate(rows.station, lam)
    w = (lam - rows.station[i]) / (rows.station[i + 1] - rows.station[i])
    return _bounds_at(rows, i, w, x, 0.0)


@njit
def _bounds_at(rows: Rows, i: int, w: float, x: float, d2: float) -> tuple[float, float]:
    """Bounds of ``u`` from the rows at share ``w`` of interval i, met after travelling ``d2 / 2`` from ``x``."""
    lowest, highest = -np.inf, np.inf
    for j in range(rows.a.shape[1]):
        b = rows.b[i, j] + w * (rows.b[i + 1, j] - rows.b[i, j])
        a = rows.a[i, j] + w * (rows.a[i + 1, j] - rows.a[i, j]) + d2 * b
        low = rows.low[i, j] + w * (rows.low[i + 1, j] - rows.low[i, j]) - b * x
        high = rows.high[i, j] + w * (rows.high[i + 1, j] - rows.high[i, j]) - b * x
        if a < 0.0:
            a, low, high = -a, -high, -low
        if a > 1e-14:
            lowest = max(lowest, low / a)
            highest = min(highest, high / a)
    return lowest, highest


@njit
def _next_piece(
    rows: Rows, edges: Edges, i: int, left: float, x: float, rest: float, command: float, by_speed: bool
) -> tuple[float, float]:
    """Length and ``u`` of the next piece in interval i, ``left`` before its end; no length: the arm stays at rest."""
    width = rows.station[i + 1] - rows.station[i]
    w = 1.0 - left / width
    u_low, u_high = _bounds_at(rows, i, w, x, 0.0)
    goal_share = command * command if by_speed else 1.0
    step = min(left, np.sqrt(x) * rest + 0.5 * max(u_high, 0.0) * rest * rest)
    if step <= 0.0:
        return 0.0, 0.0
    here = edges.high[i] + w * (edges.high_next[i] - edges.high[i])
    if i == rows.station.shape[0] - 2 and step == left:
        if x < 0.25 * goal_share * here:
            step = 0.5 * left  # from rest before the end: speed up first, the edge bends down to it
        elif by_speed and x > goal_share * here > 0.0:
            # too fast for the command: brake until the target is met, which also runs down to the end
            meet = (x - goal_share * here) / (-2.0 * u_low - goal_share * here / left)
            if 0.0 < meet < left:
                step = meet
    w_next = 1.0 if step == left else w + step / width
    x_edge = edges.high[i] + w_next * (edges.high_next[i] - edges.high[i])
    x_floor = edges.low[i] + w_next * (edges.low_next[i] - edges.low[i])
    d2 = 2.0 * step
    end_low, end_high = _bounds_at(rows, i, w_next, x, d2)
    u_low, u_high = max(u_low, end_low), min(u_high, end_high)
    if x_floor > 0.0:  # the arm cannot hold still here: it must stay fast enough
        u_low = max(u_low, (x_floor - x) / d2)
    u_high = min(u_high, (x_edge - x) / d2)
    u_low = min(u_low, u_high)
    if not by_speed:
        return step, u_low + command * (u_high - u_low)
    if command == 0.0:
        return step, u_low
    return step, min(max((goal_share * x_edge - x) / d2, u_low), u_high)


@njit
def advance(
    rows: Rows,
    edges: Edges,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    dt: float,
    record: Array,
    count: int,
) -> tuple[float, float, float, int]:
    """Move an arm along its path for ``dt`` under a command in [0, 1].

    Piece by piece, each to the next station or one tick ahead, with one constant ``u`` from ``[u_low, u_high]``: the
    rows at both ends of the piece, and no point above the controllable set. ``by_speed``: ``u`` heads for ``command``
    times ``mu*`` (0: brake as hard as the limits allow); else ``u = u_low + command (u_high - u_low)``. The edge is
    obeyed to rounding, so the end can always be met; the rows *inside* a piece hold to the second order of its length.
    ``record`` (K, 3) receives (time, lam, mu) after every piece; (0, 3): none. Returns lam, mu, the time used (less
    than ``dt`` only on arrival) and the length of the record.
    """
    station = rows.station
    last = station.shape[0] - 1
    x = mu * mu
    used = 0.0
    i = locate(station, lam)
    for _ in range(100000):
        left = station[i + 1] - lam
        while left <= 1e-12 * station[last] and i < last - 1:
            i += 1
            left = station[i + 1] - lam
        if lam >= station[last] - 1e-12 * station[last]:
            return station[last], np.sqrt(edges.high[last]), used, count
        rest = dt - used
        if rest <= 1e-9 * dt:  # rounding
            used = dt
            break
        mu = np.sqrt(x)
        step, u = _next_piece(rows, edges, i, left, x, rest, command, by_speed)
        if step <= 0.0:
            used = dt
            break
        x_next = x + 2.0 * step * u
        if x_next <= 1e-18:
            if x <= 1e-18:
                if left <= 1e-9 * station[last] and i == last - 1:
                    return station[last], 0.0, used, count  # closer to the end than rounding
                x = 0.0
                used = dt
                break
            stop = x / (-2.0 * u) if u < 0.0 else step
            if stop < step * (1.0 - 1e-12):
                time = mu / -u
                if time <= rest:
                    lam += stop
                    x = 0.0
                    used += time
                    if record.shape[0] > 0:
                        record[count, 0], record[count, 1], record[count, 2] = used, lam, 0.0
                        count += 1
                    continue
                x_next = 0.0
                step = stop
            x_next = max(x_next, 0.0)
        mu_next = np.sqrt(x_next)
        time = 2.0 * step / (mu + mu_next)
        if time > rest:
            mu_next = max(mu + u * rest, 0.0)
            lam += 0.5 * (mu + mu_next) * rest
            x = mu_next * mu_next
            used = dt
        else:
            lam = station[i + 1] if step == left else lam + step
            x = x_next
            used += time
        if record.shape[0] > 0:
            record[count, 0], record[count, 1], record[count, 2] = used, lam, np.sqrt(x)
            count += 1
        if count >= record.shape[0] > 0:
            break
    return lam, np.sqrt(x), used, count
