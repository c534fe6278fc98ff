"""Compiled: the joint controller's torques, and where the tip of an arm is."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots import ArmModel, kernels, njit


@njit
def joint_torques(
    model: ArmModel,
    before: Floats,
    now: Floats,
    after: Floats,
    q: Floats,
    qd: Floats,
    coulomb: Floats,
    torque_max: Floats,
    gain: float,
    dt: float,
    demand: Floats,
    torque: Floats,
) -> None:
    r"""The joint controller of one arm: from measured ``q``, ``qd`` to ``torque``; ``demand`` is before clipping.

    PyBullet steps semi-implicitly: ``qd' = qd + dt qdd(q, qd, tau)``, ``q' = q + dt qd'``. On the plan, the
    acceleration that lands on the next reference is its second difference, and the measured speed is the *backward*
    difference: with both, a plan at the torque limits runs without a reserve. ``before``, ``now``, ``after``:
    references. All (n,).
    """
    n = q.shape[0]
    qdd = np.empty(n)
    for j in range(n):
        wanted = (after[j] - 2.0 * now[j] + before[j]) / (dt * dt)
        speed = (now[j] - before[j]) / dt
        qdd[j] = wanted + gain * gain * (now[j] - q[j]) + 2.0 * gain * (speed - qd[j])
    kernels.inverse_dynamics(model, q, qd, qdd, demand)
    for j in range(n):  # friction: viscous as it is felt, dry as the reference moves
        demand[j] += model.damping[j] * qd[j] + coulomb[j] * np.sign(after[j] - now[j])
        torque[j] = min(max(demand[j], -torque_max[j]), torque_max[j])


@njit
def tip_of(model: ArmModel, q: Floats) -> tuple[float, float, float]:
    n = model.mass.shape[0]
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    kernels.link_frames(model, q, R, p)
    t, last, origin = model.tip_p, R[n - 1], p[n - 1]
    return (
        origin[0] + last[0, 0] * t[0] + last[0, 1] * t[1] + last[0, 2] * t[2],
        origin[1] + last[1, 0] * t[0] + last[1, 1] * t[1] + last[1, 2] * t[2],
        origin[2] + last[2, 0] * t[0] + last[2, 1] * t[1] + last[2, 2] * t[2],
    )
