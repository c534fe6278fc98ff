"""The motion that needs no plan: constant acceleration at either end of a path, constant speed between."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.topp import PhasePlane, PhaseTrajectory


def trapezoidal(plane: PhasePlane, ramp: float) -> PhaseTrajectory:
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
