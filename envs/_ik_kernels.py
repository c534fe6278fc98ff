"""Compiled: joint speeds within all limits of a joint, and how far a tip is from a pose."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from armtempo.robots import ArmModel, kernels, njit

Array = NDArray[np.float64]


@njit
def allowed_speeds(
    q: Array,
    v: Array,
    asked: Array,
    period: float,
    late: float,
    speed_max: Array,
    acceleration_max: Array,
    position_min: Array,
    position_max: Array,
    allowed: Array,
) -> float:
    """The speeds nearest to ``asked`` that a period may end with; what was cut: shares of the caps, mean of the joints.

    From the positions ``q`` and speeds ``v``, all (n,). The period covers ``period ((1 - late) v + late allowed)``, late
    1/2 for a ramp and 1 for a step. After it every joint can still stop short of its limits: braking from u takes
    u^2 / 2a and at most u period / 2 more, as speeds change from period to period.
    """
    cut = 0.0
    for j in range(q.shape[0]):
        most = speed_max[j]
        speed = min(max(asked[j], -most), most)
        for side in (1.0, -1.0):
            room = position_max[j] - q[j] if side > 0.0 else q[j] - position_min[j]
            room -= (1.0 - late) * period * side * v[j]
            if room == np.inf:
                continue
            slack = (0.5 + late) * period
            fastest = 0.0
            if room > 0.0:
                fastest = 2.0 * room / (slack + math.sqrt(slack * slack + 2.0 * room / acceleration_max[j]))
            if side * speed > fastest:
                speed = side * fastest
        change = acceleration_max[j] * period
        speed = min(max(speed, v[j] - change), v[j] + change)
        cut += min(abs(asked[j] - speed) / most, 1.0)
        allowed[j] = speed
    return cut / q.shape[0]


@njit
def pose_error(model: ArmModel, q: Array, position: Array, rotation: Array, tip: Array, error: Array) -> None:
    """From the tip at ``q`` to a pose, world axes: ``error`` (6,) metres and rotation vector; ``tip`` (3,) is written."""
    n = q.shape[0]
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    kernels.link_frames(model, q, R, p)
    now = R[n - 1] @ model.tip_R
    off = rotation @ now.T
    for r in range(3):
        tip[r] = p[n - 1, r]
        for c in range(3):
            tip[r] += R[n - 1, r, c] * model.tip_p[c]
        error[r] = position[r] - tip[r]
    x, y, z = 0.5 * (off[2, 1] - off[1, 2]), 0.5 * (off[0, 2] - off[2, 0]), 0.5 * (off[1, 0] - off[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (off[0, 0] + off[1, 1] + off[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if sine < 1e-6 and cosine < 0.0:  # a half turn: its axis is in the symmetric part
        k = 0
        for r in range(1, 3):
            if off[r, r] > off[k, k]:
                k = r
        x, y, z = off[0, k], off[1, k], off[2, k]
        if k == 0:
            x += 1.0
        elif k == 1:
            y += 1.0
        else:
            z += 1.0
        sine = math.sqrt(x * x + y * y + z * z)
    scale = angle / sine if sine > 0.0 else 1.0
    error[3], error[4], error[5] = scale * x, scale * y, scale * z
