"""Compiled: the joint controllers' torques, and where the tip of an arm is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.robots import ArmModel, kernels, njit

OF_THE_ARM = ("gravity", "base_R", "base_p", "tip_R", "tip_p")
"""Fields of a model that have no row per joint."""


@njit
def joint_demand(
    model: ArmModel,
    before: Floats,
    now: Floats,
    after: Floats,
    q: Floats,
    qd: Floats,
    coulomb: Floats,
    gain: float,
    dt: float,
    demand: Floats,
) -> None:
    r"""The joint controller of one arm: from measured ``q``, ``qd`` to ``demand``, the torque that is asked for.

    PyBullet steps semi-implicitly: ``qd' = qd + dt qdd(q, qd, tau)``, ``q' = q + dt qd'``. On the plan, the
    acceleration that lands on the next reference is its second difference, and the measured speed is the *backward*
    difference: with both, a plan within the torque limits is followed exactly. That speed is half a tick old, so
    Coriolis torques are off the plan's by about ``dt qdd / (2 qd)`` of themselves: up to 0.6 % of the limits in the
    bundled cells at 1 ms. ``before``, ``now``, ``after``: references. All (n,).
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


@njit
def clip_torques(demand: Floats, torque_max: Floats, torque: Floats) -> bool:
    """Fill ``torque`` (n,) with what of ``demand`` is within the limits; whether some was not."""
    clipped = False
    for j in range(demand.shape[0]):
        torque[j] = min(max(demand[j], -torque_max[j]), torque_max[j])
        clipped = clipped or torque[j] != demand[j]
    return clipped


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
) -> bool:
    """``joint_demand``, and ``torque`` (n,): that within the limits. Whether something was clipped."""
    joint_demand(model, before, now, after, q, qd, coulomb, gain, dt, demand)
    return clip_torques(demand, torque_max, torque)


def stack_models(models: Sequence[ArmModel]) -> ArmModel:
    """Models of A arms in one, for ``control``: each field has A rows, padded to the largest number of joints."""
    width, stacked = max(len(model.mass) for model in models), []
    for name, fields in zip(ArmModel._fields, zip(*models, strict=True), strict=True):
        shape = fields[0].shape if name in OF_THE_ARM else (width, *fields[0].shape[1:])
        rows = np.zeros((len(models), *shape), dtype=fields[0].dtype)
        for row, field in zip(rows, fields, strict=True):
            row[: len(field)] = field
        stacked.append(rows)
    return ArmModel(*stacked)


@njit
def control(
    models: ArmModel,
    dofs: Ints,
    joints: Floats,
    gain: float,
    dt: float,
    measured: Floats,
    reference: Floats,
    coulomb: Floats,
    torque_max: Floats,
    demand: Floats,
    torque: Floats,
) -> bool:
    """One tick of A controllers, from ``measured`` (2, A, n) to ``torque`` (A, n); ``joints`` (A, n) at its end.

    ``models``: stacked; ``dofs`` (A,). ``reference`` (3, A, n): before, now, next; shifted here. Whether torques were
    clipped.
    """
    clipped = False
    for i in range(dofs.shape[0]):
        n = dofs[i]
        reference[0, i], reference[1, i], reference[2, i] = reference[1, i], reference[2, i], joints[i]
        model = ArmModel(
            models.placement_R[i][:n], models.placement_p[i][:n], models.axis[i][:n], models.prismatic[i][:n],
            models.mass[i][:n], models.com[i][:n], models.inertia[i][:n], models.damping[i][:n], models.gravity[i],
            models.base_R[i], models.base_p[i], models.tip_R[i], models.tip_p[i],
        )  # fmt: skip
        clipped |= joint_torques(
            model, reference[0, i][:n], reference[1, i][:n], reference[2, i][:n], measured[0, i][:n],
            measured[1, i][:n], coulomb[i][:n], torque_max[i][:n], gain, dt, demand[i][:n], torque[i][:n],
        )  # fmt: skip
    return clipped


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
