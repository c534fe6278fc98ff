"""Compiled functions for inner loops: chain kinematics, inverse dynamics, path coefficients, capsule distances.

Sources: recursive Newton-Euler (Luh, Walker, Paul 1980); path coefficients Lee1991 eq. 8; segment distance by
comparing all candidate point pairs, which needs no tolerance for parallel segments.
All angles in radians, lengths in metres. Nothing is checked here: callers pass float64 arrays of the right shape.
"""

from __future__ import annotations

import math

import numpy as np

from armtempo.arrays import Floats
from armtempo.robots._model import ArmModel
from armtempo.robots._numba import njit

__all__ = [
    "batch_inverse_dynamics",
    "batch_jacobian",
    "batch_link_frames",
    "batch_mass_matrix",
    "inverse_dynamics",
    "link_frames",
    "path_coefficients",
    "segment_distance",
]

Vector = tuple[float, float, float]


@njit
def _joint_transform(model: ArmModel, i: int, qi: float, R: Floats, p: Floats) -> None:
    """Pose of link i in link i - 1 at joint position qi, into R (3, 3) and p (3,)."""
    ax, ay, az = model.axis[i, 0], model.axis[i, 1], model.axis[i, 2]
    P = model.placement_R[i]
    if model.prismatic[i]:
        for r in range(3):
            p[r] = model.placement_p[i, r] + qi * (P[r, 0] * ax + P[r, 1] * ay + P[r, 2] * az)
            for c in range(3):
                R[r, c] = P[r, c]
        return
    s, c1 = math.sin(qi), math.cos(qi)
    v = 1.0 - c1
    r00, r01, r02 = c1 + ax * ax * v, ax * ay * v - az * s, ax * az * v + ay * s
    r10, r11, r12 = ay * ax * v + az * s, c1 + ay * ay * v, ay * az * v - ax * s
    r20, r21, r22 = az * ax * v - ay * s, az * ay * v + ax * s, c1 + az * az * v
    for r in range(3):
        p[r] = model.placement_p[i, r]
        a, b, d = P[r, 0], P[r, 1], P[r, 2]
        R[r, 0] = a * r00 + b * r10 + d * r20
        R[r, 1] = a * r01 + b * r11 + d * r21
        R[r, 2] = a * r02 + b * r12 + d * r22


@njit
def _joint_transforms(model: ArmModel, q: Floats, R: Floats, p: Floats) -> None:
    for i in range(q.shape[0]):
        _joint_transform(model, i, q[i], R[i], p[i])


@njit
def link_frames(model: ArmModel, q: Floats, R_out: Floats, p_out: Floats) -> None:
    """World poses of all links at q (n,), into R_out (n, 3, 3) and p_out (n, 3)."""
    R = np.empty((3, 3))
    p = np.empty(3)
    R_before, p_before = model.base_R, model.base_p
    for i in range(q.shape[0]):
        _joint_transform(model, i, q[i], R, p)
        for r in range(3):
            a, b, c = R_before[r, 0], R_before[r, 1], R_before[r, 2]
            p_out[i, r] = p_before[r] + a * p[0] + b * p[1] + c * p[2]
            for k in range(3):
                R_out[i, r, k] = a * R[0, k] + b * R[1, k] + c * R[2, k]
        R_before, p_before = R_out[i], p_out[i]


@njit
def _newton_euler(
    model: ArmModel, R: Floats, p: Floats, qd: Floats, qdd: Floats, gravity: float, force: Floats, tau_out: Floats
) -> None:
    """Newton-Euler in link frames. R, p from ``_joint_transforms``; gravity: factor on g; force: (n, 6) scratch."""
    n = qd.shape[0]
    wx = wy = wz = 0.0  # angular velocity
    ux = uy = uz = 0.0  # angular acceleration
    B, g = model.base_R, model.gravity
    # A base that accelerates upwards stands for gravity.
    vx = -gravity * (B[0, 0] * g[0] + B[1, 0] * g[1] + B[2, 0] * g[2])
    vy = -gravity * (B[0, 1] * g[0] + B[1, 1] * g[1] + B[2, 1] * g[2])
    vz = -gravity * (B[0, 2] * g[0] + B[1, 2] * g[1] + B[2, 2] * g[2])
    for i in range(n):
        px, py, pz = p[i, 0], p[i, 1], p[i, 2]
        # acceleration of this link's origin, in the frame of the link before
        cx, cy, cz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
        vx, vy, vz = (
            vx + uy * pz - uz * py + wy * cz - wz * cy,
            vy + uz * px - ux * pz + wz * cx - wx * cz,
            vz + ux * py - uy * px + wx * cy - wy * cx,
        )
        r00, r01, r02 = R[i, 0, 0], R[i, 0, 1], R[i, 0, 2]
        r10, r11, r12 = R[i, 1, 0], R[i, 1, 1], R[i, 1, 2]
        r20, r21, r22 = R[i, 2, 0], R[i, 2, 1], R[i, 2, 2]
        wx, wy, wz = r00 * wx + r10 * wy + r20 * wz, r01 * wx + r11 * wy + r21 * wz, r02 * wx + r12 * wy + r22 * wz
        ux, uy, uz = r00 * ux + r10 * uy + r20 * uz, r01 * ux + r11 * uy + r21 * uz, r02 * ux + r12 * uy + r22 * uz
        vx, vy, vz = r00 * vx + r10 * vy + r20 * vz, r01 * vx + r11 * vy + r21 * vz, r02 * vx + r12 * vy + r22 * vz
        ax, ay, az = model.axis[i, 0], model.axis[i, 1], model.axis[i, 2]
        s, sd = qd[i], qdd[i]
        if model.prismatic[i]:
            vx += 2.0 * s * (wy * az - wz * ay) + ax * sd
            vy += 2.0 * s * (wz * ax - wx * az) + ay * sd
            vz += 2.0 * s * (wx * ay - wy * ax) + az * sd
        else:
            ux += s * (wy * az - wz * ay) + ax * sd
            uy += s * (wz * ax - wx * az) + ay * sd
            uz += s * (wx * ay - wy * ax) + az * sd
            wx += ax * s
            wy += ay * s
            wz += az * s
        m, about = model.mass[i], model.inertia[i]
        px, py, pz = model.com[i, 0], model.com[i, 1], model.com[i, 2]
        cx, cy, cz = wy * pz - wz * py, wz * px - wx * pz, wx * py - wy * px
        fx = m * (vx + uy * pz - uz * py + wy * cz - wz * cy)
        fy = m * (vy + uz * px - ux * pz + wz * cx - wx * cz)
        fz = m * (vz + ux * py - uy * px + wx * cy - wy * cx)
        hx = about[0, 0] * wx + about[0, 1] * wy + about[0, 2] * wz
        hy = about[1, 0] * wx + about[1, 1] * wy + about[1, 2] * wz
        hz = about[2, 0] * wx + about[2, 1] * wy + about[2, 2] * wz
        force[i, 0], force[i, 1], force[i, 2] = fx, fy, fz
        force[i, 3] = about[0, 0] * ux + about[0, 1] * uy + about[0, 2] * uz + wy * hz - wz * hy + py * fz - pz * fy
        force[i, 4] = about[1, 0] * ux + about[1, 1] * uy + about[1, 2] * uz + wz * hx - wx * hz + pz * fx - px * fz
        force[i, 5] = about[2, 0] * ux + about[2, 1] * uy + about[2, 2] * uz + wx * hy - wy * hx + px * fy - py * fx
    for k in range(n):
        i = n - 1 - k
        row = 0 if model.prismatic[i] else 3
        tau_out[i] = (
            model.axis[i, 0] * force[i, row]
            + model.axis[i, 1] * force[i, row + 1]
            + model.axis[i, 2] * force[i, row + 2]
        )
        if i > 0:
            fx, fy, fz = force[i, 0], force[i, 1], force[i, 2]
            hx, hy, hz = force[i, 3], force[i, 4], force[i, 5]
            cx = R[i, 0, 0] * fx + R[i, 0, 1] * fy + R[i, 0, 2] * fz
            cy = R[i, 1, 0] * fx + R[i, 1, 1] * fy + R[i, 1, 2] * fz
            cz = R[i, 2, 0] * fx + R[i, 2, 1] * fy + R[i, 2, 2] * fz
            px, py, pz = p[i, 0], p[i, 1], p[i, 2]
            force[i - 1, 0] += cx
            force[i - 1, 1] += cy
            force[i - 1, 2] += cz
            force[i - 1, 3] += R[i, 0, 0] * hx + R[i, 0, 1] * hy + R[i, 0, 2] * hz + py * cz - pz * cy
            force[i - 1, 4] += R[i, 1, 0] * hx + R[i, 1, 1] * hy + R[i, 1, 2] * hz + pz * cx - px * cz
            force[i - 1, 5] += R[i, 2, 0] * hx + R[i, 2, 1] * hy + R[i, 2, 2] * hz + px * cy - py * cx


@njit
def inverse_dynamics(model: ArmModel, q: Floats, qd: Floats, qdd: Floats, tau_out: Floats) -> None:
    """Joint torques J q'' + C[q', q'] + G without friction, all (n,), into tau_out."""
    n = q.shape[0]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    force = np.empty((n, 6))
    _joint_transforms(model, q, R, p)
    _newton_euler(model, R, p, qd, qdd, 1.0, force, tau_out)


@njit
def batch_inverse_dynamics(model: ArmModel, q: Floats, qd: Floats, qdd: Floats, tau_out: Floats) -> None:
    """``inverse_dynamics`` for rows of (N, n) arrays."""
    n = q.shape[1]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    force = np.empty((n, 6))
    for k in range(q.shape[0]):
        _joint_transforms(model, q[k], R, p)
        _newton_euler(model, R, p, qd[k], qdd[k], 1.0, force, tau_out[k])


@njit
def batch_mass_matrix(model: ArmModel, q: Floats, J_out: Floats) -> None:
    """Joint-space inertia J for rows of q (N, n), into J_out (N, n, n): one Newton-Euler pass per column."""
    n = q.shape[1]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    force = np.empty((n, 6))
    zero = np.zeros(n)
    unit = np.zeros(n)
    column = np.empty(n)
    for k in range(q.shape[0]):
        _joint_transforms(model, q[k], R, p)
        for j in range(n):
            unit[j] = 1.0
            _newton_euler(model, R, p, zero, unit, 0.0, force, column)
            unit[j] = 0.0
            for i in range(j + 1):  # one triangle, mirrored: exactly symmetric
                J_out[k, i, j] = column[i]
                J_out[k, j, i] = column[i]


@njit
def path_coefficients(
    model: ArmModel,
    q: Floats,
    dq: Floats,
    ddq: Floats,
    M_out: Floats,
    Q_out: Floats,
    R_out: Floats,
    S_out: Floats,
) -> None:
    """Lee1991 eq. 8 along a path: torque = M mu_dot + Q mu^2 + R mu + S.

    q = f, dq = f' and ddq = f'' at the stations, all (N, n), and so are the outputs:
    M = J f', Q = J f'' + C[f', f'], R = F_v f' (viscous friction, by itself), S = G.
    """
    n = q.shape[1]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    force = np.empty((n, 3, 6))
    for k in range(q.shape[0]):
        _joint_transforms(model, q[k], R, p)
        _path_forces(model, R, p, dq[k], ddq[k], force)
        _path_torques(model, R, p, force, M_out[k], Q_out[k], S_out[k])
        for i in range(n):
            R_out[k, i] = model.damping[i] * dq[k, i]


@njit
def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit
def _add(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit
def _times(s: float, a: Vector) -> Vector:
    return s * a[0], s * a[1], s * a[2]


@njit
def _row(A: Floats, i: int) -> Vector:
    return A[i, 0], A[i, 1], A[i, 2]


@njit
def _turn(R: Floats, a: Vector) -> Vector:
    """R a."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@njit
def _turn_back(R: Floats, a: Vector) -> Vector:
    """R^T a."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@njit
def _put(out: Floats, f: Vector, h: Vector) -> None:
    out[0], out[1], out[2], out[3], out[4], out[5] = f[0], f[1], f[2], h[0], h[1], h[2]


@njit
def _path_forces(model: ArmModel, R: Floats, p: Floats, dq: Floats, ddq: Floats, force: Floats) -> None:
    """Newton-Euler outwards for three motions at once, into force (n, 3, 6): force and moment at each link's origin.

    M: accelerations dq from rest; Q: speeds dq with accelerations ddq; S: a base that accelerates upwards, for gravity.
    Separate passes would load the chain three times and turn angular velocities that are zero.
    """
    g = model.gravity
    zero = (0.0, 0.0, 0.0)
    w, u_M, u_Q, v_M, v_Q = zero, zero, zero, zero, zero
    v_S = _times(-1.0, _turn_back(model.base_R, (g[0], g[1], g[2])))
    for i in range(dq.shape[0]):
        A, origin, axis = R[i], _row(p, i), _row(model.axis, i)
        v_M = _turn_back(A, _add(v_M, _cross(u_M, origin)))
        v_Q = _turn_back(A, _add(v_Q, _add(_cross(u_Q, origin), _cross(w, _cross(w, origin)))))
        v_S = _turn_back(A, v_S)
        w, u_M, u_Q = _turn_back(A, w), _turn_back(A, u_M), _turn_back(A, u_Q)
        spin = _times(dq[i], axis)
        if model.prismatic[i]:
            v_M = _add(v_M, spin)
            v_Q = _add(v_Q, _add(_times(2.0, _cross(w, spin)), _times(ddq[i], axis)))
        else:
            u_M = _add(u_M, spin)
            u_Q = _add(u_Q, _add(_cross(w, spin), _times(ddq[i], axis)))
            w = _add(w, spin)
        m, com, about = model.mass[i], _row(model.com, i), model.inertia[i]
        f = _times(m, _add(v_M, _cross(u_M, com)))
        _put(force[i, 0], f, _add(_turn(about, u_M), _cross(com, f)))
        f = _times(m, _add(v_Q, _add(_cross(u_Q, com), _cross(w, _cross(w, com)))))
        moment = _add(_turn(about, u_Q), _cross(w, _turn(about, w)))
        _put(force[i, 1], f, _add(moment, _cross(com, f)))
        f = _times(m, v_S)
        _put(force[i, 2], f, _cross(com, f))


@njit
def _path_torques(
    model: ArmModel, R: Floats, p: Floats, force: Floats, M_out: Floats, Q_out: Floats, S_out: Floats
) -> None:
    """Newton-Euler inwards: what ``_path_forces`` found, summed up along the chain, about the joint axes."""
    n = R.shape[0]
    for k in range(n):
        i = n - 1 - k
        first = 0 if model.prismatic[i] else 3
        axis, origin = _row(model.axis, i), _row(p, i)
        for kind in range(3):
            F = force[i, kind]
            torque = axis[0] * F[first] + axis[1] * F[first + 1] + axis[2] * F[first + 2]
            if kind == 0:
                M_out[i] = torque
            elif kind == 1:
                Q_out[i] = torque
            else:
                S_out[i] = torque
            if i > 0:
                f = _turn(R[i], (F[0], F[1], F[2]))
                h = _add(_turn(R[i], (F[3], F[4], F[5])), _cross(origin, f))
                before = force[i - 1, kind]
                for r in range(3):
                    before[r] += f[r]
                    before[3 + r] += h[r]


@njit
def batch_link_frames(model: ArmModel, q: Floats, T_out: Floats) -> None:
    """World poses of the links and then the tip for rows of q (N, n), into T_out (N, n + 1, 4, 4)."""
    n = q.shape[1]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    for k in range(q.shape[0]):
        link_frames(model, q[k], R, p)
        for i in range(n + 1):
            T = T_out[k, i]
            last = min(i, n - 1)
            for r in range(3):
                if i < n:
                    for c in range(3):
                        T[r, c] = R[last, r, c]
                    T[r, 3] = p[last, r]
                else:
                    a, b, d = R[last, r, 0], R[last, r, 1], R[last, r, 2]
                    for c in range(3):
                        T[r, c] = a * model.tip_R[0, c] + b * model.tip_R[1, c] + d * model.tip_R[2, c]
                    T[r, 3] = p[last, r] + a * model.tip_p[0] + b * model.tip_p[1] + d * model.tip_p[2]
                T[3, r] = 0.0
            T[3, 3] = 1.0


@njit
def batch_jacobian(model: ArmModel, q: Floats, J_out: Floats) -> None:
    """Geometric Jacobian of the tip in world axes for rows of q (N, n), into J_out (N, 6, n), linear rows first."""
    n = q.shape[1]
    R = np.empty((n, 3, 3))
    p = np.empty((n, 3))
    tip = np.empty(3)
    z = np.empty(3)
    for k in range(q.shape[0]):
        link_frames(model, q[k], R, p)
        for r in range(3):
            tip[r] = p[n - 1, r]
            for c in range(3):
                tip[r] += R[n - 1, r, c] * model.tip_p[c]
        for i in range(n):
            for r in range(3):
                z[r] = R[i, r, 0] * model.axis[i, 0] + R[i, r, 1] * model.axis[i, 1] + R[i, r, 2] * model.axis[i, 2]
            if model.prismatic[i]:
                for r in range(3):
                    J_out[k, r, i] = z[r]
                    J_out[k, 3 + r, i] = 0.0
            else:
                x, y, w = tip[0] - p[i, 0], tip[1] - p[i, 1], tip[2] - p[i, 2]
                J_out[k, 0, i] = z[1] * w - z[2] * y
                J_out[k, 1, i] = z[2] * x - z[0] * w
                J_out[k, 2, i] = z[0] * y - z[1] * x
                for r in range(3):
                    J_out[k, 3 + r, i] = z[r]


@njit
def segment_distance(p0: Floats, p1: Floats, q0: Floats, q1: Floats) -> float:
    """Distance [m] of the segments p0-p1 and q0-q1 (points (3,)); a segment may be a point."""
    ux, uy, uz = p1[0] - p0[0], p1[1] - p0[1], p1[2] - p0[2]
    vx, vy, vz = q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]
    wx, wy, wz = p0[0] - q0[0], p0[1] - q0[1], p0[2] - q0[2]
    a = ux * ux + uy * uy + uz * uz
    b = ux * vx + uy * vy + uz * vz
    c = vx * vx + vy * vy + vz * vz
    d = ux * wx + uy * wy + uz * wz
    e = vx * wx + vy * wy + vz * wz
    det = a * c - b * b
    best = math.inf
    # Candidates (s, t): the common perpendicular if its feet lie inside both, and each end with its nearest point.
    # The smallest of them is the distance; no case needs a tolerance.
    for case in range(5):
        if case == 0:
            if not det > 0.0:
                continue
            s, t = (b * e - c * d) / det, (a * e - b * d) / det
            if s < 0.0 or s > 1.0 or t < 0.0 or t > 1.0:
                continue
        elif case < 3:
            s = float(case - 1)
            t = min(1.0, max(0.0, (e + s * b) / c)) if c > 0.0 else 0.0
        else:
            t = float(case - 3)
            s = min(1.0, max(0.0, (t * b - d) / a)) if a > 0.0 else 0.0
        x, y, z = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
        squared = x * x + y * y + z * z
        best = min(best, squared)
        if case == 0 and det > 1e-6 * a * c:  # well conditioned: no end point can be nearer
            break
    return math.sqrt(best)
