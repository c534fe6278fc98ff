"""Inner loops of ``FeedbackIK``: the law, the damped inverse, one run over sampled targets with its error bounds.

Nothing is checked here: callers pass float64 arrays of the right shape. SI units, radians; vectors in world axes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.robots import ArmModel, inlined, njit

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
    "asked",
    "inverse",
    "law_at",
    "law_within",
    "scaled",
    "scratch",
    "tip_and_jacobian",
    "track",
    "track_many",
    "feedback_turning",
]

Quaternion = tuple[float, float, float, float]

# What a step did beyond the plain law, as bits.
DAMPED, TWIST, SPEED, LIMIT, ESCAPE, PROJECTED, STRAY, UNREACHED = 1, 2, 4, 8, 16, 32, 64, 128
EULER, HEUN, RK4 = 0, 1, 2
FLOOR = 2e-3  # singular values, as a share of the damping, that a singular posture is left with
FLEE = 0.02  # sine of the error that the law is told at least, where it would see none at 180 degrees


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


class Targets(NamedTuple):
    """Sampled poses; ``stride`` samples make a step (2: with the middles)."""

    position: Floats
    rotation: Floats
    velocity: Floats
    angular_velocity: Floats
    stride: int
    step: float


class Scratch(NamedTuple):
    p: Floats
    J: Floats
    A: Floats
    G: Floats
    C: Floats
    V: Floats
    x: Floats
    y: Floats
    z: Floats
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
        np.empty((n, 3)),
        np.empty((6, n)),
        np.empty((m, n)),
        np.empty((m, m)),
        np.empty((m, m)),
        np.empty((m, m)),
        np.empty(6),
        np.empty(m),
        np.empty(m),
        np.zeros(m + 1),
        np.empty((4, 3)),
        np.empty(3),
        np.empty(6),
        np.empty((6, n)),
        np.empty(n, dtype=np.bool_),
        np.empty(n),
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
        if e22 < 0.0 and across < FLEE:
            flags |= ESCAPE
            if across > 1e-12:
                u, v = FLEE * u / across, FLEE * v / across
            else:
                u, v = FLEE, 0.0
        around = math.sqrt(e00 * e00 + e10 * e10)
        if e00 < 0.0 and abs(t) < FLEE * around:
            flags |= ESCAPE
            t = FLEE * around if t >= 0.0 else -FLEE * around
        fx, fy, fz = law.approach_gain * u, law.approach_gain * v, law.normal_gain * t
    for r in range(3):
        w.x[3 + r] = fx * n[r] + fy * s[r] + fz * a[r]
    return flags


@inlined
def asked(task: Floats, length: float, x: Floats, out: Floats) -> None:
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
def _cholesky(G: Floats, shift: float, C: Floats) -> bool:
    """C C^T = G - shift I; False where that is not positive definite."""
    m = G.shape[0]
    for i in range(m):
        for j in range(i + 1):
            value = G[i, j]
            if i == j:
                value -= shift
            for k in range(j):
                value -= C[i, k] * C[j, k]
            if i == j:
                if not value > 0.0:
                    return False
                C[i, i] = math.sqrt(value)
            else:
                C[i, j] = value / C[j, j]
    return True


@njit
def _jacobi(G: Floats, V: Floats) -> None:
    """Eigenvalues of the symmetric G onto its diagonal, eigenvectors into the columns of V (Jacobi's rotations)."""
    m = G.shape[0]
    for i in range(m):
        for j in range(m):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(20):
        off = total = 0.0
        for i in range(m):
            total += G[i, i] * G[i, i]
            for j in range(i):
                off += G[i, j] * G[i, j]
        if off <= 1e-28 * total:
            return
        for i in range(m):
            for j in range(i + 1, m):
                if G[i, j] * G[i, j] <= 1e-32 * abs(G[i, i] * G[j, j]):
                    continue
                theta = 0.5 * (G[j, j] - G[i, i]) / G[i, j]
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                if theta < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(m):
                    left, right = G[k, i], G[k, j]
                    G[k, i], G[k, j] = c * left - s * right, s * left + c * right
                for k in range(m):
                    left, right = G[i, k], G[j, k]
                    G[i, k], G[j, k] = c * left - s * right, s * left + c * right
                    left, right = V[k, i], V[k, j]
                    V[k, i], V[k, j] = c * left - s * right, s * left + c * right


@inlined
def inverse(w: Scratch, damping: float, most: float, step: float) -> bool:
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
    if _cholesky(G, damping * damping, C) and _cholesky(G, 0.0, C):
        for i in range(m):
            y[i] -= w.z[i]
            for k in range(i):
                y[i] -= C[i, k] * y[k]
            y[i] /= C[i, i]
        for i in range(m - 1, -1, -1):
            for k in range(i + 1, m):
                y[i] -= C[k, i] * y[k]
            y[i] /= C[i, i]
        return False
    V = w.V
    _jacobi(G, V)
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
            if size < FLOOR * damping:  # as good as singular: ``_leave`` decides
                for i in range(m):
                    w.lost[i] = V[i, k]
                w.lost[m] = wanted * FLOOR * damping
                wanted = 0.0
        C[0, k] = wanted - undone / (square + 1e-12)
    for i in range(m):
        y[i] = 0.0
        for k in range(m):
            y[i] += V[i, k] * C[0, k]
    return True


@inlined
def scaled(law: Law, w: Scratch) -> None:
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
def _leave(model: ArmModel, law: Law, q: Floats, step: float, w: Scratch, qd: Floats) -> None:
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
    scaled(law, near)
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


@njit
def _law(
    model: ArmModel, law: Law, q: Floats, targets: Targets, at: int, w: Scratch, posture_rate: Floats, qd: Floats
) -> int:
    """Joint speeds of the law at q for sample ``at`` of the targets, into qd (n,); flags. Errors into w.error."""
    n, m = q.shape[0], law.task.shape[0]
    x, A = w.x, w.A
    tip_and_jacobian(model, q, w)
    flags = feedback_turning(law, w, targets.rotation[at])
    square = 0.0
    for r in range(3):
        off = targets.position[at, r] - w.tip[0, r]
        square += off * off
        x[r] = law.position_gain * off
    w.error[0] = math.sqrt(square)
    # A step must not jump across a singular posture: the faster the feedback would have the tip, the more is damped.
    pull = 0.0
    asked(law.task, law.length, x, w.y)
    for i in range(m):
        pull += w.y[i] * w.y[i]
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
    # What the task leaves out of the asked twist, in its two halves.
    astray = left = 0.0
    if m < 6:
        astray = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
        left = x[3] * x[3] + x[4] * x[4] + x[5] * x[5]
        for i in range(m):
            row = law.task[i]
            astray -= (row[0] * x[0] + row[1] * x[1] + row[2] * x[2]) ** 2
            left -= (row[3] * x[3] + row[4] * x[4] + row[5] * x[5]) ** 2
    scaled(law, w)
    if left > 1e-14 * (1.0 + x[3] * x[3] + x[4] * x[4] + x[5] * x[5]):
        flags |= PROJECTED
    if astray > 1e-14 * (1.0 + x[0] * x[0] + x[1] * x[1] + x[2] * x[2]):
        flags |= STRAY
    pull = min(math.sqrt(pull), law.pull_max)
    damping = max(law.damping, math.sqrt(2.0 * targets.step * pull))

    for k in range(n):
        w.free[k] = True
        qd[k] = posture_rate[k]
    for _ in range(n + 1):
        asked(law.task, law.length, x, w.y)
        for i in range(m):  # what the joints that are held leave to the others
            w.z[i] = 0.0
            for k in range(n):
                if w.free[k]:
                    w.z[i] += A[i, k] * qd[k]
                else:
                    w.y[i] -= A[i, k] * qd[k]
        w.lost[m] = 0.0
        damped = inverse(w, damping, law.pull_max, targets.step)
        again = False
        for k in range(n):
            if not w.free[k]:
                continue
            speed = posture_rate[k]
            for i in range(m):
                speed += A[i, k] * w.y[i]
            low = (law.position_min[k] - q[k]) / targets.step
            high = (law.position_max[k] - q[k]) / targets.step
            if speed < low or speed > high:
                w.free[k] = False
                again = True
                speed = min(max(speed, low), high)
            qd[k] = speed
        if damped:
            flags |= DAMPED
        if not again:
            break
        flags |= LIMIT
        for k in range(n):
            if w.free[k]:
                qd[k] = posture_rate[k]
    if w.lost[m] != 0.0:
        _leave(model, law, q, targets.step, w, qd)
    fastest = 1.0
    for k in range(n):
        fastest = max(fastest, abs(qd[k]) / law.speed_max[k])
    if fastest > 1.0:
        flags |= SPEED
        for k in range(n):
            qd[k] /= fastest
            if abs(qd[k]) > law.speed_max[k]:  # the last bit
                qd[k] = math.copysign(law.speed_max[k], qd[k])
    return flags


@inlined
def _posture(law: Law, q: Floats, rate: Floats) -> None:
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
    _posture(law, q, w.rate)
    return int(_law(model, law, q, targets, at, w, w.rate, qd))


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
    (T, 4): of these, and of the position up to the next sample (of a
    target that moves evenly); flags (T,).
    """
    steps, n = q.shape[0] - 1, q.shape[1]
    w = scratch(n, law.task.shape[0])
    rate, feedback = np.zeros(n), np.empty(6)
    k1, k2, k3, k4, at = np.empty(n), np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    h, stride = targets.step, targets.stride
    for k in range(steps + 1):
        here = k * stride
        _posture(law, q[k], rate)
        flag = _law(model, law, q[k], targets, here, w, rate, k1)
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
        if method == HEUN:
            for i in range(n):
                at[i] = q[k, i] + h * k1[i]
            _posture(law, at, rate)
            flag |= _law(model, law, at, targets, here + stride, w, rate, k2)
        elif method == RK4:
            for i in range(n):
                at[i] = q[k, i] + 0.5 * h * k1[i]
            _posture(law, at, rate)
            flag |= _law(model, law, at, targets, here + 1, w, rate, k2)
            for i in range(n):
                at[i] = q[k, i] + 0.5 * h * k2[i]
            _posture(law, at, rate)
            flag |= _law(model, law, at, targets, here + 1, w, rate, k3)
            for i in range(n):
                at[i] = q[k, i] + h * k3[i]
            _posture(law, at, rate)
            flag |= _law(model, law, at, targets, here + 2, w, rate, k4)
        for i in range(n):
            speed = k1[i]
            if method == HEUN:
                speed = 0.5 * (k1[i] + k2[i])
            elif method == RK4:
                speed = (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0
            moved = q[k, i] + h * speed
            if moved < law.position_min[i] or moved > law.position_max[i]:
                flag |= LIMIT
                moved = min(max(moved, law.position_min[i]), law.position_max[i])
            q[k + 1, i] = moved
            at[i] = moved - q[k, i]
        _step_bounds(law, w.before, at, feedback, plain, targets, here, bounds[k], bounds[k + 1])
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
            targets.position[b],
            targets.rotation[b],
            targets.velocity[b],
            targets.angular_velocity[b],
            targets.stride,
            targets.step,
        )
        track(model, law, method, one, q[b], qd[b], errors[b], bounds[b], flags[b])


@njit
def _decay(x: float, gain: float, cross: float, h: float) -> float:
    """X' = -gain sin x + cross (1 - cos x) after h, exactly: with t = tan(x/2), t' = cross t^2 - gain t."""
    if x >= math.pi:
        return math.pi
    t, left = math.tan(0.5 * x), math.exp(-gain * h)
    rest = 1.0 - cross / gain * t * (1.0 - left)
    return math.pi if rest <= 0.0 else min(2.0 * math.atan(t * left / rest), math.pi)


@njit
def _quaternion(x: float, y: float, z: float) -> Quaternion:
    """Of a rotation vector."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = math.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
    return math.cos(0.5 * angle), s * x, s * y, s * z


@njit
def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    )


@njit
def _angle(a: Quaternion) -> float:
    return 2.0 * math.atan2(math.sqrt(a[1] * a[1] + a[2] * a[2] + a[3] * a[3]), abs(a[0]))


@njit
def _between(A: Floats, B: Floats) -> Quaternion:
    """B A^T, from its largest component: to rounding, half turns too."""
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for c in range(3):
        xx, xy, xz = xx + B[0, c] * A[0, c], xy + B[0, c] * A[1, c], xz + B[0, c] * A[2, c]
        yx, yy, yz = yx + B[1, c] * A[0, c], yy + B[1, c] * A[1, c], yz + B[1, c] * A[2, c]
        zx, zy, zz = zx + B[2, c] * A[0, c], zy + B[2, c] * A[1, c], zz + B[2, c] * A[2, c]
    if xx + yy + zz > 0.0:
        size = math.sqrt(1.0 + xx + yy + zz)
        s = 0.5 / size
        return 0.5 * size, s * (zy - yz), s * (xz - zx), s * (yx - xy)
    if xx >= yy and xx >= zz:
        size = math.sqrt(1.0 + xx - yy - zz)
        s = 0.5 / size
        return s * (zy - yz), 0.5 * size, s * (xy + yx), s * (xz + zx)
    if yy >= zz:
        size = math.sqrt(1.0 - xx + yy - zz)
        s = 0.5 / size
        return s * (xz - zx), s * (xy + yx), 0.5 * size, s * (yz + zy)
    size = math.sqrt(1.0 - xx - yy + zz)
    s = 0.5 / size
    return s * (yx - xy), s * (xz + zx), s * (yz + zy), 0.5 * size


@njit
def _chord(J: Floats, dq: Floats, out: Floats) -> None:
    """Where dq takes the tip, from the Jacobian, into out (7,): its place to third order, its turning to second.

    out[6]: the second derivative of its place along dq.
    """
    fx = fy = fz = sx = sy = sz = tx = ty = tz = 0.0  # the place's derivatives by the joints from j on
    wx = wy = wz = vx = vy = vz = 0.0  # their turning, and half its derivative
    for j in range(dq.shape[0] - 1, -1, -1):
        d = dq[j]
        x, y, z = d * J[3, j], d * J[4, j], d * J[5, j]
        jx, jy, jz = d * J[0, j], d * J[1, j], d * J[2, j]
        ax, ay, az = jx + 3.0 * fx, jy + 3.0 * fy, jz + 3.0 * fz
        ax, ay, az = y * az - z * ay + 3.0 * sx, z * ax - x * az + 3.0 * sy, x * ay - y * ax + 3.0 * sz
        tx, ty, tz = tx + y * az - z * ay, ty + z * ax - x * az, tz + x * ay - y * ax
        ax, ay, az = jx + 2.0 * fx, jy + 2.0 * fy, jz + 2.0 * fz
        sx, sy, sz = sx + y * az - z * ay, sy + z * ax - x * az, sz + x * ay - y * ax
        fx, fy, fz = fx + jx, fy + jy, fz + jz
        vx, vy, vz = vx + 0.5 * (y * wz - z * wy), vy + 0.5 * (z * wx - x * wz), vz + 0.5 * (x * wy - y * wx)
        wx, wy, wz = wx + x, wy + y, wz + z
    out[0], out[1], out[2] = fx + sx / 2.0 + tx / 6.0, fy + sy / 2.0 + ty / 6.0, fz + sz / 2.0 + tz / 6.0
    out[3], out[4], out[5] = wx + vx, wy + vy, wz + vz
    out[6] = math.sqrt(sx * sx + sy * sy + sz * sz)


@njit
def _step_bounds(
    law: Law,
    J: Floats,
    dq: Floats,
    feedback: Floats,
    plain: bool,
    targets: Targets,
    here: int,
    old: Floats,
    new: Floats,
) -> None:
    """Bounds (4,) after a step dq from where the Jacobian was J, from those before; see ``FeedbackIK``.

    feedback (6,): what the law asked for there; not ``plain``: it was not the law's (it left a half turn).
    """
    n, h = dq.shape[0], targets.step
    then = here + targets.stride
    move = np.empty(7)
    _chord(J, dq, move)
    # The next derivatives along dq at the worst posture: the fourth of the tip's place, the third of its turning.
    turn = pairs = place = bend = spin = 0.0
    for j in range(n):
        u = abs(dq[j])
        if J[3, j] * J[3, j] + J[4, j] * J[4, j] + J[5, j] * J[5, j] > 0.5:
            place += law.levers[j] * ((turn + u) ** 4 - turn**4)
            bend += law.levers[j] * ((turn + u) ** 3 - turn**3)
            spin += u * (turn * turn + pairs)
            pairs += u * turn
            turn += u
        else:
            place += 4.0 * u * turn**3
            bend += 3.0 * u * turn * turn
    rest = place / 24.0
    # The turn of an angular velocity that is not constant, against the turn of its mean.
    slack = spin / 6.0 + turn * (pairs + spin) / 8.0 + 0.5 * (0.25 * pairs + spin / 6.0) ** 2

    parted = off = 0.0
    for r in range(3):
        apart = targets.position[then, r] - targets.position[here, r] - move[r]
        parted += apart * apart
        off += (apart + h * feedback[r]) ** 2
    # The second: where the gain is too high for the step, the caps hold the tip, and the first would grow for ever.
    new[0] = min(abs(1.0 - law.position_gain * h) * old[0] + math.sqrt(off), old[0] + math.sqrt(parted)) + rest
    # Between the samples an error is off its chord by an eighth of its greatest second derivative: the tip's part.
    old[3] = max(old[0], new[0]) + 0.125 * (move[6] + bend)

    turned = _product(
        _quaternion(-move[3], -move[4], -move[5]), _between(targets.rotation[here], targets.rotation[then])
    )
    apart = _angle(turned) + slack
    for r in range(1, 3):
        new[r] = min(old[r] + apart, math.pi)
    if not plain:
        return
    fx, fy, fz = h * feedback[3], h * feedback[4], h * feedback[5]
    fed = math.sqrt(fx * fx + fy * fy + fz * fz)
    off = _angle(_product(_quaternion(fx, fy, fz), turned)) + slack
    if law.quaternion:  # the turn is about the error's own axis
        z = law.approach_gain * h
        left = max(old[2] - 2.0 * z * math.sin(0.5 * old[2]), (z - 1.0) * old[2])
        new[2] = min(new[2], left + off)
        new[1] = min(new[1], new[2])
        return
    # The feedback does not stay what it was at the step's start, as that of the exact solution does.
    chord = 2.0 * math.sin(min(0.5 * (old[2] + fed), 0.5 * math.pi))
    most = max(law.approach_gain, law.normal_gain)
    change = min(law.approach_gain + law.normal_gain, most + (law.approach_gain + 3.0 * law.normal_gain) * chord)
    for r in range(1, 3):
        gain = law.approach_gain if r == 1 else min(law.approach_gain, law.normal_gain)
        cross = 0.0 if r == 1 else law.normal_gain / math.sqrt(27.0)
        late = 0.5 * h * change * fed
        if math.tan(min(old[r] + fed, 1.57)) * cross >= gain or old[r] + fed >= 1.57:  # there errors part
            late *= math.exp(math.sqrt(gain * gain + cross * cross) * h)
        new[r] = min(new[r], _decay(old[r], gain, cross, h) + late + off)
