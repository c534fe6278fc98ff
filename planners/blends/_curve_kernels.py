r"""Compiled geometry of one polynomial curve ``F(u)``, ``0 <= u <= 1``: derivatives, arc length and its inverse.

Its ``shape`` (8, 3) holds the coefficients of F by rising powers of u.

*Length.* ``|F'|`` is integrated by 16-point Gauss-Legendre on panels of u. On each panel the inverse ``u(s)`` is the
polynomial of degree 13 through exact pairs ``(s_j, u_j)``; a panel is halved until that polynomial is exact to
``INVERSE_TOLERANCE`` of the length between its nodes. So a control tick needs one polynomial and no iteration.
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.robots import njit

PANEL_NODES = 14  # pairs (s, u) per panel
INVERSE_TOLERANCE = 2e-15  # of the curve's length


def _panel_constants() -> tuple[Floats, Floats, Floats, Floats, Floats, Ints]:
    """Gauss nodes; pairs' u and their weights; u where fits are checked and weights; an order for divided differences.

    All u on [0, 1]. Row j of the weights integrates the values at the Gauss nodes from 0 to u_j.
    """
    x, w = np.polynomial.legendre.leggauss(16)
    order = np.arange(16)
    basis = np.polynomial.legendre.legvander(x, 16).T  # P_k(x_g)
    pairs = -np.cos(np.pi * np.arange(PANEL_NODES) / (PANEL_NODES - 1))
    middles = -np.cos(np.pi * (np.array([0, 3, 6]) + 0.5) / (PANEL_NODES - 1))

    def weights(to: Floats) -> Floats:
        p = np.polynomial.legendre.legvander(to, 17)
        integral = np.empty((len(to), 16))  # (2k+1)/2 times the integral of P_k from -1
        integral[:, 0] = 0.5 * (to + 1.0)
        integral[:, 1:] = 0.5 * (p[:, 2:17] - p[:, :15])
        return 0.5 * (integral @ (basis[order] * w))

    leja = [PANEL_NODES - 1]  # each next node the farthest from those before it: keeps the differences small
    while len(leja) < PANEL_NODES:
        apart = np.abs(pairs[:, None] - pairs[leja]).prod(axis=1)
        leja.append(int(apart.argmax()))
    return (
        0.5 * (x + 1.0), 0.5 * (pairs + 1.0), weights(pairs), 0.5 * (middles + 1.0), weights(middles), np.array(leja),
    )  # fmt: skip


GAUSS_U, PAIR_U, PAIR_WEIGHTS, CHECK_U, CHECK_WEIGHTS, PAIR_ORDER = _panel_constants()


@njit
def curve_speed(shape: Floats, degree: int, u: float) -> float:
    """``|F'(u)|`` of a polynomial [m]."""
    x = y = z = 0.0
    for k in range(degree, 0, -1):
        x, y, z = x * u + k * shape[k, 0], y * u + k * shape[k, 1], z * u + k * shape[k, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@njit
def curve_position(shape: Floats, degree: int, u: float, out: Floats) -> None:
    """``F(u)`` of a polynomial into ``out`` (3,)."""
    for i in range(3):
        value = shape[degree, i]
        for k in range(degree - 1, -1, -1):
            value = value * u + shape[k, i]
        out[i] = value


@njit
def curve_derivatives(shape: Floats, degree: int, u: float, out: Floats) -> None:
    """F, F', F'', F''' by u of a polynomial into ``out`` (4, 3)."""
    for i in range(3):
        a, b, c, d = shape[degree, i], 0.0, 0.0, 0.0  # Horner of F, F', F''/2, F'''/6
        for k in range(degree - 1, -1, -1):
            d = d * u + c
            c = c * u + b
            b = b * u + a
            a = a * u + shape[k, i]
        out[0, i], out[1, i], out[2, i], out[3, i] = a, b, 2.0 * c, 6.0 * d


@njit
def by_arc_length(out: Floats) -> None:
    """Turn derivatives by u into those by arc length, in place.

    With s' = |F'| = v:
    p' = F'/v,  p'' = (F'' - s'' p')/v^2,  p''' = (F''' - 3 v s'' p'' - s''' p')/v^3.
    """
    v2 = f12 = f22 = f13 = 0.0
    for i in range(3):
        v2 += out[1, i] * out[1, i]
        f12 += out[1, i] * out[2, i]
        f22 += out[2, i] * out[2, i]
        f13 += out[1, i] * out[3, i]
    v = np.sqrt(v2)
    s2 = f12 / v
    s3 = (f22 + f13 - s2 * s2) / v
    for i in range(3):
        tangent = out[1, i] / v
        curvature = (out[2, i] - s2 * tangent) / v2
        out[3, i] = (out[3, i] - 3.0 * v * s2 * curvature - s3 * tangent) / (v2 * v)
        out[1, i], out[2, i] = tangent, curvature


@njit
def _weighted(weights: Floats, row: int, speeds: Floats) -> float:
    total = 0.0
    for g in range(16):
        total += weights[row, g] * speeds[g]
    return total


@njit
def fit_panel(shape: Floats, degree: int, u: float, h: float, inverse: Floats, most: float) -> float:
    """Fit u(s) on the panel [u, u + h] into ``inverse`` (14,).

    Returns the panel's length, or its negative where the fit misses by more than ``most`` [m].
    """
    speeds = np.empty(16)
    for g in range(16):
        speeds[g] = curve_speed(shape, degree, u + h * GAUSS_U[g])
    size = h * _weighted(PAIR_WEIGHTS, PANEL_NODES - 1, speeds)
    scale = 2.0 * h / size
    t, c = np.empty(PANEL_NODES), np.empty(PANEL_NODES)
    for k in range(PANEL_NODES):
        j = PAIR_ORDER[k]
        t[k] = 1.0 if j == PANEL_NODES - 1 else scale * _weighted(PAIR_WEIGHTS, j, speeds) - 1.0
        c[k] = PAIR_U[j]
    for k in range(1, PANEL_NODES):  # Newton's divided differences
        for j in range(PANEL_NODES - 1, k - 1, -1):
            c[j] = (c[j] - c[j - 1]) / (t[j] - t[j - k])
    inverse[:] = 0.0
    for k in range(PANEL_NODES - 1, -1, -1):  # to powers: inverse = inverse (x - t_k) + c_k
        for j in range(PANEL_NODES - 1, 0, -1):
            inverse[j] = inverse[j - 1] - t[k] * inverse[j]
        inverse[0] = c[k] - t[k] * inverse[0]
    worst = 0.0
    for j in range(CHECK_U.shape[0]):
        at = scale * _weighted(CHECK_WEIGHTS, j, speeds) - 1.0
        value = 0.0
        for k in range(PANEL_NODES - 1, -1, -1):
            value = value * at + inverse[k]
        worst = max(worst, abs(value - CHECK_U[j]))
    for k in range(PANEL_NODES):
        inverse[k] *= h
    inverse[0] += u
    return float(size if worst * size <= most else -size)


@njit
def powers_of(points: Floats, degree: int, shape: Floats) -> None:
    """Bernstein control points (degree + 1, 3) to coefficients of rising powers, into ``shape`` (8, 3)."""
    shape[:] = 0.0
    rows = points[: degree + 1] - points[0]
    factor = 1.0
    for k in range(degree + 1):  # rows: k-th forward differences
        shape[k] = factor * rows[0]
        for j in range(degree - k):
            rows[j] = rows[j + 1] - rows[j]
        factor *= (degree - k) / (k + 1.0)
    shape[0] = points[0]


@njit
def curve_distance(shape: Floats, degree: int, vertex: Floats) -> float:
    """The smallest distance of a polynomial from a point [m]: a coarse search, then safeguarded Newton."""
    out = np.empty((4, 3))
    pieces = 32
    best, nearest = np.inf, 0
    for i in range(pieces + 1):
        curve_position(shape, degree, i / pieces, out[0])
        square = 0.0
        for j in range(3):
            square += (out[0, j] - vertex[j]) ** 2
        if square < best:
            best, nearest = square, i
    low, high = max(nearest - 1, 0) / pieces, min(nearest + 1, pieces) / pieces
    u = nearest / pieces
    for _ in range(60):
        curve_derivatives(shape, degree, u, out)
        slope = bend = 0.0
        for j in range(3):
            away = out[0, j] - vertex[j]
            slope += away * out[1, j]
            bend += out[1, j] * out[1, j] + away * out[2, j]
        if slope > 0.0:
            high = u
        else:
            low = u
        step = u - slope / bend
        if bend <= 0.0 or step < low or step > high:
            step = 0.5 * (low + high)
        if abs(step - u) < 1e-16:
            break
        u = step
    curve_position(shape, degree, u, out[0])
    return float(np.sqrt(np.sum((out[0] - vertex) ** 2)))
