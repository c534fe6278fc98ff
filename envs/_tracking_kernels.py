"""Compiled: where the tip of an arm is, and how far it is from a blended path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armtempo.envs._kernels import tip_of
from armtempo.planners import PackedPath, blended_point
from armtempo.robots import ArmModel, njit

Array = NDArray[np.float64]


@njit
def nearest_station(path: PackedPath, near: float, tip: Array) -> tuple[float, float]:
    """The station of the path nearest to ``tip`` (3,), looked for from the station ``near``, and its distance [m]."""
    at = np.empty((4, 3))
    length = path.breakpoints[-1]
    s = near
    for _ in range(20):  # Newton on the foot of the perpendicular
        blended_point(path, s, at)
        along, bend = 0.0, 1.0
        for k in range(3):
            e = tip[k] - at[0, k]
            along += e * at[1, k]
            bend -= e * at[2, k]
        after = min(max(s + along / max(bend, 0.5), 0.0), length)
        step = abs(after - s)
        s = after
        if step < 1e-13:
            break
    blended_point(path, s, at)
    off = 0.0
    for k in range(3):
        off += (tip[k] - at[0, k]) ** 2
    return s, np.sqrt(off)


@njit
def measure_tip(model: ArmModel, path: PackedPath, q: Array, near: float, tip: Array) -> tuple[float, float]:
    """Write the tip (3,) at ``q`` (n,); its station, looked for from ``near``, and its distance from the path [m]."""
    tip[0], tip[1], tip[2] = tip_of(model, q)
    return nearest_station(path, near, tip)
