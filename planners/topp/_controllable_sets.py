r"""The controllable sets of a path: backwards from its end, the ``x = mu^2`` from which the end can be met.

Viscous friction makes the rows non-convex: the speeds from which the end can be met are then a *union* of intervals, at
most ``SET_INTERVALS_MAX`` of which are kept. The pointwise largest admissible profile is still the optimum, because two
profiles can only swap where they cross.
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.topp._rows import ROW_A, ROW_B, ROW_COLUMNS, ROW_HIGH, ROW_LOW, ROW_R, Rows, beside, reach
from armtempo.robots import inlined, njit

SET_INTERVALS_MAX = 4  # of a controllable set; dropping further ones only forbids
BANDS_MAX = 8  # taken out of one candidate set
RETREAT_ITERATIONS = 60


@njit
def _put(out: Floats, a: float, b: float, r: float, low: float, high: float) -> None:
    """Write a row to ``out`` (ROW_COLUMNS,), turned round where ``a`` is negative."""
    if a < 0.0:
        a, b, r, low, high = -a, -b, -r, -high, -low
    out[ROW_A], out[ROW_B], out[ROW_R], out[ROW_LOW], out[ROW_HIGH] = a, b, r, low, high


@njit
def _stage_rows(rows: Rows, i: int, next_low: float, next_high: float, out: Floats) -> int:
    """Collect the rows (K, ROW_COLUMNS) on ``(u, x)``, ``a >= 0``, of the interval from station i.

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


@inlined
def _half_plane(
    A: float, B: float, C: float, low: float, high: float, bands: Floats, taken: int
) -> tuple[float, float, int]:
    """The part of [low, high] in which ``A x + B sqrt(x) <= C``, not both A and B zero; empty: (inf, -inf).

    ``A < 0 < B`` can take a band out of the middle: it is put into ``bands`` (B, 2), of which the number is returned.
    """
    if B == 0.0:
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
                low, high = np.inf, -np.inf
        else:
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
    return low, high, taken


@njit
def _cut_bands(low: float, high: float, bands: Floats, taken: int, out: Floats) -> int:
    """Fill ``out`` (K, 2) with what so many bands leave of [low, high]; returns the number of intervals."""
    out[0, 0], out[0, 1] = low, high
    found = 1
    for k in range(taken):
        for m in range(found):
            if bands[k, 0] < out[m, 1] and bands[k, 1] > out[m, 0]:
                below, above = bands[k, 0] > out[m, 0], bands[k, 1] < out[m, 1]
                if below and above and found < SET_INTERVALS_MAX:
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
def _eliminate(stage: Floats, count: int, x_cap: float, bands: Floats, out: Floats) -> int:
    """The intervals (K, 2) of ``x`` in [0, x_cap] for which some ``u`` meets all rows; returns their number.

    Every pair of rows gives ``A x + B sqrt(x) <= C`` (topp 5.2); no division by an inertia, so zero-inertia rows need
    no special case.
    """
    low, high = 0.0, x_cap
    slow, fast = 0.0, np.sqrt(x_cap)
    taken = 0
    for p in range(count):
        for q in range(count):
            if p == q:
                continue
            A = stage[q, ROW_B] * stage[p, ROW_A] - stage[p, ROW_B] * stage[q, ROW_A]
            B = stage[q, ROW_R] * stage[p, ROW_A] - stage[p, ROW_R] * stage[q, ROW_A]
            C = stage[q, ROW_HIGH] * stage[p, ROW_A] - stage[p, ROW_LOW] * stage[q, ROW_A]
            if (A >= 0.0 or B <= 0.0) and A * high + B * fast <= C and A * low + B * slow <= C:
                continue  # met all over the interval
            if abs(A) <= 1e-13 * (abs(stage[q, ROW_B] * stage[p, ROW_A]) + abs(stage[p, ROW_B] * stage[q, ROW_A])):
                A = 0.0
            if A == 0.0 and B == 0.0:
                if -1e-9 * (abs(stage[q, ROW_HIGH] * stage[p, ROW_A]) + abs(stage[p, ROW_LOW] * stage[q, ROW_A])) > C:
                    return 0
                continue
            low, high, taken = _half_plane(A, B, C, low, high, bands, taken)
            if low == np.inf:
                return 0
            slow, fast = np.sqrt(max(low, 0.0)), np.sqrt(max(high, 0.0))
    if low > high:
        if low > high + 1e-12 * (1.0 + high):
            return 0
        low = high
    return _cut_bands(low, high, bands, taken, out) if high >= 0.0 else 0


@njit
def _lack(rows: Rows, i: int, x: float, low: float, high: float, bands: Floats) -> float:
    """Not positive if the interval can begin with ``x`` and end in [low, high]; else by how much it cannot."""
    first, last, taken = reach(rows, i, x, low, high, bands)
    if first <= last and beside(last, False, bands, taken) < first:
        return 1e-9  # covered by bands
    return first - last


@njit
def _retreat(rows: Rows, i: int, bad: float, good: float, low: float, high: float, bands: Floats) -> float:
    """The admissible ``x`` nearest to ``bad``, on the way to ``good``: Illinois, halving when that is slow."""
    v_bad, v_good = _lack(rows, i, bad, low, high, bands), _lack(rows, i, good, low, high, bands)
    last = 0
    for k in range(RETREAT_ITERATIONS):
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

    ``sets`` (N+1, K, 2): rising intervals of ``x`` from which the end can be met, ``counts`` (N+1,) how many.
    ``single``: keep one of them at each station, the lowest or the one that ``through`` (N+1,) passes.
    """
    n, last = rows.a.shape[1], rows.station.shape[0] - 1
    stage, bands = np.empty((2 * n + 1, ROW_COLUMNS)), np.empty((max(n, BANDS_MAX), 2))
    found, here = np.empty((SET_INTERVALS_MAX, 2)), np.empty((SET_INTERVALS_MAX * SET_INTERVALS_MAX, 2))
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
        total = min(_merge(here, total), SET_INTERVALS_MAX)
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
    stage, bands, found = np.empty((n + 1, ROW_COLUMNS)), np.empty((BANDS_MAX, 2)), np.empty((SET_INTERVALS_MAX, 2))
    for i in range(rows.station.shape[0]):
        for j in range(n):
            _put(stage[j], rows.a[i, j], rows.b[i, j], rows.r[i, j], rows.low[i, j], rows.high[i, j])
        _put(stage[n], 1.0, 0.0, 0.0, -1e12, 1e12)  # any u: rows without inertia need a partner
        counts[i] = _eliminate(stage, n + 1, rows.x_cap[i], bands, found)
        for m in range(counts[i]):
            sets[i, m, 0], sets[i, m, 1] = found[m, 0], found[m, 1]
