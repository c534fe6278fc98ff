r"""Joint paths through waypoints: one cubic per piece, ``f``, ``f'`` and ``f''`` continuous.

``lambda`` is measured in joint space [rad] (prismatic joints count their metres): between two waypoints it grows by
their distance ``|q_b - q_a|`` (chord length; Ahlberg, Nilson, Walsh 1967), so that ``|f'|`` stays near 1 whatever the
spacing. ``centripetal`` takes the square roots of the distances instead (Lee 1989), which swings out less at sharp
corners between unequal pieces; the whole is scaled to the same length.

Nothing is sampled where it matters: ``f'`` is a parabola on each piece and ``f''`` a line, so extremes of the
positions and of ``|f'|`` are roots of polynomials of degree two and one.
"""

from __future__ import annotations

from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PPoly

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError, brief
from armtempo.planners.geometry import RangeMax, floats
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.robots import Arm, njit

Ends = Literal["natural", "not-a-knot"]
Spacing = Literal["chord", "centripetal"]

BOUND_ROUNDING = 1e-12  # share by which bounds are widened
POSITION_MAX = 1e6  # rad or m
POSITION_TOLERANCE = 1e-9  # rad or m
WAYPOINT_DISTANCE_MIN = 1e-9  # waypoints nearer than this [rad] are the same


@njit
def _evaluate(knots: Floats, c: Floats, lam: Floats, q: Floats, dq: Floats, ddq: Floats) -> None:
    """Cubics c (4, K - 1, n), highest power first, and their derivatives at lam (N,), each into (N, n)."""
    for k in range(lam.shape[0]):
        i = min(max(np.searchsorted(knots, lam[k], side="right") - 1, 0), knots.shape[0] - 2)
        x = lam[k] - knots[i]
        for j in range(q.shape[1]):
            c3, c2, c1, c0 = c[0, i, j], c[1, i, j], c[2, i, j], c[3, i, j]
            q[k, j] = ((c3 * x + c2) * x + c1) * x + c0
            dq[k, j] = (3.0 * c3 * x + 2.0 * c2) * x + c1
            ddq[k, j] = 6.0 * c3 * x + 2.0 * c2


@final
class WaypointPath(AbstractJointPath):
    """A C2 cubic spline through joint positions. Usually made by ``JointPath.through``.

    Args:
        waypoints: (K, n) joint positions [rad or m], K >= 2.
        arm: Whose path it is; its number of joints and position limits are checked. None: no check.
        ends: ``natural``: no curvature at the ends, the least swing; ``not-a-knot``: as scipy and toppra have it.
        spacing: How lambda is spread over the pieces: ``chord`` or ``centripetal``.

    Raises:
        InputError: Wrong shape, NaN, fewer than 2 waypoints, an unknown option.
        PathError: A repeated waypoint, or positions outside the arm's limits anywhere on the spline; ``data`` has
            ``joint``, ``station``, ``value``, ``limit``.
    """

    unit = "rad"

    def __init__(
        self, waypoints: ArrayLike, *, arm: Arm | None = None, ends: Ends = "natural", spacing: Spacing = "chord"
    ) -> None:
        points = _checked(waypoints, arm)
        for name, value, known in (
            ("ends", ends, ("natural", "not-a-knot")),
            ("spacing", spacing, ("chord", "centripetal")),
        ):
            if value not in known:
                raise InputError(f"{name} is {brief(value)}", remedy=f"give {' or '.join(known)}")
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if steps.min() < max(WAYPOINT_DISTANCE_MIN, 4.0 * np.spacing(steps.sum())):
            k = int(np.argmin(steps))
            raise PathError(
                f"waypoints {k} and {k + 1} are the same: {_listed(points[k])}",
                remedy="remove one: a path cannot stand still, waiting is the schedule's business",
                waypoint=k,
            )
        total = steps.sum()
        if spacing == "centripetal":
            steps = np.sqrt(steps)
        knots = np.concatenate([[0.0], np.cumsum(steps)]) * (total / steps.sum())
        knots[-1] = total
        self.length = float(total)
        self.dof = points.shape[1]
        self.breakpoints = knots
        self.waypoints = points
        for array in (points, knots):
            array.setflags(write=False)
        # Two points are a line for either kind of end.
        self._position: PPoly = CubicSpline(knots, points, bc_type=ends if len(points) > 2 else "natural")
        self._speed = self._position.derivative()
        self._bend = self._position.derivative(2)
        if arm is not None:
            self._check_positions(arm)
        self._peaks = [self._peaks_of(joint) for joint in range(self.dof)]

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``f``, ``f'``, ``f''`` at ``lam``, each (..., n); all are continuous, so ``before`` changes nothing."""
        stations = np.array(lam, dtype=np.float64)
        q, dq, ddq = np.empty((3, stations.size, self.dof))
        _evaluate(self.breakpoints, self._position.c, stations.reshape(-1), q, dq, ddq)
        shape = (*stations.shape, self.dof)
        return q.reshape(shape), dq.reshape(shape), ddq.reshape(shape)

    def third(self, lam: ArrayLike, *, before: bool = False) -> Floats:
        """``f'''`` (..., n), constant on each piece."""
        piece = np.searchsorted(self.breakpoints, np.asarray(lam), side="left" if before else "right") - 1
        third: Floats = 6.0 * self._position.c[0][np.clip(piece, 0, len(self.breakpoints) - 2)]
        return third

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """The largest ``|f'|`` over [low, high], (..., n): at an end, at a knot, or where ``f''`` vanishes."""
        low, high = np.broadcast_arrays(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))
        bound: Floats = np.maximum(np.abs(self._speed(low)), np.abs(self._speed(high)))
        for joint, (station, largest) in enumerate(self._peaks):
            first = np.searchsorted(station, low, side="left")
            count = np.searchsorted(station, high, side="right") - first
            inside = count > 0
            most = largest.over(np.where(inside, first, 0), np.where(inside, first + count - 1, 0))[..., 0]
            bound[..., joint] = np.maximum(bound[..., joint], np.where(inside, most, 0.0))
        return bound * (1.0 + BOUND_ROUNDING) + BOUND_ROUNDING

    def _peaks_of(self, joint: int) -> tuple[Floats, RangeMax]:
        """Stations where ``|f'|`` of a joint may peak, and how high."""
        station = np.union1d(self.breakpoints, _zeros(self._bend, joint))
        return station, RangeMax(np.abs(self._speed(station)[:, joint, None]))

    def _check_positions(self, arm: Arm) -> None:
        for joint in range(self.dof):
            station = np.union1d(self.breakpoints, _zeros(self._speed, joint))
            q = self._position(station)[:, joint]
            for limit, beyond in (
                (arm.position_min[joint], arm.position_min[joint] - q),
                (arm.position_max[joint], q - arm.position_max[joint]),
            ):
                k = int(np.argmax(beyond))
                if beyond[k] <= POSITION_TOLERANCE:
                    continue
                knot = bool(np.isin(station[k], self.breakpoints))
                where = "at a waypoint" if knot else "between two waypoints, where the spline swings out"
                raise PathError(
                    f"path of arm {arm.name!r}: joint {arm.joint_names[joint]!r} reaches {q[k]:.6g} at station "
                    f"{station[k]:.4g} {self.unit}, {where}; its limit is {limit:.6g}",
                    remedy="move the waypoint" if knot else "add a waypoint there, or move its neighbours inwards",
                    arm=arm.name,
                    joint=joint,
                    station=float(station[k]),
                    value=float(q[k]),
                    limit=float(limit),
                )


def _checked(waypoints: ArrayLike, arm: Arm | None) -> Floats:
    try:
        if np.asarray(waypoints).dtype.kind not in "iuf":
            raise InputError("no numbers")
        points = floats(waypoints, "waypoints", np.inf)
    except (InputError, ValueError):
        raise InputError("waypoints are no table of numbers", remedy="give (K, n): one row per waypoint") from None
    if points.ndim != 2 or points.shape[1] < 1:
        raise InputError(f"waypoints have shape {points.shape}", remedy="give (K, n): one row per waypoint")
    if arm is not None and points.shape[1] != arm.dof:
        raise InputError(
            f"waypoints have {points.shape[1]} joint positions each, arm {arm.name!r} has {arm.dof} joints",
            remedy=f"give one per joint: {', '.join(arm.joint_names)}",
        )
    if len(points) < 2:
        raise InputError(f"a path needs at least 2 waypoints, got {len(points)}", remedy="add its end")
    good = np.abs(points) <= POSITION_MAX
    if not good.all():
        k, joint = (int(v) for v in np.argwhere(~good)[0])
        what = f"beyond {POSITION_MAX:g}" if np.isfinite(points[k, joint]) else "not finite"
        raise InputError(f"waypoint {k} is {what} at joint {joint}", remedy="give finite numbers", waypoint=k)
    return points


def _zeros(polynomials: PPoly, joint: int) -> Floats:
    """Stations where one joint's parabolas or lines vanish; none from pieces that vanish everywhere."""
    one = PPoly(polynomials.c[:, :, joint], polynomials.x)
    roots = np.asarray(one.roots(extrapolate=False), dtype=np.float64)
    found: Floats = roots[np.isfinite(roots)]
    return found


def _listed(q: Floats) -> str:
    return ", ".join(f"{value:.4g}" for value in q)
