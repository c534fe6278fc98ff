r"""Compiled search for the earliest arrival along a path among forbidden time windows, within torque limits.

States are (station, level of ``x = mu^2``); the label of a state is the *set* of times at which it can be reached, as
disjoint closed intervals, because arriving later may be what gets through a later gap (Ali & Yakovlev 2023, SIPP-IP).
Between two stations ``u = mu_dot`` is constant, so the transit is exact: it shifts a label by its duration and takes
away the departures that would be in a slot of the path while that is forbidden. Only at rest a label grows, to the
end of the safe time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.topp.kernels import Rows
from armtempo.robots import njit

INTERVALS_PER_STATE = 12  # kept; the latest are dropped
MOST_WINDOWS = 256  # forbidden, told apart in one interval
LIMIT_SLACK_SHARE = 1e-9  # of the width of the limits: rounding, so that the plane's own fastest motion passes

WAY_FROM, WAY_TO, SHUT_FROM, SHUT_UNTIL = range(4)  # columns of the blocks of an interval


class Lattice(NamedTuple):
    """States: rows of the plane's grid that are stations (N+1,), and levels of ``x`` (N+1, K), rising in each row."""

    pick: Ints
    level: Floats
    width: Ints  # (N+1,) how many levels are used
    hold: Bools  # (N+1,) whether the arm can stand still there


class Windows(NamedTuple):
    """When which slot of the path is forbidden: slot s has the open windows ``first[s]`` to ``first[s + 1] - 1``."""

    border: Floats  # (S+1,) slots between borders; every station is a border
    first: Ints  # (S+1,)
    start: Floats
    stop: Floats
    slot: Ints  # (N+1,) the slot that begins at each station (N: one past the last)
    loose: float  # windows of neighbouring slots that differ by no more than this may become one [s]


@njit
def _accelerations(rows: Rows, p: int, q: int, x: float) -> tuple[float, float]:
    """The interval of constant ``u`` that all rows from p to q allow (of those with friction: the rows at p)."""
    lowest, highest = -np.inf, np.inf
    begin = rows.station[p]
    for m in range(p, q + 1):
        d2 = 2.0 * (rows.station[m] - begin)
        if m < q and rows.station[m + 1] == begin:
            continue  # the first row of a jump belongs to the piece before
        if d2 > 0.0:
            highest = min(highest, (rows.x_cap[m] - x) / d2)
            lowest = max(lowest, -x / d2)
        for j in range(rows.a.shape[1]):
            if d2 > 0.0 and rows.r[m, j] != 0.0:
                continue
            drag = rows.r[m, j] * np.sqrt(x)
            low, high = rows.low[m, j] - drag, rows.high[m, j] - drag
            slack = LIMIT_SLACK_SHARE * (high - low) if high - low < np.inf else 0.0
            a = rows.a[m, j] + d2 * rows.b[m, j]
            low, high = low - slack - rows.b[m, j] * x, high + slack - rows.b[m, j] * x
            if a < 0.0:
                a, low, high = -a, -high, -low
            if a > 1e-14:
                lowest = max(lowest, low / a)
                highest = min(highest, high / a)
            elif low > 0.0 or high < 0.0:
                return np.inf, -np.inf
    return lowest, highest


@njit
def _drags(rows: Rows, p: int, q: int, x: float, u: float) -> bool:
    """Whether the rows with viscous friction (not linear in ``x``) hold behind p, up to q."""
    for m in range(p + 1, q + 1):
        way = rows.station[m] - rows.station[p]
        x_here = max(x + 2.0 * way * u, 0.0)
        if way > 0.0:
            for j in range(rows.a.shape[1]):
                r = rows.r[m, j]
                if r != 0.0:
                    torque = rows.a[m, j] * u + rows.b[m, j] * x_here + r * np.sqrt(x_here)
                    slack = LIMIT_SLACK_SHARE * (rows.high[m, j] - rows.low[m, j])
                    if torque < rows.low[m, j] - slack or torque > rows.high[m, j] + slack:
                        return False
    return True


@njit
def _blocks(windows: Windows, i: int, loose: float, out: Floats) -> int:
    """Collect the windows of interval i, (B, 4): from and to which way into it, from and until when it is shut.

    Windows of neighbouring slots that differ by no more than ``loose`` become one that covers both.
    """
    count = 0
    origin = windows.border[windows.slot[i]]
    for s in range(windows.slot[i], windows.slot[i + 1]):
        begin, end = windows.border[s] - origin, windows.border[s + 1] - origin
        for w in range(windows.first[s], windows.first[s + 1]):
            start, stop = windows.start[w], windows.stop[w]
            e = count - 1
            while e >= 0 and not (
                out[e, WAY_TO] == begin
                and (out[e, SHUT_FROM] == start or abs(out[e, SHUT_FROM] - start) <= loose)
                and (out[e, SHUT_UNTIL] == stop or abs(out[e, SHUT_UNTIL] - stop) <= loose)
            ):
                e -= 1
            if e < 0 and count < out.shape[0]:
                out[count, WAY_FROM], out[count, WAY_TO] = begin, end
                out[count, SHUT_FROM], out[count, SHUT_UNTIL] = start, stop
                count += 1
            else:  # too many to tell apart: the last covers the rest
                e = max(e, 0) if e >= 0 else count - 1
                out[e, WAY_TO] = end
                out[e, SHUT_FROM], out[e, SHUT_UNTIL] = min(out[e, SHUT_FROM], start), max(out[e, SHUT_UNTIL], stop)
    return count


@njit
def _shut_departures(
    blocks: Floats, count: int, way: float, x: float, u: float, time: float, after: float, before: float, out: Floats
) -> int:
    """Collect the open intervals of departures, within (after, before), that would be in a block in its window."""
    shut = 0
    mu = np.sqrt(x)
    for e in range(count):
        if blocks[e, SHUT_UNTIL] <= after or blocks[e, SHUT_FROM] >= before + time:
            continue
        entered, left = 0.0, time
        if blocks[e, WAY_FROM] > 0.0:
            entered = 2.0 * blocks[e, WAY_FROM] / (mu + np.sqrt(max(x + 2.0 * blocks[e, WAY_FROM] * u, 0.0)))
        if blocks[e, WAY_TO] < way:
            left = 2.0 * blocks[e, WAY_TO] / (mu + np.sqrt(max(x + 2.0 * blocks[e, WAY_TO] * u, 0.0)))
        out[shut, 0], out[shut, 1] = blocks[e, SHUT_FROM] - left, blocks[e, SHUT_UNTIL] - entered
        shut += 1
    return shut


@njit
def _cut(pieces: Floats, count: int, start: float, stop: float) -> int:
    """Take the open interval (start, stop) out of sorted pieces; returns their new number."""
    k = 0
    while k < count:
        a, b = pieces[k, 0], pieces[k, 1]
        if b <= start or a >= stop:
            k += 1
        elif a <= start and b >= stop:
            if count < pieces.shape[0]:
                for m in range(count, k, -1):
                    pieces[m, 0], pieces[m, 1] = pieces[m - 1, 0], pieces[m - 1, 1]
                pieces[k, 1] = start
                pieces[k + 1, 0] = stop
                count += 1
            else:
                pieces[k, 1] = start  # no room: what comes after is given up
            k += 2
        elif a <= start:
            pieces[k, 1] = start
            k += 1
        elif b >= stop:
            pieces[k, 0] = stop
            k += 1
        else:
            for m in range(k, count - 1):
                pieces[m, 0], pieces[m, 1] = pieces[m + 1, 0], pieces[m + 1, 1]
            count -= 1
    return count


@njit
def _insert(label: Floats, count: int, a: float, b: float) -> int:
    """Add [a, b] to a sorted disjoint label, merging what touches; the latest interval falls out of a full one."""
    k = 0
    while k < count and label[k, 1] < a:
        k += 1
    last = k
    while last < count and label[last, 0] <= b:
        a, b = min(a, label[last, 0]), max(b, label[last, 1])
        last += 1
    if last == k:
        if k >= label.shape[0]:
            return count
        for m in range(min(count, label.shape[0] - 1), k, -1):
            label[m, 0], label[m, 1] = label[m - 1, 0], label[m - 1, 1]
        count = min(count + 1, label.shape[0])
    elif last > k + 1:
        gone = last - k - 1
        for m in range(k + 1, count - gone):
            label[m, 0], label[m, 1] = label[m + gone, 0], label[m + gone, 1]
        count -= gone
    label[k, 0], label[k, 1] = a, b
    return count


@njit
def _wait(windows: Windows, i: int, last: int, label: Floats, count: int, out: Floats, scratch: Floats) -> int:
    """Let the times of a state at rest grow to the end of the safe time at station i; fills ``out``."""
    low = max(windows.slot[i] - 1, 0)
    high = windows.slot[i] if i < last else windows.slot[i] - 1
    grown = 0
    for k in range(count):
        scratch[0, 0], scratch[0, 1] = label[k, 0], label[k, 1]
        pieces = 1
        for w in range(windows.first[low], windows.first[high + 1]):
            pieces = _cut(scratch, pieces, windows.start[w], windows.stop[w])
        for piece in range(pieces):
            end = np.inf
            for w in range(windows.first[low], windows.first[high + 1]):
                if windows.start[w] >= scratch[piece, 0] and windows.stop[w] > windows.start[w]:
                    end = min(end, windows.start[w])
            grown = _insert(out, grown, scratch[piece, 0], max(end, scratch[piece, 1]))
    return grown


@njit
def _span(x: float, d2: float, u_low: float, u_high: float) -> tuple[float, float, float]:
    """The ``x`` that are met after ``d2 / 2`` from ``x``, and the rounding in them."""
    return x + d2 * u_low, x + d2 * u_high, 1e-12 * (x + abs(d2 * u_high))


@njit
def reach(rows: Rows, lattice: Lattice, windows: Windows, latest: Floats, label: Floats, count: Ints) -> None:
    """Fill the times, to ``latest`` (N+1,) per station, at which every state can be reached from rest at the first.

    ``label`` (N+1, K, L, 2) and ``count`` (N+1, K), zero at first; labels of states at rest end up grown by waiting.
    """
    last = lattice.pick.shape[0] - 1
    blocks = np.empty((MOST_WINDOWS, 4))
    shut = np.empty((MOST_WINDOWS, 2))
    pieces = np.empty((INTERVALS_PER_STATE + MOST_WINDOWS, 2))
    grown = np.empty((label.shape[2], 2))
    friction = (rows.r != 0.0).any()
    label[0, 0, 0, 0] = label[0, 0, 0, 1] = 0.0
    count[0, 0] = 1
    for i in range(last + 1):
        if lattice.level[i, 0] <= 0.0 and lattice.hold[i] and count[i, 0] > 0:
            n = _wait(windows, i, last, label[i, 0], count[i, 0], grown, pieces)
            count[i, 0] = n
            for m in range(n):
                label[i, 0, m, 0], label[i, 0, m, 1] = grown[m, 0], grown[m, 1]
        if i == last:
            break
        way = float(rows.station[lattice.pick[i + 1]] - rows.station[lattice.pick[i]])
        known = _blocks(windows, i, windows.loose, blocks)
        for k in range(lattice.width[i]):
            if count[i, k] == 0:
                continue
            x = lattice.level[i, k]
            begin, end = label[i, k, 0, 0], min(label[i, k, count[i, k] - 1, 1], latest[i + 1])
            u_low, u_high = _accelerations(rows, lattice.pick[i], lattice.pick[i + 1], x)
            if u_low > u_high:
                continue
            low, high, scale = _span(x, 2.0 * way, u_low, u_high)
            reached = lattice.level[i + 1, : lattice.width[i + 1]]
            first = np.searchsorted(reached, low - scale)
            after = np.searchsorted(reached, high + scale, side="right")
            for to in range(first, after):
                x_to = lattice.level[i + 1, to]
                if x + x_to <= 0.0:
                    continue
                u = (x_to - x) / (2.0 * way)
                if friction and not _drags(rows, lattice.pick[i], lattice.pick[i + 1], x, u):
                    continue
                time = 2.0 * way / (np.sqrt(x) + np.sqrt(x_to))
                closed = _shut_departures(blocks, known, way, x, u, time, begin, end, shut)
                for m in range(count[i, k]):
                    pieces[0, 0], pieces[0, 1] = label[i, k, m, 0], label[i, k, m, 1]
                    n = 1
                    for s in range(closed):
                        n = _cut(pieces, n, shut[s, 0], shut[s, 1])
                        if n == 0:
                            break
                    for piece in range(n):
                        if pieces[piece, 0] + time <= latest[i + 1]:
                            count[i + 1, to] = _insert(
                                label[i + 1, to], count[i + 1, to], pieces[piece, 0] + time, pieces[piece, 1] + time
                            )


@njit
def arrival(windows: Windows, label: Floats, count: int) -> float:
    """The first time in the label of the last state after which its slot is never forbidden again; or infinite."""
    last = windows.first.shape[0] - 2
    free = 0.0
    for w in range(windows.first[last], windows.first[last + 1]):
        free = max(free, windows.stop[w])
    for k in range(count):
        if label[k, 1] >= free:
            return float(max(label[k, 0], free))
    return np.inf


@njit
def trace(
    rows: Rows,
    lattice: Lattice,
    windows: Windows,
    label: Floats,
    count: Ints,
    end: int,
    time: float,
    x: Floats,
    leave: Floats,
) -> int:
    """Walk back from the last station (level ``end`` at ``time``); fills ``x`` and the times of leaving stations.

    Of the ways back the one is taken that changes ``u`` least. Returns 0, or the station where none is left.
    """  # fmt: skip
    last = lattice.pick.shape[0] - 1
    blocks = np.empty((MOST_WINDOWS, 4))
    shut = np.empty((MOST_WINDOWS, 2))
    pieces = np.empty((INTERVALS_PER_STATE + MOST_WINDOWS, 2))
    x[last], leave[last] = lattice.level[last, end], time
    u_after = 0.0
    for i in range(last - 1, -1, -1):
        way = float(rows.station[lattice.pick[i + 1]] - rows.station[lattice.pick[i]])
        x_to = x[i + 1]
        rests = x_to <= 0.0 and lattice.hold[i + 1]
        since = 0.0  # at rest: since when the station has been safe
        if rests:
            low = max(windows.slot[i + 1] - 1, 0)
            high = windows.slot[i + 1] if i + 1 < last else windows.slot[i + 1] - 1
            for w in range(windows.first[low], windows.first[high + 1]):
                if windows.stop[w] <= leave[i + 1] + 1e-12:
                    since = max(since, windows.stop[w])
        least, found = np.inf, False
        slack = 1e-10 * (1.0 + leave[i + 1])
        known = _blocks(windows, i, windows.loose, blocks)
        for k in range(lattice.width[i]):
            if count[i, k] == 0:
                continue
            x_from = lattice.level[i, k]
            if x_from + x_to <= 0.0:
                continue
            u = (x_to - x_from) / (2.0 * way)
            if abs(u - u_after) >= least:
                continue
            u_low, u_high = _accelerations(rows, lattice.pick[i], lattice.pick[i + 1], x_from)
            low, high, scale = _span(x_from, 2.0 * way, u_low, u_high)
            if not low - scale <= x_to <= high + scale:
                continue
            if not _drags(rows, lattice.pick[i], lattice.pick[i + 1], x_from, u):
                continue
            duration = 2.0 * way / (np.sqrt(x_from) + np.sqrt(x_to))
            closed = _shut_departures(blocks, known, way, x_from, u, duration, -np.inf, np.inf, shut)
            for m in range(count[i, k]):
                pieces[0, 0], pieces[0, 1] = label[i, k, m, 0], label[i, k, m, 1]
                n = 1
                for s in range(closed):
                    n = _cut(pieces, n, shut[s, 0], shut[s, 1])
                for piece in range(n):
                    a, b = pieces[piece, 0] + duration, pieces[piece, 1] + duration
                    wanted = min(leave[i + 1], b)
                    if wanted < a:
                        if wanted < a - slack:
                            continue
                        wanted = a
                    if wanted < (since if rests else leave[i + 1]) - slack:
                        continue
                    least, found = abs(u - u_after), True
                    x[i], leave[i] = x_from, wanted - duration
        if not found:
            return i + 1
        u_after = (x_to - x[i]) / (2.0 * way)
    return 0
