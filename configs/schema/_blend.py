"""Cells of kind blend."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import (
    model_validator,
)

from armtempo.configs.schema._arm import ArmConfig
from armtempo.configs.schema._base import (
    FileModel,
    Positive,
)
from armtempo.configs.schema._cell import CellFileConfig
from armtempo.configs.schema._geometry import BlendConfig


class LineSpeedConfig(FileModel):
    """How fast the tip may go along its path."""

    speed_m_s: Positive
    """Line speed [m/s]."""
    acceleration_m_s2: Positive
    """Largest acceleration along the path [m/s^2], as ``acceleration_reading`` reads it."""
    acceleration_reading: Literal["peak", "mean"] = "peak"
    """``peak``: the largest; ``mean``: that of the ramp from rest to line speed."""
    jerk_m_s3: Positive
    """Largest jerk [m/s^3]."""
    normal_acceleration_m_s2: Positive | None = None
    """Largest acceleration across the path [m/s^2], for profiles that look at it; null: as along the path."""


class BlendCellConfig(CellFileConfig):
    """One arm whose tip follows lines and arcs, blended at the corners, at a constant line speed."""

    kind: Literal["blend"]
    """What the cell is for."""
    arm: ArmConfig
    """The arm and its path: lines and arcs that may meet in corners."""
    blend: BlendConfig
    """How the corners are rounded."""
    line_speed: LineSpeedConfig
    """Limits of the tip's motion."""
    contour_error_max_m: Positive = 0.005
    """Distance of the tip from the path at which an episode ends [m]."""

    @property
    def arms(self) -> tuple[ArmConfig]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @model_validator(mode="after")
    def _path_of_segments(self) -> Self:
        if self.arm.path.start_m is None:
            raise ValueError("arm: its path must be given by start_m and segments; waypoints have no corners to blend")
        return self

    @model_validator(mode="after")
    def _has_a_posture(self) -> Self:
        if self.arm.elbow is None and self.arm.path.start_rad is None:
            raise ValueError(
                "arm: its elbow is missing: positive or negative, of a two-link arm or a SCARA; "
                "or give path.start_rad: joint positions at start_m"
            )
        if self.arm.limits.tool_speed_m_s or any(one.tool_speed_m_s for one in self.arm.path.segments):
            raise ValueError("arm: its tool_speed_m_s is for coordination cells; give line_speed.speed_m_s here")
        if self.arm.path.blend is not None:
            raise ValueError("arm: its path has a blend of its own; give it beside the arm only")
        self.blend.check_corners(len(self.arm.path.segments) - 1)
        return self
