"""How far two convex shapes are apart, bounded from both sides: GJK whose answer needs no trust in its convergence.

Gilbert, Johnson, Keerthi 1988: the point ``v`` of the difference ``A - B`` nearest to the origin is approached from
within. Every iterate is itself a proof: ``|v|`` is the distance of two points of the shapes, so not less than theirs,
and the plane across ``v`` through the farthest point of ``A - B`` against it separates them by at least
``v . support / |v|``. A search may stop as soon as the bounds answer its question, which most do after a
few steps. Rounding is in both bounds: of a cylinder's rim seen along its axis up to 1e-8 of its radius, nanometres
beside tolerances of half a millimetre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints, all_finite
from armtempo.errors import RobotError
from armtempo.robots._numba import njit
from armtempo.robots._shapes import Shape

__all__ = ["Bodies", "pack_bodies", "separation"]

BOUNDS_GAP_MAX = 1e-7  # [m] between the bounds
STEPS_MAX = 100  # hulls need about six, cylinders some more


class Bodies(NamedTuple):
    """Convex shapes as arrays, in their links' frames: hull of points, plus a disc across an axis, plus a ball."""

    vertices: Floats
    """(v, 3) points of all shapes [m]."""
    first: Ints
    """(k + 1,) where each shape's points begin."""
    disc: Floats
    """(k, 4) axis and radius of a disc that is added (cylinders), else zeros."""
    radius: Floats
    """(k,) radius of a ball that is added (capsules, spheres), else zero [m]."""
    link: Ints
    """(k,) moving link 0..n-1, or -1 for the base."""
    tolerance: Floats
    """(k,) ``Shape.tolerance`` [m]."""


def pack_bodies(shapes: Sequence[Shape]) -> Bodies:
    """The shapes as arrays; index = shape index.

    Raises:
        RobotError: A number of a shape is not finite: no distance to it would mean anything.
    """
    points: list[Floats] = []
    disc, radius = np.zeros((len(shapes), 4)), np.zeros(len(shapes))
    for k, shape in enumerate(shapes):
        T = shape.T_link_shape
        own = shape.points  # boxes: their corners; capsules and spheres: the axis
        if shape.kind == "convex":
            assert shape.vertices is not None
            own = shape.vertices @ T[:3, :3].T + T[:3, 3]
        elif shape.kind == "cylinder":
            disc[k] = *T[:3, 2], shape.size[0]
            own = T[:3, 3] + np.outer([-0.5 * shape.size[1], 0.5 * shape.size[1]], T[:3, 2])
        elif shape.exact:
            radius[k] = shape.size[0]
        if not all_finite(T, own, shape.points, *shape.capsule[:2], np.array([*shape.size, shape.capsule[2]])):
            raise RobotError(
                f"the collision shape of {shape.link_name!r} is not finite",
                remedy="give finite numbers",
                element=shape.link_name,
            )
        points.append(own)
    return Bodies(
        vertices=np.concatenate([np.zeros((0, 3)), *points]),
        first=np.cumsum([0, *(len(own) for own in points)]),
        disc=disc,
        radius=radius,
        link=np.array([shape.link for shape in shapes], dtype=np.int64),
        tolerance=np.array([shape.tolerance for shape in shapes], dtype=np.float64),
    )


@njit
def _support(body: Bodies, k: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The point of shape k (without its ball) farthest along (x, y, z), in the link's frame."""
    best, at = -math.inf, body.first[k]
    for i in range(body.first[k], body.first[k + 1]):
        along = body.vertices[i, 0] * x + body.vertices[i, 1] * y + body.vertices[i, 2] * z
        if along > best:
            best, at = along, i
    px, py, pz = body.vertices[at, 0], body.vertices[at, 1], body.vertices[at, 2]
    disc = body.disc[k]
    if disc[3] > 0.0:
        axial = x * disc[0] + y * disc[1] + z * disc[2]
        ax, ay, az = x - axial * disc[0], y - axial * disc[1], z - axial * disc[2]
        across = math.sqrt(ax * ax + ay * ay + az * az)
        if across > 1e-8 * (abs(x) + abs(y) + abs(z)):  # else the rest is rounding, and any point of the disc as far
            px += disc[3] * ax / across
            py += disc[3] * ay / across
            pz += disc[3] * az / across
    return px, py, pz


@njit
def _nearest(W: Floats, n: int, v: Floats) -> int:
    """Move v (3,) to the point of the simplex W[:n] nearest to the origin; keep the corners that hold it.

    The newest corner is the last and is one of them. Candidates are the nearest points of every face through it whose
    weights are not negative: whichever is taken lies in the simplex. Returns the number of corners kept.
    """
    p = W[n - 1]
    best = p[0] * p[0] + p[1] * p[1] + p[2] * p[2]
    v0, v1, v2 = p[0], p[1], p[2]
    keep_i, keep_j = -1, -1
    for i in range(n - 1):
        a0, a1, a2 = W[i, 0] - p[0], W[i, 1] - p[1], W[i, 2] - p[2]
        aa = a0 * a0 + a1 * a1 + a2 * a2
        ap = a0 * p[0] + a1 * p[1] + a2 * p[2]
        if ap < 0.0 and -ap <= aa:
            t = -ap / aa
            x, y, z = p[0] + t * a0, p[1] + t * a1, p[2] + t * a2
            size = x * x + y * y + z * z
            if size < best:
                best, v0, v1, v2, keep_i, keep_j = size, x, y, z, i, -1
        for j in range(i + 1, n - 1):
            b0, b1, b2 = W[j, 0] - p[0], W[j, 1] - p[1], W[j, 2] - p[2]
            bb = b0 * b0 + b1 * b1 + b2 * b2
            bp = b0 * p[0] + b1 * p[1] + b2 * p[2]
            ab = a0 * b0 + a1 * b1 + a2 * b2
            det = aa * bb - ab * ab
            if det > 1e-14 * aa * bb:
                s, t = (ab * bp - bb * ap) / det, (ab * ap - aa * bp) / det
                if s > 0.0 and t > 0.0 and s + t <= 1.0:
                    x, y, z = p[0] + s * a0 + t * b0, p[1] + s * a1 + t * b1, p[2] + s * a2 + t * b2
                    size = x * x + y * y + z * z
                    if size < best:
                        best, v0, v1, v2, keep_i, keep_j = size, x, y, z, i, j
    if n == 4 and _inside(W):
        v0, v1, v2 = 0.0, 0.0, 0.0
    v[0], v[1], v[2] = v0, v1, v2
    kept = 0
    for i in range(n):
        if i in (keep_i, keep_j, n - 1):
            for axis in range(3):
                W[kept, axis] = W[i, axis]
            kept += 1
    return kept


@njit
def _inside(W: Floats) -> bool:
    """Whether the origin is in the tetrahedron W (4, 3); a flat one holds nothing."""
    p = W[3]
    a0, a1, a2 = W[0, 0] - p[0], W[0, 1] - p[1], W[0, 2] - p[2]
    b0, b1, b2 = W[1, 0] - p[0], W[1, 1] - p[1], W[1, 2] - p[2]
    c0, c1, c2 = W[2, 0] - p[0], W[2, 1] - p[1], W[2, 2] - p[2]
    x0, x1, x2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
    det = a0 * x0 + a1 * x1 + a2 * x2
    scale = (a0 * a0 + a1 * a1 + a2 * a2) * (b0 * b0 + b1 * b1 + b2 * b2) * (c0 * c0 + c1 * c1 + c2 * c2)
    if not det * det > 1e-20 * scale:
        return False
    r = -(p[0] * x0 + p[1] * x1 + p[2] * x2) / det
    s = -(p[0] * (c1 * a2 - c2 * a1) + p[1] * (c2 * a0 - c0 * a2) + p[2] * (c0 * a1 - c1 * a0)) / det
    t = -(p[0] * (a1 * b2 - a2 * b1) + p[1] * (a2 * b0 - a0 * b2) + p[2] * (a0 * b1 - a1 * b0)) / det
    return bool(r >= 0.0 and s >= 0.0 and t >= 0.0 and r + s + t <= 1.0)


@njit
def separation(
    a: Bodies, i: int, T_a: Floats, b: Bodies, j: int, T_b: Floats, far: float, near: float, v: Floats, W: Floats
) -> tuple[float, float]:
    """Lower and upper bound of the distance [m] of shapes i of a and j of b, whose links are at T_a and T_b (4, 4).

    The search ends as soon as the lower bound is ``far``, or the upper one below ``near``, or both lie in between, or
    they meet. ``near`` nan asks for the distance itself. Negative: balls that overlap; other overlaps are 0.
    v: (3,) a guess of the shortest vector from b to a, in the frame of a's link, such as the last answer's; gets the
    new one. W: (4, 3) scratch.
    """
    # b in the frame of a
    d0, d1, d2 = T_b[0, 3] - T_a[0, 3], T_b[1, 3] - T_a[1, 3], T_b[2, 3] - T_a[2, 3]
    t0 = T_a[0, 0] * d0 + T_a[1, 0] * d1 + T_a[2, 0] * d2
    t1 = T_a[0, 1] * d0 + T_a[1, 1] * d1 + T_a[2, 1] * d2
    t2 = T_a[0, 2] * d0 + T_a[1, 2] * d1 + T_a[2, 2] * d2
    r00 = T_a[0, 0] * T_b[0, 0] + T_a[1, 0] * T_b[1, 0] + T_a[2, 0] * T_b[2, 0]
    r01 = T_a[0, 0] * T_b[0, 1] + T_a[1, 0] * T_b[1, 1] + T_a[2, 0] * T_b[2, 1]
    r02 = T_a[0, 0] * T_b[0, 2] + T_a[1, 0] * T_b[1, 2] + T_a[2, 0] * T_b[2, 2]
    r10 = T_a[0, 1] * T_b[0, 0] + T_a[1, 1] * T_b[1, 0] + T_a[2, 1] * T_b[2, 0]
    r11 = T_a[0, 1] * T_b[0, 1] + T_a[1, 1] * T_b[1, 1] + T_a[2, 1] * T_b[2, 1]
    r12 = T_a[0, 1] * T_b[0, 2] + T_a[1, 1] * T_b[1, 2] + T_a[2, 1] * T_b[2, 2]
    r20 = T_a[0, 2] * T_b[0, 0] + T_a[1, 2] * T_b[1, 0] + T_a[2, 2] * T_b[2, 0]
    r21 = T_a[0, 2] * T_b[0, 1] + T_a[1, 2] * T_b[1, 1] + T_a[2, 2] * T_b[2, 1]
    r22 = T_a[0, 2] * T_b[0, 2] + T_a[1, 2] * T_b[1, 2] + T_a[2, 2] * T_b[2, 2]
    radius = a.radius[i] + b.radius[j]
    far, near = far + radius, near + radius
    if not v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > 0.0:
        v[0] = 1.0
    lower, upper, corners = 0.0, math.inf, 0
    for _ in range(STEPS_MAX):
        x, y, z = v[0], v[1], v[2]
        p0, p1, p2 = _support(a, i, -x, -y, -z)
        q0, q1, q2 = _support(
            b, j, r00 * x + r10 * y + r20 * z, r01 * x + r11 * y + r21 * z, r02 * x + r12 * y + r22 * z
        )
        w = W[corners]
        w[0] = p0 - (r00 * q0 + r01 * q1 + r02 * q2 + t0)
        w[1] = p1 - (r10 * q0 + r11 * q1 + r12 * q2 + t1)
        w[2] = p2 - (r20 * q0 + r21 * q1 + r22 * q2 + t2)
        lower = max(lower, (x * w[0] + y * w[1] + z * w[2]) / math.sqrt(x * x + y * y + z * z))
        if lower >= far or (lower >= near and upper < far) or upper - lower <= BOUNDS_GAP_MAX:
            break
        corners = _nearest(W, corners + 1, v)
        size = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
        if not size < upper:  # nothing is gained any more: rounding
            break
        upper = size
        if upper < near or upper < BOUNDS_GAP_MAX:
            break
    return lower - radius, upper - radius
