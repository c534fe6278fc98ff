"""Compiled: joint speeds within all limits of a joint, the law tick by tick, and how far a tip is from a pose."""

from __future__ import annotations

import math

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.ik.kernels import Law as IKLaw
from armtempo.planners.ik.kernels import Targets as IKTargets
from armtempo.planners.ik.kernels import law_within
from armtempo.planners.ik.kernels import scratch as law_scratch
from armtempo.robots import ArmModel, kernels, njit


@njit
def allowed_speeds(
    q: Floats,
    v: Floats,
    asked: Floats,
    period: float,
    late: float,
    speed_max: Floats,
    acceleration_max: Floats,
    position_min: Floats,
    position_max: Floats,
    allowed: Floats,
) -> None:
    """Write ``allowed``: the speeds nearest to ``asked`` that a period may end with.

    From the positions ``q`` and speeds ``v``, all (n,). The period covers ``period ((1 - late) v + late allowed)``:
    late is 1/2 for a ramp and 1 for a step. After it every joint can still stop short of its limits: braking from u
    takes u^2 / 2a and at most u period / 2 more, as speeds change from period to period.
    """
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
        allowed[j] = min(max(speed, v[j] - change), v[j] + change)


@njit
def ramp(
    q: Floats, v: Floats, end: Floats, tick: float, position_min: Floats, position_max: Floats, joints: Floats
) -> None:
    """Positions ``joints`` (K, n) at the ticks of a period in which speeds go from ``v`` to ``end`` (n,) linearly."""
    ticks, n = joints.shape
    for k in range(ticks):
        for j in range(n):
            mean = v[j] + (end[j] - v[j]) * (k + 0.5) / ticks
            at = (joints[k - 1, j] if k else q[j]) + tick * mean
            joints[k, j] = min(max(at, position_min[j]), position_max[j])  # the last bit


@njit
def run_law(
    model: ArmModel,
    law: IKLaw,
    targets: IKTargets,
    row: int,
    q: Floats,
    v: Floats,
    acceleration_max: Floats,
    joints: Floats,
    asked: Floats,
    speeds: Floats,
) -> None:
    """Ticks of the law from the row ``row`` of its targets on, on its own state: ``q``, ``v`` (n,) before.

    All (K, n): positions ``joints`` after each tick, speeds ``asked`` for and ``speeds`` that limits allow.
    """
    scratch = law_scratch(q.shape[0], law.task.shape[0])
    for k in range(joints.shape[0]):
        here, before = (joints[k - 1], speeds[k - 1]) if k else (q, v)
        law_within(model, law, here, targets, row + targets.stride * k, scratch, asked[k])
        allowed_speeds(
            here, before, asked[k], targets.step, 1.0, law.speed_max, acceleration_max, law.position_min,
            law.position_max, speeds[k],
        )  # fmt: skip
        ramp(here, speeds[k], speeds[k], targets.step, law.position_min, law.position_max, joints[k : k + 1])


@njit
def brake(
    q: Floats,
    v: Floats,
    period: float,
    late: float,
    acceleration: Floats,
    speed_max: Floats,
    position_min: Floats,
    position_max: Floats,
    joints: Floats,
    speeds: Floats,
) -> None:
    """Periods in which all joints brake at ``acceleration`` (n,), from ``q``, ``v`` (n,), as ``allowed_speeds`` has it.

    ``speeds`` (L, n): at the ends of L periods; ``joints`` (K, n): positions at their K / L ticks.
    """
    still = np.zeros(q.shape[0])
    ticks = joints.shape[0] // speeds.shape[0]
    for k in range(speeds.shape[0]):
        here, before = (joints[k * ticks - 1], speeds[k - 1]) if k else (q, v)
        allowed_speeds(
            here, before, still, period, late, speed_max, acceleration, position_min, position_max, speeds[k]
        )
        first = before if late < 1.0 else speeds[k]
        ramp(here, first, speeds[k], period / ticks, position_min, position_max, joints[k * ticks : (k + 1) * ticks])


@njit
def pose_errors(
    model: ArmModel, q: Floats, positions: Floats, rotations: Floats, every: int, tips: Floats, errors: Floats
) -> None:
    """From the tips at ``q`` (K, n) to poses: ``errors`` (K, 6), metres and rotation vectors in world axes.

    The poses are every so manieth of the rows of ``positions`` (., 3) and ``rotations`` (., 3, 3). Writes ``tips``
    (K, 3), too.
    """
    n = q.shape[1]
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    for k in range(q.shape[0]):
        kernels.link_frames(model, q[k], R, p)
        for r in range(3):
            tips[k, r] = p[n - 1, r]
            for c in range(3):
                tips[k, r] += R[n - 1, r, c] * model.tip_p[c]
            errors[k, r] = positions[every * k, r] - tips[k, r]
        rotation_vector(rotations[every * k] @ (R[n - 1] @ model.tip_R).T, errors[k, 3:])


@njit
def rotation_vector(R: Floats, vector: Floats) -> None:
    """The rotation vector (3,) of R (3, 3), at most pi long."""
    x, y, z = 0.5 * (R[2, 1] - R[1, 2]), 0.5 * (R[0, 2] - R[2, 0]), 0.5 * (R[1, 0] - R[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    angle = math.atan2(sine, cosine)
    if sine < 1e-6 and cosine < 0.0:  # a half turn: its axis is in the symmetric part
        k = 0
        for r in range(1, 3):
            if R[r, r] > R[k, k]:
                k = r
        x, y, z = R[0, k], R[1, k], R[2, k]
        if k == 0:
            x += 1.0
        elif k == 1:
            y += 1.0
        else:
            z += 1.0
        sine = math.sqrt(x * x + y * y + z * z)
    scale = angle / sine if sine > 0.0 else 1.0
    vector[0], vector[1], vector[2] = scale * x, scale * y, scale * z
