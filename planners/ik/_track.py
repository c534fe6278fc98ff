"""Runs of the feedback law along sampled targets, compiled, with the bounds of their errors."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.ik._dead_ends import leave_dead_end, watch_of
from armtempo.planners.ik._error_bounds import step_bounds
from armtempo.planners.ik._law import ESCAPE, LIMIT, Law, Targets, law_speeds, posture_speeds, scratch
from armtempo.robots import ArmModel, njit

__all__ = ["EULER", "HEUN", "RK4", "track", "track_many"]

EULER, HEUN, RK4 = 0, 1, 2  # methods


@njit
def track(
    model: ArmModel,
    law: Law,
    method: int,
    targets: Targets,
    q: Floats,
    qd: Floats,
    errors: Floats,
    bounds: Floats,
    flags: Ints,
) -> None:
    """One run from q[0].

    Into q, qd (T, n): positions, and the law's speeds there; errors (T, 3): position, approach, whole rotation; bounds
    (T, 4): of these, and of the position up to the next sample (of a target that moves evenly); flags (T,).
    """
    steps, n = q.shape[0] - 1, q.shape[1]
    w = scratch(n, law.task.shape[0])
    rate, feedback = np.zeros(n), np.empty(6)
    k1, k2, k3, k4, at = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    h, stride, watch = targets.step, targets.stride, watch_of(n)
    for k in range(steps + 1):
        here = k * stride
        posture_speeds(law, q[k], rate)
        flag = law_speeds(model, law, q[k], targets, here, w, rate, k1)
        stages = method
        if leave_dead_end(model, law, targets, here, q[0], q[k], w, watch, k1):
            flag |= ESCAPE
            stages = EULER
        for i in range(n):
            qd[k, i] = k1[i]
        for r in range(3):
            errors[k, r] = w.error[r]
            if k == 0:
                bounds[0, r] = w.error[r]
        if k == steps:
            flags[k] = flag
            bounds[k, 3] = bounds[k, 0]
            return
        plain = flag & ESCAPE == 0
        for r in range(6):
            feedback[r] = w.feedback[r]
            for i in range(n):
                w.before[r, i] = w.J[r, i]
        if stages == HEUN:
            for i in range(n):
                at[i] = q[k, i] + h * k1[i]
            posture_speeds(law, at, rate)
            flag |= law_speeds(model, law, at, targets, here + stride, w, rate, k2)
        elif stages == RK4:
            for i in range(n):
                at[i] = q[k, i] + 0.5 * h * k1[i]
            posture_speeds(law, at, rate)
            flag |= law_speeds(model, law, at, targets, here + 1, w, rate, k2)
            for i in range(n):
                at[i] = q[k, i] + 0.5 * h * k2[i]
            posture_speeds(law, at, rate)
            flag |= law_speeds(model, law, at, targets, here + 1, w, rate, k3)
            for i in range(n):
                at[i] = q[k, i] + h * k3[i]
            posture_speeds(law, at, rate)
            flag |= law_speeds(model, law, at, targets, here + 2, w, rate, k4)
        for i in range(n):
            speed = k1[i]
            if stages == HEUN:
                speed = 0.5 * (k1[i] + k2[i])
            elif stages == RK4:
                speed = (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0
            moved = q[k, i] + h * speed
            if moved < law.position_min[i] or moved > law.position_max[i]:
                flag |= LIMIT
                moved = min(max(moved, law.position_min[i]), law.position_max[i])
            q[k + 1, i] = moved
            at[i] = moved - q[k, i]
        step_bounds(law, w.before, at, feedback, plain, targets, here, bounds[k], bounds[k + 1])
        flags[k] = flag


@njit
def track_many(
    model: ArmModel,
    law: Law,
    method: int,
    targets: Targets,
    q: Floats,
    qd: Floats,
    errors: Floats,
    bounds: Floats,
    flags: Ints,
) -> None:
    """``track`` for each of the first axis of all arrays (B, ...)."""
    for b in range(q.shape[0]):
        one = Targets(
            position=targets.position[b],
            rotation=targets.rotation[b],
            velocity=targets.velocity[b],
            angular_velocity=targets.angular_velocity[b],
            stride=targets.stride,
            step=targets.step,
        )
        track(model, law, method, one, q[b], qd[b], errors[b], bounds[b], flags[b])
