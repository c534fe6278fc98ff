r"""Minimum time with joint jerk limits: one unknown per station (after Consolini, Locatelli, Minari 2021).

Besides the rows of second order every joint keeps ``|f''' mu^3 + 3 f'' mu mu_dot + f' mu_ddot| <= jerk_max``. With
``x = mu^2``, ``u = mu_dot``, ``z = du / d lambda`` (so ``mu_ddot = z mu``) that is

    sqrt(x) |f''' x + 3 f'' u + f' z| <= jerk_max

From rest x grows with the power 4/3 of the distance and z has no bound: the first and the last interval are motions of
constant path jerk, ``x = x_1 (s / s_1)^(4/3)``, at most as long as the first phase of jerk, and the stations beside
them lie at most a tenth of their distance from the end apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.planners.topp._jerk_kernels import ThirdOrder
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._trajectory import PhaseTrajectory

END_SHARE = 0.5  # of the first phase of jerk: how long the interval at an end is
END_LEAST_SHARE = 1e-9  # of the path
END_MOST_SHARE = 1.0 / 24.0  # of the path: jerk alone takes a twelfth of it for its first phase
END_FRACTIONS = np.linspace(0.0, 1.0, 33)  # of an interval at an end, at which its jerk is looked at
SPACING_SHARE = 0.1  # of the distance from the nearer end: the longest interval
NEAR_ENDS = 20.0  # first intervals from an end: how far the speed counts that the arm reaches after its first phase
JUMP_SHARE = 1e-6  # of the largest f'': what is less is rounding
SLIVER_SHARE = 0.2  # of the usual interval: stations nearer to a mark go
UNLIMITED = 1e12
GUESS_SHARE = 0.5  # of the squared speed of the motion without jerk limits
GUESS_END_SHARE = 0.35  # of what it, or jerk, allows one interval from an end: the curves cross farther inside


class Piece(NamedTuple):
    """A part of the path from rest to rest, and what is limited on it."""

    start: float
    stop: float
    station: Floats
    """(K+1,) the inner stations."""
    problem: ThirdOrder
    guess: Floats
    """(K,) free coefficients."""
    dynamics: PathDynamics
    """Of the inner stations."""
    jerk_max: Floats


def stops_of(path: AbstractJointPath, start: float, stop: float) -> Floats:
    """Where a part of the path must be left at rest: its ends, its stops, and stations at which ``f''`` jumps."""
    inner = path.breakpoints[(path.breakpoints > start) & (path.breakpoints < stop)]
    if len(inner):
        _, dq, ddq = path.evaluate(np.linspace(start, stop, 257))
        scale = np.abs(ddq).max() + np.abs(dq).max() / (stop - start)
        jump = np.abs(path.evaluate(inner)[2] - path.evaluate(inner, before=True)[2]).max(axis=-1)
        inner = inner[(jump > JUMP_SHARE * scale) | np.isin(inner, path.stops)]
    return np.concatenate([[start], inner, [stop]])


def first_interval(dynamics: PathDynamics, jerk_max: Floats, row: int, mu: Floats, side: int) -> float:
    """How long the interval at an end may be; ``mu`` (N+1,): the speed of the motion without jerk limits.

    Args:
        dynamics: Limits; its row ``row`` is the end.
        jerk_max: (n,) limits.
        row: Of ``dynamics``.
        mu: Of its rows.
        side: 1 at the start, -1 at the end of a motion.
    """
    path, grid = dynamics.path, dynamics.grid
    assert path is not None
    a, hold = side * dynamics.M[row], dynamics.S[row]
    up, down = dynamics.torque_max[row] - hold, hold - dynamics.torque_min[row]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        acceleration = float(np.where(a > 0.0, up / a, np.where(a < 0.0, down / -a, np.inf)).min())
        speed = np.abs(path.evaluate(grid[row : row + 1], before=side < 0)[1][0])
        jerk = float(np.where(speed > 0.0, jerk_max / speed, np.inf).min())
    if not acceleration > 0.0:
        raise InfeasibleError(
            f"the arm cannot start or stop at rest at station {grid[row]:.4g}: a torque is at its limit there",
            remedy="raise the torque limits, or move the path",
            station=float(grid[row]),
            row=row,
        )
    length, longest = 0.0, float(grid[-1] - grid[0])
    reach = longest
    for _ in range(2):  # the speed counts that is reached nearby
        near = np.abs(grid - grid[row]) <= reach
        time = min(acceleration / jerk, np.sqrt(float(mu[near].max()) / jerk)) if np.isfinite(jerk) else 0.0
        length = jerk * time**3 / 6.0 if time > 0.0 else 0.0
        reach = max(NEAR_ENDS * length, END_LEAST_SHARE * longest)
        if not (np.abs(grid - grid[row]) <= reach).sum() > 1:
            break
    return END_SHARE * length


def inner_stations(base: Floats, start: float, stop: float, ends: tuple[float, float], marks: Floats) -> Floats:
    """Stations from ``start + ends[0]`` to ``stop - ends[1]``, as close as ``base``, closer near both ends."""
    first, last = start + ends[0], stop - ends[1]
    middle = 0.5 * (start + stop)
    near = start + np.geomspace(ends[0], middle - start, 60)
    far = stop - np.geomspace(ends[1], stop - middle, 60)
    places = np.unique(np.concatenate([near, far, base[(base > first) & (base < last)], [first, last]]))
    centre, way = 0.5 * (places[1:] + places[:-1]), np.diff(places)
    after = np.clip(np.searchsorted(base, centre), 1, len(base) - 1)
    usual = base[after] - base[after - 1]
    shortest = np.minimum(usual, SPACING_SHARE * np.minimum(centre - start, stop - centre))
    count = np.concatenate([[0.0], np.cumsum(way / shortest)])
    stations: Floats = np.interp(np.linspace(0.0, count[-1], max(int(np.ceil(count[-1])), 4) + 1), count, places)
    marks = marks[(marks > first) & (marks < last)]
    if len(marks):
        gap = np.abs(stations[:, None] - marks).min(axis=1) if len(marks) < 64 else _gaps(stations, marks)
        spacing = np.minimum(np.diff(stations, prepend=-np.inf), np.diff(stations, append=np.inf))
        keep = gap > SLIVER_SHARE * spacing
        keep[0] = keep[-1] = True
        stations = np.union1d(stations[keep], marks)
    return stations


def _gaps(stations: Floats, marks: Floats) -> Floats:
    """Distances of the nearest marks."""
    after = np.clip(np.searchsorted(marks, stations), 1, len(marks) - 1)
    return np.minimum(np.abs(stations - marks[after - 1]), np.abs(marks[after] - stations))


def end_cap(path: AbstractJointPath, jerk_max: Floats, end: float, way: float) -> float:
    """The largest x one interval ``way`` (signed) from an end at which its jerk is within the limits."""
    lam = end + way * END_FRACTIONS
    before = way < 0.0
    _, dq, ddq = path.evaluate(lam, before=before)
    share, length = END_FRACTIONS[:, None], abs(way)
    third = path.third(lam, before=before)
    # x_1^(3/2) times this is the jerk of x_1 (s / s_1)^(4/3)
    bend = third * share**2 + np.sign(way) * 2.0 * ddq * share / length + 2.0 / 9.0 * dq / length**2
    most = float((np.abs(bend) / jerk_max).max())
    return min(most ** (-2.0 / 3.0), UNLIMITED) if most > 0.0 else UNLIMITED


def piece_of(
    dynamics: PathDynamics, rows: tuple[int, int], ends: tuple[float, float], jerk_max: Floats, fastest: PhaseTrajectory
) -> Piece:
    """The problem of a part of the path, from the motion without jerk limits.

    ``rows`` are the first and last of its inner stations in ``dynamics``.
    """
    path, (start, stop) = dynamics.path, ends
    assert path is not None
    part = slice(rows[0], rows[1] + 1)
    grid = dynamics.grid[part]
    new = np.append(True, np.diff(grid) > 0.0)
    station, at = grid[new], np.cumsum(new) - 1
    step = np.diff(station)
    first, last = station[0] - start, stop - station[-1]
    weight = 0.5 * (np.append(0.0, step) + np.append(step, 0.0))
    weight[0] += 3.0 * first
    weight[-1] += 3.0 * last
    half = 0.5 * (dynamics.torque_max - dynamics.torque_min)[part]
    a, b, r = (rows[part] / half for rows in (dynamics.M, dynamics.Q, dynamics.R))
    high = (dynamics.torque_max - dynamics.S)[part] / half
    low = (dynamics.torque_min - dynamics.S)[part] / half
    speed = np.full(len(station), np.inf)
    np.minimum.at(speed, at, dynamics.speed_max[part])
    cap = np.minimum(speed, UNLIMITED) ** 2
    cap[0] = min(cap[0], end_cap(path, jerk_max, start, first))
    cap[-1] = min(cap[-1], end_cap(path, jerk_max, stop, -last))
    guess, scale = _guess(station, (start, stop), cap, fastest)
    limited = np.flatnonzero(np.isfinite(jerk_max))
    inside = np.stack([station[:-1] + 1e-9 * step, station[1:] - 1e-9 * step], axis=1)
    _, dq, ddq = path.evaluate(inside)
    part_of_limit = np.stack([scale[:-1], scale[1:]], axis=1)[..., None] / jerk_max[limited]
    d1, d2, d3 = (rows[..., limited] * part_of_limit for rows in (dq, 3.0 * ddq, path.third(inside)))
    fold = np.array([1.0 + 2.0 * step[0] / (3.0 * first), 1.0 + 2.0 * step[-1] / (3.0 * last)])
    arrays = (np.ascontiguousarray(rows) for rows in (a, b, r, low, high, d1, d2, d3))
    problem = ThirdOrder(step, weight, fold, cap, scale, at.astype(np.int64), *arrays)
    return Piece(start, stop, station, problem, guess, dynamics, jerk_max)


def _guess(station: Floats, ends: tuple[float, float], cap: Floats, fastest: PhaseTrajectory) -> tuple[Floats, Floats]:
    """Free coefficients (K,) to begin with, and mu there (K+1,): slower than the motion without jerk limits."""
    knots = np.concatenate([station[:1], 0.5 * (station[1:] + station[:-1]), station[-1:]])
    x = fastest.mu**2
    guess = GUESS_SHARE * np.interp(knots, fastest.lam, x)
    for end, k in ((ends[0], 0), (ends[1], -1)):
        first = GUESS_END_SHARE * min(cap[k], float(np.interp(station[k], fastest.lam, x)))
        guess = np.minimum(guess, first * (np.abs(knots - end) / abs(station[k] - end)) ** (4.0 / 3.0))
    guess = np.maximum(guess, 1e-12 * guess.max())
    scale = np.sqrt(np.interp(station, knots, guess))
    return np.concatenate([guess[:1], guess[2:-2], guess[-1:]]), scale
