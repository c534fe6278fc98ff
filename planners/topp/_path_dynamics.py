r"""The dynamics of an arm along its path (Lee1991 eqs. 5 and 8).

With ``q = f(lambda)``, ``mu = dlambda/dt``, the torque of joint i is

    U_i = M_i mu_dot + Q_i mu^2 + R_i mu + S_i,        U_min_i <= U_i <= U_max_i
    M = J f'      Q = J f'' + C[f', f']      R = F_v f'      S = G + F_c sign(f')

====== ========================================== ==========================
symbol meaning                                    unit (lambda in metres)
====== ========================================== ==========================
M      inertia seen by the path acceleration      N m s^2 / m
Q      inertia and Coriolis terms of ``mu^2``     N m s^2 / m^2
R      viscous friction                           N m s / m
S      gravity and Coulomb friction               N m
====== ========================================== ==========================

Limits of joint accelerations, ``|f' mu_dot + f'' mu^2| <= a_max``, are further rows with ``M = f'``, ``Q = f''``.
Where a path stands (see ``SequencePath``) one more keeps the time: ``M = d^2 / 4 w`` there and 0 elsewhere.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats
from armtempo.errors import InputError, RobotError
from armtempo.planners.geometry import floats, number
from armtempo.planners.joint_paths import AbstractJointPath, Standing
from armtempo.planners.topp._rows import Rows
from armtempo.planners.topp._settled_grid import SETTLED_SHARE, change_by_halving
from armtempo.robots import Arm, kernels

GRADED_SHARE = 0.05  # of the grid at either end; steps shrink towards it: friction is steep in lambda near rest
STANDING_SHARE = 1e-13  # of the fastest joint: slower ones stand still, whatever the sign of their rounding
INTERVALS_MAX = 10**7
RUN_INTERVALS = 50  # at least, between two stops
STANDING_INTERVALS = 8  # of a part on which the arm stands: an even number
STANDING_SLACK = 1e-7  # of its time: how exact it is
INTERVALS_FIRST, INTERVALS_SETTLED_MAX = 1000, 2**16  # of a grid that follows its path
HALVINGS_MAX = 7
FALLING_SHARE = 0.9  # of the change before: where halving changes the time by more it does not settle
TOOL_SAMPLES = 5  # of an interval, for the tip's speed
NUMBER_MAX = 1e60  # of a coefficient: products of several must not overflow
SpeedCap = float | Callable[[Floats], ArrayLike]


def _read_only(value: ArrayLike, name: str) -> Floats:
    array = floats(value, name, NUMBER_MAX)
    array.setflags(write=False)
    return array


def moving(dq: Floats) -> Floats:
    """The sign of every joint's motion (..., n), 0 for joints that only rounding moves."""
    fastest = np.abs(dq).max(axis=-1, keepdims=True, initial=0.0)
    sign: Floats = np.sign(np.where(np.abs(dq) > STANDING_SHARE * fastest, dq, 0.0))
    return sign


def _coefficients(arm: Arm, q: Floats, dq: Floats, ddq: Floats, sign: Floats) -> list[Floats]:
    """M, Q, R, S at samples of a path, each (N, n), and of joints with an acceleration limit once more."""
    rows = [np.empty_like(q) for _ in range(4)]
    kernels.path_coefficients(arm.model, q, dq, ddq, *rows)
    if arm.coulomb.any():
        rows[3] += arm.coulomb * sign
    limited = np.flatnonzero(np.isfinite(arm.acceleration_max))
    if not len(limited):
        return rows
    none = np.zeros((len(q), len(limited)))
    further = (dq[:, limited], ddq[:, limited], none, none)
    return [np.concatenate([of_torque, of_limit], axis=1) for of_torque, of_limit in zip(rows, further, strict=True)]


def _tip_speed(arm: Arm, path: AbstractJointPath, lam: Floats) -> Floats:
    """(K,) [m] that the tip moves by lambda at stations (K,)."""
    q, dq, _ = path.sampled(lam, arm.dof)
    return np.asarray(np.linalg.norm(np.einsum("kij,kj->ki", arm.jacobian(q)[:, :3], dq), axis=1))


def _limits_at(limit: SpeedCap, lam: Floats) -> Floats:
    """(K,) [m/s] a limit of the tip's speed at stations (K,)."""
    given = floats(limit(lam) if callable(limit) else limit, "tool_speed_m_s", np.inf)
    if given.shape not in ((), lam.shape) or not (given > 0.0).all():
        raise InputError(
            f"tool_speed_m_s of shape {given.shape} at {lam.shape} stations, or not > 0",
            remedy="give a speed > 0, or a function of stations (K,) that gives (K,) of them",
        )
    return np.broadcast_to(given, lam.shape)


def _tool_caps(arm: Arm, path: AbstractJointPath, grid: Floats, limit: SpeedCap) -> Floats:
    """(N+1,) of ``mu``: what the tip's limit allows at every sample of the intervals on either side."""
    way = np.diff(grid)
    lam = (grid[:-1, None] + way[:, None] * np.linspace(1e-9, 1.0 - 1e-9, TOOL_SAMPLES)).ravel()
    with np.errstate(divide="ignore"):
        caps = (_limits_at(limit, lam) / _tip_speed(arm, path, lam)).reshape(len(way), -1).min(axis=1)
    caps = np.where(way > 0.0, caps, np.inf)
    return np.asarray(np.minimum(np.append(caps, np.inf), np.append(np.inf, caps)))


def _stations(path: AbstractJointPath, intervals: int) -> Floats:
    """(N+1,) of a grid: every run between two stops by itself is graded; on parts that stand few will do."""
    border = np.concatenate([[0.0], path.stops, [path.length]])
    still = {standing.start for standing in path.standing}
    way = np.diff(border)
    moving_way = float(sum(size for size, start in zip(way, border, strict=False) if start not in still))
    runs = []
    for start, size in zip(border, way, strict=False):
        if start in still:
            share = np.linspace(0.0, 1.0, STANDING_INTERVALS + 1)
        else:
            least = min(intervals, RUN_INTERVALS)
            share = _graded(max(least, round(intervals * size / moving_way)))
        runs.append(start + size * share[:-1])
    return np.append(np.concatenate(runs), path.length)


def _standing_inertia(standing: Standing) -> float:
    """``M`` of the row that keeps its time."""
    return standing.seconds**2 / (4.0 * (standing.stop - standing.start))


def _add_standing(
    standing: tuple[Standing, ...], grid: Floats, rows: list[Floats], low: Floats, high: Floats
) -> tuple[list[Floats], Floats, Floats]:
    """M, Q, R, S and limits (N+1, n) with one more row, which says how long the arm stands where it does."""
    inertia, least, most = np.zeros(len(grid)), np.full(len(grid), -1.0), np.ones(len(grid))
    for part in standing:
        first = np.searchsorted(grid, part.start, side="right") - 1
        last = np.searchsorted(grid, part.stop, side="left")
        inertia[first : last + 1] = _standing_inertia(part)
        if part.exact:  # but at its ends, where it may wait
            middle = np.searchsorted(grid, part.middle, side="right") - 1
            least[first + 1 : middle], most[middle:last] = 1.0 - STANDING_SLACK, STANDING_SLACK - 1.0
    none = np.zeros((len(grid), 1))
    rows = [
        np.concatenate([own, new], axis=1) for own, new in zip(rows, (inertia[:, None], none, none, none), strict=True)
    ]
    return rows, np.column_stack([low, least]), np.column_stack([high, most])


def _graded(intervals: int) -> Floats:
    """(N+1,) shares of the path: equal steps, shrinking linearly to the ends over ``GRADED_SHARE`` of them."""
    t = np.linspace(0.0, 1.0, intervals + 1)
    ends = np.minimum(t, 1.0 - t)
    inside = np.where(ends < GRADED_SHARE, ends**2 / (2.0 * GRADED_SHARE), ends - 0.5 * GRADED_SHARE)
    return np.asarray(np.where(t < 0.5, inside, 1.0 - GRADED_SHARE - inside) / (1.0 - GRADED_SHARE))


def _reversals(path: AbstractJointPath, joints: Bools) -> Floats:
    """Stations at which one of the ``joints`` turns back: Coulomb friction jumps there."""
    start, stop = path.breakpoints[:-1, None], path.breakpoints[1:, None]
    share = np.linspace(1e-6, 1.0 - 1e-6, 257)  # breakpoints have rows on either side already
    lam = start + share * (stop - start)
    slope = path.evaluate(lam)[1]
    piece, row, joint = np.nonzero((slope[:, :-1] * slope[:, 1:] < 0.0) & joints)
    a, b, ahead = lam[piece, row], lam[piece, row + 1], slope[piece, row, joint]
    every = np.arange(len(a))
    for _ in range(60 if len(a) else 0):
        middle = 0.5 * (a + b)
        before = path.evaluate(middle)[1][every, joint] * ahead > 0.0
        a, b = np.where(before, middle, a), np.where(before, b, middle)
    return np.unique(b)


def _read_rows(grid: ArrayLike, M: ArrayLike, Q: ArrayLike, R: ArrayLike, S: ArrayLike) -> dict[str, Floats]:
    """The coefficients by name, read-only, if their shapes are right."""
    rows = {name: _read_only(value, name) for name, value in (("grid", grid), ("M", M))}
    shape = rows["M"].shape
    if len(shape) != 2 or rows["grid"].shape != shape[:1] or shape[0] < 2 or shape[1] < 1:
        raise InputError(f"grid and M must have shapes (N+1,) and (N+1, n), got {rows['grid'].shape} and {shape}")
    rows |= {name: _read_only(value, name) for name, value in (("Q", Q), ("R", R), ("S", S))}
    for name, value in rows.items():
        if name != "grid" and value.shape != shape:
            raise InputError(f"{name} must have shape {shape} like M, got {value.shape}")
    return rows


def _read_limits(
    shape: tuple[int, ...], torque_min: ArrayLike, torque_max: ArrayLike, speed_max: ArrayLike | None
) -> dict[str, Floats]:
    """The limits by name, read-only, one row per station."""
    limits = {}
    for name, value in (("torque_min", torque_min), ("torque_max", torque_max)):
        try:
            limits[name] = _read_only(np.broadcast_to(floats(value, name, NUMBER_MAX), shape), name)
        except InputError:
            raise
        except ValueError:
            raise InputError(f"{name} must have shape {shape[1:]} or {shape}, got {np.shape(value)}") from None
    limits["speed_max"] = _read_only(np.full(shape[0], np.inf) if speed_max is None else speed_max, "speed_max")
    if limits["speed_max"].shape != shape[:1]:
        raise InputError(f"speed_max must have shape {shape[:1]}, got {limits['speed_max'].shape}")
    return limits


def _check_numbers(rows: dict[str, Floats], limits: dict[str, Floats]) -> None:
    """Refuse coefficients and limits that are no numbers or contradict each other."""
    for name, value in rows.items():
        if not np.isfinite(value).all():
            k = int(np.argwhere(~np.isfinite(value))[0][0])
            raise InputError(f"{name} is not finite at row {k}", row=k)
    if any(np.isnan(value).any() for value in limits.values()):
        raise InputError("torque_min, torque_max and speed_max must not hold NaN")
    if (limits["speed_max"] < 0.0).any():
        raise InputError("speed_max must not be negative")
    grid = rows["grid"]
    if (np.diff(grid) < 0.0).any() or grid[0] == grid[1] or grid[-1] == grid[-2]:
        raise InputError("grid must rise, and may stay at one station for two rows only between its ends")
    crossed = np.argwhere(limits["torque_min"] > limits["torque_max"])
    if len(crossed):
        k, joint = crossed[0]
        raise InputError(f"torque_min exceeds torque_max at row {k}, joint {joint}", row=int(k), joint=int(joint))


class _Origin(NamedTuple):
    """What rows were sampled from."""

    arm: Arm
    path: AbstractJointPath
    torque_reserve: float
    speed_cap: SpeedCap | None
    tool_speed: SpeedCap | None


@final
@dataclass(frozen=True, init=False, eq=False, repr=False)
class PathDynamics:
    """Rows ``U = M mu_dot + Q mu^2 + R mu + S`` with limits, on a grid of stations; read-only.

    Rows need not be joints: acceleration limits are rows with ``M = f'`` and ``Q = f''``.

    Args:
        grid: (N+1,) stations, never falling; a station that appears twice is a jump of the coefficients.
        M: (N+1, n) coefficients of ``mu_dot``.
        Q: (N+1, n) coefficients of ``mu^2``.
        R: (N+1, n) coefficients of ``mu``.
        S: (N+1, n) torques at rest.
        torque_min: (n,) or (N+1, n) lower limits.
        torque_max: (n,) or (N+1, n) upper limits.
        speed_max: Upper limits of ``mu``, (N+1,), or None.

    Attributes:
        joints: How many of the rows, the first, are torques of joints; all, if nothing else was said.

    Raises:
        InputError: A shape is wrong, a number is not finite, or limits cross; the message names the argument.
    """

    grid: Floats
    M: Floats
    Q: Floats
    R: Floats
    S: Floats
    torque_min: Floats
    torque_max: Floats
    speed_max: Floats
    joints: int
    _origin: _Origin | None

    def __init__(
        self,
        grid: ArrayLike,
        M: ArrayLike,
        Q: ArrayLike,
        R: ArrayLike,
        S: ArrayLike,
        torque_min: ArrayLike,
        torque_max: ArrayLike,
        speed_max: ArrayLike | None = None,
    ) -> None:
        rows = _read_rows(grid, M, Q, R, S)
        shape = rows["M"].shape
        limits = _read_limits(shape, torque_min, torque_max, speed_max)
        _check_numbers(rows, limits)
        for name, value in (rows | limits | {"joints": shape[1], "_origin": None}).items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_path(
        cls,
        arm: Arm,
        path: AbstractJointPath,
        *,
        intervals: int | None = None,
        torque_reserve: float = 0.0,
        speed_max: SpeedCap | None = None,
        tool_speed_m_s: SpeedCap | None = None,
    ) -> PathDynamics:
        """Sample the dynamics of ``arm`` along ``path``.

        The grid's steps shrink towards both ends; stations where coefficients jump (breakpoints of the path, joints
        with Coulomb friction that turn back) appear twice.

        Args:
            arm: Gives the dynamics, friction, and the limits of torque, speed and acceleration.
            path: Where the arm goes.
            intervals: Number of grid intervals N (breakpoints add to it). None: as many as the path needs, that is
                1000, halved until halving has changed the minimum time from rest to rest by less than 0.1 %.
            torque_reserve: Share of every torque limit that the plan leaves unused, in [0, 1).
            speed_max: A further upper limit of ``mu``: a number, or a function of stations (K,) that gives (K,).
            tool_speed_m_s: Upper limit of the tip's linear speed [m/s], likewise; also between stations. A function may
                jump, best at a breakpoint of the path (where segments meet): elsewhere an interval is the slower one's.

        Raises:
            InputError: An argument is out of range.
            PathError: The path is not finite, or not one of this arm.
            RobotError: A joint has neither a torque nor an acceleration limit.
        """
        torque_reserve = number(torque_reserve, "torque_reserve")
        count = INTERVALS_FIRST if intervals is None else number(intervals, "intervals")
        if not 1 <= count <= INTERVALS_MAX or not 0.0 <= torque_reserve < 1.0:
            raise InputError(
                f"intervals must be at least 1, at most {INTERVALS_MAX}, and torque_reserve in [0, 1), "
                f"got {intervals} and {torque_reserve}"
            )
        if arm.unlimited.any():
            joint = arm.joint_names[int(np.argmax(arm.unlimited))]
            known = "no inertia" if arm.kinematic else "effort=0"
            raise RobotError(
                f"arm {arm.name!r}: {arm.urdf} has {known} for joint {joint!r}, which has no acceleration limit either",
                remedy="give acceleration limits (limits.acceleration_rad_s2 in a cell, acceleration_max in Python)",
                file=str(arm.urdf),
            )
        path.check_stations()
        turns = _reversals(path, arm.coulomb > 0.0) if arm.coulomb.any() else np.empty(0)
        jumps = np.union1d(path.breakpoints[1:-1], turns)
        stations = path.length * _graded(int(count)) if not len(path.stops) else _stations(path, int(count))
        marks = np.union1d(path.breakpoints, jumps)
        steps = np.diff(stations)
        inner = stations[1:-1]  # without slivers beside marks
        after = np.searchsorted(marks, inner)
        gap = np.minimum(inner - marks[after - 1], marks[after] - inner)
        inner = inner[gap > 0.01 * np.minimum(steps[:-1], steps[1:])]
        grid = np.sort(np.concatenate([inner, marks, jumps]))
        dynamics = cls._sampled(grid, _Origin(arm, path, torque_reserve, speed_max, tool_speed_m_s))
        return dynamics if intervals is not None else dynamics._settled()

    def _settled(self) -> PathDynamics:
        """The same limits on a grid that has been halved until that changes the minimum time no longer."""
        assert self._origin is not None
        dynamics, before = self, np.inf
        for _ in range(HALVINGS_MAX):
            grid, change = dynamics.grid, change_by_halving(dynamics.rows)
            if not change > SETTLED_SHARE or 2 * len(grid) > INTERVALS_SETTLED_MAX:
                break
            if change > FALLING_SHARE * before:  # a time that does not settle, of an arm that cannot hold still
                return self
            before = change
            grid = np.sort(np.concatenate([grid, 0.5 * (grid[1:] + grid[:-1])[np.diff(grid) > 0.0]]))
            dynamics = self._sampled(grid, self._origin)
        return dynamics

    @classmethod
    def _sampled(cls, grid: Floats, origin: _Origin) -> PathDynamics:
        """On a given grid, in which stations where coefficients jump appear twice."""
        arm, path, torque_reserve, speed_cap, tool_speed = origin
        q, dq, ddq = path.sampled(grid, arm.dof)
        sign = moving(dq)
        for k in np.flatnonzero(np.diff(grid) == 0.0):  # the first of the two rows belongs to the piece before
            for rows, value in zip((q, dq, ddq), path.sampled(grid[k], arm.dof, before=True), strict=True):
                rows[k] = value
            sign[k], sign[k + 1] = sign[k - 1], sign[k + 2]
        M, Q, R, S = _coefficients(arm, q, dq, ddq, sign)
        with np.errstate(divide="ignore", over="ignore"):
            speed_max = np.min(np.where(np.abs(dq) > 0.0, arm.speed_max / np.abs(dq), np.inf), axis=1)
        if speed_cap is not None:
            cap = floats(speed_cap(grid) if callable(speed_cap) else speed_cap, "speed_max")
            speed_max = np.minimum(speed_max, np.broadcast_to(cap, grid.shape))
        if tool_speed is not None:
            speed_max = np.minimum(speed_max, _tool_caps(arm, path, grid, tool_speed))
        speed_max = np.where(np.isin(grid, path.stops), 0.0, speed_max)
        limit = (1.0 - torque_reserve) * arm.torque_max
        limit = np.concatenate([limit, arm.acceleration_max[np.isfinite(arm.acceleration_max)]])
        low, high = -limit, limit
        if path.standing:
            low, high = (np.broadcast_to(own, M.shape) for own in (low, high))
            (M, Q, R, S), low, high = _add_standing(path.standing, grid, [M, Q, R, S], low, high)
        dynamics = cls(grid, M, Q, R, S, low, high, speed_max)
        return dynamics._with(arm.dof, origin)

    def _with(self, joints: int, origin: _Origin | None) -> PathDynamics:
        """The same rows; what they are of."""
        other = copy.copy(self)
        object.__setattr__(other, "joints", joints)
        object.__setattr__(other, "_origin", origin)
        return other

    def with_joints(self, joints: int) -> PathDynamics:
        """The same rows, of which the first ``joints`` are torques of joints and the others further limits.

        Raises:
            InputError: There are not so many rows.
        """
        if not 1 <= joints <= self.M.shape[1]:
            raise InputError(f"joints must be from 1 to the number of rows, {self.M.shape[1]}, got {joints}")
        return self._with(joints, self._origin)

    @property
    def arm(self) -> Arm | None:
        """What it was sampled from; None: bare arrays."""
        return None if self._origin is None else self._origin.arm

    @property
    def path(self) -> AbstractJointPath | None:
        """Likewise."""
        return None if self._origin is None else self._origin.path

    def refined(self, stations: ArrayLike) -> PathDynamics:
        """The same limits with the intervals in which ``stations`` (K,) lie cut in four; needs an arm and a path."""
        if self._origin is None:
            raise InputError("bare arrays cannot be refined", remedy="give a finer grid")
        cut = np.unique(np.clip(np.searchsorted(self.grid, stations, side="right") - 1, 0, len(self.grid) - 2))
        cut = cut[self.grid[cut + 1] > self.grid[cut]]
        new = (self.grid[cut, None] + np.diff(self.grid)[cut, None] * np.array([0.25, 0.5, 0.75])).ravel()
        return self.on_stations(np.sort(np.concatenate([self.grid, new])))

    def with_intervals(self, intervals: int) -> PathDynamics:
        """The same limits on a grid of so many intervals; needs an arm and a path."""
        if self._origin is None:
            raise InputError("bare arrays cannot be sampled anew", remedy="build them with PathDynamics.from_path")
        arm, path, torque_reserve, speed_cap, tool_speed = self._origin
        return self.from_path(
            arm, path, intervals=intervals, torque_reserve=torque_reserve, speed_max=speed_cap,
            tool_speed_m_s=tool_speed,
        )  # fmt: skip

    def on_stations(self, grid: Floats) -> PathDynamics:
        """The same limits at other stations, those twice at which coefficients jump; needs an arm and a path."""
        if self._origin is None:
            raise InputError("bare arrays cannot be sampled anew", remedy="build them with PathDynamics.from_path")
        return self._sampled(grid, self._origin)

    def between(self, start: float, stop: float, *, intervals: int = 100) -> PathDynamics:
        """The same limits on the part of the path from ``start`` to ``stop``, in ``intervals`` equal ones or finer.

        Coefficients at new stations are exact if there are an arm and a path; limits are interpolated.

        Raises:
            InputError: The part is empty or not on the path.
        """
        rounding = 1e-9 * self.length
        if not self.grid[0] - rounding <= start < stop <= self.length + rounding:
            raise InputError(f"a part must lie in [{self.grid[0]:.6g}, {self.length:.6g}], got [{start}, {stop}]")
        inside = (self.grid > start) & (self.grid < stop)
        for row, end in (
            (np.searchsorted(self.grid, start, side="right") - 1, start), (np.searchsorted(self.grid, stop), stop)
        ):  # fmt: skip
            if row < len(self.grid) and self.grid[row] == end:  # what it has on this side
                inside[row] = True
        more = np.linspace(start, stop, intervals + 1)
        more = more[~np.isin(more, self.grid[inside])]
        M, Q, R, S = self.evaluate(more)
        grid = np.concatenate([self.grid[inside], more])
        order = np.argsort(grid, kind="stable")
        after = np.clip(np.searchsorted(self.grid, more, side="right"), 1, len(self.grid) - 1)
        w = ((more - self.grid[after - 1]) / (self.grid[after] - self.grid[after - 1]))[:, None]
        low, high = ((1.0 - w) * rows[after - 1] + w * rows[after] for rows in (self.torque_min, self.torque_max))
        caps = np.stack([self.speed_max[after - 1], self.speed_max[after]])
        slower = np.where(caps.min(axis=0) > 0.0, caps.min(axis=0), caps.max(axis=0))  # 0 is a stop, there alone
        known = (self.M, self.Q, self.R, self.S, self.torque_min, self.torque_max, self.speed_max)
        joined = (
            np.concatenate([rows[inside], new])[order]
            for rows, new in zip(known, (M, Q, R, S, low, high, slower), strict=True)
        )
        return PathDynamics(grid[order], *joined)._with(self.joints, self._origin)

    @property
    def rows(self) -> Rows:
        """The limits as arrays for compiled loops."""
        return Rows(
            self.grid,
            self.M,
            self.Q,
            self.R,
            self.torque_min - self.S,
            self.torque_max - self.S,
            np.minimum(self.speed_max, 1e6) ** 2,
        )

    @property
    def length(self) -> float:
        """``lambda_max``, the last station."""
        return float(self.grid[-1])

    def evaluate(self, lam: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """M, Q, R, S at any ``lam``, each (..., rows): exact from arm and path, else interpolated between stations."""
        lam = np.asarray(lam, dtype=np.float64)
        if self._origin is None:
            M, Q, R, S = (
                np.stack([np.interp(lam, self.grid, column) for column in rows.T], axis=-1)
                for rows in (self.M, self.Q, self.R, self.S)
            )
            return M, Q, R, S
        flat = np.atleast_1d(lam).reshape(-1)
        q, dq, ddq = self._origin.path.evaluate(flat)
        rows = _coefficients(self._origin.arm, q, dq, ddq, moving(dq))
        if self._origin.path.standing:
            none = np.zeros((len(flat), 1))
            inertia = none.copy()
            for part in self._origin.path.standing:
                on = (part.start <= flat) & ((flat < part.stop) | (part.stop == self.length))
                inertia[on] = _standing_inertia(part)
            rows = [
                np.concatenate([own, new], axis=1) for own, new in zip(rows, (inertia, none, none, none), strict=True)
            ]
        M, Q, R, S = (row.reshape(*lam.shape, -1) for row in rows)
        return M, Q, R, S

    def tool_speed_ratio(self, lam: Floats, mu: Floats) -> Floats:
        """The tip's linear speed over its limit (...) at speeds ``mu`` (...); 0 without such a limit."""
        if self._origin is None or self._origin.tool_speed is None:
            return np.zeros(np.shape(lam))
        flat = np.ravel(lam)
        per_lambda = _tip_speed(self._origin.arm, self._origin.path, flat)
        ratio = np.ravel(mu) * per_lambda / _limits_at(self._origin.tool_speed, flat)
        return np.asarray(ratio.reshape(np.shape(lam)))

    def torque(self, lam: ArrayLike, mu: ArrayLike, mu_dot: ArrayLike) -> Floats:
        """Torques ``M mu_dot + Q mu^2 + R mu + S`` (..., joints) [N m] of a motion (Lee1991 eq. 8)."""
        M, Q, R, S = (rows[..., : self.joints] for rows in self.evaluate(lam))
        mu, mu_dot = np.asarray(mu)[..., None], np.asarray(mu_dot)[..., None]
        torque: Floats = M * mu_dot + Q * mu**2 + R * mu + S
        return torque
