"""Compiled: where the tip of an arm is, and how far it is from a blended path."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies import joint_torques, tip_of
from armtempo.planners.blends.kernels import PackedPath, blended_point
from armtempo.robots import ArmModel, njit


@njit
def nearest_station(path: PackedPath, near: float, tip: Floats) -> tuple[float, float]:
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
def measure_tip(model: ArmModel, path: PackedPath, q: Floats, near: float, tip: Floats) -> tuple[float, float]:
    """Write the tip (3,) at ``q`` (n,); its station, looked for from ``near``, and its distance from the path [m]."""
    tip[0], tip[1], tip[2] = tip_of(model, q)
    return nearest_station(path, near, tip)


@njit
def follow_ideal(
    model: ArmModel,
    path: PackedPath,
    joints: Floats,
    reference: Floats,
    coulomb: Floats,
    torque_max: Floats,
    gain: float,
    tick: float,
    near: float,
    allowed: float,
    tip: Floats,
    rows: Floats,
) -> int:
    """Ticks of an arm that is always on its reference ``joints`` (K, n), up to the first out of the tube; their number.

    ``reference`` (3, n): before, now, next; shifted here. ``tip`` (3,): where it was. ``near``: about where the first
    tick ends [m]. ``rows`` (K, 7 + 3 n): station, contour error, speeds of the tip point to point and along the path,
    tip, joint positions, torques applied and asked for.
    """
    ticks, n = joints.shape
    demand, torque, qd = np.empty(n), np.empty(n), np.empty(n)
    station, last = near, 0.0
    for k in range(ticks):
        for j in range(n):
            qd[j] = (reference[2, j] - reference[1, j]) / tick
            reference[0, j], reference[1, j], reference[2, j] = reference[1, j], reference[2, j], joints[k, j]
        joint_torques(
            model, reference[0], reference[1], reference[2], reference[1], qd, coulomb, torque_max, gain, tick,
            demand, torque,
        )  # fmt: skip
        x, y, z = tip[0], tip[1], tip[2]
        station, error = measure_tip(model, path, joints[k], station + last, tip)
        row = rows[k]
        row[0], row[1] = station, error
        row[2] = np.sqrt((tip[0] - x) ** 2 + (tip[1] - y) ** 2 + (tip[2] - z) ** 2) / tick
        last = station - rows[k - 1, 0] if k else 0.0
        row[3] = last / tick
        row[4:7] = tip
        row[7 : 7 + n], row[7 + n : 7 + 2 * n], row[7 + 2 * n :] = joints[k], torque, demand
        if not error <= allowed:
            return k + 1
    return int(ticks)
