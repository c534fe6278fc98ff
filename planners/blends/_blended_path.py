"""Blended paths: a chain of lines and arcs whose corners are rounded, by exact line length (Lee2006 section II).

The task is given as simple segments that may meet in corners; each corner is replaced by a blend, and what is left of
the segments joins them. Position, tangent and curvature are functions of the travelled length; so is the orientation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self, final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, PathError, brief
from armtempo.planners.blends import _path_kernels as kernels
from armtempo.planners.blends._blend import Blend, lengths_on, path_derivatives
from armtempo.planners.blends._corners import Corners, arc_shapes, packed_segments, plan_corners
from armtempo.planners.blends._families import Curve, PassingLimits
from armtempo.planners.blends._path_kernels import ARC, LINE, PackedPath
from armtempo.planners.geometry import (
    FIT_DEGREE,
    SEGMENT_LENGTH_MIN,
    Arc,
    Line,
    checked_tolerance,
    floats,
    smooth_fit,
)

FIT_SPEED_MIN = 1e-3  # of the chords' length: where a fitted curve is slower than that, it turns back


def _points(points: ArrayLike) -> Floats:
    vertices = floats(points, "points")
    if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) < 2 or not np.isfinite(vertices).all():
        raise InputError(f"points must be (N, 3), N >= 2, and finite, got shape {vertices.shape}")
    return vertices


@final
class BlendedPath:
    """Segments with their corners rounded.

    ``through`` rounds a polyline, ``fit`` replaces one of many points.

    Segments that continue each other are joined as they are. Where two join smoothly but the curvature jumps (a line
    into an arc), they are blended like at a corner if a remaining distance is given there, and left as they are by
    ``tolerance`` alone. A segment that two blends use up is dropped; the blends then meet.

    Args:
        segments: Lines and arcs, each starting where the one before ends.
        remaining_distance: From the vertex along the segments [m]: for all corners, per corner (n - 1,), or before and
            behind each (n - 1, 2).
        shape_factor: lambda of the cubic, for all corners or each.
        tolerance: Instead: the most that the path leaves the vertex by [m], for all corners or each. It is used up
            where the segments are long enough: of a segment that two corners want more of than there is, each takes
            half, or what the other leaves. With both, the remaining distance is the most that is taken, too, of a pair
            the smaller.
        curve: As for ``blend``.
        limits: For ``curve="least-time"``.
        orientation: Of the tool, quaternions (x, y, z, w): one (4,) for all the way, or two (2, 4), between which it
            turns in proportion to the length (slerp, the shorter way). None: no rotation.

    Attributes:
        length: Of the whole path [m].
        breakpoints: (K + 1,) lengths at which the K pieces join, with both ends [m].
        continuity: (K - 1,) order of geometric continuity at the interior ones: 1 tangent, 2 curvature, 3 its slope.
        deviation: (n - 1,) distance of each vertex from its blend [m], 0 where nothing is blended; of a fit (1,).
        remaining: (n - 1, 2) remaining distances [m], 0 where nothing is blended; of a fit (1, 2), 0.
        oriented: Whether an orientation was given.
        packed: The path in arrays, for ``blended_point``.

    Raises:
        InputError: A number that makes no sense, an unknown curve, a wrong shape.
        PathError: A gap, a reversal; by remaining distance a blend longer than its segment, two blends that overlap;
            ``data`` has ``segments`` and ``station`` (length along the segments to the corner) [m].
    """

    length: float
    breakpoints: Floats
    continuity: Ints
    deviation: Floats
    remaining: Floats
    oriented: bool
    packed: PackedPath

    def __init__(
        self,
        segments: Sequence[Line | Arc],
        remaining_distance: ArrayLike | None = None,
        *,
        shape_factor: ArrayLike = 3.0,
        tolerance: ArrayLike | None = None,
        curve: Curve = "cubic",
        limits: PassingLimits | None = None,
        orientation: ArrayLike | None = None,
    ) -> None:
        kind, shape, lengths = packed_segments(segments)
        if not len(kind):
            raise PathError("a path needs at least one segment")
        corners = plan_corners(
            kind, shape, lengths, remaining_distance,
            shape_factor=shape_factor, tolerance=tolerance, curve=curve, limits=limits,
        )  # fmt: skip
        self._assemble(kind, shape, lengths, corners)
        self._turn(orientation)

    @classmethod
    def through(
        cls,
        points: ArrayLike,
        remaining_distance: ArrayLike | None = None,
        *,
        shape_factor: ArrayLike = 3.0,
        tolerance: ArrayLike | None = None,
        curve: Curve = "cubic",
        limits: PassingLimits | None = None,
        orientation: ArrayLike | None = None,
    ) -> Self:
        """The polyline through ``points`` (N, 3) [m], N >= 2, with its N - 2 corners rounded. Arguments as the class.

        Raises:
            InputError: As the class, and points of a wrong shape or not finite.
            PathError: As the class, and a point that is given twice in a row.
        """
        vertices = _points(points)
        steps = np.diff(vertices, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        if lengths.min() < SEGMENT_LENGTH_MIN:
            k = int(np.argmin(lengths))
            raise PathError(
                f"points {k} and {k + 1} are the same: {vertices[k].tolist()}", remedy="drop one", segments=(k,)
            )
        shape = np.zeros((len(steps), 8, 3))
        shape[:, 0], shape[:, 1] = vertices[:-1], steps / lengths[:, None]
        kind = np.full(len(steps), LINE, dtype=np.int64)
        corners = plan_corners(
            kind, shape, lengths, remaining_distance,
            shape_factor=shape_factor, tolerance=tolerance, curve=curve, limits=limits,
        )  # fmt: skip
        path = cls.__new__(cls)
        path._assemble(kind, shape, lengths, corners)
        path._turn(orientation)
        return path

    @classmethod
    def fit(cls, points: ArrayLike, tolerance: float, *, orientation: ArrayLike | None = None) -> Self:
        """A smooth path near many points: chords of a CAM program, a recording. Few quintics that join C4 over chords.

        The path starts at the first point and ends at the last; it is nowhere farther than ``tolerance`` from the
        chords between neighbouring points, nor they from it: certified between the points, too, ``deviation`` (1,)
        says how far at most. Where the points lie on something smooth it is far closer than that.

        Args:
            points: (N, 3) [m], N >= 2; the same one may be given again.
            tolerance: [m]. More than the noise of a recording: what is noise beyond it is followed.
            orientation: As the class.

        Raises:
            InputError: Points of a wrong shape or not finite, a tolerance that is not positive.
            PathError: All points are the same; a place where the path turns straight back; no curve that near.
        """
        found = smooth_fit(_points(points), checked_tolerance(tolerance))
        steps = np.diff(found.knots)
        shape = np.zeros((len(steps), 8, 3))
        shape[:, : FIT_DEGREE + 1] = found.coefficients * (steps[:, None] ** np.arange(FIT_DEGREE + 1))[..., None]
        kind = np.full(len(steps), FIT_DEGREE, dtype=np.int64)
        slowest = np.full(len(steps), np.inf)
        kernels.slowest_speeds(shape, kind, np.ones((len(steps), 2)), slowest)
        if (slowest < FIT_SPEED_MIN * steps).any():
            k = int(np.argmin(slowest / steps))
            raise PathError(
                f"the path turns straight back at {shape[k, 0].tolist()}",
                remedy="split it there into two, or give a larger tolerance",
            )
        path = cls.__new__(cls)
        path._corner = np.zeros(len(steps), dtype=np.int64)
        path.deviation, path.remaining = np.array([found.deviation]), np.zeros((1, 2))
        path._pack(kind, shape, np.zeros(len(steps)))
        path._turn(orientation)
        return path

    def _assemble(self, kind: Ints, shape: Floats, lengths: Floats, corners: Corners) -> None:
        """Interleave what is left of the segments with the blends."""
        count = len(kind)
        lead = np.concatenate([[0.0], corners.remaining[:, 1]])
        left = lengths - lead - np.concatenate([corners.remaining[:, 0], [0.0]])
        start = np.empty((count, 4, 3))
        kernels.segment_points(kind, shape, lead, start)
        trimmed = shape.copy()
        trimmed[:, 0] = start[:, 0]
        arcs = kind == ARC
        trimmed[arcs] = arc_shapes(start[arcs, 0], start[arcs, 1], start[arcs, 2], shape[arcs, 3, 0])
        # a piece must be a segment after rounding, too; one that no blend touches is one already
        whole = (left > 2.0 * SEGMENT_LENGTH_MIN) | (left == lengths)
        kinds, shapes = np.zeros(2 * count - 1, dtype=np.int64), np.zeros((2 * count - 1, 8, 3))
        sizes, kept = np.zeros(2 * count - 1), np.ones(2 * count - 1, dtype=bool)
        kinds[::2], shapes[::2], sizes[::2], kept[::2] = kind, trimmed, left, whole
        kinds[1::2], shapes[1::2], kept[1::2] = corners.degree, corners.curve, corners.remaining[:, 0] > 0.0
        corner = np.repeat(np.arange(count), 2)[: 2 * count - 1]
        self._corner, self.deviation, self.remaining = corner[kept], corners.deviation, corners.remaining
        self._pack(kinds[kept], shapes[kept], sizes[kept])

    def _pack(self, kinds: Ints, shapes: Floats, sizes: Floats) -> None:
        """Join pieces (K,) as they are; sizes of polynomials are found."""
        first_panel, panel_start, panel_size, inverse = kernels.tabulate(kinds, shapes, sizes)
        breakpoints = np.concatenate([[0.0], np.cumsum(sizes)])
        self.packed = PackedPath(
            breakpoints=breakpoints,
            kind=kinds,
            shape=shapes,
            first_panel=first_panel,
            panel_start=panel_start,
            panel_size=panel_size,
            inverse=inverse,
        )
        continuity = np.zeros(len(kinds) - 1, dtype=np.int64)
        kernels.joint_orders(self.packed, continuity)
        self.length, self.breakpoints, self.continuity = float(breakpoints[-1]), breakpoints, continuity
        for array in (continuity, self.deviation, self.remaining):
            array.setflags(write=False)
        for array in self.packed:
            array.setflags(write=False)
        self._pieces: tuple[Line | Arc | Blend, ...] | None = None

    def _turn(self, orientation: ArrayLike | None) -> None:
        self.oriented = orientation is not None
        given = floats([0.0, 0.0, 0.0, 1.0] if orientation is None else orientation, "orientation")
        if given.shape == (4,):
            given = np.stack([given, given])
        if given.shape != (2, 4) or not np.abs(np.linalg.norm(given, axis=1) - 1.0).max() <= 1e-6:
            raise InputError(
                f"orientation {brief(orientation)} is not one or two unit quaternions (x, y, z, w)",
                remedy="give shape (4,) or (2, 4), each of length 1",
            )
        given = given / np.linalg.norm(given, axis=1, keepdims=True)
        if given[0] @ given[1] < 0.0:
            given[1] = -given[1]
        self._quaternions = given

    @property
    def segments_of_pieces(self) -> Ints:
        """(K, 2) the numbers of the segments that each piece is of: of a blend those on either side, else one twice."""
        blends = (self.packed.kind != LINE) & (self.packed.kind != ARC)
        return np.stack([self._corner, self._corner + blends], axis=1)

    @property
    def pieces(self) -> tuple[Line | Arc | Blend, ...]:
        """What is left of the segments, and the blends, in order."""
        if self._pieces is None:
            self._pieces = tuple(self._piece(k) for k in range(len(self.packed.kind)))
        return self._pieces

    def _piece(self, k: int) -> Line | Arc | Blend:
        kind, shape = int(self.packed.kind[k]), self.packed.shape[k]
        size = float(self.breakpoints[k + 1] - self.breakpoints[k])
        if kind == LINE:
            return Line(shape[0], shape[0] + size * shape[1])
        if kind == ARC:
            radius = shape[3, 0]
            angle = size / radius
            end = shape[0] + np.sin(angle) * radius * shape[2] - 2.0 * np.sin(0.5 * angle) ** 2 * shape[1]
            return Arc(shape[0], end, shape[0] - shape[1], np.cross(shape[1], shape[2]) / radius)
        corner = self._corner[k]
        return Blend(
            coefficients=shape[: kind + 1],
            start_remaining=float(self.remaining[corner, 0]),
            end_remaining=float(self.remaining[corner, 1]),
            deviation=float(self.deviation[corner]),
            continuity=tuple(int(self.continuity[j]) if 0 <= j < len(self.continuity) else 3 for j in (k - 1, k)),  # type: ignore[arg-type]
        )

    def evaluate(self, s: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at length ``s``: each (..., 3), [m], [1], [1/m].

        At a breakpoint the piece behind it counts, or the one before it if ``before``; beyond the ends the path stands.
        """
        return self.derivatives(s, before=before)[:3]

    def derivatives(self, s: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by length [1/m^2], each (..., 3)."""
        return path_derivatives(self.packed, s, before)

    def position(self, s: ArrayLike) -> Floats:
        """Where the path is after the length ``s``, (..., 3) [m]."""
        return self.derivatives(s)[0]

    def tangent(self, s: ArrayLike) -> Floats:
        """Unit tangent (..., 3)."""
        return self.derivatives(s)[1]

    def curvature(self, s: ArrayLike) -> Floats:
        """Curvature (...,) [1/m], not negative."""
        return np.asarray(np.linalg.norm(self.derivatives(s)[2], axis=-1))

    def orientation(self, s: ArrayLike) -> Floats:
        """Orientation of the tool at length ``s``: unit quaternions (x, y, z, w), (..., 4)."""
        share = np.clip(lengths_on(s) / self.length, 0.0, 1.0)[..., None]
        first, last = self._quaternions
        angle = np.arctan2(np.linalg.norm(last - (first @ last) * first), first @ last)
        if angle < 1e-9:
            return np.asarray(np.broadcast_to(first, (*share.shape[:-1], 4)).copy())
        return np.asarray((np.sin((1.0 - share) * angle) * first + np.sin(share * angle) * last) / np.sin(angle))
