"""Motions under commands, on ``Edges.steps``: whatever is commanded, the end can still be met inside the limits."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.topp._rows import (
    COLUMNS_PER_ROW,
    EDGE_HIGH,
    EDGE_HIGH_NEXT,
    EDGE_LOW,
    EDGE_LOW_NEXT,
    END_LOWEST,
    ROW_A,
    ROW_B,
    ROW_COLUMNS,
    ROW_HIGH,
    ROW_LOW,
    ROW_R,
    SMALLEST_INERTIA,
    STATION,
    STATION_BEFORE,
    STEP_HEADER_COLUMNS,
    TWICE_LENGTH,
    WHOLE_COLUMNS,
    WHOLE_LEAST,
    WHOLE_MOST,
    WHOLE_SLOPE,
    end_row,
)
from armtempo.robots import inlined, uncounted

STATION_ROUNDING = 1e-12  # of the path: nearer to a station, or to the end of a piece, than this is there
TIME_ROUNDING = 1e-9  # of the time asked for: a rest so short is none
END_ROUNDING = 1e-9  # of the path: an arm at rest so near to the end has arrived
X_AT_REST = 1e-18  # ``x = mu^2`` that is not larger is rest
SMALLEST_GOAL = 1e-8  # of the edge's ``x``: what a command that is not 0 heads for, at least; less is rest by rounding
PIECES_MAX = 100_000


@inlined
def interval_at(steps: Floats, lam: float) -> int:
    """The interval that begins at or before ``lam`` (the last one at the end).

    Quick where stations are about equally far apart.
    """
    last = steps.shape[0] - 1
    share = min(max(int(lam / steps[last, STATION] * last), 0), last)
    i = int(steps[share, STATION_BEFORE])
    while i < last - 1 and steps[i + 1, STATION] <= lam:
        i += 1
    return i


@inlined
def upper_edge(steps: Floats, i: int, w: float) -> float:
    """``mu*^2``, the upper edge of the controllable set, at share ``w`` of interval i."""
    return float(steps[i, EDGE_HIGH] + w * (steps[i, EDGE_HIGH_NEXT] - steps[i, EDGE_HIGH]))


@uncounted
def _viscous_bounds(a: float, b: float, r: float, low: float, high: float, x: float, d2: float) -> tuple[float, float]:
    """Bounds of ``u`` from one row with friction, met after travelling ``d2 / 2`` from ``x``."""
    if d2 <= 0.0:
        used = b * x + r * np.sqrt(x)
        if a < 0.0:
            a, low, high, used = -a, -high, -low, -used
        return ((low - used) / a, (high - used) / a) if a > SMALLEST_INERTIA else (-np.inf, np.inf)
    at_rest = -np.inf  # the hardest braking that the row allows where the arm comes to rest, its friction gone
    if abs(a) > SMALLEST_INERTIA:
        at_rest = low / a if a > 0.0 else high / a
    low, high, band_low, band_high = end_row(a, b, r, low, high, d2, x)
    if band_high > band_low:  # stay on the side where the arm is
        low, high = (low, min(high, band_low)) if x <= band_low else (max(low, band_high), high)
    # without a speed that is needed there the arm may come to rest before the end of the piece
    return (low - x) / d2 if low > 0.0 else at_rest, (high - x) / d2


@inlined
def bounds_in(steps: Floats, i: int, w: float, x: float, d2: float) -> tuple[float, float]:
    """Bounds of ``u`` from the rows at share ``w`` of interval i, met after travelling ``d2 / 2`` from ``x``."""
    columns = steps.shape[1]
    rows = (columns - STEP_HEADER_COLUMNS) // COLUMNS_PER_ROW
    lowest, highest = -np.inf, np.inf
    for j in range(STEP_HEADER_COLUMNS + 2 * WHOLE_COLUMNS * rows, columns, ROW_COLUMNS):
        a = steps[i, j + ROW_A] + w * (steps[i + 1, j + ROW_A] - steps[i, j + ROW_A])
        b = steps[i, j + ROW_B] + w * (steps[i + 1, j + ROW_B] - steps[i, j + ROW_B])
        low = steps[i, j + ROW_LOW] + w * (steps[i + 1, j + ROW_LOW] - steps[i, j + ROW_LOW])
        high = steps[i, j + ROW_HIGH] + w * (steps[i + 1, j + ROW_HIGH] - steps[i, j + ROW_HIGH])
        r = steps[i, j + ROW_R] + w * (steps[i + 1, j + ROW_R] - steps[i, j + ROW_R])
        if r != 0.0:
            least, most = _viscous_bounds(a, b, r, low, high, x, d2)
            lowest, highest = max(lowest, least), min(highest, most)
            continue
        a, low, high = a + d2 * b, low - b * x, high - b * x
        if a < 0.0:
            a, low, high = -a, -high, -low
        if a > SMALLEST_INERTIA:
            lowest, highest = max(lowest, low / a), min(highest, high / a)
    return lowest, highest


@uncounted
def edge_speed(steps: Floats, lam: float) -> float:
    """``mu*``, the largest speed at ``lam`` from which the end can be met."""
    i = interval_at(steps, lam)
    w = (lam - steps[i, STATION]) / (steps[i + 1, STATION] - steps[i, STATION])
    return float(np.sqrt(max(upper_edge(steps, i, w), 0.0)))


@uncounted
def acceleration_bounds(steps: Floats, lam: float, x: float) -> tuple[float, float]:
    """LB and UB (Lee1991 eq. 9): what the limits at ``(lam, x)`` alone allow."""
    i = interval_at(steps, lam)
    w = (lam - steps[i, STATION]) / (steps[i + 1, STATION] - steps[i, STATION])
    return bounds_in(steps, i, w, x, 0.0)


@inlined
def _goal_share(command: float, by_speed: bool, share: float) -> float:
    """Which part of the edge's ``x`` a motion heads for, at most."""
    part = command * share if by_speed else share
    return max(part * part, SMALLEST_GOAL) if part > 0.0 else 0.0


@inlined
def _rests_behind(steps: Floats, i: int) -> bool:
    """Whether interval i leads to the end, or to a stop."""
    return bool(i == steps.shape[0] - 2 or steps[i + 1, EDGE_HIGH] <= 0.0)


@inlined
def _next_piece(
    steps: Floats, i: int, left: float, x: float, rest: float, command: float, by_speed: bool, goal_share: float
) -> tuple[float, float]:
    """Length and ``u`` of the next piece in interval i, ``left`` before its end; no length: the arm stays at rest."""
    width = steps[i + 1, STATION] - steps[i, STATION]
    w = 1.0 - left / width
    u_low, u_high = bounds_in(steps, i, w, x, 0.0)
    step = min(left, np.sqrt(x) * rest + 0.5 * max(u_high, 0.0) * rest * rest)
    if step <= 0.0:
        return 0.0, 0.0
    high, rise = steps[i, EDGE_HIGH], steps[i, EDGE_HIGH_NEXT] - steps[i, EDGE_HIGH]
    here = high + w * rise
    if step == left and _rests_behind(steps, i):
        if x < 0.25 * goal_share * here:
            step = 0.5 * left  # from rest before the end: speed up first, the edge bends down to it
        elif x > goal_share * here > 0.0:
            # too fast for the command: brake until the target is met, which also runs down to the end
            meet = (x - goal_share * here) / (-2.0 * u_low - goal_share * here / left)
            rounding = STATION_ROUNDING * steps[i + 1, STATION]
            if rounding < meet < left - rounding:  # from a target met but for rounding it would be met for ever
                step = meet
    w_next = 1.0 if step == left else w + step / width
    x_edge = high + w_next * rise
    x_floor = steps[i, EDGE_LOW] + w_next * (steps[i, EDGE_LOW_NEXT] - steps[i, EDGE_LOW])
    d2 = 2.0 * step
    end_low, end_high = bounds_in(steps, i, w_next, x, d2)
    u_low, u_high = max(u_low, end_low), min(u_high, end_high)
    if x_floor > 0.0:  # the arm cannot hold still here: it must stay fast enough
        u_low = max(u_low, (x_floor - x) / d2)
    u_high = min(u_high, (x_edge - x) / d2)
    u_low = min(u_low, u_high)
    if not by_speed:
        return step, u_low + command * (min(max((goal_share * x_edge - x) / d2, u_low), u_high) - u_low)
    if command == 0.0:
        return step, u_low
    return step, min(max((goal_share * x_edge - x) / d2, u_low), u_high)


@inlined
def _one_piece(
    steps: Floats, i: int, lam: float, x: float, rest: float, command: float, by_speed: bool, goal_share: float
) -> tuple[float, float, float, float]:
    """Where the next piece ends, ``x`` there, its time and its ``u``; no time: the arm stays there until ``rest``.

    A piece ends at the next station, where the arm comes to rest, or after ``rest`` [s].
    """
    left, mu = steps[i + 1, STATION] - lam, np.sqrt(x)
    step, u = _next_piece(steps, i, left, x, rest, command, by_speed, goal_share)
    x_next = x + 2.0 * step * u
    if step <= 0.0 or (x <= X_AT_REST and x_next <= X_AT_REST):
        if step > 0.0:
            x = 0.0
            if _rests_behind(steps, i) and left <= END_ROUNDING * steps[steps.shape[0] - 1, STATION]:
                lam = steps[i + 1, STATION]
        return lam, x, 0.0, 0.0
    there = steps[i + 1, STATION] if step == left else lam + step
    if x_next <= X_AT_REST:
        stop = x / (-2.0 * u) if u < 0.0 else step
        if stop < step * (1.0 - 1e-12):
            step, there, x_next = stop, lam + stop, 0.0
        x_next = max(x_next, 0.0)
    time = 2.0 * step / (mu + np.sqrt(x_next))
    if time > rest:
        mu_next = max(mu + u * rest, 0.0)
        there, x_next, time = min(lam + 0.5 * (mu + mu_next) * rest, there), mu_next * mu_next, rest
    return there, x_next, time, u


@inlined
def _within_piece(lam: float, mu: float, u: float, t: float, there: float) -> tuple[float, float]:
    """Place and speed ``t`` after the beginning of a piece from ``lam`` to ``there``."""
    return min(lam + t * (mu + 0.5 * t * u), there), max(mu + t * u, 0.0)


@inlined
def _whole_interval(
    steps: Floats, i: int, lines: int, x: float, command: float, by_speed: bool, goal_share: float
) -> float:
    """``x`` at the end of interval i from ``x`` at its beginning; ``lines``: the column behind these numbers."""
    low, high, edge = steps[i, END_LOWEST], steps[i, EDGE_HIGH_NEXT], steps[i, EDGE_HIGH_NEXT]
    for j in range(STEP_HEADER_COLUMNS, lines, WHOLE_COLUMNS):
        change = steps[i, j + WHOLE_SLOPE] * x
        low, high = max(low, steps[i, j + WHOLE_LEAST] + change), min(high, steps[i, j + WHOLE_MOST] + change)
    low = min(low, high)
    if not by_speed:
        return float(low + command * (min(max(goal_share * edge, low), high) - low))
    return float(low if command == 0.0 else min(max(goal_share * edge, low), high))


@inlined
def _stays_at_start(steps: Floats, lam: float, mu: float, command: float) -> bool:
    """Whether an arm has not begun and is not told to: brakes hold it, also where torques do not suffice."""
    return lam <= steps[0, STATION] and mu <= 0.0 and command <= 0.0


@inlined
def _stays_at_stop(steps: Floats, i: int, lam: float, x: float, command: float) -> bool:
    """Whether an arm stands at a stop and is not told to go on: what comes may be a dwell, which takes its time."""
    if command > 0.0 or x > X_AT_REST or i == 0 or lam > steps[i, STATION] or steps[i, EDGE_HIGH] > 0.0:
        return False
    return bounds_in(steps, i, 0.0, x, 0.0)[0] <= 0.0


@uncounted
def advance(
    steps: Floats,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    tick: float,
    ticks: int,
    places: Floats,
    speeds: Floats,
    share: float = 1.0,
) -> tuple[float, float, float]:
    """Move an arm along its path for so many ticks [s] under one command in [0, 1].

    Piece by piece, each to the next station or to the end of the time, with one constant ``u`` from
    ``[u_low, u_high]``: the rows at both ends of the piece, and no point above the controllable set. ``by_speed``:
    ``u`` heads for ``command`` times ``mu*`` (0: brake as hard as the limits allow); else
    ``u = u_low + command (u_high - u_low)``. The edge is obeyed to rounding, so the end can always be met; the rows
    *inside* a piece hold to the second order of its length. Intervals that fit in whole are three numbers per row.

    ``share``: what a slow arm takes for the largest speed, of ``mu*``; commands and ``u_high`` head for no more.

    An arm that has not begun, or stands at a stop, stays where it is under command 0.

    ``steps``: of the edges. ``places`` and ``speeds``, (ticks,) or both (0,): place and speed at the end of every tick;
    asking changes nothing. Returns lam, mu and the time used (less than all only on arrival).
    """
    last, dt, wanted = steps.shape[0] - 1, tick * ticks, places.shape[0]
    end = steps[last, STATION]
    lines = STEP_HEADER_COLUMNS + 2 * WHOLE_COLUMNS * ((steps.shape[1] - STEP_HEADER_COLUMNS) // COLUMNS_PER_ROW)
    x, used, k = mu * mu, 0.0, 0
    if _stays_at_start(steps, lam, mu, command):
        places[:], speeds[:] = lam, 0.0
        return lam, 0.0, dt
    goal_share = _goal_share(command, by_speed, share)
    due = tick if wanted else np.inf  # when place and speed are asked for next
    i = interval_at(steps, lam)
    for _ in range(PIECES_MAX):
        while i < last - 1 and steps[i + 1, STATION] - lam <= STATION_ROUNDING * end:
            i += 1
        if lam < steps[i, STATION] and steps[i, EDGE_HIGH] <= 0.0:
            lam, x = steps[i, STATION], 0.0  # a stop
        if lam >= end - STATION_ROUNDING * end:
            lam, x = end, steps[last, EDGE_HIGH]
            break
        rest = dt - used
        if rest <= TIME_ROUNDING * dt or _stays_at_stop(steps, i, lam, x, command):
            used = dt
            break
        mu = np.sqrt(x)
        if lam == steps[i, STATION]:
            began = i
            while i < last - 1:
                x_next = _whole_interval(steps, i, lines, x, command, by_speed, goal_share)
                if not x_next > X_AT_REST:
                    break
                mu_next = np.sqrt(x_next)
                time = steps[i, TWICE_LENGTH] / (mu + mu_next)
                if not used + time < dt:
                    break
                while due <= used + time:
                    u = (x_next - x) / steps[i, TWICE_LENGTH]
                    places[k], speeds[k] = _within_piece(
                        steps[i, STATION], mu, u, due - used, steps[i + 1, STATION]
                    )  # fmt: skip
                    k += 1
                    due = tick * (k + 1) if k < wanted else np.inf
                x, mu, used = x_next, mu_next, used + time
                i += 1
            if i > began:
                lam = steps[i, STATION]
                continue
        there, x_next, time, u = _one_piece(steps, i, lam, x, rest, command, by_speed, goal_share)
        if time <= 0.0:
            x = x_next
            if lam < there < end:  # it was at a stop but for rounding
                lam = there
                continue
            lam, used = there, (dt if there < end else used)
            break
        while due <= used + time:
            places[k], speeds[k] = _within_piece(lam, mu, u, due - used, there)
            k += 1
            due = tick * (k + 1) if k < wanted else np.inf
        lam, x = there, x_next
        used = used + time if time < rest else dt
    mu = np.sqrt(x)
    if lam < end and k == wanted:  # the last tick is due now, whatever rounding says
        k = max(k - 1, 0)
    for m in range(k, wanted):
        places[m], speeds[m] = lam, mu
    return lam, mu, used


@uncounted
def record_pieces(
    steps: Floats, lam: float, mu: float, command: float, by_speed: bool, dt: float, record: Floats, share: float = 1.0
) -> tuple[float, float, float, int]:
    """As ``advance`` for ``dt`` [s], each interval piece by piece: that differs by rounding.

    ``record`` (K, 3) receives (time, lam, mu) after every piece; a full one ends the motion. Returns lam, mu, the time
    used (less than ``dt`` only on arrival) and the number of rows.
    """
    if _stays_at_start(steps, lam, mu, command):
        return lam, 0.0, dt, 0
    last, x, used, count = steps.shape[0] - 1, mu * mu, 0.0, 0
    end, goal_share = steps[last, STATION], _goal_share(command, by_speed, share)
    i = interval_at(steps, lam)
    while count < record.shape[0]:
        while i < last - 1 and steps[i + 1, STATION] - lam <= STATION_ROUNDING * end:
            i += 1
        if lam < steps[i, STATION] and steps[i, EDGE_HIGH] <= 0.0:
            lam, x = steps[i, STATION], 0.0  # a stop
        if lam >= end - STATION_ROUNDING * end:
            lam, x = end, steps[last, EDGE_HIGH]
            break
        rest = dt - used
        if rest <= TIME_ROUNDING * dt or _stays_at_stop(steps, i, lam, x, command):
            used = dt
            break
        there, x_next, time, _ = _one_piece(steps, i, lam, x, rest, command, by_speed, goal_share)
        if time <= 0.0:
            x = x_next
            if lam < there < end:  # it was at a stop but for rounding
                lam = there
                continue
            lam, used = there, (dt if there < end else used)
            break
        lam, x = there, x_next
        used = used + time if time < rest else dt
        record[count, 0], record[count, 1], record[count, 2] = used, lam, np.sqrt(x)
        count += 1
    return lam, np.sqrt(x), used, count
