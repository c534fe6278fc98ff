"""Bodies of a cell file that stand still."""

from __future__ import annotations

from typing import Self

from pydantic import (
    model_validator,
)

from armtempo.configs.schema._base import (
    FileModel,
    Name,
    Positive,
    exactly_one,
)
from armtempo.configs.schema._geometry import PoseConfig


class BoxConfig(FileModel):
    """A box around its origin."""

    size_m: tuple[Positive, Positive, Positive]
    """Full lengths along x, y, z [m]."""


class SphereConfig(FileModel):
    """A sphere around its origin."""

    radius_m: Positive
    """Radius [m]."""


class CylinderConfig(FileModel):
    """A cylinder along z around its origin."""

    radius_m: Positive
    """Radius [m]."""
    length_m: Positive
    """Length along z [m]."""


class CapsuleConfig(FileModel):
    """A capsule along z around its origin."""

    radius_m: Positive
    """Radius [m]."""
    length_m: Positive
    """Length of its cylindrical part along z [m]; the two round ends come on top."""


class MeshConfig(FileModel):
    """A mesh file, taken as its convex hull."""

    file: str
    """Mesh file (.stl, .obj, ...), a path from the cell file; its unit is the metre."""


class ObstacleConfig(FileModel):
    """A body that stands still: exactly one shape, and where it stands."""

    name: Name
    """Short name, unique in the cell."""
    box: BoxConfig | None = None
    sphere: SphereConfig | None = None
    cylinder: CylinderConfig | None = None
    capsule: CapsuleConfig | None = None
    mesh: MeshConfig | None = None
    pose: PoseConfig = PoseConfig()
    """Pose in the world."""

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        exactly_one(self, "an obstacle")
        return self

    @property
    def kind(self) -> str:
        """Which shape: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``."""
        return exactly_one(self, "an obstacle")
