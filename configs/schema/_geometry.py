"""Poses, segments, corners and paths of a cell file."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import (
    Field,
    field_validator,
    model_validator,
)

from armtempo.configs.schema._base import (
    ZERO,
    FileModel,
    PerJoint,
    Point,
    Positive,
    Real,
    exactly_one,
)


class PoseConfig(FileModel):
    """A position and an orientation in the parent frame."""

    position_m: Point = ZERO
    """Origin [m]."""
    rpy_rad: Point = ZERO
    """Roll, pitch, yaw [rad] about fixed x, y, z, as in URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""


class LineConfig(FileModel):
    """A straight line from where the path stands."""

    to_m: Point
    """End [m], world frame."""


class ArcConfig(FileModel):
    """A circular arc from where the path stands: about a centre, or through a point on the way.

    About a centre it is the shorter one, unless ``turn`` says which.
    """

    to_m: Point
    """End [m], world frame."""
    center_m: Point | None = None
    """Centre [m], world frame; as far from the start as from the end."""
    via_m: Point | None = None
    """Instead: a point [m] on the arc between its ends, world frame."""
    turn: Literal["ccw", "cw"] | None = None
    """Sense seen against ``normal``; null: the shorter arc (a half circle needs a sense)."""
    normal: Point = (0.0, 0.0, 1.0)
    """Axis that ``turn`` refers to, any length; used only with ``turn``."""

    @field_validator("normal")
    @classmethod
    def _normal_has_a_direction(cls, normal: Point) -> Point:
        if not any(normal):
            raise ValueError("must not be the zero vector")
        return normal

    @model_validator(mode="after")
    def _one_way(self) -> Self:
        if (self.center_m is None) == (self.via_m is None):
            raise ValueError(f"center_m: give it or via_m, {'one of them' if self.via_m is None else 'not both'}")
        if self.via_m is not None and self.turn is not None:
            raise ValueError("turn: belongs to center_m; an arc through via_m turns as it must")
        return self


class SegmentConfig(FileModel):
    """One piece of a path: a line or an arc."""

    line: LineConfig | None = None
    arc: ArcConfig | None = None
    tool_speed_m_s: Positive | None = None
    """Largest speed of the tip on it, and on the blends at its ends [m/s]: seams go at it if torques suffice."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        exactly_one(self, "a segment", ("line", "arc"))
        return self

    @property
    def geometry(self) -> LineConfig | ArcConfig:
        """The piece itself."""
        geometry = self.line or self.arc
        assert geometry is not None  # by _one_kind
        return geometry


class BlendConfig(FileModel):
    """How corners are rounded."""

    curve: Literal["cubic", "quintic", "low-peak", "septic", "least-time"] = "cubic"
    """Family of the curve: the paper's ``cubic``; the others have no jump of curvature at any corner."""
    shape_factor: Annotated[Positive, Field(le=4)] = 3.0
    """End tangents of the cubic in remaining distances, at most 4; at 3 the curvature does not jump between lines."""
    remaining_distance_m: PerJoint | None = None
    """Length that a blend takes off each of its two segments [m]; with a tolerance, the most that it takes.

    One number for all corners, or a list with one for each joint of two segments; 0 where they join smoothly.
    """
    tolerance_m: PerJoint | None = None
    """The most that the path leaves a corner by [m]; less where the segments are too short for it. As above."""

    @model_validator(mode="after")
    def _some_size(self) -> Self:
        if self.remaining_distance_m is None and self.tolerance_m is None:
            raise ValueError("a blend needs remaining_distance_m or tolerance_m, or both; got none")
        return self

    @model_validator(mode="after")
    def _fits_the_curve(self) -> Self:
        if self.curve != "cubic" and self.shape_factor != 3.0:
            raise ValueError(f"shape_factor: belongs to curve 'cubic', not to {self.curve!r}; drop it")
        if self.curve == "least-time" and self.tolerance_m is None:
            raise ValueError("tolerance_m: missing; curve 'least-time' needs it")
        return self

    def check_corners(self, count: int) -> None:
        """Refuse lists that are not as long as the path has joints.

        Raises:
            ValueError: One of another length.
        """
        for key in ("remaining_distance_m", "tolerance_m"):
            given = getattr(self, key)
            if isinstance(given, tuple) and len(given) != count:
                raise ValueError(
                    f"blend: {key} has {len(given)} values, and {count + 1} segments have {count} joints "
                    "(give one number, or one per joint)"
                )


class PathConfig(FileModel):
    """Where an arm goes: lines and arcs of its working point, or waypoints of its joints."""

    start_m: Point | None = None
    """First point [m], world frame."""
    waypoints_rad: Annotated[tuple[tuple[Real, ...], ...], Field(min_length=2)] | None = None
    """Joint positions [rad] (prismatic joints: [m]), one row per waypoint, one value per joint from the base on."""
    waypoints_file: str | None = None
    """CSV or JSON file of waypoints, a path from the cell file; columns may be named after the joints."""
    segments: Annotated[tuple[SegmentConfig, ...], Field(min_length=1)] = ()
    """Pieces in order; each begins where the one before ended."""
    start_rad: Annotated[tuple[Real, ...], Field(min_length=2)] | None = None
    """Joint positions [rad] (prismatic joints: [m]) at ``start_m``, of any arm, instead of an elbow: how it gets there.

    They may be rounded: the arm is moved onto ``start_m``, no joint by more than 0.25.
    The tool keeps the orientation that it has there, as far as the arm has the joints for it.
    """
    blend: BlendConfig | None = None
    """How corners of the segments are rounded; null: there are none. Cells of kind blend have it beside the arm."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        kind = exactly_one(self, "a path", ("start_m", "waypoints_rad", "waypoints_file"))
        if kind == "start_m" and not self.segments:
            raise ValueError("segments: missing; a path that starts at start_m goes on in lines and arcs")
        if kind != "start_m" and self.segments:
            raise ValueError(f"segments: belong to start_m, not to {kind}")
        for key in ("start_rad", "blend"):
            if kind != "start_m" and getattr(self, key) is not None:
                raise ValueError(f"{key}: belongs to start_m, not to {kind}")
        if self.blend is not None:
            self.blend.check_corners(len(self.segments) - 1)
        if self.blend is not None and self.blend.curve == "least-time":
            raise ValueError("blend: curve 'least-time' needs a line speed; use it in a cell of kind blend")
        return self
