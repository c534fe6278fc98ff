r"""Cartesian paths by arc length: lines, circular arcs, and chains of them.

A path is given; the planners only decide *when*. Each segment maps the travelled length ``s`` [m] to the position
``p(s)`` and its derivatives ``dp/ds`` (unit tangent), ``d2p/ds2`` (curvature vector, [1/m]) and ``d3p/ds3`` [1/m^2],
all exact. Segments of a chain join with one tangent; the curvature may jump there (the joints are ``breakpoints``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError, brief

NUMBER_MAX = 1e12  # of what is given as a number: powers of it must not overflow
COORDINATE_MAX = 1e9  # [m] centres of flat arcs are far away
SEGMENT_LENGTH_MIN = 1e-9  # [m] a segment that is shorter is none
ARC_FLATNESS_MIN = 1e-6  # the size of three points over the diameter of their circle, below which they are a line
ARC_ROUNDING, ARC_ROUNDING_SHARE = 7.5e-6, 0.02  # [m] by which radii may differ: three points to 1e-4 inch, unless tiny
ARC_SHARE, ARC_OFF_MAX = 1e-3, 5e-4  # or this share of the radius, up to so much [m], as machine controllers have it
ARC_SHIFT_SHARE_MAX = 0.25  # of the radius, by which a centre may move to be as far from both ends
TANGENT_TOLERANCE = 1e-6  # [rad] largest corner that passes for a smooth joint (rounded coordinates in a cell file)


class Segment(Protocol):
    """One smooth piece of a Cartesian path."""

    @property
    def length(self) -> float:
        """Arc length [m]."""
        ...

    def evaluate(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m]."""
        ...

    def derivatives(self, s: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by arc length [1/m^2], each (..., 3)."""
        ...


def floats(value: ArrayLike, name: str, most: float = NUMBER_MAX) -> Floats:
    """A copy of what a caller gave as numbers of one shape; nothing else passes, nor do finite ones beyond ``most``."""
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} must be numbers, got {brief(value)}") from None
    size = np.abs(array)
    if ((size > most) & (size < np.inf)).any():
        raise InputError(f"{name} must be numbers up to {most:g}, got {brief(value)}")
    return array


def number(value: ArrayLike, name: str) -> float:
    """``floats`` for one number; NaN and infinity pass."""
    array = floats(value, name)
    if array.shape:
        raise InputError(f"{name} must be one number, got {brief(value)}")
    return float(array)


def _checked_part(low: float, high: float, length: float) -> None:
    """Refuse a piece that is empty, runs backwards or leaves its segment."""
    slack = SEGMENT_LENGTH_MIN * max(length, 1.0)
    if not (-slack <= low and low + SEGMENT_LENGTH_MIN <= high <= length + slack):
        raise PathError(
            f"the piece {brief(low)} .. {brief(high)} m is not in 0 .. {length:.6g} m", remedy="give 0 <= low < high"
        )


def _point(value: ArrayLike, name: str) -> Floats:
    point = floats(value, name, np.inf)
    if point.shape != (3,) or not (np.abs(point) <= COORDINATE_MAX).all():
        raise PathError(f"{name} must be three finite coordinates in metres, got {brief(value)}")
    point.setflags(write=False)
    return point


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """Straight segment from ``start`` to ``end``, both (3,) [m].

    Raises:
        PathError: The two points coincide.
    """

    start: Floats
    end: Floats
    length: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", _point(self.start, "start of a line"))
        object.__setattr__(self, "end", _point(self.end, "end of a line"))
        object.__setattr__(self, "length", float(np.linalg.norm(self.end - self.start)))
        if self.length < SEGMENT_LENGTH_MIN:
            raise PathError(f"line from {self.start.tolist()} has no length", remedy="move its end or drop it")

    def evaluate(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m]."""
        s = np.asarray(s, dtype=np.float64)[..., None]
        tangent = (self.end - self.start) / self.length
        position = self.start + s * tangent
        return position, np.broadcast_to(tangent, position.shape).copy(), np.zeros_like(position)

    def derivatives(self, s: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by arc length [1/m^2], each (..., 3)."""
        position, tangent, curvature = self.evaluate(s)
        return position, tangent, curvature, np.zeros_like(position)

    def part(self, low: float, high: float) -> Line:
        """The piece between two arc lengths [m], 0 <= low < high <= length.

        Raises:
            PathError: Other lengths.
        """
        _checked_part(low, high, self.length)
        return Line(*self.evaluate([low, high])[0])


def _centered(start: Floats, end: Floats, center: Floats) -> Floats:
    """The centre of an arc, moved along the chord to the same distance from both ends if it is off by rounding.

    Raises:
        PathError: It is farther off.
    """
    before, after = float(np.linalg.norm(start - center)), float(np.linalg.norm(end - center))
    off, radius = abs(after - before), min(before, after)
    rounding = max(min(ARC_ROUNDING, ARC_ROUNDING_SHARE * radius), min(ARC_SHARE * radius, ARC_OFF_MAX))
    if radius < SEGMENT_LENGTH_MIN or off > rounding:
        raise PathError(
            f"arc centre {center.tolist()} is {before:.6g} m from its start but {after:.6g} m from its end",
            remedy="give a centre at equal distances from both",
        )
    chord = end - start
    size = float(np.linalg.norm(chord))
    if off <= 1e-9 * radius or size * ARC_SHIFT_SHARE_MAX * radius < off * before:  # nearly a whole turn: no one circle
        return center
    along = chord / size
    return np.asarray(center - ((center - 0.5 * (start + end)) @ along) * along)


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """Circular arc about a centre, the shorter of the two unless ``normal`` is given.

    Args:
        start: First point (3,) [m].
        end: Last point (3,) [m], at the same distance from the centre.
        center: Centre of the circle (3,) [m]. Coordinates may be rounded as machine programs round them: if its
            distances from both points differ by up to 7.5 um (three points to 1e-4 inch), or by 0.1 % and up to
            0.5 mm, it is moved to the same distance from both, ``center_shift`` [m] says how far.
        normal: Axis (3,) about which the arc turns counter-clockwise; needed for a half circle, and for arcs that are
            longer than one.

    Raises:
        PathError: Radii differ by more than that, or by more than 2 % of a tiny one; the arc has no length, or its
            plane is open.
    """

    start: Floats
    end: Floats
    center: Floats
    normal: Floats | None = None
    length: float = field(init=False)
    radius: float = field(init=False)
    angle: float = field(init=False)
    center_shift: float = field(init=False)
    _axes: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("start", "end", "center"):
            object.__setattr__(self, name, _point(getattr(self, name), f"{name} of an arc"))
        given = self.center
        object.__setattr__(self, "center", _point(_centered(self.start, self.end, given), "center of an arc"))
        object.__setattr__(self, "center_shift", float(np.linalg.norm(self.center - given)))
        a, b = self.start - self.center, self.end - self.center
        radius = float(np.linalg.norm(a))
        normal = np.cross(a, b) if self.normal is None else _point(self.normal, "normal of an arc")
        size = float(np.linalg.norm(normal))
        if size < (1e-5 * radius**2 if self.normal is None else 1e-9):  # rounded coordinates do not choose a side
            raise PathError(
                f"the plane of the arc about {self.center.tolist()} is not determined",
                remedy="a half circle needs a turn, cw or ccw; a full one is two halves",
            )
        normal = normal / size
        x_axis = a / radius
        if abs(float(x_axis @ normal)) > 1e-6 or abs(float(b @ normal)) > 1e-6 * radius:
            raise PathError("the normal of an arc must be perpendicular to both its radii")
        y_axis = np.cross(normal, x_axis)
        angle = math.atan2(float(b @ y_axis), float(b @ x_axis)) % (2.0 * math.pi)
        if radius * min(angle, 2.0 * math.pi - angle) < SEGMENT_LENGTH_MIN:  # rounding makes a whole turn of none
            raise PathError(f"arc about {self.center.tolist()} has no length", remedy="move its end or drop it")
        axes = np.stack([x_axis, y_axis])
        axes.setflags(write=False)
        object.__setattr__(self, "normal", _point(normal, "normal of an arc"))
        object.__setattr__(self, "radius", radius)
        object.__setattr__(self, "angle", angle)
        object.__setattr__(self, "length", radius * angle)
        object.__setattr__(self, "_axes", axes)

    @staticmethod
    def through(start: ArrayLike, via: ArrayLike, end: ArrayLike) -> Arc:
        """The arc from ``start`` over ``via`` to ``end``, three points (3,) [m].

        Raises:
            PathError: Two of them coincide, or the three lie on one line, to a millionth of its length.
        """
        a, b, c = (_point(p, f"{name} of an arc") for p, name in ((start, "start"), (via, "via"), (end, "end")))
        u, v = b - a, c - a
        if min(np.linalg.norm(u), np.linalg.norm(v), np.linalg.norm(c - b)) < 1e-9:
            raise PathError(
                f"two of the arc's points {a.tolist()}, {b.tolist()}, {c.tolist()} are the same",
                remedy="give three different points; a full circle is two arcs",
            )
        normal = np.cross(u, v)
        area = float(normal @ normal)
        sides = [float(np.linalg.norm(side)) for side in (u, v, c - b)]
        if math.sqrt(area) * max(sides) < ARC_FLATNESS_MIN * math.prod(sides):  # the largest over the circle's diameter
            raise PathError(
                f"the arc's points {a.tolist()}, {b.tolist()}, {c.tolist()} lie on one line, or nearly",
                remedy="use a Line, or move the middle point off it",
            )
        center = a + np.cross((u @ u) * v - (v @ v) * u, normal) * (0.5 / area)
        return Arc(a, c, center, normal / math.sqrt(area))

    def evaluate(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m]."""
        turned = np.asarray(s, dtype=np.float64)[..., None] / self.radius
        x_axis, y_axis = self._axes
        outward = np.cos(turned) * x_axis + np.sin(turned) * y_axis
        tangent = np.cos(turned) * y_axis - np.sin(turned) * x_axis
        return self.center + self.radius * outward, tangent, -outward / self.radius

    def derivatives(self, s: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by arc length [1/m^2], each (..., 3)."""
        position, tangent, curvature = self.evaluate(s)
        return position, tangent, curvature, -tangent / self.radius**2

    def part(self, low: float, high: float) -> Arc:
        """The piece between two arc lengths [m], 0 <= low < high <= length.

        Raises:
            PathError: Other lengths.
        """
        _checked_part(low, high, self.length)
        start, end = self.evaluate([low, high])[0]
        return Arc(start, end, self.center, self.normal)


@dataclass(frozen=True, slots=True, eq=False)
class CartesianPath:
    """A chain of segments that join in position and tangent.

    Args:
        segments: Lines and arcs, at least one, each starting where the one before ends.

    Raises:
        PathError: A gap or a corner between two segments; the message names them.
    """

    segments: tuple[Segment, ...]
    length: float = field(init=False)
    breakpoints: Floats = field(init=False)

    def __init__(self, segments: Sequence[Segment]) -> None:
        if not segments:
            raise PathError("a path needs at least one segment")
        ends = np.cumsum([0.0, *(segment.length for segment in segments)])
        ends.setflags(write=False)
        object.__setattr__(self, "segments", tuple(segments))
        object.__setattr__(self, "length", float(ends[-1]))
        object.__setattr__(self, "breakpoints", ends)
        for k, (before, after) in enumerate(zip(self.segments, self.segments[1:], strict=False)):
            p0, t0, _ = before.evaluate(before.length)
            p1, t1, _ = after.evaluate(0.0)
            gap = float(np.linalg.norm(p1 - p0))
            if gap > 1e-6:
                raise PathError(
                    f"segments {k} and {k + 1} are {gap:.6g} m apart", remedy="let each start where the last ends"
                )
            corner = math.atan2(float(np.linalg.norm(np.cross(t0, t1))), float(t0 @ t1))
            if corner > TANGENT_TOLERANCE:
                raise PathError(
                    f"segments {k} and {k + 1} meet in a corner of {math.degrees(corner):.4g} degrees "
                    f"at {ends[k + 1]:.6g} m",
                    remedy="round it with an arc that is tangent to both",
                    station=float(ends[k + 1]),
                )

    def evaluate(self, s: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """Position, tangent and curvature vector at arc length ``s``: each (..., 3), [m], [1], [1/m].

        At a joint the segment behind it counts, or the one before it if ``before``.
        """
        return self.derivatives(s, before=before)[:3]

    def derivatives(self, s: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats, Floats]:
        """``evaluate`` and the third derivative by arc length [1/m^2], each (..., 3)."""
        s = np.clip(np.asarray(s, dtype=np.float64), 0.0, self.length)
        index = np.searchsorted(self.breakpoints, s, side="left" if before else "right") - 1
        index = np.clip(index, 0, len(self.segments) - 1)
        out = tuple(np.empty((*s.shape, 3)) for _ in range(4))
        for k, segment in enumerate(self.segments):
            chosen = index == k
            if chosen.any():
                for whole, part in zip(out, segment.derivatives(s[chosen] - self.breakpoints[k]), strict=True):
                    whole[chosen] = part
        return out[0], out[1], out[2], out[3]
