r"""Compiled geometry of blended paths: their pieces, points by length, corners, and how smoothly pieces meet.

A piece is a line, an arc or a polynomial ``F(u)``, ``0 <= u <= 1``. Its ``shape`` (8, 3) holds

    line        start, tangent
    arc         start, R x, tangent at the start, (R, 0, 0)         p = start + R (cos - 1) x + R sin t
    polynomial  coefficients of F by rising powers of u

and its ``kind`` says which: ``LINE``, ``ARC``, or the degree of the polynomial.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.blends._curve_kernels import (
    INVERSE_TOLERANCE,
    PANEL_NODES,
    by_arc_length,
    curve_derivatives,
    curve_distance,
    curve_speed,
    fit_panel,
    powers_of,
)
from armtempo.robots import njit

LINE, ARC = 0, 1  # kinds; others are the degree of a polynomial
PANEL_SIZE_MIN = 2.0**-40


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
        by_arc_length(out)


@njit
def tabulate(kind: Ints, shape: Floats, lengths: Floats) -> tuple[Ints, Floats, Floats, Floats]:
    """Panels of all polynomial pieces and their lengths into ``lengths`` (K,); other entries are kept.

    Returns ``first_panel``, ``panel_start``, ``panel_size``, ``inverse`` of a PackedPath.
    """
    count = kind.shape[0]
    first = np.zeros(count + 1, dtype=np.int64)
    room = 16 + 16 * count
    start, size, inverse = np.empty(room), np.empty(room), np.empty((room, PANEL_NODES))
    used = 0
    trial = np.empty(PANEL_NODES)
    for k in range(count):
        first[k] = used
        degree = kind[k]
        if degree <= ARC:
            continue
        most = INVERSE_TOLERANCE * abs(fit_panel(shape[k], degree, 0.0, 1.0, trial, 0.0))
        u, s, h = 0.0, 0.0, 0.125
        while u < 1.0:
            h = min(h, 1.0 - u)
            panel = fit_panel(shape[k], degree, u, h, trial, most)
            if panel < 0.0 and h > PANEL_SIZE_MIN:
                h *= 0.5
                continue
            if used == room:
                room *= 2
                start = np.concatenate((start, np.empty(used)))
                size = np.concatenate((size, np.empty(used)))
                inverse = np.concatenate((inverse, np.empty((used, PANEL_NODES))))
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
    u = packed.inverse[low, PANEL_NODES - 1]
    for j in range(PANEL_NODES - 2, -1, -1):
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
