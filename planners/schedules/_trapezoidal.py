"""The motion that needs no plan: constant acceleration at either end of a path, constant speed between."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.topp import PhasePlane, PhaseTrajectory


def trapezoidal(plane: PhasePlane, ramp: float) -> PhaseTrajectory:
    """Constant acceleration over a share ``ramp`` of the path at either end, constant speed between, all at the limits.

    Likewise on every part of a path with stops; dwells take their time.
    """
    path = plane.dynamics.path
    stops, standing = (np.empty(0), ()) if path is None else (path.stops, path.standing)
    still = {part.start for part in standing}
    runs = [
        _as_fast_as_can_be(plane, start, stop) if start in still else _ramped(plane, start, stop, ramp)
        for start, stop in pairwise([0.0, *stops, plane.length])
    ]
    profile, x = (np.concatenate(column) for column in zip(*runs, strict=True))
    return PhaseTrajectory.from_profile(profile, np.sqrt(x), plane.dynamics)


def _as_fast_as_can_be(plane: PhasePlane, start: float, stop: float) -> tuple[Floats, Floats]:
    """Stations (K,) and ``mu^2`` there of the fastest motion."""
    fastest = plane.fastest()
    at = (start <= fastest.lam) & (fastest.lam <= stop)
    return fastest.lam[at], fastest.mu[at] ** 2


def _ramped(plane: PhasePlane, start: float, stop: float, ramp: float) -> tuple[Floats, Floats]:
    """Stations (K,) and ``mu^2`` there of a motion with ramps.

    ``mu^2 = 2 a way`` with ``way`` the distance into the ramp, so every torque is a quadratic in ``sqrt(a)``: the
    largest ``a`` is where the first of them meets a limit.
    """
    rows, length = plane.rows, stop - start
    own = rows.station[(start <= rows.station) & (rows.station <= stop)]
    profile = np.union1d(own, [start + ramp * length, stop - ramp * length])
    jumps = own[1:][np.diff(own) == 0.0]
    station = np.union1d(profile, jumps[jumps > start] - 1e-9 * length)  # coefficients before a jump count too
    if stop < plane.length:
        station = station[station < stop]  # those at a stop are of what follows
    way = np.minimum(np.minimum(station - start, stop - station), ramp * length)
    M, Q, R, S = plane.dynamics.evaluate(station)
    limits = (plane.dynamics.torque_min, plane.dynamics.torque_max)
    low, high = (np.stack([np.interp(station, rows.station, column) for column in limit.T], -1) - S for limit in limits)
    if (low > 0.0).any() or (high < 0.0).any():
        raise InfeasibleError(
            "an arm that cannot hold still cannot move with constant acceleration", remedy="use another method"
        )
    on = way > 0.0
    largest = float(np.min(np.interp(station, rows.station, rows.x_cap)[on] / np.maximum(2.0 * way[on], 1e-12)))
    rising, falling = station <= start + ramp * length, station >= stop - ramp * length
    for sign, piece in ((1.0, rising), (0.0, way >= ramp * length), (-1.0, falling)):
        square = sign * M[piece] + 2.0 * Q[piece] * way[piece, None]  # torque per unit of acceleration
        linear = R[piece] * np.sqrt(2.0 * way[piece, None])
        for limit in (low[piece], high[piece]):
            largest = min(largest, float(_first_root(square, linear, limit).min(initial=np.inf)) ** 2)
    way = np.minimum(np.minimum(profile - start, stop - profile), ramp * length)
    return profile, 2.0 * largest * np.maximum(way, 0.0)


def _first_root(square: Floats, linear: Floats, value: Floats) -> Floats:
    """The smallest positive ``s`` with ``square s^2 + linear s = value``; infinite where there is none."""
    under = linear**2 + 4.0 * square * value
    with np.errstate(divide="ignore", invalid="ignore"):
        half = -0.5 * (linear + np.copysign(np.sqrt(np.maximum(under, 0.0)), linear))
        roots = np.stack([half / square, -value / half])
    first: Floats = np.where((under >= 0.0) & (roots > 0.0), roots, np.inf).min(axis=0)
    return first
