r"""Schedules: when every arm of a cell is where on its path, by method, with a certified lower bound and a certificate.

``sequential``             one arm after the other, each in minimum time
``constant-speed``         constant acceleration over a quarter of the path at either end, constant speed between,
start delayed
``constant-acceleration``  constant acceleration over half the path and constant deceleration over the other, start
delayed
``delay``                  minimum time, start delayed ("method 1" of Lee1991 section 2.4)
``vci``                    velocity control intervals ("method 3", the paper's own)
``offset``                 minimum time, started at the first instant from which it runs through without a conflict
``interval``               minimum time for the first arm; the others shape their motions round those before them
``optimal``                the best plan found with all arms free to yield, in any order
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.planners.cells import CoordinationCell, as_cell
from armtempo.planners.coordination import (
    Precedence,
    VciPlan,
    delayed,
    offset,
    one_by_one,
    optimal,
    plan_vci,
    prioritised,
)
from armtempo.planners.topp import LIMIT_EXCESS_MAX, PhasePlane, PhaseTrajectory

AUDIT_PERIOD = 0.0002  # [s] between FCL distances in a certificate


@dataclass(frozen=True, kw_only=True, slots=True)
class ScheduleCertificate:
    """What a schedule asks of arms and space, computed apart from its planner.

    Attributes:
        torque_ratio_max: Largest |torque| / limit, sampled ten times per interval from the robot model.
        speed_ratio_max: Largest mu / speed limit.
        min_clearance: Smallest FCL distance between two arms [m], every 0.2 ms; infinite for one arm.
        certified_free: Whether the motion stays in cells of the chart that are certified free, between samples too.
        end_error: Largest distance of an arm's last row from the end of its path [lambda].
    """

    torque_ratio_max: float
    speed_ratio_max: float
    min_clearance: float
    certified_free: bool
    end_error: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Schedule:
    """One motion per arm, on a common clock.

    Attributes:
        method: The planner's name.
        cell: What was planned for.
        trajectories: One per arm, in the cell's order; each ends when its arm arrives.
        order: Arms by priority: in the order in which they pass, or, where each passes first somewhere, arrive.
        vci: What velocity control of the last arm in ``order`` did, where it was asked.
        fallback: The method that planned instead of the one asked for, where that found no way.
        fallback_reason: Why it did.
    """

    method: str
    cell: CoordinationCell
    trajectories: tuple[PhaseTrajectory, ...]
    order: tuple[int, ...]
    vci: VciPlan | None = None
    fallback: str | None = None
    fallback_reason: str = ""

    @property
    def makespan(self) -> float:
        """Time at which the last arm arrives [s]."""
        return max(trajectory.duration for trajectory in self.trajectories)

    @property
    def lower_bound(self) -> float:
        """Certified lower bound on the makespan of any timing of this cell [s]."""
        return self.cell.lower_bound

    @property
    def gap_percent(self) -> float:
        """(makespan - lower bound) / lower bound, in percent."""
        return 100.0 * (self.makespan / self.lower_bound - 1.0)

    @cached_property
    def precedence(self) -> Precedence:
        """What it decides about who passes first.

        Raises:
            InfeasibleError: It leads two arms through a cell of their chart that is not free.
        """
        pairs = combinations(range(len(self.trajectories)), 2)
        charts = {(i, j): self.cell.chart_between(i, j) for i, j in pairs}
        return Precedence.of_motions(self.trajectories, charts)

    @cached_property
    def certificate(self) -> ScheduleCertificate:
        """Worst ratios, smallest clearance and end error, computed apart from the planner."""
        motions = [trajectory.certificate for trajectory in self.trajectories]
        return ScheduleCertificate(
            torque_ratio_max=max(motion.torque_ratio_max for motion in motions),
            speed_ratio_max=max(motion.speed_ratio_max for motion in motions),
            min_clearance=self._audit_clearance(),
            certified_free=self._certify_free(),
            end_error=max(motion.end_error for motion in motions),
        )

    def _audit_clearance(self) -> float:
        if len(self.trajectories) < 2:
            return float("inf")
        instants = np.append(np.arange(0.0, self.makespan, AUDIT_PERIOD), self.makespan)
        joints = [
            path.evaluate(trajectory.at(np.minimum(instants, trajectory.duration))[0])[0]
            for path, trajectory in zip(self.cell.paths, self.trajectories, strict=True)
        ]
        nearest = np.inf
        for q in zip(*joints, strict=True):
            nearest = min(nearest, self.cell.clearance.arms(q, cutoff=nearest).distance)
        return float(nearest)

    def _certify_free(self) -> bool:
        """Cover the motion with boxes of the charts that are free, splitting those that are not until they are tiny."""
        return all(self._certify_pair(i, j) for i, j in combinations(range(len(self.trajectories)), 2))

    def _certify_pair(self, i: int, j: int) -> bool:
        chart = self.cell.chart_between(i, j)
        sides = ((self.trajectories[i], chart.length_a), (self.trajectories[j], chart.length_b))

        def covered(start: float, stop: float, depth: int) -> bool:
            boxes = []
            for trajectory, length in sides:
                low, high = trajectory.at(np.minimum([start, stop], trajectory.duration))[0]
                boxes.append((min(float(low), length), min(float(high), length)))
            if chart.is_free(boxes[0], boxes[1]):
                return True
            if depth == 0:
                return False
            middle = 0.5 * (start + stop)
            return covered(start, middle, depth - 1) and covered(middle, stop, depth - 1)

        return covered(0.0, self.makespan, 24)


def _sequential(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    motions, order = one_by_one(cell.timing, order)
    return Schedule(method="sequential", cell=cell, trajectories=motions, order=order)


def _delay(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    motions = delayed(cell.timing, cell.fastest, order)
    return Schedule(method="delay", cell=cell, trajectories=motions, order=order)


def _offset(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return Schedule(method="offset", cell=cell, trajectories=offset(cell.timing, order), order=order)


def _interval(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return Schedule(method="interval", cell=cell, trajectories=prioritised(cell.timing, order), order=order)


def _optimal(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    motions, found = optimal(cell.timing)
    return Schedule(method="optimal", cell=cell, trajectories=motions, order=found)


def _constant_speed(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return _trapezoidal(cell, order, "constant-speed")


def _constant_acceleration(cell: CoordinationCell, order: tuple[int, ...]) -> Schedule:
    return _trapezoidal(cell, order, "constant-acceleration")


_RAMPS = {"constant-speed": 0.25, "constant-acceleration": 0.5}


def _trapezoidal(cell: CoordinationCell, order: tuple[int, ...], method: str) -> Schedule:
    motions = delayed(cell.timing, tuple(_trapezoid(plane, _RAMPS[method]) for plane in cell.planes), order)
    return Schedule(method=method, cell=cell, trajectories=motions, order=order)


def _trapezoid(plane: PhasePlane, ramp: float) -> PhaseTrajectory:
    """Constant acceleration over a share ``ramp`` of the path at either end, constant speed between, all at the limits.

    ``mu^2 = 2 a way`` with ``way`` the distance into the ramp, so every torque is a quadratic in ``sqrt(a)``: the
    largest ``a`` is where the first of them meets a limit.
    """
    rows, length = plane.rows, plane.length
    profile = np.union1d(rows.station, [ramp * length, (1.0 - ramp) * length])
    jumps = rows.station[1:][np.diff(rows.station) == 0.0]
    station = np.union1d(profile, jumps - 1e-9 * length)  # coefficients before a jump count too
    way = np.minimum(np.minimum(station, length - station), ramp * length)
    M, Q, R, S = plane.dynamics.evaluate(station)
    limits = (plane.dynamics.torque_min, plane.dynamics.torque_max)
    low, high = (np.stack([np.interp(station, rows.station, column) for column in limit.T], -1) - S for limit in limits)
    if (low > 0.0).any() or (high < 0.0).any():
        raise InfeasibleError(
            "an arm that cannot hold still cannot move with constant acceleration", remedy="use another method"
        )
    largest = float(np.min(np.interp(station, rows.station, rows.x_cap) / np.maximum(2.0 * way, 1e-12)))
    pieces = ((1.0, station <= ramp * length), (0.0, way >= ramp * length), (-1.0, station >= (1.0 - ramp) * length))
    for sign, piece in pieces:
        square = sign * M[piece] + 2.0 * Q[piece] * way[piece, None]  # torque per unit of acceleration
        linear = R[piece] * np.sqrt(2.0 * way[piece, None])
        for limit in (low[piece], high[piece]):
            largest = min(largest, float(_first_root(square, linear, limit).min()) ** 2)
    way = np.minimum(np.minimum(profile, length - profile), ramp * length)
    return PhaseTrajectory.from_profile(profile, np.sqrt(2.0 * largest * way), plane.dynamics)


def _first_root(square: Floats, linear: Floats, value: Floats) -> Floats:
    """The smallest positive ``s`` with ``square s^2 + linear s = value``; infinite where there is none."""
    under = linear**2 + 4.0 * square * value
    with np.errstate(divide="ignore", invalid="ignore"):
        half = -0.5 * (linear + np.copysign(np.sqrt(np.maximum(under, 0.0)), linear))
        roots = np.stack([half / square, -value / half])
    first: Floats = np.where((under >= 0.0) & (roots > 0.0), roots, np.inf).min(axis=0)
    return first


def _vci(cell: CoordinationCell, order: tuple[int, ...], period: float) -> Schedule:
    try:
        motions, plans = plan_vci(cell.planes, cell.chart_between, order, period)
        if not cell.timing.is_free(motions):
            raise InfeasibleError(f"velocity control's motions in {cell.name!r} are not certified free")
        # its commands are not searched on the grid that the limits were refined for
        if any(motion.certificate.excess > LIMIT_EXCESS_MAX for motion in motions):
            raise InfeasibleError("velocity control's motions exceed a limit between stations", reason="grid")
    except InfeasibleError as refusal:
        try:  # the slave may not be able to stay behind everywhere, and yet have a way
            shaped = prioritised(cell.timing, order)
        except InfeasibleError:
            raise refusal from None
        return Schedule(
            method="vci",
            cell=cell,
            trajectories=shaped,
            order=order,
            fallback="interval",
            fallback_reason=refusal.message,
        )
    return Schedule(method="vci", cell=cell, trajectories=motions, order=order, vci=plans[order[-1]])


_PLANNERS: dict[str, Callable[..., Schedule]] = {  # in the order in which tables show them
    "sequential": _sequential,
    "constant-speed": _constant_speed,
    "constant-acceleration": _constant_acceleration,
    "delay": _delay,
    "vci": _vci,
    "offset": _offset,
    "interval": _interval,
    "optimal": _optimal,
}
METHODS = tuple(_PLANNERS)


def schedule(
    cell: CoordinationCell | str | Path, method: str, *, order: Sequence[int] | None = None, period: float | None = None
) -> Schedule:
    """Plan when every arm of a cell moves.

    Args:
        cell: Arms on their paths, the first with priority; or a bundled name or file to build it from.
        method: One of ``METHODS``.
        order: Arms by priority, the first never yields (default: as in the cell); ``sequential`` keeps to it where that
            is safe, ``optimal`` does without it.
        period: Step of ``vci`` [s] (default: the cell's control period).

    Raises:
        UnknownNameError: No such method.
        InputError: ``order`` does not name every arm once, or ``period`` is no period or is given to another method.
        CollisionError: The arms are too close where they start or where they end.
        InfeasibleError: The method has no solution here; the message says why, and what to try. That of ``optimal``
            has as its ``reason`` ``certified infeasible``, ``undecided`` or ``not holdable``.
    """
    cell = as_cell(cell, CoordinationCell)
    if method not in _PLANNERS:
        raise UnknownNameError("method", method, METHODS)
    if period is not None and method != "vci":
        raise InputError(f"method {method!r} has no period: it is that of 'vci'")
    arms = tuple(range(len(cell.arms)))
    chosen = arms if order is None else tuple(order)
    if tuple(sorted(chosen)) != arms:
        raise InputError(f"order {chosen} must name each of the {len(arms)} arms once, by its index")
    if len(arms) == 1:
        if method in _RAMPS:
            return _trapezoidal(cell, (0,), method)
        return Schedule(method=method, cell=cell, trajectories=cell.fastest, order=(0,))
    cell.check_ends()
    if method == "vci":
        return _vci(cell, chosen, cell.control_period if period is None else period)
    return _PLANNERS[method](cell, chosen)
