r"""How much quicker a motion could be at most: a lower bound on the duration of any motion inside the limits.

*Proven* for bare arrays without viscous friction, which are linear between their stations, where the arm can hold still
everywhere. Let x(lambda) be any motion within the limits, U an upper bound of |u| and X one of x on an interval of
length D, u' = (x_1 - x_0) / 2D. The mean over the interval of ``a u + b x`` lies between the mean limits, and differs
from ``a_0 u' + b_0 x_0`` by no more than

    e = |a_1 - a_0| U / 2 + |b_1 - b_0| X / 2 + |b_0| U D

(likewise at the other end). So (x_i) keeps rows at the stations that are wider by e; the largest such sequence is above
x everywhere, inside intervals plus what U adds from either end, and so its time is below. X is a guess: it holds if the
bound comes out below it, because with x all ``share * x`` are within the limits, from rest on, and the first of them to
touch X would contradict the bound.

*An estimate* else: the time on a grid four times as fine, less all that this changes (three times what is expected to
be left).
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.planners.geometry import DurationBound, least_times
from armtempo.planners.topp._controllable_sets import SET_INTERVALS_MAX, controllable_sets
from armtempo.planners.topp._greedy import greedy_profile
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._rows import Rows

__all__ = ["duration_bound"]

PROOF_INTERVALS = 8000  # at least, by cutting those there are
GUESSES = (1.05, 1.3, 2.0, 5.0)  # of X, in times of what the limits alone allow
ROUNDING = 1e-8  # of a bound


def duration_bound(dynamics: PathDynamics, ends: tuple[float, float], speeds: tuple[float, float]) -> DurationBound:
    """The bound for motions from station ``ends[0]`` with mu ``speeds[0]`` to ``ends[1]`` with ``speeds[1]``."""
    if ends[1] <= ends[0]:
        return DurationBound(seconds=0.0, proven=True)
    squares = (speeds[0] ** 2, speeds[1] ** 2)
    rows = dynamics.rows
    if dynamics.arm is None and not dynamics.R.any() and rows.low.max() <= 0.0 <= rows.high.min():
        parts = -(-PROOF_INTERVALS // (len(dynamics.grid) - 1))
        seconds = _proven(_cut(rows, ends, parts), squares)
        if seconds is not None:
            return DurationBound(seconds=seconds, proven=True)
    return DurationBound(seconds=_estimated(dynamics, ends, squares), proven=False)


def _cut(rows: Rows, ends: tuple[float, float], parts: int) -> Rows:
    """The rows between two stations, every interval by itself (its ends twice) and in so many parts: linear there."""
    low, high = np.maximum(rows.station[:-1], ends[0]), np.minimum(rows.station[1:], ends[1])
    at = np.flatnonzero(high > low)
    size = rows.station[at + 1] - rows.station[at]
    share = np.linspace(0.0, 1.0, parts + 1)
    station = low[at, None] + share * (high - low)[at, None]
    w = np.clip((station - rows.station[at, None]) / size[:, None], 0.0, 1.0)

    def between(column: Floats) -> Floats:
        weight = w.reshape(*w.shape, *[1] * (column.ndim - 1))
        with np.errstate(invalid="ignore"):
            value = (1.0 - weight) * column[at][:, None] + weight * column[at + 1][:, None]
        endless = np.isinf(column[at]) | np.isinf(column[at + 1])
        value = np.where(endless[:, None], np.where(np.isinf(column[at]), column[at], column[at + 1])[:, None], value)
        return np.ascontiguousarray(value.reshape(-1, *column.shape[1:]))

    return Rows(np.ascontiguousarray(station.ravel()), *(between(column) for column in rows[1:]))


def _largest(rows: Rows, squares: tuple[float, float]) -> Floats | None:
    """The largest ``mu^2`` (N+1,) between these ends within the rows; None: there is none."""
    count = len(rows.station)
    sets, counts, x = np.zeros((count, SET_INTERVALS_MAX, 2)), np.zeros(count, dtype=np.int64), np.empty(count)
    if controllable_sets(rows, squares[1], False, np.empty(0), sets, counts) >= 0:
        return None
    start = float(np.clip(squares[0], sets[0, 0, 0], sets[0, counts[0] - 1, 1]))
    return None if greedy_profile(rows, sets, counts, start, False, x) >= 0 else x


def _time(rows: Rows, x: Floats | None) -> float:
    """[s] of the motion through ``mu^2`` x (N+1,), nan without one."""
    if x is None:
        return float("nan")
    way, pace = np.diff(rows.station), np.sqrt(x[1:]) + np.sqrt(x[:-1])
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.where(way > 0.0, 2.0 * way / pace, 0.0).sum())


def _estimated(dynamics: PathDynamics, ends: tuple[float, float], squares: tuple[float, float]) -> float:
    coarse = _cut(dynamics.rows, ends, 1)
    finer = _cut(dynamics.rows, ends, 4)
    if dynamics.arm is not None:
        middle = 0.5 * (dynamics.grid[1:] + dynamics.grid[:-1])
        finer = _cut(dynamics.refined(middle).rows, ends, 1)
    time, before = (_time(rows, _largest(rows, squares)) for rows in (finer, coarse))
    least = min(time, before) - abs(time - before)
    return max(least, 0.0) if np.isfinite(least) else 0.0


def _proven(rows: Rows, squares: tuple[float, float]) -> float | None:
    """The proven bound [s]; None: no guess of X holds."""
    x = _largest(rows, squares)
    if x is None:
        return None
    real = np.diff(rows.station) > 0.0
    for guess in GUESSES:
        most = guess * np.maximum(x[1:], x[:-1]) + 0.02 * guess * x.max()
        most = np.minimum(most, np.maximum(rows.x_cap[1:], rows.x_cap[:-1]))
        u_most = _acceleration_max(rows, most)
        if not np.isfinite(u_most[real]).all():
            continue
        u_most[~real] = 0.0
        above = _largest(_widened(rows, most, u_most, real), squares)
        if above is None:
            continue
        cap = np.maximum(rows.x_cap[1:], rows.x_cap[:-1])
        peak = np.minimum(0.5 * (above[1:] + above[:-1]) + u_most * np.diff(rows.station), cap)
        held = (peak < most) | (peak >= cap)  # beyond its cap nothing is to be shown
        if held[real].all():
            first, last = (np.minimum(ends, peak) for ends in (above[:-1], above[1:]))
            times = least_times(np.diff(rows.station), first, last, peak, u_most)
            return float(times[real].sum()) * (1.0 - ROUNDING)
    return None


def _acceleration_max(rows: Rows, most: Floats) -> Floats:
    """(N,) upper bounds of ``|u|`` on the intervals, where ``mu^2`` is below ``most`` (N,)."""
    limit = np.maximum(np.abs(rows.low), np.abs(rows.high))
    asked = np.maximum(limit[1:], limit[:-1]) + np.maximum(np.abs(rows.b[1:]), np.abs(rows.b[:-1])) * most[:, None]
    least = np.where(rows.a[1:] * rows.a[:-1] > 0.0, np.minimum(np.abs(rows.a[1:]), np.abs(rows.a[:-1])), 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nanmin(np.where(least > 0.0, asked / least, np.inf), axis=1))


def _widened(rows: Rows, most: Floats, u_most: Floats, real: Bools) -> Rows:
    """Rows that the chords of all motions keep."""
    way = np.diff(rows.station)[:, None]
    e = 0.5 * np.abs(np.diff(rows.a, axis=0)) * u_most[:, None] + 0.5 * np.abs(np.diff(rows.b, axis=0)) * most[:, None]
    low, high = rows.low.copy(), rows.high.copy()
    with np.errstate(invalid="ignore"):
        mean_low, mean_high = 0.5 * (rows.low[1:] + rows.low[:-1]), 0.5 * (rows.high[1:] + rows.high[:-1])
    for end in (slice(0, -1), slice(1, None)):
        slack = e + np.abs(rows.b[end]) * u_most[:, None] * way
        low[end][real] = np.minimum(low[end], mean_low - slack)[real]
        high[end][real] = np.maximum(high[end], mean_high + slack)[real]
    return rows._replace(low=low, high=high)
