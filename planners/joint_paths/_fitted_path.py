"""Joint paths near recorded positions: few quintics that join C4, within a tolerance certified between points, too.

``lambda`` is the length of the chords between the recorded points in joint space [rad]. Bounds of ``|f'|`` are
Bernstein coefficients: those of an eighth of a piece lie close to the curve, and none lies below it.
"""

from __future__ import annotations

import math
from typing import final

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners.geometry import FIT_DEGREE, RangeMax, checked_tolerance, floats, smooth_fit
from armtempo.planners.joint_paths._joint_path import AbstractJointPath
from armtempo.robots import Arm

PARTS = 8  # of a piece, each with bounds of its own
BOUND_ROUNDING = 1e-12  # share by which bounds are widened
POSITION_TOLERANCE = 1e-9  # rad or m


@final
class FittedPath(AbstractJointPath):
    """A C4 spline near joint positions. Usually made by ``JointPath.fit``.

    Args:
        points: (N, n) joint positions [rad or m], N >= 2; the first and the last are kept.
        tolerance: The most that the path leaves the chords of the points by, as a vector [rad].
        arm: Whose path it is; its number of joints and position limits are checked. None: no check.

    Attributes:
        deviation: How far it leaves them, at most [rad].

    Raises:
        InputError: Wrong shape, NaN, fewer than 2 points, a tolerance that is not positive.
        PathError: All points are the same; positions outside the arm's limits anywhere on the spline.
    """

    unit = "rad"
    deviation: float

    def __init__(self, points: ArrayLike, tolerance: float, *, arm: Arm | None = None) -> None:
        recorded = floats(points, "points")
        if recorded.ndim != 2 or len(recorded) < 2 or recorded.shape[1] < 1 or not np.isfinite(recorded).all():
            raise InputError(f"points must be (N, n), N >= 2, and finite, got shape {recorded.shape}")
        if arm is not None and recorded.shape[1] != arm.dof:
            raise InputError(
                f"points have {recorded.shape[1]} joint positions each, arm {arm.name!r} has {arm.dof} joints",
                remedy=f"give one per joint: {', '.join(arm.joint_names)}",
            )
        found = smooth_fit(recorded, checked_tolerance(tolerance))
        self.length, self.dof = float(found.knots[-1]), recorded.shape[1]
        self.breakpoints, self.deviation = found.knots, found.deviation
        self.breakpoints.setflags(write=False)
        falling = np.ascontiguousarray(np.moveaxis(found.coefficients, 1, 0)[::-1])
        self._derivatives = [PPoly(falling, found.knots)]
        for _ in range(FIT_DEGREE):
            self._derivatives.append(self._derivatives[-1].derivative())
        shares = np.arange(PARTS) / PARTS
        parts = self.breakpoints[:-1, None] + np.diff(self.breakpoints)[:, None] * shares
        self._parts = np.append(parts, self.length)
        self._fastest = RangeMax(self._part_bounds())
        if arm is not None:
            self._check_positions(arm)

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``f``, ``f'``, ``f''`` at ``lam``, each (..., n); all are continuous, so ``before`` changes nothing."""
        stations = np.array(lam, dtype=np.float64)
        q, dq, ddq = (np.asarray(of(stations)) for of in self._derivatives[:3])
        return q, dq, ddq

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Bounds of ``|f'|`` over [low, high], (..., n): those of the parts of pieces that it touches."""
        low, high = np.broadcast_arrays(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))
        last = len(self._parts) - 2
        first = np.clip(np.searchsorted(self._parts, low, side="right") - 1, 0, last)
        end = np.clip(np.searchsorted(self._parts, high, side="left") - 1, first, last)
        return np.asarray(self._fastest.over(first, end))

    def _part_bounds(self) -> Floats:
        """(P, n) largest Bernstein coefficients of ``f'``, a polynomial of degree 4, over every part of a piece."""
        degree = FIT_DEGREE - 1
        start, size = self._parts[:-1], np.diff(self._parts)[:, None]
        rising = [self._derivatives[k + 1](start) * size**k / math.factorial(k) for k in range(degree)]
        middle = start + 0.5 * size[:, 0]
        rising.append(self._derivatives[FIT_DEGREE](middle) * size**degree / math.factorial(degree))
        bernstein = [
            sum(math.comb(j, k) / math.comb(degree, k) * rising[k] for k in range(j + 1)) for j in range(degree + 1)
        ]
        most = np.abs(np.stack(bernstein)).max(axis=0)
        return np.asarray(most * (1.0 + BOUND_ROUNDING) + BOUND_ROUNDING)

    def _check_positions(self, arm: Arm) -> None:
        slopes = self._derivatives[1]
        for joint in range(self.dof):
            turns = np.asarray(PPoly(slopes.c[:, :, joint], slopes.x).roots(extrapolate=False), dtype=np.float64)
            station = np.union1d(self._parts, turns[np.isfinite(turns)])
            q = self._derivatives[0](station)[:, joint]
            beyond = np.maximum(arm.position_min[joint] - q, q - arm.position_max[joint])
            k = int(np.argmax(beyond))
            if beyond[k] > POSITION_TOLERANCE:
                limit = arm.position_min[joint] if q[k] < arm.position_min[joint] else arm.position_max[joint]
                raise PathError(
                    f"path of arm {arm.name!r}: joint {arm.joint_names[joint]!r} reaches {q[k]:.6g} at station "
                    f"{station[k]:.4g} {self.unit}; its limit is {limit:.6g}",
                    remedy="keep the points off the limit by more than the tolerance",
                    arm=arm.name,
                    joint=joint,
                    station=float(station[k]),
                    value=float(q[k]),
                    limit=float(limit),
                )
