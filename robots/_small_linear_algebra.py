"""Compiled linear algebra of matrices with a handful of rows, and quaternions: without allocating, in scalars.

Nothing is checked here: callers pass float64 arrays of the right shape. Quaternions are (w, x, y, z), of unit length.
"""

from __future__ import annotations

import math

from armtempo.arrays import Floats
from armtempo.robots._numba import inlined, njit

__all__ = [
    "Quaternion",
    "cholesky",
    "eigenvectors",
    "invert",
    "quaternion_angle",
    "quaternion_between",
    "quaternion_of",
    "quaternion_product",
]

Quaternion = tuple[float, float, float, float]


@inlined
def cholesky(G: Floats, shift: float, C: Floats) -> bool:
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


@inlined
def cholesky_solve(C: Floats, y: Floats) -> None:
    """Solve C C^T x = y in place, for the factor C of ``cholesky``."""
    m = y.shape[0]
    for i in range(m):
        for k in range(i):
            y[i] -= C[i, k] * y[k]
        y[i] /= C[i, i]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            y[i] -= C[k, i] * y[k]
        y[i] /= C[i, i]


@njit
def eigenvectors(G: Floats, V: Floats) -> None:
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


@njit
def invert(A: Floats, B: Floats) -> bool:
    """B = A^-1 by Gauss and Jordan with row pivots; A is lost. False: singular."""
    n = A.shape[0]
    for i in range(n):
        for k in range(n):
            B[i, k] = 1.0 if i == k else 0.0
    for c in range(n):
        best = c
        for i in range(c + 1, n):
            if abs(A[i, c]) > abs(A[best, c]):
                best = i
        pivot = A[best, c]
        if not abs(pivot) > 1e-14:
            return False
        for k in range(n):
            A[best, k], A[c, k] = A[c, k], A[best, k] / pivot
            B[best, k], B[c, k] = B[c, k], B[best, k] / pivot
        for i in range(n):
            if i != c and A[i, c] != 0.0:
                f = A[i, c]
                for k in range(n):
                    A[i, k] -= f * A[c, k]
                    B[i, k] -= f * B[c, k]
    return True


@njit
def quaternion_of(x: float, y: float, z: float) -> Quaternion:
    """Of a rotation vector [rad]."""
    angle = math.sqrt(x * x + y * y + z * z)
    s = math.sin(0.5 * angle) / angle if angle > 1e-8 else 0.5
    return math.cos(0.5 * angle), s * x, s * y, s * z


@njit
def quaternion_product(a: Quaternion, b: Quaternion) -> Quaternion:
    """The rotation ``b``, then ``a``."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] + a[2] * b[0] + a[3] * b[1] - a[1] * b[3],
        a[0] * b[3] + a[3] * b[0] + a[1] * b[2] - a[2] * b[1],
    )


@njit
def quaternion_angle(a: Quaternion) -> float:
    """Of the rotation, 0 to pi [rad]."""
    return 2.0 * math.atan2(math.sqrt(a[1] * a[1] + a[2] * a[2] + a[3] * a[3]), abs(a[0]))


@njit
def quaternion_between(A: Floats, B: Floats) -> Quaternion:
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
