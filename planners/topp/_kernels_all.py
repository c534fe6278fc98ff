r"""Compiled loops of the phase plane. State ``(lambda, x)`` with ``x = mu^2``, constant ``u = mu_dot`` per interval.

Between two stations at distance D the motion is exact: ``x_next = x + 2 D u``. Limits are rows
``low <= a u + b x + r sqrt(x) <= high`` (``a = M, b = Q, r = R``, ``S`` folded into the limits), asked for at *both*
ends of every interval: that also bounds the speed at zero-inertia points (``a = 0``), where the rows at one end alone
say nothing of ``u``.

Viscous friction (``r``) makes the rows non-convex: the speeds from which the end can be met are then a *union* of
intervals, at most ``MOST`` of which are kept. The pointwise largest admissible profile is still the optimum, because
two profiles can only swap where they cross.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.robots import inlined, njit

ROW_SLACK = 1e-10  # rounding allowed when rows are divided by a small inertia, relative to the width of the limits
MOST = 4  # intervals of a controllable set; dropping further ones only forbids
BANDS = 8  # taken out of one candidate set
RETREATS = 60
FIXED = 8  # columns of Edges.steps before those of the rows
GREEDY_LACK = 1e-6  # of x: what rounding may keep the fastest motion from the controllable set


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

    ``steps`` (N+1, 8 + 11 n): the rows and edges once more, all of a station side by side, and what intervals do as a
    whole; see ``_fill_steps``.
    """

    low: Floats
    high: Floats
    low_next: Floats
    high_next: Floats
    steps: Floats


@njit
def _put(out: Floats, a: float, b: float, r: float, low: float, high: float) -> None:
    """Write a row to ``out`` (5,), turned round where ``a`` is negative."""
    if a < 0.0:
        a, b, r, low, high = -a, -b, -r, -high, -low
    out[0], out[1], out[2], out[3], out[4] = a, b, r, low, high


@njit
def _stage_rows(rows: Rows, i: int, next_low: float, next_high: float, out: Floats) -> int:
    """Collect the rows (a, b, r, low, high) on ``(u, x)``, ``a >= 0``, of the interval from station i.

    Friction at the far end acts on the speed there, ``sqrt(x + 2 D u)``, which is only known to be in the next set: its
    rows are widened by that. Returns the number of rows.
    """
    n, k = rows.a.shape[1], i + 1
    d2 = 2.0 * (rows.station[k] - rows.station[i])
    slow, fast = np.sqrt(next_low), np.sqrt(next_high)
    for j in range(n):
        drag = rows.r[k, j]
        most, least = max(drag * slow, drag * fast), min(drag * slow, drag * fast)
        _put(out[j], rows.a[i, j], rows.b[i, j], rows.r[i, j], rows.low[i, j], rows.high[i, j])
        _put(
            out[n + j], rows.a[k, j] + d2 * rows.b[k, j], rows.b[k, j], 0.0, rows.low[k, j] - most,
            rows.high[k, j] - least,
        )  # fmt: skip
    _put(out[2 * n], d2, 1.0, 0.0, next_low, next_high)
    return int(2 * n + 1)


@njit
def _eliminate(stage: Floats, count: int, x_cap: float, bands: Floats, out: Floats) -> int:
    """The intervals (K, 2) of ``x`` in [0, x_cap] for which some ``u`` meets all rows; returns their number.

    Every pair of rows gives ``A x + B sqrt(x) <= C`` (topp 5.2); no division by an inertia, so zero-inertia rows need
    no special case. ``A < 0 < B`` can take a band out of the middle.
    """
    low, high = 0.0, x_cap
    slow, fast = 0.0, np.sqrt(x_cap)
    taken = 0
    for p in range(count):
        for q in range(count):
            if p == q:
                continue
            A = stage[q, 1] * stage[p, 0] - stage[p, 1] * stage[q, 0]
            B = stage[q, 2] * stage[p, 0] - stage[p, 2] * stage[q, 0]
            C = stage[q, 4] * stage[p, 0] - stage[p, 3] * stage[q, 0]
            if (A >= 0.0 or B <= 0.0) and A * high + B * fast <= C and A * low + B * slow <= C:
                continue  # met all over the interval
            if abs(A) <= 1e-13 * (abs(stage[q, 1] * stage[p, 0]) + abs(stage[p, 1] * stage[q, 0])):
                A = 0.0
            if A == 0.0 and B == 0.0:
                if -1e-9 * (abs(stage[q, 4] * stage[p, 0]) + abs(stage[p, 3] * stage[q, 0])) > C:
                    return 0
            elif B == 0.0:
                if A > 0.0:
                    high = min(high, C / A)
                else:
                    low = max(low, C / A)
            elif A == 0.0:
                if B > 0.0:
                    high = min(high, (C / B) ** 2 if C > -1e-12 * B else -1.0)
                elif C < 0.0:
                    low = max(low, (C / B) ** 2)
            else:
                root = B * B + 4.0 * A * C
                if root < 0.0:
                    if A > 0.0:
                        return 0
                    continue
                half = -0.5 * (B + (np.sqrt(root) if B > 0.0 else -np.sqrt(root)))
                one, two = half / A, -C / half if half != 0.0 else 0.0
                near, far = min(one, two), max(one, two)
                if A > 0.0:  # between the roots
                    high = min(high, far * far if far > 0.0 else -far * far)
                    if near > 0.0:
                        low = max(low, near * near)
                elif far > 0.0 and far * far > low and near * near * np.sign(near) < high:  # outside them
                    if near <= 0.0 or taken == bands.shape[0]:  # no room for one more: leave out what is below
                        low = max(low, far * far)
                    else:
                        bands[taken, 0], bands[taken, 1] = near * near, far * far
                        taken += 1
            slow, fast = np.sqrt(max(low, 0.0)), np.sqrt(max(high, 0.0))
    if low > high:
        if low > high + 1e-12 * (1.0 + high):
            return 0
        low = high
    if high < 0.0:
        return 0
    out[0, 0], out[0, 1] = low, high
    found = 1
    for k in range(taken):
        for m in range(found):
            if bands[k, 0] < out[m, 1] and bands[k, 1] > out[m, 0]:
                below, above = bands[k, 0] > out[m, 0], bands[k, 1] < out[m, 1]
                if below and above and found < MOST:
                    out[found, 0], out[found, 1] = bands[k, 1], out[m, 1]
                    out[m, 1] = bands[k, 0]
                    found += 1
                elif below and not above:
                    out[m, 1] = bands[k, 0]
                elif below or above:
                    out[m, 0] = bands[k, 1]
                else:
                    out[m, 0], out[m, 1] = 1.0, 0.0
    kept = 0
    for m in range(found):
        if out[m, 0] <= out[m, 1]:
            out[kept, 0], out[kept, 1] = out[m, 0], out[m, 1]
            kept += 1
    return kept


@njit
def _end_row(
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
        if 1e-14 * abs(a) >= P:
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
def _reach(rows: Rows, i: int, x: float, low: float, high: float, bands: Floats) -> tuple[float, float, int]:
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
        if a > 1e-14:
            low, high = max(low, x + d2 * least / a), min(high, x + d2 * most / a)
        slack = _slack(rows.low[k, j], rows.high[k, j])
        first, last, band_low, band_high = _end_row(
            rows.a[k, j], rows.b[k, j], rows.r[k, j], rows.low[k, j] - slack, rows.high[k, j] + slack, d2, x
        )
        low, high = max(low, first), min(high, last)
        if band_high > band_low and taken < bands.shape[0]:
            bands[taken, 0], bands[taken, 1] = band_low, band_high
            taken += 1
    return low, high, taken


@njit
def _beside(value: float, up: bool, bands: Floats, taken: int) -> float:
    """The value itself, or where it leaves the bands that it is in, upwards or downwards."""
    moved = True
    while moved:
        moved = False
        for k in range(taken):
            if bands[k, 0] < value < bands[k, 1]:
                value, moved = bands[k, 1 if up else 0], True
    return value


@njit
def _lack(rows: Rows, i: int, x: float, low: float, high: float, bands: Floats) -> float:
    """Not positive if the interval can begin with ``x`` and end in [low, high]; else by how much it cannot."""
    first, last, taken = _reach(rows, i, x, low, high, bands)
    if first <= last and _beside(last, False, bands, taken) < first:
        return 1e-9  # covered by bands
    return first - last


@njit
def _retreat(rows: Rows, i: int, bad: float, good: float, low: float, high: float, bands: Floats) -> float:
    """The admissible ``x`` nearest to ``bad``, on the way to ``good``: Illinois, halving when that is slow."""
    v_bad, v_good = _lack(rows, i, bad, low, high, bands), _lack(rows, i, good, low, high, bands)
    last = 0
    for k in range(RETREATS):
        if abs(bad - good) <= 1e-9 * abs(bad) or 0.0 <= -v_good <= 1e-10 * good:
            break
        share = v_good / (v_good - v_bad) if k < 12 and v_bad < np.inf else 0.5
        x = good + min(max(share, 1e-9), 1.0 - 1e-9) * (bad - good)
        v = _lack(rows, i, x, low, high, bands)
        if v > 0.0:
            if last > 0:
                v_good *= 0.5
            bad, v_bad, last = x, v, 1
        else:
            if last < 0:
                v_bad *= 0.5
            good, v_good, last = x, v, -1
    return good


@njit
def _tighten(rows: Rows, i: int, low: float, high: float, span: Floats, bands: Floats) -> bool:
    """Move the ends of a candidate interval ``span`` (2,) of ``x`` inwards to where the exact rows hold."""
    low_fits = _lack(rows, i, span[0], low, high, bands) <= 0.0
    high_fits = _lack(rows, i, span[1], low, high, bands) <= 0.0
    if low_fits and high_fits:
        return True
    inside = span[0] if low_fits else span[1]
    if not (low_fits or high_fits):
        found = False
        for k in range(1, 16):
            inside = span[0] + k / 16.0 * (span[1] - span[0])
            if _lack(rows, i, inside, low, high, bands) <= 0.0:
                found = True
                break
        if not found:
            return False
    if not high_fits:
        span[1] = _retreat(rows, i, span[1], inside, low, high, bands)
    if not low_fits:
        span[0] = _retreat(rows, i, span[0], inside, low, high, bands)
    return True


@njit
def _merge(spans: Floats, count: int) -> int:
    """Sort intervals (K, 2) and unite those that touch; returns their number."""
    for k in range(1, count):
        first, last, m = spans[k, 0], spans[k, 1], k
        while m > 0 and spans[m - 1, 0] > first:
            spans[m, 0], spans[m, 1] = spans[m - 1, 0], spans[m - 1, 1]
            m -= 1
        spans[m, 0], spans[m, 1] = first, last
    kept = 0
    for k in range(count):
        if kept and spans[k, 0] <= spans[kept - 1, 1]:
            spans[kept - 1, 1] = max(spans[kept - 1, 1], spans[k, 1])
        else:
            spans[kept, 0], spans[kept, 1] = spans[k, 0], spans[k, 1]
            kept += 1
    return kept


@njit
def controllable_sets(rows: Rows, x_end: float, single: bool, through: Floats, sets: Floats, counts: Ints) -> int:
    """Fill the controllable sets backwards from ``x_end``; returns -1, or the station whose set is empty.

    ``sets`` (N+1, MOST, 2): rising intervals of ``x`` from which the end can be met, ``counts`` (N+1,) how many.
    ``single``: keep one of them at each station, the lowest or the one that ``through`` (N+1,) passes.
    """
    n, last = rows.a.shape[1], rows.station.shape[0] - 1
    stage, bands = np.empty((2 * n + 1, 5)), np.empty((max(n, BANDS), 2))
    found, here = np.empty((MOST, 2)), np.empty((MOST * MOST, 2))
    counts[:] = 0
    sets[last, 0, 0] = sets[last, 0, 1] = x_end
    counts[last] = 1
    if x_end > rows.x_cap[last]:
        return int(last)
    for i in range(last - 1, -1, -1):
        total = 0
        viscous = False
        for j in range(n):
            viscous = viscous or rows.r[i + 1, j] != 0.0
        for m in range(counts[i + 1]):
            low, high = sets[i + 1, m, 0], sets[i + 1, m, 1]
            if rows.station[i + 1] == rows.station[i]:
                if low <= rows.x_cap[i]:
                    here[total, 0], here[total, 1] = low, min(high, rows.x_cap[i])
                    total += 1
                continue
            count = _stage_rows(rows, i, low, high, stage)
            for k in range(_eliminate(stage, count, rows.x_cap[i], bands, found)):
                if not viscous or _tighten(rows, i, low, high, found[k], bands):
                    here[total, 0], here[total, 1] = found[k, 0], found[k, 1]
                    total += 1
        total = min(_merge(here, total), MOST)
        if total == 0:
            return i
        if single:
            pick = 0
            while pick < total - 1 and len(through) and here[pick, 1] < through[i]:
                pick += 1
            here[0, 0], here[0, 1], total = here[pick, 0], here[pick, 1], 1
        counts[i] = total
        for m in range(total):
            sets[i, m, 0], sets[i, m, 1] = here[m, 0], here[m, 1]
    return -1


@njit
def admissible_sets(rows: Rows, sets: Floats, counts: Ints) -> None:
    """Fill the intervals of ``x`` at which some ``u`` meets the rows of the station itself (Lee1991 eq. 10)."""
    n = rows.a.shape[1]
    stage, bands, found = np.empty((n + 1, 5)), np.empty((BANDS, 2)), np.empty((MOST, 2))
    for i in range(rows.station.shape[0]):
        for j in range(n):
            _put(stage[j], rows.a[i, j], rows.b[i, j], rows.r[i, j], rows.low[i, j], rows.high[i, j])
        _put(stage[n], 1.0, 0.0, 0.0, -1e12, 1e12)  # any u: rows without inertia need a partner
        counts[i] = _eliminate(stage, n + 1, rows.x_cap[i], bands, found)
        for m in range(counts[i]):
            sets[i, m, 0], sets[i, m, 1] = found[m, 0], found[m, 1]


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


@njit
def _fill_steps(rows: Rows, edges: Edges) -> None:
    """Fill ``edges.steps``: one array, because loops over many cost more (their reference counts) than what they do.

    Per station: where it is; twice the length of its interval (nan: friction in it, or empty); the lowest ``x`` at the
    interval's end (-inf: any); its edges, low, low_next, high, high_next; the station at or before its share of the
    path, for ``find``. Then per row and end of the interval (A, B, C): beginning with ``x`` it ends inside
    ``[A + B x, C + B x]``. Then per row (a, b, low, high, r).
    """
    n, last = rows.a.shape[1], rows.station.shape[0] - 1
    at = 0
    for i in range(last + 1):
        step, k = edges.steps[i], min(i, last - 1)
        d2 = 2.0 * (rows.station[k + 1] - rows.station[k])
        while at < last - 1 and rows.station[at + 1] < rows.station[last] * (i / last) * (1.0 - 1e-12):
            at += 1
        step[0], step[1] = rows.station[i], (d2 if d2 > 0.0 and i < last else np.nan)
        step[2] = edges.low_next[k] if edges.low_next[k] > 0.0 else -np.inf
        step[3], step[4], step[5], step[6] = edges.low[i], edges.low_next[k], edges.high[i], edges.high_next[k]
        step[7] = at
        for j in range(n):
            base = FIXED + 6 * n + 5 * j
            step[base], step[base + 1], step[base + 2] = rows.a[i, j], rows.b[i, j], rows.low[i, j]
            step[base + 3], step[base + 4] = rows.high[i, j], rows.r[i, j]
            for e in range(2):
                a, b, low, high = rows.a[k + e, j], rows.b[k + e, j], rows.low[k + e, j], rows.high[k + e, j]
                if e == 1:
                    a += d2 * b
                if rows.r[k + e, j] != 0.0:
                    step[1] = np.nan
                if a < 0.0:
                    a, b, low, high = -a, -b, -high, -low
                base = FIXED + 3 * (e * n + j)
                step[base], step[base + 1], step[base + 2] = -np.inf, 0.0, np.inf
                if a > 1e-14:
                    step[base], step[base + 1], step[base + 2] = d2 * low / a, 1.0 - d2 * b / a, d2 * high / a


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
        _, final, taken = _reach(rows, i, edges.high[i], low, high, bands)
        edges.high_next[i] = min(max(_beside(final, False, bands, taken), low), high)
        first, _, taken = _reach(rows, i, edges.low[i], low, high, bands)
        edges.low_next[i] = min(max(_beside(first, True, bands, taken), low), high)
    _fill_steps(rows, edges)


@njit
def greedy_profile(rows: Rows, sets: Floats, counts: Ints, x_start: float, x: Floats) -> int:
    """The fastest motion: at every station the largest ``u`` that stays in the controllable set.

    Returns -1, or the station from which more than rounding keeps the motion out of the next set.
    """
    bands = np.empty((rows.a.shape[1], 2))
    x[0] = x_start
    for i in range(rows.station.shape[0] - 1):
        if rows.station[i + 1] == rows.station[i]:
            x[i + 1] = x[i]
            continue
        best, least = -1.0, np.inf
        for m in range(counts[i + 1] - 1, -1, -1):
            low, high = sets[i + 1, m, 0], sets[i + 1, m, 1]
            first, last, taken = _reach(rows, i, x[i], low, high, bands)
            y = _beside(last, False, bands, taken)
            if y >= first:
                best, least = y, 0.0
                break
            if first - last < least:  # rounding closed it: the interval that lacks least
                best, least = min(max(last, low), high), first - last
        if least > GREEDY_LACK * (1.0 + best):
            return i
        x[i + 1] = best
    return -1


@njit
def locate(station: Floats, lam: float) -> int:
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
def _viscous_bounds(a: float, b: float, r: float, low: float, high: float, x: float, d2: float) -> tuple[float, float]:
    """Bounds of ``u`` from one row with friction, met after travelling ``d2 / 2`` from ``x``."""
    if d2 <= 0.0:
        used = b * x + r * np.sqrt(x)
        if a < 0.0:
            a, low, high, used = -a, -high, -low, -used
        return ((low - used) / a, (high - used) / a) if a > 1e-14 else (-np.inf, np.inf)
    at_rest = -np.inf  # the hardest braking that the row allows where the arm comes to rest, its friction gone
    if abs(a) > 1e-14:
        at_rest = low / a if a > 0.0 else high / a
    low, high, band_low, band_high = _end_row(a, b, r, low, high, d2, x)
    if band_high > band_low:  # stay on the side where the arm is
        low, high = (low, min(high, band_low)) if x <= band_low else (max(low, band_high), high)
    # without a speed that is needed there the arm may come to rest before the end of the piece
    return (low - x) / d2 if low > 0.0 else at_rest, (high - x) / d2


@inlined
def _bounds_at(rows: Rows, i: int, w: float, x: float, d2: float) -> tuple[float, float]:
    """Bounds of ``u`` from the rows at share ``w`` of interval i, met after travelling ``d2 / 2`` from ``x``."""
    lowest, highest = -np.inf, np.inf
    for j in range(rows.a.shape[1]):
        a = rows.a[i, j] + w * (rows.a[i + 1, j] - rows.a[i, j])
        b = rows.b[i, j] + w * (rows.b[i + 1, j] - rows.b[i, j])
        low = rows.low[i, j] + w * (rows.low[i + 1, j] - rows.low[i, j])
        high = rows.high[i, j] + w * (rows.high[i + 1, j] - rows.high[i, j])
        r = rows.r[i, j] + w * (rows.r[i + 1, j] - rows.r[i, j])
        if r != 0.0:
            least, most = _viscous_bounds(a, b, r, low, high, x, d2)
            lowest, highest = max(lowest, least), min(highest, most)
            continue
        a, low, high = a + d2 * b, low - b * x, high - b * x
        if a < 0.0:
            a, low, high = -a, -high, -low
        if a > 1e-14:
            lowest = max(lowest, low / a)
            highest = min(highest, high / a)
    return lowest, highest


@inlined
def find(steps: Floats, lam: float) -> int:
    """As ``locate``, in ``edges.steps``; quick where stations are about equally far apart."""
    last = steps.shape[0] - 1
    i = int(steps[min(max(int(lam / steps[last, 0] * last), 0), last), 7])
    while i < last - 1 and steps[i + 1, 0] <= lam:
        i += 1
    return i


@inlined
def bounds_in(steps: Floats, i: int, w: float, x: float, d2: float) -> tuple[float, float]:
    """As ``_bounds_at``, from ``edges.steps``."""
    columns = steps.shape[1]
    lowest, highest = -np.inf, np.inf
    for j in range(FIXED + 6 * ((columns - FIXED) // 11), columns, 5):
        a = steps[i, j] + w * (steps[i + 1, j] - steps[i, j])
        b = steps[i, j + 1] + w * (steps[i + 1, j + 1] - steps[i, j + 1])
        low = steps[i, j + 2] + w * (steps[i + 1, j + 2] - steps[i, j + 2])
        high = steps[i, j + 3] + w * (steps[i + 1, j + 3] - steps[i, j + 3])
        r = steps[i, j + 4] + w * (steps[i + 1, j + 4] - steps[i, j + 4])
        if r != 0.0:
            least, most = _viscous_bounds(a, b, r, low, high, x, d2)
            lowest, highest = max(lowest, least), min(highest, most)
            continue
        a, low, high = a + d2 * b, low - b * x, high - b * x
        if a < 0.0:
            a, low, high = -a, -high, -low
        if a > 1e-14:
            lowest, highest = max(lowest, low / a), min(highest, high / a)
    return lowest, highest


@inlined
def _next_piece(
    steps: Floats, i: int, left: float, x: float, rest: float, command: float, by_speed: bool
) -> tuple[float, float]:
    """Length and ``u`` of the next piece in interval i, ``left`` before its end; no length: the arm stays at rest."""
    width = steps[i + 1, 0] - steps[i, 0]
    w = 1.0 - left / width
    u_low, u_high = bounds_in(steps, i, w, x, 0.0)
    goal_share = command * command if by_speed else 1.0
    step = min(left, np.sqrt(x) * rest + 0.5 * max(u_high, 0.0) * rest * rest)
    if step <= 0.0:
        return 0.0, 0.0
    here = steps[i, 5] + w * (steps[i, 6] - steps[i, 5])
    if i == steps.shape[0] - 2 and step == left:
        if x < 0.25 * goal_share * here:
            step = 0.5 * left  # from rest before the end: speed up first, the edge bends down to it
        elif by_speed and x > goal_share * here > 0.0:
            # too fast for the command: brake until the target is met, which also runs down to the end
            meet = (x - goal_share * here) / (-2.0 * u_low - goal_share * here / left)
            if 0.0 < meet < left:
                step = meet
    w_next = 1.0 if step == left else w + step / width
    x_edge = steps[i, 5] + w_next * (steps[i, 6] - steps[i, 5])
    x_floor = steps[i, 3] + w_next * (steps[i, 4] - steps[i, 3])
    d2 = 2.0 * step
    end_low, end_high = bounds_in(steps, i, w_next, x, d2)
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
    record: Floats,
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
        step, u = _next_piece(edges.steps, i, left, x, rest, command, by_speed)
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


@njit
def run(
    steps: Floats,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    tick: float,
    ticks: int,
    out: Floats,
    speeds: Floats,
) -> tuple[float, float, float]:
    """Move an arm for so many ticks under one command, as ``advance`` does for all of that time; but fast.

    ``steps``: of the edges; intervals that fit in as a whole are three numbers per row there. ``out`` and
    ``speeds``, (ticks,) or both (0,): place and speed at the end of every tick; asking changes nothing. Returns lam, mu
    and the time used (less than all only on arrival).
    """
    last, count = steps.shape[0] - 1, out.shape[0]
    lines = FIXED + 6 * ((steps.shape[1] - FIXED) // 11)
    end, dt = steps[last, 0], tick * ticks
    tiny = 1e-12 * end
    share = command * command if by_speed else 1.0
    x, used = mu * mu, 0.0
    k, due = 0, (tick if count else np.inf)
    i = find(steps, lam)
    for _ in range(100000):
        left = steps[i + 1, 0] - lam
        while left <= tiny and i < last - 1:
            i += 1
            left = steps[i + 1, 0] - lam
        if lam >= end - tiny:
            lam, x = end, steps[last, 5]
            break
        rest = dt - used
        if rest <= 1e-9 * dt:  # rounding
            used = dt
            break
        mu = np.sqrt(x)
        if lam == steps[i, 0]:
            began = i
            while i < last - 1:
                d2, low, high = steps[i, 1], steps[i, 2], steps[i, 6]
                for j in range(FIXED, lines, 3):
                    change = steps[i, j + 1] * x
                    low, high = max(low, steps[i, j] + change), min(high, steps[i, j + 2] + change)
                low = min(low, high)
                y = min(max(share * steps[i, 6], low), high) if by_speed else low + command * (high - low)
                if by_speed and command == 0.0:
                    y = low
                if not y > 1e-18:
                    break
                mu_next = np.sqrt(y)
                time = d2 / (mu + mu_next)
                if not used + time < dt:
                    break
                while due <= used + time:
                    t = due - used
                    u = (y - x) / d2
                    out[k] = min(steps[i, 0] + t * (mu + 0.5 * t * u), steps[i + 1, 0])
                    speeds[k] = mu + t * u
                    k += 1
                    due = tick * (k + 1) if k < count else np.inf
                x, mu, used = y, mu_next, used + time
                i += 1
            if i > began:
                lam = steps[i, 0]
                continue
        step, u = _next_piece(steps, i, left, x, rest, command, by_speed)
        if step <= 0.0:
            used = dt
            break
        there = steps[i + 1, 0] if step == left else lam + step
        x_next = x + 2.0 * step * u
        if x_next <= 1e-18:
            if x <= 1e-18:
                if left <= 1e-9 * end and i == last - 1:  # closer to the end than rounding
                    lam, x = end, 0.0
                else:
                    x, used = 0.0, dt
                break
            stop = x / (-2.0 * u) if u < 0.0 else step
            if stop < step * (1.0 - 1e-12):
                step, there = stop, lam + stop
                x_next = 0.0
            x_next = max(x_next, 0.0)
        time = 2.0 * step / (mu + np.sqrt(x_next))
        if time > rest:
            mu_next = max(mu + u * rest, 0.0)
            there = min(lam + 0.5 * (mu + mu_next) * rest, there)
            x_next, time = mu_next * mu_next, rest
        while due <= used + time:
            t = due - used
            out[k], speeds[k] = min(lam + t * (mu + 0.5 * t * u), there), max(mu + t * u, 0.0)
            k += 1
            due = tick * (k + 1) if k < count else np.inf
        lam, x = there, x_next
        used = used + time if time < rest else dt
    mu = np.sqrt(x)
    if lam < end and k == count:  # the last tick is due now, whatever rounding says
        k = max(count - 1, 0)
    for m in range(k, count):
        out[m], speeds[m] = lam, mu
    return lam, mu, used
