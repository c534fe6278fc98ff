"""The fastest motion with joint jerk limits: solved piece by piece, repaired between stations, in closed form."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.joint_paths import Standing
from armtempo.planners.topp._jerk_kernels import (
    GAP_SHARE,
    INFEASIBILITY_MAX,
    Point,
    ThirdOrder,
    descend,
    spline,
    unfold,
)
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._phase_plane import LIMIT_EXCESS_MAX, REFINEMENTS_MAX, PhasePlane
from armtempo.planners.topp._smooth_trajectory import SmoothTrajectory, passing_time
from armtempo.planners.topp._third_order import (
    END_LEAST_SHARE,
    END_MOST_SHARE,
    Piece,
    first_interval,
    inner_stations,
    piece_of,
    stops_of,
)
from armtempo.planners.topp._trajectory import PhaseTrajectory

REPAIRED_ABOVE = 5e-4  # of a limit: what the middle of an interval may have above it
ACCEPTED_SHARE = 0.7  # of what may be above a limit: samples miss the peaks between them
REPAIR_GAIN = 1.3  # of an excess: by so much the limits beside it are lowered
REPAIRS_MAX = 3
SLACK_FLOOR, WARM_SLACK_FLOOR = 0.1, 0.02
WARM_SHARE = 0.97  # of the coefficients before a repair, as its first guess
WARM_CENTERING = 0.1


def jerk_limited(dynamics: PathDynamics, jerk_max: Floats) -> SmoothTrajectory:
    """The fastest motion from rest to rest that keeps jerk limits (n,), too.

    Raises:
        InputError: The dynamics are bare arrays.
        InfeasibleError: No motion was found; the message says which limit is in the way where.
    """
    arm, path = dynamics.arm, dynamics.path
    if arm is None or path is None:
        raise InputError("bare arrays have no joints whose jerk is limited", remedy="use PathDynamics.from_path")
    fastest = PhasePlane(dynamics).fastest()
    stops = stops_of(path, dynamics.grid[0], dynamics.grid[-1])
    for _ in range(REFINEMENTS_MAX):
        motion = _solved(dynamics, fastest, stops, jerk_max)
        stations = motion.stations_above(ACCEPTED_SHARE * LIMIT_EXCESS_MAX)
        if not len(stations):
            return motion
        dynamics = dynamics.refined(stations)
    if motion.certificate.excess <= LIMIT_EXCESS_MAX:
        return motion
    raise InfeasibleError(
        f"limits of arm {arm.name!r} change too fast near station {stations[0]:.4g}: exceeded by "
        f"{100.0 * motion.certificate.excess:.2g} % even with {len(motion.lam)} stations",
        remedy="keep the path away from the limits of the arm's reach",
        station=float(stations[0]),
    )


def _solved(dynamics: PathDynamics, fastest: PhaseTrajectory, stops: Floats, jerk_max: Floats) -> SmoothTrajectory:
    """The motion on a grid made for it, from the one without jerk limits."""
    laws, rows = [], 0
    grid = _grid(dynamics, fastest, stops, jerk_max)
    sampled = dynamics.on_stations(np.concatenate([part for _, part in grid]))
    standing = _standing(dynamics)
    for (start, stop), part in grid:
        if start in standing:
            laws.append(_standing_law(standing[start]))
        else:
            piece = piece_of(sampled, (rows + 1, rows + len(part) - 2), (start, stop), jerk_max, fastest)
            laws.append(_laws(piece, _coefficients(piece)))
        rows += len(part)
    lam, mu, steps, mu_dot, growth, path_jerk = (np.concatenate(rows) for rows in zip(*laws, strict=True))
    return SmoothTrajectory(
        lam=np.append(lam, stops[-1]), mu=np.append(mu, 0.0), time=np.append(0.0, np.cumsum(steps)),
        dynamics=sampled, mu_dot_start=mu_dot, growth=growth, path_jerk=path_jerk, jerk_max=jerk_max,
    )  # fmt: skip


def _grid(
    dynamics: PathDynamics, fastest: PhaseTrajectory, stops: Floats, jerk_max: Floats
) -> list[tuple[tuple[float, float], Floats]]:
    """Every piece's ends and rows: its stations, those twice at which coefficients may jump."""
    twice = dynamics.grid[:-1][np.diff(dynamics.grid) == 0.0]
    base = np.unique(dynamics.grid)
    mu = np.interp(dynamics.grid, fastest.lam, fastest.mu)
    parts = []
    for start, stop in pairwise(stops):
        if start in _standing(dynamics):
            inside = dynamics.grid[(start < dynamics.grid) & (dynamics.grid < stop)]
            parts.append(((float(start), float(stop)), np.concatenate([[start], inside, [stop]])))
            continue
        length = stop - start
        rows = np.searchsorted(dynamics.grid, start, side="right") - 1, np.searchsorted(dynamics.grid, stop)
        first, last = (
            min(max(first_interval(dynamics, jerk_max, int(row), mu, side), END_LEAST_SHARE * length),
                END_MOST_SHARE * length)
            for row, side in zip(rows, (1, -1), strict=True)
        )  # fmt: skip
        station = inner_stations(base, start, stop, (first, last), twice)
        again = twice[(twice > station[0]) & (twice < station[-1])]
        part = np.concatenate([[start], np.sort(np.concatenate([station, again])), [stop]])
        parts.append(((float(start), float(stop)), part))
    return parts


def _standing(dynamics: PathDynamics) -> dict[float, Standing]:
    """The parts on which the arm stands, by where they begin."""
    return {} if dynamics.path is None else {part.start: part for part in dynamics.path.standing}


def _standing_law(part: Standing) -> tuple[Floats, ...]:
    """As ``_laws``, while the arm stands: no joint moves, so no jerk is in the way of the path's own acceleration."""
    half = 0.5 * part.seconds
    u = (part.middle - part.start) / (0.5 * half**2)
    none = np.zeros(2)
    return (
        np.array([part.start, part.middle]),
        np.array([0.0, u * half]),
        np.full(2, half),
        np.array([u, -u]),
        none,
        none,
    )


def _coefficients(piece: Piece) -> Floats:
    """The free coefficients of the optimum that keeps the limits between its stations, too."""
    problem, y = piece.problem, piece.guess.copy()
    floor, centering = SLACK_FLOOR, 1.0
    checks = _Middles.of(piece)
    for repair in range(REPAIRS_MAX + 1):
        _, gap, excess, row, time = descend(problem, y, floor, centering)
        if not (excess <= INFEASIBILITY_MAX and gap <= GAP_SHARE * time):
            raise _refusal(piece, int(row))
        above = checks.excesses(problem, y)
        if repair == REPAIRS_MAX or max(one.max(initial=0.0) for one in above) <= REPAIRED_ABOVE:
            break
        problem = _tightened(problem, *above)
        y *= WARM_SHARE
        floor, centering = WARM_SLACK_FLOOR, WARM_CENTERING
    return y


def _states(problem: ThirdOrder, y: Floats) -> Point:
    count = len(y)
    c, point = np.empty(count + 2), Point(np.empty(count + 1), np.empty(count + 1), np.empty(count))
    unfold(problem, y, c)
    spline(problem, c, point)
    return point


class _Middles(NamedTuple):
    """What is limited in the middle of every interval."""

    limits: PathDynamics
    jerk: tuple[Floats, ...]
    """(K, n) each: f', 3 f'' and f''' over the jerk limit."""

    @classmethod
    def of(cls, piece: Piece) -> _Middles:
        middle = 0.5 * (piece.station[1:] + piece.station[:-1])
        path = piece.dynamics.path
        assert path is not None
        limited = np.isfinite(piece.jerk_max)
        _, dq, ddq = path.evaluate(middle)
        jerk = (dq, 3.0 * ddq, path.third(middle))
        return cls(piece.dynamics.on_stations(middle), tuple(d[:, limited] / piece.jerk_max[limited] for d in jerk))

    def excesses(self, problem: ThirdOrder, y: Floats) -> tuple[Floats, Floats, Floats]:
        """By how much of a limit speed (K,), torques and accelerations (K, m), jerk (K, n) are above it there."""
        point, half = _states(problem, y), 0.5 * problem.step
        x = point.x[:-1] + half * (2.0 * point.u[:-1] + half * point.z)
        u = point.u[:-1] + half * point.z
        mu, limits = np.sqrt(x), self.limits
        x, u, z = x[:, None], u[:, None], point.z[:, None]
        value = np.abs(limits.M * u + limits.Q * x + limits.R * mu[:, None] + limits.S) / limits.torque_max
        d1, d2, d3 = self.jerk
        jerk = np.abs(d1 * z + d2 * u + d3 * x) * mu[:, None]
        above = [np.maximum(ratio - 1.0, 0.0) for ratio in (mu / limits.speed_max, value, jerk)]
        return above[0], above[1], above[2]


def _tightened(problem: ThirdOrder, speed: Floats, value: Floats, jerk: Floats) -> ThirdOrder:
    """Limits lowered beside the intervals in which they are exceeded."""

    def beside(excess: Floats) -> Floats:
        edge = np.zeros_like(excess[:1])
        more: Floats = np.maximum(np.concatenate([edge, excess]), np.concatenate([excess, edge]))
        return 1.0 + REPAIR_GAIN * more

    less = 1.0 - 1.0 / beside(value)[problem.at]
    more = 1.0 + REPAIR_GAIN * jerk[:, None]
    return problem._replace(
        cap=problem.cap / beside(speed) ** 2, high=problem.high - less, low=problem.low + less,
        d1=problem.d1 * more, d2=problem.d2 * more, d3=problem.d3 * more,
    )  # fmt: skip


def _laws(piece: Piece, y: Floats) -> tuple[Floats, ...]:
    """Station and mu where every interval of a piece begins, its time, mu_dot where it begins, growth, path jerk."""
    point = _states(piece.problem, y)
    first, last = piece.station[0] - piece.start, piece.stop - piece.station[-1]
    mu = np.sqrt(point.x)
    inner = passing_time(piece.problem.step, mu[:-1], mu[1:], point.z)
    time = np.concatenate([[3.0 * first / mu[0]], inner, [3.0 * last / mu[-1]]])
    zero = np.zeros_like(point.z)
    path_jerk = np.concatenate([[6.0 * first / time[0] ** 3], zero, [6.0 * last / time[-1] ** 3]])
    return (
        np.append(piece.start, piece.station), np.append(0.0, mu), time, np.append(0.0, point.u),
        np.concatenate([[0.0], point.z, [0.0]]), path_jerk,
    )  # fmt: skip


def _refusal(piece: Piece, row: int) -> InfeasibleError:
    """What stood in the way: the row that is farthest from being kept."""
    problem = piece.problem
    stations, sides, n = len(piece.station), 2 * problem.a.size, problem.d1.shape[2]
    if row < stations:
        station, what = piece.station[row], "the speed limit"
    elif row < stations + sides:
        point, of = divmod((row - stations) // 2, problem.a.shape[1])
        station, what = piece.station[problem.at[point]], f"limit {of} of torques and accelerations"
    else:
        station, what = piece.station[(row - stations - sides) // (4 * n)], "a jerk limit"
    return InfeasibleError(
        f"no motion with limited jerk was found from station {piece.start:.4g} to {piece.stop:.4g}: near station "
        f"{station:.4g} {what} is in the way",
        remedy="raise that limit, or move the path: at rest every torque must be inside its limits",
        station=float(station),
    )
