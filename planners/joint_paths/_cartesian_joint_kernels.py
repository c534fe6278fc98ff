"""Inner loops of ``CartesianJointPath``: joints on a pose by Newton, their exact derivatives, bounds of their speed.

The joints at lambda solve

    task (pose(lambda) - FK(q)) = 0,    N^T (q - r(lambda)) = 0

with r a reference curve, quintic on each interval, and N (n, spare) a constant there that tells apart the postures of a
redundant arm (no columns otherwise). Both derivatives follow from the same matrix A = [task J; N^T]:

    A q' = [task t; N^T r'],    A q'' = [task (t' - J' q'); N^T r'']

Where an interval is next to a singular posture through which the path goes, the row l of the task that is lost there is
replaced by one more row n^T (q - r) = 0, with n the direction of the joints that moves nothing there: l^T task is left
out. What the tip is off along it is what r is off along n, times the least singular value.

Nothing is checked here: callers pass float64 arrays of the right shape.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.ik.kernels import Scratch as ArmScratch
from armtempo.planners.ik.kernels import scratch as arm_scratch
from armtempo.planners.ik.kernels import tip_and_jacobian
from armtempo.robots import ArmModel, inlined, njit
from armtempo.robots.kernels import invert

__all__ = ["Reference", "Scratch", "follow", "scratch", "speed_bounds"]

NEWTON_STEPS_MAX = 20
LAST_STEP = 1e-12  # [rad, m] a step of this size is the last, and
LAST_STEP_BUT_ONE = 1e-8  # one of this size is the last but one, whatever rounding does next to a singularity


class Reference(NamedTuple):
    """M intervals of a joint path."""

    station: Floats
    """(M + 1,) rising."""
    curve: Floats
    """(M, 6, n) coefficients of r by rising powers of (lambda - start) / size."""
    null: Floats
    """(M, n, spare) N."""
    lost: Floats
    """(M, m) l, a unit vector; zero where no row is lost."""
    idle: Floats
    """(M, n) n, a unit vector; zero likewise."""


class Scratch(NamedTuple):
    q: Floats
    arm: ArmScratch
    """Of the tip and the Jacobian at q."""
    A: Floats
    B: Floats
    b: Floats
    """(n,) a right-hand side."""


@njit
def scratch(n: int) -> Scratch:
    """Room for one arm of n joints."""
    return Scratch(q=np.empty(n), arm=arm_scratch(n, 0), A=np.empty((n, n)), B=np.empty((n, n)), b=np.empty(n))


@njit
def _drift(J: Floats, u: Floats, out: Floats) -> None:
    """J' u for joint speeds u (n,), into out (6,): the tip's acceleration where the joints have none.

    Column j changes as the joints before it turn it, and as joint j turns all columns after it.
    """
    ax = ay = az = 0.0
    bx = by = bz = 0.0  # angular acceleration
    wx = wy = wz = 0.0  # angular velocity of the link before
    for j in range(u.shape[0]):
        x, y, z = u[j] * J[3, j], u[j] * J[4, j], u[j] * J[5, j]
        vx, vy, vz = u[j] * J[0, j], u[j] * J[1, j], u[j] * J[2, j]
        sx, sy, sz = 2.0 * wx + x, 2.0 * wy + y, 2.0 * wz + z
        ax, ay, az = ax + sy * vz - sz * vy, ay + sz * vx - sx * vz, az + sx * vy - sy * vx
        bx, by, bz = bx + wy * z - wz * y, by + wz * x - wx * z, bz + wx * y - wy * x
        wx, wy, wz = wx + x, wy + y, wz + z
    out[0], out[1], out[2], out[3], out[4], out[5] = ax, ay, az, bx, by, bz


@njit
def _matrix(task: Floats, null: Floats, lost: Floats, idle: Floats, w: Scratch) -> None:
    """A = [task J; N^T] into w.A, with a row replaced that is lost."""
    m, n = task.shape[0], w.q.shape[0]
    for k in range(n):
        for i in range(m):
            value = 0.0
            if m == 6:  # all of the twist, in whatever axes
                w.A[i, k] = w.arm.J[i, k]
                continue
            for r in range(6):
                value += task[i, r] * w.arm.J[r, k]
            w.A[i, k] = value
        for i in range(m, n):
            w.A[i, k] = null[k, i - m]
        if lost.any():
            part = -idle[k]
            for i in range(m):
                part += lost[i] * w.A[i, k]
            for i in range(m):
                w.A[i, k] -= lost[i] * part


@njit
def _solve(w: Scratch, task: Floats, twist: Floats, rest: Floats, lost: Floats, along: float, out: Floats) -> None:
    """Out = A^-1 [task twist; rest] from w.B; ``along``: what stands for a row that is lost."""
    m, n = task.shape[0], out.shape[0]
    for k in range(n):
        out[k] = 0.0
    for i in range(n):
        value = 0.0
        if i >= m:
            value = rest[i - m]
        elif m == 6:
            value = twist[i]
        else:
            for r in range(6):
                value += task[i, r] * twist[r]
        w.b[i] = value
    if lost.any():
        part = -along
        for i in range(m):
            part += lost[i] * w.b[i]
        for i in range(m):
            w.b[i] -= lost[i] * part
    for i in range(n):
        for k in range(n):
            out[k] += w.B[k, i] * w.b[i]


@inlined
def _on_reference(reference: Reference, at: int, lam: float, r: Floats) -> None:
    """The reference and its two derivatives on interval ``at``, into r (3, n)."""
    size = reference.station[at + 1] - reference.station[at]
    x, c = (lam - reference.station[at]) / size, reference.curve[at]
    for j in range(r.shape[1]):
        r[0, j] = c[0, j] + x * (c[1, j] + x * (c[2, j] + x * (c[3, j] + x * (c[4, j] + x * c[5, j]))))
        r[1, j] = c[1, j] + x * (2 * c[2, j] + x * (3 * c[3, j] + x * (4 * c[4, j] + x * 5 * c[5, j])))
        r[2, j] = 2 * c[2, j] + x * (6 * c[3, j] + x * (12 * c[4, j] + x * 20 * c[5, j]))
        r[1, j] /= size
        r[2, j] /= size * size


@njit
def follow(
    model: ArmModel,
    task: Floats,
    reference: Reference,
    interval: Ints,
    lam: Floats,
    position: Floats,
    rotation: Floats,
    twist: Floats,
    change: Floats,
    q: Floats,
    dq: Floats,
    ddq: Floats,
    off: Floats,
) -> None:
    """Joints at S stations, and both derivatives, into q, dq, ddq (S, n).

    position (S, 3), rotation (S, 3, 3): the poses; twist, change (S, 6): their first and second derivatives. Newton
    starts on the reference. off (S,): how far it went from there [rad, m]; infinite where it did not arrive.
    """
    n, m = q.shape[1], task.shape[0]
    w = scratch(n)
    error, step, spare, accelerated = np.empty(6), np.empty(n), np.empty(n), np.empty(6)
    rest = np.zeros((3, n))  # N^T r and its derivatives by lambda
    r, idle = np.empty((3, n)), np.zeros(3)  # likewise n^T r
    for k in range(q.shape[0]):
        at = interval[k]
        N = reference.null[at]
        _on_reference(reference, at, lam[k], r)
        for j in range(n):
            w.q[j] = r[0, j]
        for i in range(n - m):
            for d in range(3):
                value = 0.0
                for j in range(n):
                    value += N[j, i] * r[d, j]
                rest[d, i] = value
        lost = reference.lost[at]
        for d in range(3):
            idle[d] = 0.0
            for j in range(n):
                idle[d] += reference.idle[at, j] * r[d, j]
        off[k] = before = math.inf
        for _ in range(NEWTON_STEPS_MAX):
            tip_and_jacobian(model, w.q, w.arm)
            _matrix(task, N, lost, reference.idle[at], w)
            if not invert(w.A, w.B):
                break
            tip, R = w.arm.tip, rotation[k]
            for i in range(3):
                error[i] = position[k, i] - tip[0, i]
                a, b = (i + 2) % 3, (i + 1) % 3  # R Rtip^T turns by sin(angle) axis = half its odd part
                value = 0.0
                for j in range(3):
                    value += R[a, j] * tip[1 + j, b] - R[b, j] * tip[1 + j, a]
                error[3 + i] = 0.5 * value
            for i in range(n - m):
                spare[i] = rest[0, i]
                for j in range(n):
                    spare[i] -= N[j, i] * w.q[j]
            along = idle[0]
            for j in range(n):
                along -= reference.idle[at, j] * w.q[j]
            _solve(w, task, error, spare, lost, along, step)
            largest = 0.0
            for j in range(n):
                w.q[j] += step[j]
                largest = max(largest, abs(step[j]))
            if not largest < 1e3:
                break
            if largest <= LAST_STEP or (largest <= LAST_STEP_BUT_ONE and before <= LAST_STEP_BUT_ONE):
                off[k] = 0.0
                for j in range(n):
                    off[k] = max(off[k], abs(w.q[j] - r[0, j]))
                break
            before = largest
        for j in range(n):
            q[k, j] = w.q[j]
        _solve(w, task, twist[k], rest[1], lost, idle[1], dq[k])
        _drift(w.arm.J, dq[k], accelerated)
        for i in range(6):
            accelerated[i] = change[k, i] - accelerated[i]
        _solve(w, task, accelerated, rest[2], lost, idle[2], ddq[k])


@njit
def _weigh(task: Floats, lost: Floats, B: Floats, weight: Floats) -> None:
    """How far errors of b move each joint at most, by A0^-1 = B: linear, angular and spare ones, into weight (n, 3).

    A row that is lost takes in spare ones in its place: B is left without it.
    """
    m, n = task.shape[0], B.shape[0]
    for j in range(n):
        replaced = 0.0
        for i in range(m):
            replaced += B[j, i] * lost[i]
        for i in range(m):
            B[j, i] -= replaced * lost[i]
        for part in range(3):
            weight[j, part] = 0.0
        for r in range(6):  # A0^-1 takes in a twist by way of the task's rows
            value = 0.0
            if m == 6:
                value = B[j, r]
            else:
                for i in range(m):
                    value += B[j, i] * task[i, r]
            weight[j, r // 3] += value * value
        weight[j, 2] += replaced * replaced
        for i in range(m, n):
            weight[j, 2] += B[j, i] * B[j, i]
        for part in range(3):
            weight[j, part] = math.sqrt(weight[j, part])


@inlined
def _longest_columns(prismatic: Bools, lever: Floats, half: float, guess: Floats, length: Floats) -> None:
    """The longest that each column of the Jacobian gets, from its ``lever`` in the middle, into length (n,).

    From the tip inwards: |d J_j / d q_l| is the length of the outer column of the two, and zero if the inner joint
    slides.
    """
    n = guess.shape[0]
    swung = 0.0  # by all joints up to this one
    for j in range(n):
        if not prismatic[j]:
            swung += half * guess[j]
    after = 0.0
    for i in range(n):
        j = n - 1 - i
        if prismatic[j]:
            length[j] = 1.0
        else:
            length[j] = (lever[j] + after) / (1.0 - swung) if swung < 1.0 else math.inf
            swung -= half * guess[j]
        after += half * guess[j] * length[j]


@inlined
def _tip_errors(prismatic: Bools, length: Floats, half: float, guess: Floats, bend: Floats) -> tuple[float, float]:
    """Upper bounds of (b - b0) - (A - A0) u at the tip: linear, angular."""
    n = guess.shape[0]
    linear, angular = half * bend[0], half * bend[1]
    for j in range(n):
        for i in range(n):
            if not prismatic[min(i, j)]:
                linear += length[max(i, j)] * half * guess[i] * guess[j]
                if i < j and not prismatic[j]:
                    angular += half * guess[i] * guess[j]
    return linear, angular


@njit
def speed_bounds(
    model: ArmModel,
    task: Floats,
    reference: Reference,
    interval: Ints,
    q: Floats,
    dq: Floats,
    half: Floats,
    bend: Floats,
    tolerance: float,
    bound: Floats,
    kept: Bools,
) -> None:
    """Upper bounds (S, n) of |q'| over intervals of half widths ``half`` (S,) about stations with joints q, dq (S, n).

    bend (S, 3): upper bounds there of |p''|, |w'| and |r''|; interval (S,): of the reference. With u = q' and A0, u0
    those of the
    middle: u - u0 = A0^-1 ((b - b0) - (A - A0) u), and |A - A0| by how far the joints get from the middle, at most
    half |u|. A guess U of sup |u| for which the right-hand side stays below U is a bound: u, which is continuous,
    never gets there. kept: one was found, and no bound exceeds |u0| by more than ``tolerance`` of the largest.
    """
    n = q.shape[1]
    w = scratch(n)
    weight = np.empty((n, 3))
    lever, length, guess, new = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for k in range(q.shape[0]):
        kept[k] = False
        for j in range(n):
            w.q[j] = q[k, j]
        tip_and_jacobian(model, w.q, w.arm)
        at = interval[k]
        _matrix(task, reference.null[at], reference.lost[at], reference.idle[at], w)
        if not invert(w.A, w.B):
            continue
        _weigh(task, reference.lost[at], w.B, weight)
        largest = 0.0
        for j in range(n):
            lever[j] = math.sqrt(w.arm.J[0, j] ** 2 + w.arm.J[1, j] ** 2 + w.arm.J[2, j] ** 2)
            largest = max(largest, abs(dq[k, j]))
        for j in range(n):
            guess[j] = abs(dq[k, j]) + 0.02 * largest + 1e-9
        for _ in range(40):
            _longest_columns(model.prismatic, lever, half[k], guess, length)
            linear, angular = _tip_errors(model.prismatic, length, half[k], guess, bend[k])
            below = True
            for j in range(n):
                new[j] = abs(dq[k, j]) + weight[j, 0] * linear + weight[j, 1] * angular
                new[j] += weight[j, 2] * half[k] * bend[k, 2]
                new[j] = new[j] * (1.0 + 1e-9) + 1e-12
                if not new[j] < guess[j]:
                    below = False
            if below:
                kept[k] = True
                break
            for j in range(n):
                guess[j] = max(guess[j], 1.02 * new[j])
            if not guess.max() < 1e9:
                break
        if kept[k]:
            for j in range(n):
                bound[k, j] = new[j]
                if new[j] - abs(dq[k, j]) > tolerance * largest:
                    kept[k] = False
