r"""Compiled geometry of blended paths: derivatives by arc length, exact lengths and their inverse, corners.

A piece is a line, an arc or a polynomial ``F(u)``, ``0 <= u <= 1``. Its ``shape`` (8, 3) holds

    line        start, tangent
    arc         start, R x, tangent at the start, (R, 0, 0)         p = start + R (cos - 1) x + R sin t
    polynomial  coefficients of F by rising powers of u

and its ``kind`` says which: ``LINE``, ``ARC``, or the degree of the polynomial.

*Length.* ``|F'|`` is integrated by 16-point Gauss-Legendre on panels of u. On each panel the inverse ``u(s)`` is the
polynomial of degree 13 through exact pairs ``(s_j, u_j)``; a panel is halved until that polynomial is exact to
``INVERSE_TOLERANCE`` of the length between its nodes. So a control tick needs one polynomial and no iteration.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.robots import njit

LINE, ARC = 0, 1  # kinds; others are the degree of a polynomial
NODES = 14  # pairs (s, u) per panel
INVERSE_TOLERANCE = 2e-15  # of the curve's length
SMALLEST_PANEL = 2.0**-40


class PackedPath(NamedTuple):
    """A blended path in arrays, K pieces and P panels; K = 1 for a single blend.

    ``breakpoints`` (K+1,) [m]; ``kind`` (K,); ``shape`` (K, 8, 3); the panels of piece k are ``first_panel[k]`` to
    ``first_panel[k + 1]``, each from ``panel_start`` [m from the start of its piece] over ``panel_size`` [m], with
    ``inverse`` (P, 14): u by rising powers of ``2 (s - start) / size - 1``.
    """

    breakpoints: Floats
    kind: Ints
    shape: Floats
    first_panel: Ints
    panel_start: Floats
    panel_size: Floats
    inverse: Floats


def _panel_constants() -> tuple[Floats, Floats, Floats, Floats, Floats, Ints]:
    """Gauss nodes; pairs' u and their weights; u where fits are checked and weights; an order for divided differences.

    All u on [0, 1]. Row j of the weights integrates the values at the Gauss nodes from 0 to u_j.
    """
    x, w = np.polynomial.legendre.leggauss(16)
    order = np.arange(16)
    basis = np.polynomial.legendre.legvander(x, 16).T  # P_k(x_g)
    pairs = -np.cos(np.pi * np.arange(NODES) / (NODES - 1))
    middles = -np.cos(np.pi * (np.array([0, 3, 6]) + 0.5) / (NODES - 1))

    def weights(to: Floats) -> Floats:
        p = np.polynomial.legendre.legvander(to, 17)
        integral = np.empty((len(to), 16))  # (2k+1)/2 times the integral of P_k from -1
        integral[:, 0] = 0.5 * (to + 1.0)
        integral[:, 1:] = 0.5 * (p[:, 2:17] - p[:, :15])
        return 0.5 * (integral @ (basis[order] * w))

    leja = [NODES - 1]  # each next node the farthest from those before it: keeps the differences small
    while len(leja) < NODES:
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
def _by_arc_length(out: Floats) -> None:
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
def piece_point(kind: int, shape: Floats, x: float, out: Floats) -> None:
    """Position and three derivatives by arc length into ``out`` (4, 3), at arc length ``x`` (polynomials: at u = x)."""
    if kind == LINE:
        for i in range(3):
            out[0, i] = shape[0, i] + x * shape[1, i]
            out[1, i] = shape[1, i]
            out[2, i] = out[3, i] = 0.0
    elif kind == ARC:
        radius = shape[3, 0]
        sine, cosine, half = np.sin(x / radius), np.cos(x / radius), np.sin(0.5 * x / radius)
        for i in range(3):
            out[0, i] = shape[0, i] + sine * radius * shape[2, i] - 2.0 * half * half * shape[1, i]
            out[1, i] = cosine * shape[2, i] - sine * shape[1, i] / radius
            out[2, i] = -(sine * shape[2, i] + cosine * shape[1, i] / radius) / radius
            out[3, i] = -out[1, i] / (radius * radius)
    else:
        curve_derivatives(shape, kind, x, out)
        _by_arc_length(out)


@njit
def _weighted(weights: Floats, row: int, speeds: Floats) -> float:
    total = 0.0
    for g in range(16):
        total += weights[row, g] * speeds[g]
    return total


@njit
def _fit_panel(shape: Floats, degree: int, u: float, h: float, inverse: Floats, most: float) -> float:
    """Fit u(s) on the panel [u, u + h] into ``inverse`` (14,).

    Returns the panel's length, or its negative where the fit misses by more than ``most`` [m].
    """
    speeds = np.empty(16)
    for g in range(16):
        speeds[g] = curve_speed(shape, degree, u + h * GAUSS_U[g])
    size = h * _weighted(PAIR_WEIGHTS, NODES - 1, speeds)
    scale = 2.0 * h / size
    t, c = np.empty(NODES), np.empty(NODES)
    for k in range(NODES):
        j = PAIR_ORDER[k]
        t[k] = 1.0 if j == NODES - 1 else scale * _weighted(PAIR_WEIGHTS, j, speeds) - 1.0
        c[k] = PAIR_U[j]
    for k in range(1, NODES):  # Newton's divided differences
        for j in range(NODES - 1, k - 1, -1):
            c[j] = (c[j] - c[j - 1]) / (t[j] - t[j - k])
    inverse[:] = 0.0
    for k in range(NODES - 1, -1, -1):  # to powers: inverse = inverse (x - t_k) + c_k
        for j in range(NODES - 1, 0, -1):
            inverse[j] = inverse[j - 1] - t[k] * inverse[j]
        inverse[0] = c[k] - t[k] * inverse[0]
    worst = 0.0
    for j in range(CHECK_U.shape[0]):
        at = scale * _weighted(CHECK_WEIGHTS, j, speeds) - 1.0
        value = 0.0
        for k in range(NODES - 1, -1, -1):
            value = value * at + inverse[k]
        worst = max(worst, abs(value - CHECK_U[j]))
    for k in range(NODES):
        inverse[k] *= h
    inverse[0] += u
    return float(size if worst * size <= most else -size)


@njit
def tabulate(kind: Ints, shape: Floats, lengths: Floats) -> tuple[Ints, Floats, Floats, Floats]:
    """Panels of all polynomial pieces and their lengths into ``lengths`` (K,); other entries are kept.

    Returns ``first_panel``, ``panel_start``, ``panel_size``, ``inverse`` of a PackedPath.
    """
    count = kind.shape[0]
    first = np.zeros(count + 1, dtype=np.int64)
    room = 16 + 16 * count
    start, size, inverse = np.empty(room), np.empty(room), np.empty((room, NODES))
    used = 0
    trial = np.empty(NODES)
    for k in range(count):
        first[k] = used
        degree = kind[k]
        if degree <= ARC:
            continue
        most = INVERSE_TOLERANCE * abs(_fit_panel(shape[k], degree, 0.0, 1.0, trial, 0.0))
        u, s, h = 0.0, 0.0, 0.125
        while u < 1.0:
            h = min(h, 1.0 - u)
            panel = _fit_panel(shape[k], degree, u, h, trial, most)
            if panel < 0.0 and h > SMALLEST_PANEL:
                h *= 0.5
                continue
            if used == room:
                room *= 2
                start = np.concatenate((start, np.empty(used)))
                size = np.concatenate((size, np.empty(used)))
                inverse = np.concatenate((inverse, np.empty((used, NODES))))
            start[used], size[used] = s, abs(panel)
            inverse[used] = trial
            used += 1
            u += h  # exact: h is a power of two that divides u
            s += abs(panel)
            if np.floor(u / (2.0 * h)) * (2.0 * h) == u:
                h *= 2.0
        lengths[k] = s
    first[count] = used
    return first, start[:used].copy(), size[:used].copy(), inverse[:used].copy()


@njit
def curve_parameter(packed: PackedPath, k: int, s: float) -> float:
    """The parameter u at arc length ``s`` from the start of piece k, a polynomial."""
    low, high = packed.first_panel[k], packed.first_panel[k + 1] - 1
    while low < high:
        middle = (low + high + 1) // 2
        if packed.panel_start[middle] <= s:
            low = middle
        else:
            high = middle - 1
    x = 2.0 * (s - packed.panel_start[low]) / packed.panel_size[low] - 1.0
    u = packed.inverse[low, NODES - 1]
    for j in range(NODES - 2, -1, -1):
        u = u * x + packed.inverse[low, j]
    return float(min(max(u, 0.0), 1.0))


@njit
def find_piece(breakpoints: Floats, s: float, before: bool) -> int:
    """The piece at length ``s``; at a breakpoint the one behind it, or the one ``before`` it."""
    low, high = 0, breakpoints.shape[0] - 2
    while low < high:
        middle = (low + high + 1) // 2
        if breakpoints[middle] < s or (breakpoints[middle] == s and not before):
            low = middle
        else:
            high = middle - 1
    return low


@njit
def _point(packed: PackedPath, s: float, before: bool, out: Floats) -> None:
    k = find_piece(packed.breakpoints, s, before)
    x = min(max(s, packed.breakpoints[0]), packed.breakpoints[k + 1]) - packed.breakpoints[k]
    kind = packed.kind[k]
    if kind > ARC:  # at its end exactly u = 1, whatever the rounding of lengths far down the path
        x = 1.0 if s >= packed.breakpoints[k + 1] else curve_parameter(packed, k, x)
    piece_point(kind, packed.shape[k], x, out)


@njit
def blended_point(packed: PackedPath, s: float, out: Floats) -> None:
    """Position and its three derivatives by length at ``s`` [m] into ``out`` (4, 3): [m], [1], [1/m], [1/m^2]."""
    _point(packed, s, False, out)


@njit
def blended_points(packed: PackedPath, s: Floats, before: bool, out: Floats) -> None:
    """``blended_point`` at all ``s`` (T,) into ``out`` (T, 4, 3)."""
    for i in range(s.shape[0]):
        _point(packed, s[i], before, out[i])


@njit
def segment_points(kind: Ints, shape: Floats, x: Floats, out: Floats) -> None:
    """``piece_point`` of K pieces, each at its own ``x`` (K,), into ``out`` (K, 4, 3)."""
    for k in range(kind.shape[0]):
        piece_point(kind[k], shape[k], x[k], out[k])


@njit
def inner_points(ends: Floats, remaining: Floats, shares: Floats, degree: int, points: Floats) -> None:
    """Control points (degree + 1, 3) of a blend, into ``points`` (8, 3).

    ``ends`` (2, 4, 3): position and derivatives by arc length where the blend leaves a segment and meets the next.
    Along the tangents the inner points stand at ``shares`` (3,) of the remaining distance from the vertex; across them
    they are what continuity asks for, of curvature (degree 5) and of its slope too (degree 7). With F' = v T at an end,
    F'' = v^2 p'' + w T and F''' = v^3 p''' + 3 v w p'' + (..) T, where v and w follow from the shares.
    """
    for side in range(2):
        sign = 1.0 - 2.0 * side  # the far end is walked backwards: odd derivatives change sign
        start = degree * side
        step = 1 - 2 * side
        distance = remaining[side]
        along = (1.0 - shares) * distance
        v = degree * along[0]
        p, tangent, curvature, third = ends[side, 0], sign * ends[side, 1], ends[side, 2], sign * ends[side, 3]
        points[start] = p
        points[start + step] = p + along[0] * tangent
        if degree >= 5:
            across = v * v / (degree * (degree - 1)) * curvature
            points[start + 2 * step] = p + along[1] * tangent + across
            if degree == 7:
                w = 42.0 * (along[1] - 2.0 * along[0])
                slope = third - np.dot(third, tangent) * tangent
                more = (v * v * v * slope + 3.0 * v * w * curvature) / 210.0
                points[start + 3 * step] = p + along[2] * tangent + 3.0 * across + more


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


@njit
def corner_blend(
    kind: Ints,
    segment: Floats,
    length: float,
    remaining: Floats,
    shares: Floats,
    degree: int,
    points: Floats,
    shape: Floats,
) -> float:
    """The blend of two segments: ``kind`` (2,), ``segment`` (2, 8, 3), the first ``length`` long.

    Control points into ``points`` (8, 3), coefficients into ``shape`` (8, 3); returns the distance from the vertex.
    """
    ends = np.empty((2, 4, 3))
    piece_point(kind[0], segment[0], length - remaining[0], ends[0])
    piece_point(kind[1], segment[1], remaining[1], ends[1])
    inner_points(ends, remaining, shares, degree, points)
    powers_of(points, degree, shape)
    return curve_distance(shape, degree, segment[1, 0])


@njit
def remaining_for(
    kind: Ints, segment: Floats, length: float, shares: Floats, degree: int, tolerance: float, most: float
) -> float:
    """The remaining distance, the same at both ends, at which a blend passes the vertex at ``tolerance`` [m].

    Blends of two lines are similar: closed form. With an arc: the smallest by stepping out, then regula falsi
    (Illinois); more than ``most`` is returned where that is not enough.
    """
    points, shape = np.empty((8, 3)), np.empty((8, 3))
    if kind[0] == LINE and kind[1] == LINE:
        unit = corner_blend(kind, segment, length, np.array([most, most]), shares, degree, points, shape) / most
        return tolerance / unit
    low, at_low = 0.0, -tolerance
    high = min(tolerance, most)  # the curve is nowhere farther from the vertex than its ends
    at_high = corner_blend(kind, segment, length, np.array([high, high]), shares, degree, points, shape) - tolerance
    while at_high < 0.0:
        if high >= most:
            return 2.0 * most
        low, at_low = high, at_high
        high = min(1.5 * high, most)
        at_high = corner_blend(kind, segment, length, np.array([high, high]), shares, degree, points, shape) - tolerance
    x, side = high, 0
    for _ in range(200):
        x = (low * at_high - high * at_low) / (at_high - at_low)
        value = corner_blend(kind, segment, length, np.array([x, x]), shares, degree, points, shape) - tolerance
        if abs(value) < 1e-15 + 1e-13 * tolerance or high - low < 1e-15 * high:
            break
        if value > 0.0:
            high, at_high = x, value
            if side > 0:
                at_low *= 0.5
            side = 1
        else:
            low, at_low = x, value
            if side < 0:
                at_high *= 0.5
            side = -1
    return x


@njit
def corner_distances(
    kind: Ints,
    shape: Floats,
    lengths: Floats,
    shares: Floats,
    degree: Ints,
    tolerance: Floats,
    skip: Bools,
    out: Floats,
) -> None:
    """``remaining_for`` at all corners (C,) but those to ``skip`` (C,), into ``out`` (C,); no limit for lines."""
    for k in range(out.shape[0]):
        if not skip[k]:
            corner = (kind[k : k + 2], shape[k : k + 2], lengths[k])
            out[k] = remaining_for(*corner, shares[k], degree[k], tolerance[k], min(lengths[k], lengths[k + 1]))


@njit
def corner_blends(
    kind: Ints,
    shape: Floats,
    lengths: Floats,
    remaining: Floats,
    shares: Floats,
    degree: Ints,
    curve: Floats,
    miss: Floats,
) -> None:
    """Coefficients of all blends into ``curve`` (n - 1, 8, 3), distances from their vertices into ``miss`` (n - 1,).

    Corners with no remaining distance are left out.
    """
    points = np.empty((8, 3))
    for k in range(miss.shape[0]):
        if remaining[k, 0] > 0.0:
            miss[k] = corner_blend(
                kind[k : k + 2], shape[k : k + 2], lengths[k], remaining[k], shares[k], degree[k], points, curve[k]
            )


@njit
def slowest_speeds(curve: Floats, degree: Ints, remaining: Floats, out: Floats) -> None:
    """Smallest ``|F'|`` [m] of all blends (n - 1,) into ``out``: samples, then thirds around the lowest."""
    for k in range(out.shape[0]):
        if remaining[k, 0] <= 0.0:
            continue
        best, at = np.inf, 0.0
        for i in range(33):
            speed = curve_speed(curve[k], degree[k], i / 32)
            if speed < best:
                best, at = speed, i / 32
        low, high = max(at - 1.0 / 32, 0.0), min(at + 1.0 / 32, 1.0)
        for _ in range(40):
            third = (high - low) / 3.0
            left = curve_speed(curve[k], degree[k], low + third)
            right = curve_speed(curve[k], degree[k], high - third)
            best = min(best, left, right)
            if left < right:
                high -= third
            else:
                low += third
        out[k] = best


@njit
def joint_order(before: Floats, after: Floats, size: float) -> int:
    """Order of geometric continuity (1, 2 or 3) between two (4, 3) of derivatives; ``size`` [m] scales the jumps."""
    jump2 = jump3 = bend = slope = 0.0
    for i in range(3):
        jump2 += (before[2, i] - after[2, i]) ** 2
        jump3 += (before[3, i] - after[3, i]) ** 2
        bend += before[2, i] ** 2 + after[2, i] ** 2
        slope += before[3, i] ** 2 + after[3, i] ** 2
    size = 1.0 / size if size > 0.0 else 0.0
    if np.sqrt(jump2) > 1e-8 * max(size, np.sqrt(bend)):
        return 1
    return 2 if np.sqrt(jump3) > 1e-7 * max(size * size, np.sqrt(slope)) else 3


@njit
def joint_orders(packed: PackedPath, out: Ints) -> None:
    """``joint_order`` at every interior breakpoint into ``out`` (K - 1,)."""
    before, after = np.empty((4, 3)), np.empty((4, 3))
    for k in range(out.shape[0]):
        end = packed.breakpoints[k + 1] - packed.breakpoints[k]
        size = end if packed.kind[k] > ARC else 0.0
        if packed.kind[k + 1] > ARC:
            size = max(size, packed.breakpoints[k + 2] - packed.breakpoints[k + 1])
        piece_point(packed.kind[k], packed.shape[k], 1.0 if packed.kind[k] > ARC else end, before)
        piece_point(packed.kind[k + 1], packed.shape[k + 1], 0.0, after)
        out[k] = joint_order(before, after, size)
