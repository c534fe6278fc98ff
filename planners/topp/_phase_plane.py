r"""Minimum time along a path by the phase plane (Lee1991 section 2.2, after Shin & McKay 1985).

Find ``mu(lambda)`` that minimises ``T = integral d lambda / mu`` (Lee1991 eq. 14) where every joint keeps
``U_min <= M mu_dot + Q mu^2 + S <= U_max`` and ``0 <= mu <= speed_max``. In ``x = mu^2`` the motion is linear,
``dx/dlambda = 2 mu_dot``, and so are the limits: one backward pass finds the controllable set ``K(lambda)``, one greedy
forward pass the fastest motion inside it. The pointwise largest admissible profile is the optimum.
"""

from __future__ import annotations

import math
import warnings
from functools import cached_property
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import ActionError, InfeasibleError, InputError
from armtempo.planners.geometry import floats, number
from armtempo.planners.topp._advance import acceleration_bounds, advance, edge_speed, record_pieces
from armtempo.planners.topp._controllable_sets import SET_INTERVALS_MAX, admissible_sets, controllable_sets
from armtempo.planners.topp._greedy import active_rows, follow_edges, greedy_profile
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._rows import COLUMNS_PER_ROW, STEP_HEADER_COLUMNS, Edges, Rows
from armtempo.planners.topp._trajectory import PhaseTrajectory

Mode = Literal["speed", "acceleration"]

NO_TICKS = np.empty(0)
NO_PROFILE = np.empty(0)
LIMIT_EXCESS_MAX = 1e-3  # of a limit: what dense sampling may find above it
REFINEMENTS_MAX = 10
FLOOR_SLACK = 1e-9  # of the slowest motion's mu^2: a limit lies so far above it, for the rounding of its sets


@final
class PhasePlane:
    """The controllable set of a path, and motions inside it.

    Args:
        dynamics: Limits along the path.
        mu_end: Path speed wanted at the end.

    Attributes:
        rows: The limits as arrays for compiled loops.
        sets: (N+1, K, 2) the controllable set: rising intervals of ``mu^2`` from which the end can be met.
        counts: (N+1,) how many of them; more than one only with viscous friction.

    Raises:
        InfeasibleError: From some station no speed lets the arm reach the end; the message names it, the joint and why.
    """

    def __init__(self, dynamics: PathDynamics, mu_end: float = 0.0) -> None:
        if not 0.0 <= number(mu_end, "mu_end") < math.inf:
            raise InputError(f"mu_end must be finite and not negative, got {mu_end}")
        self.dynamics = dynamics
        self.mu_end = float(mu_end)
        self.rows = dynamics.rows
        count = len(dynamics.grid)
        self.sets, self.counts = np.zeros((count, SET_INTERVALS_MAX, 2)), np.zeros(count, dtype=np.int64)
        failed = controllable_sets(self.rows, self.mu_end**2, False, NO_PROFILE, self.sets, self.counts)
        if failed >= 0:
            raise self._explain(failed)

    @cached_property
    def edges(self) -> Edges:
        """One interval of the controllable set per station, for motions under commands.

        The lowest, so that an arm can always yield; ``mu*`` is its upper end. Where friction splits the set, the
        minimum-time motion may pass above it (``fastest`` knows all intervals).
        """
        sets = self.sets
        if self.counts.max() > 1:
            sets, counts = np.zeros_like(self.sets), np.zeros_like(self.counts)
            if controllable_sets(self.rows, self.mu_end**2, True, NO_PROFILE, sets, counts) >= 0:
                # slow motions lead nowhere: keep to the intervals that the fastest one passes
                x = self._greedy(float(self.sets[0, self.counts[0] - 1, 1]))
                failed = controllable_sets(self.rows, self.mu_end**2, True, x, sets, counts)
                if failed >= 0:
                    raise self._explain(failed)
        count = len(self.rows.station)
        steps = np.zeros((count, STEP_HEADER_COLUMNS + COLUMNS_PER_ROW * self.rows.a.shape[1]))
        edges = Edges(np.zeros(count), np.zeros(count), np.zeros(count - 1), np.zeros(count - 1), steps)
        follow_edges(self.rows, sets, edges)
        return edges

    @cached_property
    def holdable(self) -> Bools:
        """(N+1,) the stations where the arm can stand still for as long as it likes, and go on from there."""
        return np.asarray(self._still & (self.edges.low <= 0.0))

    @property
    def _still(self) -> Bools:
        """(N+1,) the stations where the limits let it stand still."""
        return np.asarray(((self.rows.low <= 0.0) & (self.rows.high >= 0.0)).all(axis=1))

    @property
    def dwelling(self) -> Bools:
        """(N+1,) the stations inside a dwell, which takes exactly its time: nothing waits there."""
        path, grid = self.dynamics.path, self.dynamics.grid
        inside = np.zeros(len(grid), dtype=np.bool_)
        for part in () if path is None else path.standing:
            inside |= part.exact & (part.start < grid) & (grid < part.stop)
        return inside

    def _joint(self, row: int) -> int:
        """The joint that a row of the limits is about; of a dwell 0."""
        arm, joints = self.dynamics.arm, self.dynamics.joints
        if row < joints or arm is None:
            return row
        limited = np.flatnonzero(np.isfinite(arm.acceleration_max))
        return int(limited[row - joints]) if row - joints < len(limited) else 0

    def limit_name(self, row: int) -> str:
        """What a row of the limits is, in words."""
        arm = self.dynamics.arm
        if arm is not None and row - self.dynamics.joints >= np.isfinite(arm.acceleration_max).sum():
            return f"the time of a dwell{self._of_arm}"
        what = "torque" if row < self.dynamics.joints else "acceleration"
        joint = self._joint(row)
        return f"the {what} of joint {joint if arm is None else repr(arm.joint_names[joint])}{self._of_arm}"

    @property
    def _of_arm(self) -> str:
        arm = self.dynamics.arm
        return f" of arm {arm.name!r}" if arm is not None else ""

    def _most_limiting(self, row: int) -> int:
        """The limit that leaves least acceleration from rest at a row of the grid."""
        a, low, high = self.rows.a[row], self.rows.low[row], self.rows.high[row]
        with np.errstate(divide="ignore", invalid="ignore"):
            return int(np.where(a > 0.0, high / a, np.where(a < 0.0, low / a, np.inf)).argmin())

    def _explain(self, row: int) -> InfeasibleError:
        """Why nothing is controllable at a row of the grid."""
        dynamics = self.dynamics
        station = float(dynamics.grid[row])
        if row == len(dynamics.grid) - 1 and self.mu_end**2 > self.rows.x_cap[row]:
            cap = float(np.sqrt(self.rows.x_cap[row]))
            return InfeasibleError(
                f"mu_end = {self.mu_end:.6g} is above the speed limit {cap:.6g} at the end, station {station:.4g}",
                remedy="end with a lower speed, or raise the speed limit there",
                station=station,
                row=row,
            )
        hold = dynamics.S[row]
        over = np.maximum(hold - dynamics.torque_max[row], dynamics.torque_min[row] - hold)
        limit = int(over.argmax())
        if over[limit] > 0.0 and limit < dynamics.joints:
            name = limit if dynamics.arm is None else repr(dynamics.arm.joint_names[limit])
            reason = (
                f"joint {name}{self._of_arm} needs {hold[limit]:.4g} N m to hold still at station {station:.4g}, "
                f"its limits are [{dynamics.torque_min[row, limit]:.4g}, {dynamics.torque_max[row, limit]:.4g}] N m"
            )
            remedy = "raise limits.torque_nm, lower torque_reserve, or move the path"
        elif row + 1 < len(hold) and self.rows.x_cap[row] < self.sets[row + 1, 0, 0]:
            needed = float(np.sqrt(self.sets[row + 1, 0, 0]))
            reason = (
                f"past station {station:.4g} the arm must move at mu >= {needed:.4g}, because it could not hold still "
                f"there, but the speed limit is {float(dynamics.speed_max[row]):.4g}"
            )
            remedy = "raise limits.speed_rad_s or the torque limits there, or move the path"
        else:
            limit = self._most_limiting(row)
            reason = (
                f"no speed at station {station:.4g} lets the path be finished inside the limits "
                f"({self.limit_name(limit)} limits the acceleration from rest most)"
            )
            remedy = "raise the torque or speed limits there, or smooth the path"
        return InfeasibleError(reason, remedy=remedy, station=station, joint=self._joint(limit), row=row)

    def _explain_stuck(self, row: int) -> InfeasibleError:
        """Why the arm cannot move on from rest at a row of the grid."""
        station = float(self.rows.station[row])
        where = f"the arm cannot move on from rest at station {station:.4g}"
        if self.rows.x_cap[row + 1] <= 0.0:
            remedy = "a speed limit of 0 is no limit but a stop: raise it"
            return InfeasibleError(f"{where}: the speed limit there is 0", remedy=remedy, station=station, row=row)
        limit = self._most_limiting(row)
        return InfeasibleError(
            f"{where}: {self.limit_name(limit)} is at its limit",
            remedy="raise that limit, or move the path",
            station=station,
            joint=self._joint(limit),
            row=row,
        )

    @property
    def length(self) -> float:
        """``lambda_max``."""
        return self.dynamics.length

    def upper(self, lam: ArrayLike) -> Floats:
        """``mu*``: the largest speed at ``lam`` (any shape) from which the end can be met."""
        lam = np.asarray(lam, dtype=np.float64)
        return self._edge(lam, self.edges.high, self.edges.high_next)

    def lower(self, lam: ArrayLike) -> Floats:
        """The smallest such speed; positive where the arm cannot hold still."""
        lam = np.asarray(lam, dtype=np.float64)
        return self._edge(lam, self.edges.low, self.edges.low_next)

    def _edge(self, lam: Floats, here: Floats, there: Floats) -> Floats:
        grid = self.rows.station
        i = np.clip(np.searchsorted(grid, lam, side="right") - 1, 0, len(grid) - 2)
        w = (lam - grid[i]) / (grid[i + 1] - grid[i])
        return np.sqrt(np.maximum(here[i] + w * (there[i] - here[i]), 0.0))

    def acceleration_bounds(self, lam: float, mu: float) -> tuple[float, float]:
        """LB and UB (Lee1991 eqs. 9-10): the largest deceleration and acceleration the torque limits allow there."""
        low, high = acceleration_bounds(self.edges.steps, float(lam), float(mu) ** 2)
        return float(low), float(high)

    @property
    def controllable(self) -> Floats:
        """(N+1, K, 2) the intervals of ``mu`` from which the end can be met; NaN where there are fewer."""
        return _speeds(self.sets, self.counts)

    @cached_property
    def admissible(self) -> Floats:
        """(N+1, K, 2) the intervals of ``mu`` in which some ``mu_dot`` keeps the limits of the station; else NaN.

        Without friction there is one, under the velocity limit curve; with it islands may be cut out (Lee1991 eq. 10).
        """
        sets, counts = np.zeros_like(self.sets), np.zeros_like(self.counts)
        admissible_sets(self.rows, sets, counts)
        return _speeds(sets, counts)

    def speed_limit(self) -> Floats:
        """(N+1,) the top of the admissible region: above it no ``mu_dot`` keeps the limits (Lee1991 eq. 10)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a station without any admissible speed
            return np.asarray(np.nanmax(self.admissible[..., 1], axis=1))

    def advance(
        self, lam: float, mu: float, command: float, dt: float, *, mode: Mode = "speed"
    ) -> tuple[float, float, float]:
        """Move for ``dt`` [s] under a command in [0, 1]; returns ``lam``, ``mu`` and the time used (less on arrival).

        ``speed``: heads for ``command`` times ``mu*`` as fast as the torque limits allow, so 1 is the minimum-time
        motion and 0 is maximum braking. ``acceleration``: takes that share of the interval between the lowest and the
        highest admissible ``mu_dot``. From every state reached so, the end can be met at rest.
        """
        command = self._checked(command, lam, mu, dt)
        steps = self.edges.steps
        lam, mu, used = advance(
            steps, float(lam), float(mu), command, mode == "speed", float(dt), 1, NO_TICKS, NO_TICKS, 1.0
        )
        return float(lam), float(mu), float(used)

    @staticmethod
    def _checked(command: float, *state: float) -> float:
        """The command, clipped: beyond [0, 1] it would break the torque limits, and NaN would pass every comparison."""
        if not (math.isfinite(command) and all(math.isfinite(value) for value in state)):
            raise ActionError(
                f"command, lam, mu and time step must be finite, got {command}, {', '.join(map(str, state))}"
            )
        return min(max(float(command), 0.0), 1.0)

    def fastest(self, mu_start: float = 0.0) -> PhaseTrajectory:
        """The minimum-time motion from ``mu_start`` to ``mu_end``; solved once for each.

        Raises:
            InfeasibleError: ``mu_start`` is outside the controllable set (the message gives its ends), or the arm
                cannot move on from rest somewhere.
        """
        mu_start = number(mu_start, "mu_start")
        if mu_start not in self._fastest:
            self._fastest[mu_start] = self._solve(mu_start)
        return self._fastest[mu_start]

    @cached_property
    def _fastest(self) -> dict[float, PhaseTrajectory]:
        return {}

    def _solve(self, mu_start: float) -> PhaseTrajectory:
        spans = np.sqrt(self.sets[0, : self.counts[0]])
        if not any(low - 1e-9 <= mu_start <= high + 1e-9 for low, high in spans):
            inside = " or ".join(f"[{low:.6g}, {high:.6g}]" for low, high in spans)
            raise InfeasibleError(
                f"mu_start = {mu_start:.6g} is outside {inside}, from where the end can be met",
                remedy="start with a speed inside, or raise the limits",
                station=float(self.rows.station[0]),
            )
        nearest = min(spans.ravel(), key=lambda edge: abs(edge - mu_start))
        inside_one = any(low <= mu_start <= high for low, high in spans)
        x = self._greedy(float(mu_start if inside_one else nearest) ** 2)
        stuck = self._stuck(x)
        if len(stuck):
            raise self._explain_stuck(int(stuck[0]))
        return self._motion(x)

    def with_duration(self, duration: float, mu_start: float = 0.0) -> PhaseTrajectory:
        """The motion under one speed limit ``mu <= kappa`` that takes exactly ``duration`` [s].

        A start above that limit is braked down to it as hard as can be; where the arm cannot hold still it is as slow
        as it can. Where no such limit gives the duration (viscous friction can make the time jump), it brakes as hard
        as it can for a while, if need be to rest, waits where it can hold still (at the start, if it rests there and
        can), and goes on at full speed. Where dense sampling finds a limit exceeded by more than 0.1 % (friction is
        steep where an arm brakes to rest between stations), the motion is that of a grid refined there.

        Raises:
            InputError: ``duration`` is not finite.
            InfeasibleError: It is shorter than the minimum time, or longer than the slowest motion: the arm can stop
                nowhere. The message says which limit is to blame.
        """
        plane, motion = self, self._lasting(duration, mu_start)
        for _ in range(REFINEMENTS_MAX):
            above = motion.stations_above(LIMIT_EXCESS_MAX) if self.dynamics.arm is not None else ()
            if not len(above):
                break
            plane = PhasePlane(plane.dynamics.refined(above), self.mu_end)
            motion = plane._lasting(duration, mu_start)
        return motion

    def _lasting(self, duration: float, mu_start: float) -> PhaseTrajectory:
        """``with_duration`` on this grid."""
        fastest = self.fastest(mu_start)
        if not math.isfinite(number(duration, "duration")):
            raise InputError(f"the duration must be finite, got {duration}")
        if duration < fastest.duration * (1.0 - 1e-12):
            raise InfeasibleError(
                f"a duration of {duration:.6g} s is wanted, the minimum is {fastest.duration:.6g} s",
                remedy="allow more time, or raise the limits",
            )
        floor = self._slowest(float(fastest.mu[0]))
        motion = self._under_one_limit(duration, fastest, floor)
        left = duration - motion.duration
        if left <= 1e-9 * duration:
            return motion
        if mu_start == 0.0 and self.holdable[0]:
            return motion.delayed(left)
        for row in np.flatnonzero((floor[:-1] == 0.0) & self._still[:-1]):
            stop = self._braked(floor, int(row), 0.0)
            if stop is not None and stop.duration <= duration:
                return stop.waiting(int(row), duration - stop.duration)
        motion = self._braked_for_a_while(duration, fastest, floor)
        if duration - motion.duration <= 1e-9 * duration:
            return motion
        raise self._explain_slowest(duration, motion, floor)

    def _under_one_limit(self, duration: float, fastest: PhaseTrajectory, floor: Floats) -> PhaseTrajectory:
        """The slowest motion under one speed limit, or above it along ``floor``, that does not take too long."""
        if np.all(floor[:-1] + floor[1:] > 0.0):  # no limit makes it slower than that
            slowest = self._motion(floor)
            if slowest.duration <= duration:
                return slowest
        slow, quick = 0.0, float(fastest.mu.max(initial=0.0))  # kappa: too slow or impossible, fast enough
        motion = fastest
        for _ in range(200):
            if duration - motion.duration <= 1e-13 * duration or quick - slow <= 1e-15 * quick:
                break
            kappa = 0.5 * (slow + quick)
            if slow == 0.0:  # towards ever slower motions: the time grows about as 1 / kappa
                kappa = quick * min(0.9 * motion.duration / duration, 0.5)
            tried = self._capped(kappa, floor)
            if tried is not None and tried.duration <= duration:
                quick, motion = kappa, tried
            else:
                slow = kappa
        return motion

    def _capped(self, kappa: float, floor: Floats) -> PhaseTrajectory | None:
        """The fastest motion with ``mu <= kappa``, or where ``floor`` (N+1,) of ``mu^2`` is above that, along it."""
        cap = np.maximum(kappa**2, floor + np.where(floor > 0.0, FLOOR_SLACK * (floor + floor.max()), 0.0))
        rows = self.rows._replace(x_cap=np.minimum(self.rows.x_cap, cap))
        sets, counts = np.zeros_like(self.sets), np.zeros_like(self.counts)
        if controllable_sets(rows, self.mu_end**2, False, NO_PROFILE, sets, counts) >= 0:
            return None
        if not any(low <= floor[0] <= high for low, high in sets[0, : counts[0]]):
            return None
        x = np.empty(len(rows.station))
        if greedy_profile(rows, sets, counts, floor[0], False, x) >= 0:
            return None
        return None if self._stuck(x).size else self._motion(x)

    def _slowest(self, mu_start: float) -> Floats:
        """(N+1,) of ``mu^2``: the lowest motion, braking as hard as can be; at rest it stays so while it can."""
        x = np.empty(len(self.rows.station))
        failed = greedy_profile(self.rows, self.sets, self.counts, mu_start**2, True, x)
        if failed >= 0:
            raise self._explain_leaving("slowest", failed)
        return x

    def _braked(self, floor: Floats, row: int, x_row: float) -> PhaseTrajectory | None:
        """The motion along ``floor`` to the row before, ``x_row`` there, then as fast as can be; None: it cannot."""
        rows = Rows(*(column[row:] for column in self.rows))
        x = np.empty(len(rows.station))
        if greedy_profile(rows, self.sets[row:], self.counts[row:], x_row, False, x) >= 0:
            return None
        x = np.concatenate([floor[:row], x])
        return None if self._stuck(x).size else self._motion(x)

    def _braked_for_a_while(self, duration: float, fastest: PhaseTrajectory, floor: Floats) -> PhaseTrajectory:
        """The slowest motion that does not take too long of those that brake along ``floor``, then go full speed."""
        motion, row, beyond = fastest, 0, len(floor) - 1
        while beyond - row > 1:
            middle = (row + beyond) // 2
            tried = self._braked(floor, middle, float(floor[middle]))
            if tried is not None and tried.duration <= duration:
                motion, row = tried, middle
            else:
                beyond = middle
        quick, slow = float(motion.mu[beyond] ** 2), float(floor[beyond])
        for _ in range(60):
            middle_x = 0.5 * (quick + slow)
            tried = self._braked(floor, beyond, middle_x)
            if tried is not None and tried.duration <= duration:
                motion, quick = tried, middle_x
            else:
                slow = middle_x
        return motion

    def _motion(self, x: Floats) -> PhaseTrajectory:
        return PhaseTrajectory.from_profile(self.rows.station, np.sqrt(x), self.dynamics, mu_end=self.mu_end)

    def _stuck(self, x: Floats) -> Ints:
        """Rows from which a profile (N+1,) of ``mu^2`` does not get on."""
        return np.flatnonzero((x[:-1] + x[1:] <= 0.0) & (np.diff(self.rows.station) > 0.0))

    def _explain_slowest(self, duration: float, slowest: PhaseTrajectory, floor: Floats) -> InfeasibleError:
        """Why no motion takes so long."""
        wanted = f"a duration of {duration:.6g} s is wanted; the slowest motion takes {slowest.duration:.6g} s"
        if np.any(floor[:-1] + floor[1:] <= 0.0):
            return InfeasibleError(
                f"{wanted} before the time jumps, because viscous friction parts slow motions from fast ones",
                remedy="ask for less or much more time, or start more slowly",
            )
        lacking = np.maximum(self.rows.low, -self.rows.high)
        weak = np.flatnonzero(lacking.max(axis=1) > 0.0)
        reasons, remedies = [], [f"ask for {slowest.duration:.6g} s at most"]
        if floor[0] > 0.0 and not (len(weak) and weak[0] == 0):
            row, side = np.empty((2, len(floor) - 1), dtype=np.int64)
            active_rows(self.rows, floor, slowest.mu_dot, row, side)
            braking = row[(slowest.mu_dot < 0.0) & (row >= 0)]
            most = self.limit_name(int(np.bincount(braking).argmax())) if len(braking) else "no single limit"
            where = f"before station {self.rows.station[weak[0]]:.4g}" if len(weak) else "before the end"
            reasons.append(f"the arm, whose braking {most} limits, does not stop {where}")
            remedies.append("start more slowly, or raise that limit")
        if len(weak):
            worst = int(weak[lacking[weak].max(axis=1).argmax()])
            limit = int(lacking[worst].argmax())
            reasons.append(
                f"the arm cannot hold still everywhere: at station {self.rows.station[worst]:.4g} "
                f"{self.limit_name(limit)} is too small by {lacking[worst, limit]:.4g}"
            )
            remedies.append("raise that limit" if len(reasons) == 1 else "raise this one, too")
        return InfeasibleError(f"{wanted}, because {'; '.join(reasons)}", remedy=", or ".join(remedies))

    def _greedy(self, x_start: float) -> Floats:
        x = np.empty(len(self.rows.station))
        failed = greedy_profile(self.rows, self.sets, self.counts, x_start, False, x)
        if failed >= 0:
            raise self._explain_leaving("fastest", failed)
        return x

    def _explain_leaving(self, which: str, row: int) -> InfeasibleError:
        station = float(self.rows.station[row])
        return InfeasibleError(
            f"the {which} motion leaves the controllable set after station {station:.4g}: the grid is too coarse",
            remedy="use more intervals",
            station=station,
            row=row,
        )

    def braking(self, lam: float, mu: float) -> PhaseTrajectory:
        """Maximum braking from a state to rest (or to the end of the path)."""
        return self.motion([0.0], [np.inf], lam, mu)

    def motion(
        self, commands: ArrayLike, times: ArrayLike, lam: float = 0.0, mu: float = 0.0, *, mode: Mode = "speed",
        share: float = 1.0,
    ) -> PhaseTrajectory:  # fmt: skip
        """The motion under commands in [0, 1], each for its time [s], row by row; it ends on arrival or at rest.

        ``share``: of ``mu*``, that the arm takes for the largest speed.
        """
        commands, times = (np.atleast_1d(floats(v, name)) for v, name in ((commands, "commands"), (times, "times")))
        if commands.ndim != 1 or commands.shape != times.shape:
            raise InputError(
                f"{commands.shape} commands for {times.shape} times", remedy="give (K,) commands, and a time for each"
            )
        record = np.empty((8 * len(self.rows.station) + 64 * np.size(times), 3))
        pieces = [np.array([[0.0, lam, mu]])]
        clock = 0.0
        for command, dt in zip(commands, times, strict=True):
            step = min(float(dt), 1e3)
            command = self._checked(command, lam, mu, step)
            lam, mu, used, count = record_pieces(
                self.edges.steps, float(lam), float(mu), command, mode == "speed", step, record, share
            )
            if count:
                pieces.append(record[:count] + np.array([clock, 0.0, 0.0]))
            clock += used
            seen, place, _ = pieces[-1][-1]
            if lam != place or (
                np.isfinite(dt) and clock > seen
            ):  # the end, reached to rounding; or time spent at rest
                pieces.append(np.array([[clock, lam, mu]]))
            if lam >= self.length:
                break
        rows = np.concatenate(pieces)
        rows = np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows  # at rest, and staying there
        return PhaseTrajectory(
            lam=rows[:, 1], mu=rows[:, 2], time=rows[:, 0], dynamics=self.dynamics, mu_end=self.mu_end
        )

    def edge_speed(self, lam: float) -> float:
        """``mu*`` at one station, without NumPy's overhead."""
        return float(edge_speed(self.edges.steps, lam))


def _speeds(sets: Floats, counts: Ints) -> Floats:
    """Intervals of ``x`` as such of ``mu``, those that are not there as NaN."""
    there = np.arange(sets.shape[1]) < counts[:, None]
    return np.asarray(np.sqrt(np.where(there[..., None], sets, np.nan)))


def refined_plane(
    dynamics: PathDynamics, mu_end: float = 0.0, *, mu_start: float = 0.0, tick: float = 0.0
) -> PhasePlane:
    """The phase plane on a grid fine enough: dense sampling finds no limit exceeded by more than 0.1 %.

    Asked of the minimum-time motion and, with a ``tick`` [s], of full speed in ticks, which does not move from station
    to station. Where one is exceeded the grid is refined; bare arrays are taken as they are.

    Raises:
        InfeasibleError: No motion keeps the limits, or the limits change too fast for any grid.
    """
    if dynamics.arm is None:
        return PhasePlane(dynamics, mu_end)
    name = dynamics.arm.name
    for _ in range(REFINEMENTS_MAX):
        plane = PhasePlane(dynamics, mu_end)
        motions = [plane.fastest(mu_start)]
        if tick:
            ticks = int(1.5 * motions[0].duration / tick) + 2
            motions.append(plane.motion(np.ones(ticks), np.full(ticks, tick), mu=mu_start))
        stations = np.concatenate([motion.stations_above(LIMIT_EXCESS_MAX) for motion in motions])
        if not len(stations):
            return plane
        dynamics = dynamics.refined(stations)
    worst = max((motion.certificate for motion in motions), key=lambda certificate: certificate.excess)
    raise InfeasibleError(
        f"limits of arm {name!r} change too fast near station {stations[0]:.4g}: exceeded by "
        f"{100.0 * worst.excess:.2g} % even with {len(plane.dynamics.grid)} stations",
        remedy="keep the path away from the limits of the arm's reach",
        station=float(stations[0]),
        joint=worst.worst_joint,
    )
