"""The feedback law, compiled: from joint positions and a target to joint speeds, by the damped inverse.

Nothing is checked here: callers pass float64 arrays of the right shape. SI units, radians; vectors in world axes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.robots import ArmModel, inlined, njit
from armtempo.robots.kernels import cholesky, cholesky_solve, eigenvectors

__all__ = [
    "DAMPED",
    "ESCAPE",
    "LIMIT",
    "PROJECTED",
    "SPEED",
    "STRAY",
    "TWIST",
    "UNREACHED",
    "Law",
    "Scratch",
    "Targets",
    "damped_inverse",
    "feedback_turning",
    "law_at",
    "law_speeds",
    "law_within",
    "posture_speeds",
    "scale_jacobian",
    "scaled",
    "scratch",
    "task_part",
    "tip_and_jacobian",
]

# What a step did beyond the plain law, as bits.
DAMPED, TWIST, SPEED, LIMIT, ESCAPE, PROJECTED, STRAY, UNREACHED = 1, 2, 4, 8, 16, 32, 64, 128
SINGULAR_SHARE_OF_DAMPING = 2e-3  # smaller singular values are as good as zero
HALF_TURN_SINE_MIN = 0.02  # of the error that the law is told at least, where it would see none at 180 degrees


class Law(NamedTuple):
    """The law's constants."""

    position_gain: float
    approach_gain: float
    normal_gain: float
    quaternion: bool
    feed_forward: bool
    task: Floats
    """(m, 6) orthonormal rows that pick what is controlled of a twist; no row mixes its two halves."""
    length: float
    """[m] of the arm: velocities are divided by it before they are compared with angular ones."""
    damping: float
    """Singular value of the scaled Jacobian below which it is damped."""
    pull_max: float
    """[1/s] fastest scaled twist that the joints' caps let the feedback reach."""
    linear_max: float
    angular_max: float
    speed_max: Floats
    position_min: Floats
    position_max: Floats
    posture: Floats
    posture_gain: float
    levers: Floats
    """(n,) [m] how far a unit of each joint moves the tip at most."""


@inlined
def scaled(law: Law, factors: tuple[float, float, float, float], damping_max: float) -> Law:
    """The law with its gains (position, approach, normal) and its damping by ``factors``; no damping above the last."""
    return Law(
        position_gain=factors[0] * law.position_gain,
        approach_gain=factors[1] * law.approach_gain,
        normal_gain=factors[2] * law.normal_gain,
        quaternion=law.quaternion,
        feed_forward=law.feed_forward,
        task=law.task,
        length=law.length,
        damping=min(factors[3] * law.damping, damping_max),
        pull_max=law.pull_max,
        linear_max=law.linear_max,
        angular_max=law.angular_max,
        speed_max=law.speed_max,
        position_min=law.position_min,
        position_max=law.position_max,
        posture=law.posture,
        posture_gain=law.posture_gain,
        levers=law.levers,
    )


class Targets(NamedTuple):
    """Sampled poses; ``stride`` samples make a step (2: with the middles)."""

    position: Floats
    rotation: Floats
    velocity: Floats
    angular_velocity: Floats
    stride: int
    step: float


class Scratch(NamedTuple):
    """Room to work in, for n joints and a task of m rows."""

    p: Floats
    """(n, 3) origins of the turning joints."""
    J: Floats
    """(6, n) the tip's Jacobian."""
    A: Floats
    """(m, n) the task's rows of it, scaled."""
    G: Floats
    """(m, m) A A^T."""
    C: Floats
    """(m, m) its Cholesky factor."""
    V: Floats
    """(m, m) its eigenvectors."""
    x: Floats
    """(6,) the twist that is asked for."""
    y: Floats
    """(m,) the scaled task's part of it."""
    z: Floats
    """(m,) what the free joints' speeds towards the posture do to that part."""
    lost: Floats
    """(m + 1,) a direction of the task that is as good as singular, and the joint speed that is asked for it."""
    tip: Floats
    """(4, 3) the tip's position and the columns n, s, a of its rotation."""
    error: Floats
    """(3,) position [m], approach, whole rotation [rad]."""
    feedback: Floats
    """(6,) the twist that the feedback asks for."""
    before: Floats
    """(6, n) the Jacobian at a step's start."""
    free: Bools
    rate: Floats
    """(n,) joint speeds towards the posture."""


@njit
def scratch(n: int, m: int) -> Scratch:
    """Room to work in, for n joints and a task of m rows."""
    return Scratch(
        p=np.empty((n, 3)),
        J=np.empty((6, n)),
        A=np.empty((m, n)),
        G=np.empty((m, m)),
        C=np.empty((m, m)),
        V=np.empty((m, m)),
        x=np.empty(6),
        y=np.empty(m),
        z=np.empty(m),
        lost=np.zeros(m + 1),
        tip=np.empty((4, 3)),
        error=np.empty(3),
        feedback=np.empty(6),
        before=np.empty((6, n)),
        free=np.empty(n, dtype=np.bool_),
        rate=np.empty(n),
    )


@njit
def tip_and_jacobian(model: ArmModel, q: Floats, w: Scratch) -> None:
    """Into w.tip and w.J. In one piece, in scalars: calls that pass a model cost more than its sums."""
    n, tip, J, points = q.shape[0], w.tip, w.J, w.p
    B = model.base_R
    a, b, c = B[0, 0], B[0, 1], B[0, 2]
    d, e, f = B[1, 0], B[1, 1], B[1, 2]
    g, h, k = B[2, 0], B[2, 1], B[2, 2]
    px, py, pz = model.base_p[0], model.base_p[1], model.base_p[2]
    for i in range(n):
        x, y, z = model.placement_p[i, 0], model.placement_p[i, 1], model.placement_p[i, 2]
        px, py, pz = px + a * x + b * y + c * z, py + d * x + e * y + f * z, pz + g * x + h * y + k * z
        P = model.placement_R[i]
        x, y, z = P[0, 0], P[1, 0], P[2, 0]
        a0, d0, g0 = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z
        x, y, z = P[0, 1], P[1, 1], P[2, 1]
        b0, e0, h0 = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z
        x, y, z = P[0, 2], P[1, 2], P[2, 2]
        c0, f0, k0 = a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + k * z
        x, y, z = model.axis[i, 0], model.axis[i, 1], model.axis[i, 2]
        u, v, t = a0 * x + b0 * y + c0 * z, d0 * x + e0 * y + f0 * z, g0 * x + h0 * y + k0 * z
        if model.prismatic[i]:
            a, b, c, d, e, f, g, h, k = a0, b0, c0, d0, e0, f0, g0, h0, k0
            px, py, pz = px + q[i] * u, py + q[i] * v, pz + q[i] * t
            J[0, i], J[1, i], J[2, i] = u, v, t
            J[3, i], J[4, i], J[5, i] = 0.0, 0.0, 0.0
        else:
            # Each row r of the turned frame: cos r + (1 - cos) (r . axis) axis + sin (r x axis).
            s, co = math.sin(q[i]), math.cos(q[i])
            m = (1.0 - co) * u
            a, b, c = (
                co * a0 + m * x + s * (b0 * z - c0 * y),
                co * b0 + m * y + s * (c0 * x - a0 * z),
                co * c0 + m * z + s * (a0 * y - b0 * x),
            )
            m = (1.0 - co) * v
            d, e, f = (
                co * d0 + m * x + s * (e0 * z - f0 * y),
                co * e0 + m * y + s * (f0 * x - d0 * z),
                co * f0 + m * z + s * (d0 * y - e0 * x),
            )
            m = (1.0 - co) * t
            g, h, k = (
                co * g0 + m * x + s * (h0 * z - k0 * y),
                co * h0 + m * y + s * (k0 * x - g0 * z),
                co * k0 + m * z + s * (g0 * y - h0 * x),
            )
            points[i, 0], points[i, 1], points[i, 2] = px, py, pz
            J[3, i], J[4, i], J[5, i] = u, v, t
    x, y, z = model.tip_p[0], model.tip_p[1], model.tip_p[2]
    px, py, pz = px + a * x + b * y + c * z, py + d * x + e * y + f * z, pz + g * x + h * y + k * z
    tip[0, 0], tip[0, 1], tip[0, 2] = px, py, pz
    for r in range(3):
        x, y, z = model.tip_R[0, r], model.tip_R[1, r], model.tip_R[2, r]
        tip[1 + r, 0] = a * x + b * y + c * z
        tip[1 + r, 1] = d * x + e * y + f * z
        tip[1 + r, 2] = g * x + h * y + k * z
    for i in range(n):
        if not model.prismatic[i]:
            x, y, z = px - points[i, 0], py - points[i, 1], pz - points[i, 2]
            u, v, t = J[3, i], J[4, i], J[5, i]
            J[0, i], J[1, i], J[2, i] = v * z - t * y, t * x - u * z, u * y - v * x


@inlined
def feedback_turning(law: Law, w: Scratch, Rd: Floats) -> int:
    """The feedback's angular velocity into w.x[3:], the errors of orientation into w.error; flags."""
    flags = 0
    n, s, a = w.tip[1], w.tip[2], w.tip[3]
    # E[i, j]: axis j of the target along axis i of the tip, in the order n, s, a.
    e00 = n[0] * Rd[0, 0] + n[1] * Rd[1, 0] + n[2] * Rd[2, 0]
    e01 = n[0] * Rd[0, 1] + n[1] * Rd[1, 1] + n[2] * Rd[2, 1]
    e02 = n[0] * Rd[0, 2] + n[1] * Rd[1, 2] + n[2] * Rd[2, 2]
    e10 = s[0] * Rd[0, 0] + s[1] * Rd[1, 0] + s[2] * Rd[2, 0]
    e11 = s[0] * Rd[0, 1] + s[1] * Rd[1, 1] + s[2] * Rd[2, 1]
    e12 = s[0] * Rd[0, 2] + s[1] * Rd[1, 2] + s[2] * Rd[2, 2]
    e20 = a[0] * Rd[0, 0] + a[1] * Rd[1, 0] + a[2] * Rd[2, 0]
    e21 = a[0] * Rd[0, 1] + a[1] * Rd[1, 1] + a[2] * Rd[2, 1]
    e22 = a[0] * Rd[0, 2] + a[1] * Rd[1, 2] + a[2] * Rd[2, 2]
    hx, hy, hz = 0.5 * (e21 - e12), 0.5 * (e02 - e20), 0.5 * (e10 - e01)  # sin(angle) times the axis
    sine = math.sqrt(hx * hx + hy * hy + hz * hz)
    angle = math.atan2(sine, 0.5 * (e00 + e11 + e22 - 1.0))
    across = math.sqrt(e02 * e02 + e12 * e12)
    w.error[1] = math.atan2(across, e22)
    w.error[2] = angle
    if law.quaternion:  # 2 K sin(angle/2) about the axis; towards 180 degrees the axis comes from the symmetric part
        size = 2.0 * law.approach_gain * math.sin(0.5 * angle)
        if sine > 1e-6:
            fx, fy, fz = size * hx / sine, size * hy / sine, size * hz / sine
        elif e00 + e11 + e22 > 0.0:
            fx, fy, fz = law.approach_gain * hx, law.approach_gain * hy, law.approach_gain * hz
        else:
            flags |= ESCAPE
            if e00 >= e11 and e00 >= e22:
                fx, fy, fz = 1.0 + e00, e10, e20
            elif e11 >= e22:
                fx, fy, fz = e01, 1.0 + e11, e21
            else:
                fx, fy, fz = e02, e12, 1.0 + e22
            size /= math.sqrt(fx * fx + fy * fy + fz * fz)
            fx, fy, fz = fx * size, fy * size, fz * size
    else:  # the paper's: a x a_d and, about a, n x n_d
        u, v, t = -e12, e02, e10
        if e22 < 0.0 and across < HALF_TURN_SINE_MIN:
            flags |= ESCAPE
            if across > 1e-12:
                u, v = HALF_TURN_SINE_MIN * u / across, HALF_TURN_SINE_MIN * v / across
            else:
                u, v = HALF_TURN_SINE_MIN, 0.0
        around = math.sqrt(e00 * e00 + e10 * e10)
        if e00 < 0.0 and abs(t) < HALF_TURN_SINE_MIN * around:
            flags |= ESCAPE
            t = HALF_TURN_SINE_MIN * around if t >= 0.0 else -HALF_TURN_SINE_MIN * around
        fx, fy, fz = law.approach_gain * u, law.approach_gain * v, law.normal_gain * t
    for r in range(3):
        w.x[3 + r] = fx * n[r] + fy * s[r] + fz * a[r]
    return flags


@inlined
def task_part(task: Floats, length: float, x: Floats, out: Floats) -> None:
    """The scaled task's part of a twist, into out (m,); six rows are all of it, whatever their axes."""
    m = task.shape[0]
    for i in range(m):
        if m == 6:
            out[i] = x[i] / length if i < 3 else x[i]
        else:
            out[i] = (task[i, 0] * x[0] + task[i, 1] * x[1] + task[i, 2] * x[2]) / length
            out[i] += task[i, 3] * x[3] + task[i, 4] * x[4] + task[i, 5] * x[5]


@inlined
def _cap(x: Floats, first: int, most: float) -> bool:
    size = math.sqrt(x[first] ** 2 + x[first + 1] ** 2 + x[first + 2] ** 2)
    if size <= most:
        return False
    for r in range(first, first + 3):
        x[r] *= most / size
    return True


@inlined
def damped_inverse(w: Scratch, damping: float, most: float, step: float) -> bool:
    """w.y: (A A^T)^-1 (w.y - w.z) over the free joints, with damping; was anything damped?

    w.y, what is asked for, has 2/(damping^2 + s^2) in place of 1/s^2 for small s, and ``most`` of it there at most:
    speeds of |w.y|/damping at most, exact where nothing is damped. w.z, what the spare joints would do to it, is undone
    all the same.
    """
    m, n = w.A.shape
    A, G, C, y = w.A, w.G, w.C, w.y
    for i in range(m):
        for j in range(i + 1):
            value = 0.0
            for k in range(n):
                if w.free[k]:
                    value += A[i, k] * A[j, k]
            G[i, j] = G[j, i] = value
    # All singular values are above the damping exactly where this stays positive definite: no need to know them.
    if cholesky(G, damping * damping, C) and cholesky(G, 0.0, C):
        for i in range(m):
            y[i] -= w.z[i]
        cholesky_solve(C, y)
        return False
    V = w.V
    eigenvectors(G, V)
    for k in range(m):
        wanted = undone = 0.0
        for i in range(m):
            wanted += V[i, k] * y[i]
            undone += V[i, k] * w.z[i]
        square = max(G[k, k], 0.0)
        if square > damping * damping:
            wanted /= square
        else:
            wanted = min(max(wanted, -most), most)
            wanted *= 2.0 / (max(damping * damping, 2.0 * step * abs(wanted)) + square)
            size = 0.0
            for j in range(n):
                if w.free[j]:
                    side = 0.0
                    for i in range(m):
                        side += A[i, j] * V[i, k]
                    size += side * side
            size = math.sqrt(size)
            if size < SINGULAR_SHARE_OF_DAMPING * damping:  # as good as singular: ``_leave_singularity`` decides
                for i in range(m):
                    w.lost[i] = V[i, k]
                w.lost[m] = wanted * SINGULAR_SHARE_OF_DAMPING * damping
                wanted = 0.0
        C[0, k] = wanted - undone / (square + 1e-12)
    for i in range(m):
        y[i] = 0.0
        for k in range(m):
            y[i] += V[i, k] * C[0, k]
    return True


@inlined
def scale_jacobian(law: Law, w: Scratch) -> None:
    """The task's rows of the Jacobian w.J, scaled, into w.A."""
    m, n = w.A.shape
    for i in range(m):
        for k in range(n):
            if m == 6:
                w.A[i, k] = w.J[i, k] / law.length if i < 3 else w.J[i, k]
            else:
                row = law.task[i]
                w.A[i, k] = (row[0] * w.J[0, k] + row[1] * w.J[1, k] + row[2] * w.J[2, k]) / law.length
                w.A[i, k] += row[3] * w.J[3, k] + row[4] * w.J[4, k] + row[5] * w.J[5, k]


@njit
def _leave_singularity(model: ArmModel, law: Law, q: Floats, step: float, w: Scratch, qd: Floats) -> None:
    """Adds to qd what is asked for the singular direction w.lost where that leads away from the singularity.

    A straight arm could not be bent again by the damped inverse alone, and one that is pulled on would pass through
    straight and come back with its elbow on the other side: it stops short of that.
    """
    m, n = w.A.shape
    along, at, near = np.zeros(n), q.copy(), scratch(n, m)
    size = 0.0
    for k in range(n):
        if w.free[k]:
            for i in range(m):
                along[k] += w.A[i, k] * w.lost[i]
            size += along[k] * along[k]
    size = math.sqrt(size)
    if size == 0.0:
        return
    for k in range(n):
        along[k] *= w.lost[m] / size
        at[k] += 1e-4 * along[k] / abs(w.lost[m])
    tip_and_jacobian(model, at, near)
    scale_jacobian(law, near)
    there = 0.0
    for k in range(n):
        if w.free[k]:
            side = 0.0
            for i in range(m):
                side += near.A[i, k] * w.lost[i]
            there += side * side
    if math.sqrt(there) <= size:
        return
    for k in range(n):
        low, high = (law.position_min[k] - q[k]) / step, (law.position_max[k] - q[k]) / step
        if w.free[k]:
            qd[k] = min(max(qd[k] + along[k], low), high)


@inlined
def _ask_twist(law: Law, targets: Targets, at: int, w: Scratch) -> int:
    """The twist that is asked for into w.x, the feedback's part of it into w.feedback, errors into w.error; flags."""
    x = w.x
    flags = feedback_turning(law, w, targets.rotation[at])
    square = 0.0
    for r in range(3):
        off = targets.position[at, r] - w.tip[0, r]
        square += off * off
        x[r] = law.position_gain * off
    w.error[0] = math.sqrt(square)
    for r in range(6):
        w.feedback[r] = x[r]
    if law.feed_forward:
        for r in range(3):
            x[r] += targets.velocity[at, r]
            x[3 + r] += targets.angular_velocity[at, r]
    if _cap(x, 0, law.linear_max):
        flags |= TWIST
    if _cap(x, 3, law.angular_max):
        flags |= TWIST
    return flags


@inlined
def _find_left_out(task: Floats, x: Floats) -> int:
    """Flags of what the task leaves out of the asked twist, in its two halves."""
    flags, m = 0, task.shape[0]
    astray = left = 0.0
    if m < 6:
        astray = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        left = x[3] * x[3] + x[4] * x[4] + x[5] * x[5]
        for i in range(m):
            row = task[i]
            astray -= (row[0] * x[0] + row[1] * x[1] + row[2] * x[2]) ** 2
            left -= (row[3] * x[3] + row[4] * x[4] + row[5] * x[5]) ** 2
    if left > 1e-14 * (1.0 + x[3] * x[3] + x[4] * x[4] + x[5] * x[5]):
        flags |= PROJECTED
    if astray > 1e-14 * (1.0 + x[0] * x[0] + x[1] * x[1] + x[2] * x[2]):
        flags |= STRAY
    return flags


@inlined
def _damping_for(law: Law, step: float, w: Scratch) -> float:
    """A step must not jump across a singular posture: the faster the feedback wants the tip, the more is damped."""
    pull = 0.0
    task_part(law.task, law.length, w.feedback, w.y)
    for i in range(law.task.shape[0]):
        pull += w.y[i] * w.y[i]
    return max(law.damping, math.sqrt(2.0 * step * min(math.sqrt(pull), law.pull_max)))


@inlined
def _solve_free_joints(law: Law, q: Floats, step: float, posture_rate: Floats, w: Scratch, qd: Floats) -> int:
    """Joint speeds for the twist w.x into qd; joints that would pass a position limit are held there; flags."""
    m, n = w.A.shape
    A, flags = w.A, 0
    damping = _damping_for(law, step, w)
    for k in range(n):
        w.free[k] = True
        qd[k] = posture_rate[k]
    for _ in range(n + 1):
        task_part(law.task, law.length, w.x, w.y)
        for i in range(m):  # what the joints that are held leave to the others
            w.z[i] = 0.0
            for k in range(n):
                if w.free[k]:
                    w.z[i] += A[i, k] * qd[k]
                else:
                    w.y[i] -= A[i, k] * qd[k]
        w.lost[m] = 0.0
        if damped_inverse(w, damping, law.pull_max, step):
            flags |= DAMPED
        again = False
        for k in range(n):
            if not w.free[k]:
                continue
            speed = posture_rate[k]
            for i in range(m):
                speed += A[i, k] * w.y[i]
            low, high = (law.position_min[k] - q[k]) / step, (law.position_max[k] - q[k]) / step
            if speed < low or speed > high:
                w.free[k] = False
                again = True
                speed = min(max(speed, low), high)
            qd[k] = speed
        if not again:
            break
        flags |= LIMIT
        for k in range(n):
            if w.free[k]:
                qd[k] = posture_rate[k]
    return flags


@inlined
def _cap_speeds(speed_max: Floats, qd: Floats) -> int:
    """Slows all joints in one ratio until none is faster than its cap; flags."""
    fastest = 1.0
    for k in range(qd.shape[0]):
        fastest = max(fastest, abs(qd[k]) / speed_max[k])
    if not fastest > 1.0:
        return 0
    for k in range(qd.shape[0]):
        qd[k] /= fastest
        if abs(qd[k]) > speed_max[k]:  # the last bit
            qd[k] = math.copysign(speed_max[k], qd[k])
    return SPEED


@njit
def law_speeds(
    model: ArmModel, law: Law, q: Floats, targets: Targets, at: int, w: Scratch, posture_rate: Floats, qd: Floats
) -> int:
    """Joint speeds of the law at q for sample ``at`` of the targets, into qd (n,); flags. Errors into w.error."""
    tip_and_jacobian(model, q, w)
    flags = _ask_twist(law, targets, at, w)
    scale_jacobian(law, w)
    flags |= _find_left_out(law.task, w.x)
    flags |= _solve_free_joints(law, q, targets.step, posture_rate, w, qd)
    if w.lost[w.A.shape[0]] != 0.0:
        _leave_singularity(model, law, q, targets.step, w, qd)
    return flags | _cap_speeds(law.speed_max, qd)


@inlined
def posture_speeds(law: Law, q: Floats, rate: Floats) -> None:
    """Speeds that draw spare joints to the posture, into rate (n,): half of their caps at most."""
    for k in range(q.shape[0]):
        rate[k] = law.posture_gain * (law.posture[k] - q[k])
        rate[k] = min(max(rate[k], -0.5 * law.speed_max[k]), 0.5 * law.speed_max[k])


@njit
def law_at(model: ArmModel, law: Law, q: Floats, targets: Targets, at: int, qd: Floats) -> int:
    """The law once: joint speeds at q for row ``at`` of the targets, into qd (n,); flags."""
    return int(law_within(model, law, q, targets, at, scratch(q.shape[0], law.task.shape[0]), qd))


@njit
def law_within(model: ArmModel, law: Law, q: Floats, targets: Targets, at: int, w: Scratch, qd: Floats) -> int:
    """``law_at`` for who calls it often and has made the ``scratch`` once."""
    posture_speeds(law, q, w.rate)
    return int(law_speeds(model, law, q, targets, at, w, w.rate, qd))
