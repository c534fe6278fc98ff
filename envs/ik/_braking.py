"""Compiled: references that torques can follow, and from which the arm can always stop."""

from __future__ import annotations

import math

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies import joint_torques
from armtempo.robots import ArmModel, kernels, njit

BRAKING_HARDNESSES = np.array([1.0, 0.5, 0.25, 0.125, 0.0625])
"""Shares of the braking accelerations at which it is tried to stop, the hardest first."""
TORQUE_SHARE_PLANNED = 0.95  # of the torques' limits, on the way to a stop, which is looked at in places
TORQUE_SHARE_RUN = 0.99  # of the same, in a tick
HARDNESS_HALVINGS = 5


@njit
def can_stop(
    model: ArmModel,
    q: Floats,
    v: Floats,
    acceleration: Floats,
    period: float,
    hardness: float,
    position_min: Floats,
    position_max: Floats,
    coulomb: Floats,
    torque_max: Floats,
) -> bool:
    """Whether all joints can brake to a stop from ``q``, ``v`` (n,) at a share of their accelerations ``acceleration``.

    That is, within position limits, to half a ``period`` at their speed, and with torques within
    ``TORQUE_SHARE_PLANNED`` of their limits: looked at now and then, where a joint stops, and at rest.
    """
    n = q.shape[0]
    lasts, at, speed, rate, torque = 0.0, np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for j in range(n):
        way = 0.5 * v[j] * abs(v[j]) / (hardness * acceleration[j]) + 0.5 * period * v[j]
        if q[j] + way > position_max[j] + 1e-9 or q[j] + way < position_min[j] - 1e-9:
            return False
        lasts = max(lasts, abs(v[j]) / (hardness * acceleration[j]))
    every = max(period, 1e-2) / hardness
    looks = math.ceil(lasts / every - 1e-9) + 1
    for k in range(looks + n):  # on the way, and where a joint stops and the others go on
        time = k * every if k < looks else abs(v[k - looks]) / (hardness * acceleration[k - looks])
        for j in range(n):
            side = np.sign(v[j])
            a = hardness * acceleration[j]
            t = min(time, abs(v[j]) / a)
            speed[j] = v[j] - side * a * t
            at[j] = q[j] + 0.5 * (v[j] + speed[j]) * t
            rate[j] = -side * a if time < abs(v[j]) / a else 0.0
        kernels.inverse_dynamics(model, at, speed, rate, torque)
        for j in range(n):
            needed = torque[j] + model.damping[j] * speed[j] + coulomb[j] * np.sign(speed[j])
            if abs(needed) > TORQUE_SHARE_PLANNED * torque_max[j]:
                return False
    return True


@njit
def hardest_stop(
    model: ArmModel,
    q: Floats,
    v: Floats,
    acceleration: Floats,
    period: float,
    position_min: Floats,
    position_max: Floats,
    coulomb: Floats,
    torque_max: Floats,
) -> float:
    """The largest of ``BRAKING_HARDNESSES`` at which it can stop from ``q``, ``v`` (n,); 0: at none."""
    for hardness in BRAKING_HARDNESSES:
        if can_stop(
            model, q, v, acceleration, period, hardness, position_min, position_max, coulomb, torque_max
        ):  # fmt: skip
            return float(hardness)
    return 0.0


@njit
def hold_back(
    model: ArmModel,
    joints: Floats,
    speeds: Floats,
    braking: Floats,
    braking_speeds: Floats,
    reference: Floats,
    acceleration: Floats,
    period: float,
    position_min: Floats,
    position_max: Floats,
    coulomb: Floats,
    torque_max: Floats,
    tick: float,
    after: Floats,
    rows: Floats,
) -> float:
    """Draw references ``joints`` (K, n) of a control period to ``braking`` (K, n) until the arm can follow, and stop.

    Both start from ``reference`` (3, n). ``speeds`` (L, n) go with the joints and are drawn alike; the last are those
    at the end. What speeds, accelerations and positions may be are convex sets: what is between keeps them. Returns how
    hard it can brake then; 0: as planned before, as only ``braking`` is left.

    Also writes, for an arm that is always on its reference, ``after`` (3, n), the reference at the period's end, and
    ``rows`` (K, 3, n) as ``stay_on_reference`` has them.
    """
    K, n = joints.shape
    wanted, wanted_speeds = joints.copy(), speeds.copy()
    share, step, best, hardness = 1.0, 1.0, 0.0, 0.0
    for _ in range(HARDNESS_HALVINGS + 1):
        if share < 1.0:
            joints[:] = braking + share * (wanted - braking)
            speeds[:] = braking_speeds + share * (wanted_speeds - braking_speeds)
        after[:] = reference
        stay_on_reference(model, joints, after, coulomb, torque_max, 0.0, tick, rows)
        fits = True
        for k in range(K):
            for j in range(n):
                fits = fits and abs(rows[k, 2, j]) <= TORQUE_SHARE_RUN * torque_max[j]
        found = 0.0
        if fits:
            found = hardest_stop(
                model, joints[K - 1], speeds[-1], acceleration, period, position_min, position_max, coulomb, torque_max
            )
        step *= 0.5
        if found > 0.0:
            best, hardness = share, found
            if share == 1.0:
                return float(hardness)
            share += step
        else:
            share -= step
    joints[:] = braking + best * (wanted - braking)
    speeds[:] = braking_speeds + best * (wanted_speeds - braking_speeds)
    after[:] = reference
    stay_on_reference(model, joints, after, coulomb, torque_max, 0.0, tick, rows)
    return float(hardness)


@njit
def stay_on_reference(
    model: ArmModel,
    joints: Floats,
    reference: Floats,
    coulomb: Floats,
    torque_max: Floats,
    gain: float,
    tick: float,
    rows: Floats,
) -> None:
    """Ticks of an arm that is always on its reference ``joints`` (K, n): ``rows`` (K, 3, n) q, torques, demand.

    ``reference`` (3, n): before, now, next; shifted here.
    """
    qd = np.empty(joints.shape[1])
    for k in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            qd[j] = (reference[2, j] - reference[1, j]) / tick
            reference[0, j], reference[1, j], reference[2, j] = reference[1, j], reference[2, j], joints[k, j]
        joint_torques(
            model, reference[0], reference[1], reference[2], reference[1], qd, coulomb, torque_max, gain, tick,
            rows[k, 2], rows[k, 1],
        )  # fmt: skip
        rows[k, 0] = joints[k]
