"""A way out where the feedback law is stuck: a posture that has the pose, by bounded least squares; compiled.

The law is blind to what lies beyond a singular posture or a joint's limit: it may come to rest there short of a target
that the arm can reach. A run notices that it makes no headway towards a target at rest, looks for a posture that has
the pose (Levenberg and Marquardt's method inside the position limits, from where the arm is, and from other postures)
and, if it finds one, goes there on a straight line of joints. If it finds none nothing changes: the target is out of
reach, and the law stays as near as it can.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.ik._law import Law, Scratch, Targets, scale_jacobian, scratch, task_part, tip_and_jacobian
from armtempo.robots import ArmModel, inlined, njit
from armtempo.robots.kernels import cholesky, cholesky_solve

__all__ = ["Watch", "leave_dead_end", "watch_of"]

WINDOW = 10.0  # by the smallest gain [s]: so long without headway is stuck; the law alone would be at e^-10
HEADWAY_SHARE = 0.01  # of the error, or of what the caps let it shrink by in a window
MOVED_SHARE = 0.1  # of what the joints could move in a window: an arm that moves is not stuck
AT_REST_SHARE = 1e-3  # of the error: a target that moved by less is at rest
ARRIVED = 1e-7  # [length, rad] of error: there is nothing to leave
FOUND = 1e-9  # [length, rad] likewise, of a posture that is found
DESCENT_STEPS_MAX, SLOW_STEPS_MAX = 150, 8
SLOW_SHARE = 1e-3  # of the error: a step that takes off less is a slow one
JOINT_STEP_MAX = 0.5  # [rad, m]
DAMPING_MAX = 1e4
OTHER_STARTS = 24

STEPS, BEST, SINCE, TRIED, GOING = 0, 1, 2, 3, 4  # of ``Watch.state``


class Watch(NamedTuple):
    """What a run remembers of its headway."""

    state: Floats
    """(5,) steps without headway, the least error before, the row since which the target is at rest, is it tried, on
    the way out."""
    anchor: Floats
    """(n,) joints where the headway ended."""
    goal: Floats
    """(n,) the posture to go to."""


@njit
def watch_of(n: int) -> Watch:
    """At a run's start."""
    state = np.zeros(5)
    state[BEST] = np.inf
    return Watch(state=state, anchor=np.zeros(n), goal=np.zeros(n))


@inlined
def _missed(law: Law, w: Scratch, position: Floats, rotation: Floats) -> float:
    """What the tip lacks to the pose, the task's part of it, scaled, into w.y (m,); its size."""
    tip, x = w.tip, w.x
    m00 = rotation[0, 0] * tip[1, 0] + rotation[0, 1] * tip[2, 0] + rotation[0, 2] * tip[3, 0]
    m11 = rotation[1, 0] * tip[1, 1] + rotation[1, 1] * tip[2, 1] + rotation[1, 2] * tip[3, 1]
    m22 = rotation[2, 0] * tip[1, 2] + rotation[2, 1] * tip[2, 2] + rotation[2, 2] * tip[3, 2]
    square = 0.0
    for r in range(3):
        x[r] = position[r] - tip[0, r]
        a, b = (r + 2) % 3, (r + 1) % 3
        x[3 + r] = 0.0  # half the odd part of Rd R^T: the axis by the angle's sine
        for c in range(3):
            x[3 + r] += 0.5 * (rotation[a, c] * tip[1 + c, b] - rotation[b, c] * tip[1 + c, a])
        square += x[3 + r] * x[3 + r]
    sine = math.sqrt(square)
    angle = math.atan2(sine, 0.5 * (m00 + m11 + m22 - 1.0))
    if sine > 1e-9:
        for r in range(3, 6):
            x[r] *= angle / sine
    elif angle > 1.0:  # half a turn: a column of Rd R^T + 1 is along the axis
        k = 0 if m00 >= m11 and m00 >= m22 else (1 if m11 >= m22 else 2)
        square = 0.0
        for r in range(3):
            x[3 + r] = 1.0 if r == k else 0.0
            for c in range(3):
                x[3 + r] += rotation[r, c] * tip[1 + c, k]
            square += x[3 + r] * x[3 + r]
        for r in range(3, 6):
            x[r] *= angle / math.sqrt(square)
    task_part(law.task, law.length, x, w.y)
    square = 0.0
    for i in range(law.task.shape[0]):
        square += w.y[i] * w.y[i]
    return math.sqrt(square)


@inlined
def _step(law: Law, q: Floats, damping: float, w: Scratch, G: Floats, C: Floats, at: Floats) -> None:
    """The damped step from q (n,) for what w.y lacks, into at (n,): joints at limits that it would pass stay there."""
    m, n = w.A.shape
    for k in range(n):
        pull = 0.0
        for i in range(m):
            pull += w.A[i, k] * w.y[i]
        w.rate[k] = pull
        w.free[k] = (pull <= 0.0 or q[k] < law.position_max[k]) and (pull >= 0.0 or q[k] > law.position_min[k])
    for k in range(n):
        for j in range(k + 1):
            value = 0.0
            if w.free[k] and w.free[j]:
                for i in range(m):
                    value += w.A[i, k] * w.A[i, j]
            G[k, j] = G[j, k] = value
    cholesky(G, -damping, C)
    largest = JOINT_STEP_MAX
    for k in range(n):
        at[k] = w.rate[k] if w.free[k] else 0.0
    cholesky_solve(C, at)
    for k in range(n):
        largest = max(largest, abs(at[k]))
    for k in range(n):
        moved = q[k] + at[k] * (JOINT_STEP_MAX / largest)
        at[k] = min(max(moved, law.position_min[k]), law.position_max[k])


@njit
def _descend(model: ArmModel, law: Law, position: Floats, rotation: Floats, q: Floats, w: Scratch) -> bool:
    """Move q (n,) to where the pose's error is least, downhill, inside the position limits; has it gone?"""
    n = q.shape[0]
    G, C, at, lacks = np.empty((n, n)), np.empty((n, n)), np.empty(n), np.empty(law.task.shape[0])
    tip_and_jacobian(model, q, w)
    error, damping, slow = _missed(law, w, position, rotation), 1e-3, 0
    for _ in range(DESCENT_STEPS_MAX):
        if error <= FOUND:
            return True
        scale_jacobian(law, w)
        lacks[:] = w.y
        while True:
            w.y[:] = lacks
            _step(law, q, damping, w, G, C, at)
            tip_and_jacobian(model, at, w)
            then = _missed(law, w, position, rotation)
            if then < error:
                break
            damping *= 8.0
            if damping > DAMPING_MAX:
                return False
        slow = slow + 1 if then > (1.0 - SLOW_SHARE) * error else 0
        if slow > SLOW_STEPS_MAX:
            return False
        q[:] = at
        error, damping = then, max(0.1 * damping, 1e-14)
    return error <= FOUND


@inlined
def _start(law: Law, number: int, ratio: float, q: Floats) -> None:
    """The so-manyth posture to start from, into q (n,): even over the joints' ranges, or a turn about zero."""
    share = 1.0
    for k in range(q.shape[0]):
        centre = min(max(0.0, law.position_min[k]), law.position_max[k])
        low, high = max(law.position_min[k], centre - math.pi), min(law.position_max[k], centre + math.pi)
        share /= ratio
        part = 0.5 + number * share
        q[k] = low + (part - math.floor(part)) * (high - low)


@njit
def _find_posture(
    model: ArmModel, law: Law, position: Floats, rotation: Floats, here: Floats, first: Floats, goal: Floats
) -> bool:
    """A posture with the pose into goal (n,), the one that is downhill from here, or else the nearest; is there one?"""
    n = here.shape[0]
    w, q = scratch(n, law.task.shape[0]), here.copy()
    nearest, ratio = np.inf, 1.5
    for _ in range(60):  # the number whose powers are spread most evenly over n dimensions
        ratio = (1.0 + ratio) ** (1.0 / (n + 1.0))
    for start in range(OTHER_STARTS + 3):
        if start == 1:
            q[:] = first
        elif start == 2:
            for k in range(n):
                q[k] = min(max(law.posture[k], law.position_min[k]), law.position_max[k])
        elif start > 2:
            _start(law, start - 2, ratio, q)
        if not _descend(model, law, position, rotation, q, w):
            continue
        far = 0.0
        for k in range(n):
            if not model.prismatic[k]:  # as few turns away as the limits let it be
                back = q[k] - 2.0 * math.pi * round((q[k] - here[k]) / (2.0 * math.pi))
                if law.position_min[k] <= back <= law.position_max[k]:
                    q[k] = back
            far = max(far, abs(q[k] - here[k]))
        if far < nearest:
            nearest = far
            goal[:] = q
        if start == 0:
            break
    return nearest < np.inf


@inlined
def _head_for(law: Law, q: Floats, goal: Floats, step: float, w: Scratch, qd: Floats) -> bool:
    """Joint speeds towards the goal inside all caps, into qd (n,); False: it is reached with this step."""
    n = q.shape[0]
    time = step
    for k in range(n):
        time = max(time, abs(goal[k] - q[k]) / law.speed_max[k])
    for half in range(2):
        square = 0.0
        for r in range(3 * half, 3 * half + 3):
            value = 0.0
            for k in range(n):
                value += w.J[r, k] * (goal[k] - q[k])
            square += value * value
        time = max(time, math.sqrt(square) / (law.linear_max if half == 0 else law.angular_max))
    for k in range(n):
        speed = (goal[k] - q[k]) / time
        qd[k] = min(max(speed, -law.speed_max[k]), law.speed_max[k])
    return time > step


@njit
def leave_dead_end(
    model: ArmModel, law: Law, targets: Targets, at: int, first: Floats, q: Floats, w: Scratch, watch: Watch, qd: Floats
) -> bool:
    """Is the run on its way out of a dead end: then its joint speeds into qd (n,). To be called at every step.

    first, q (n,): joints at the run's start, and now, where w has the tip and the Jacobian.
    """
    n, state = q.shape[0], watch.state
    if max(law.position_gain, law.approach_gain, law.normal_gain) * targets.step >= 2.0:  # unstable, not stuck
        return False
    error = _missed(law, w, targets.position[at], targets.rotation[at])
    since, moved = int(state[SINCE]), 0.0
    for r in range(3):
        moved = max(moved, abs(targets.position[at, r] - targets.position[since, r]) / law.length)
        for c in range(3):
            moved = max(moved, abs(targets.rotation[at, r, c] - targets.rotation[since, r, c]))
    if moved > AT_REST_SHARE * error + 1e-12:
        state[BEST], state[SINCE], state[TRIED], state[GOING] = np.inf, at, 0.0, 0.0
    window = WINDOW / min(law.position_gain, law.approach_gain, law.normal_gain)
    if state[GOING] == 0.0:
        far = 0.0
        for k in range(n):
            far = max(far, abs(q[k] - watch.anchor[k]) / law.speed_max[k])
        least = 0.1 * window * min(law.linear_max / law.length, law.angular_max)
        ahead = error < state[BEST] - min(HEADWAY_SHARE * state[BEST], least) or state[BEST] == np.inf
        if error <= ARRIVED or ahead or far > MOVED_SHARE * window:
            state[STEPS], state[BEST] = 0.0, min(state[BEST], error)
            watch.anchor[:] = q
            return False
        state[STEPS] += 1.0
        if state[TRIED] == 1.0 or state[STEPS] * targets.step < window:
            return False
        state[TRIED] = 1.0
        if not _find_posture(model, law, targets.position[at], targets.rotation[at], q, first, watch.goal):
            return False
    state[GOING] = 1.0 if _head_for(law, q, watch.goal, targets.step, w, qd) else 0.0
    if state[GOING] == 0.0:
        state[STEPS], state[BEST] = 0.0, np.inf
    return True
