"""An arm of a cell file: robot, tool, limits, friction, mounting, path."""

from __future__ import annotations

from typing import Any, Literal, Self, TypeVar

from pydantic import (
    field_validator,
    model_validator,
)

from armtempo.configs.schema._base import (
    ZERO,
    FileModel,
    Name,
    NonNegative,
    Point,
    Positive,
    Real,
)
from armtempo.configs.schema._geometry import PathConfig, PoseConfig


class ToolConfig(FileModel):
    """A rigid body bolted to the tip link. All of it is given in the tip link's frame."""

    mass_kg: NonNegative = 0.0
    """Mass [kg]."""
    com_m: Point = ZERO
    """Centre of mass [m]."""
    inertia_kgm2: tuple[Real, Real, Real, Real, Real, Real] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """ixx, iyy, izz, ixy, ixz, iyz about the centre of mass [kg m^2]."""
    frame: PoseConfig = PoseConfig()
    """The tool's working point, which follows the path."""
    hull_m: tuple[Point, ...] | None = None
    """Corner points [m] of the convex body for collision checks; null: the tool cannot collide."""

    @field_validator("hull_m")
    @classmethod
    def _hull_is_a_body(cls, hull: tuple[Point, ...] | None) -> tuple[Point, ...] | None:
        if hull is not None and len(set(hull)) < 4:
            raise ValueError("a hull needs at least 4 different points")
        return hull

    @model_validator(mode="after")
    def _inertia_is_physical(self) -> Self:
        ixx, iyy, izz = self.inertia_kgm2[:3]
        if min(ixx, iyy, izz) < 0 or 2 * max(ixx, iyy, izz) > (ixx + iyy + izz) * (1 + 1e-9):
            raise ValueError("inertia_kgm2: ixx, iyy, izz must be >= 0, and none larger than the sum of the other two")
        if any(self.inertia_kgm2) and self.mass_kg == 0.0:
            raise ValueError("inertia_kgm2: a tool without mass_kg cannot have one")
        return self


class LimitsConfig(FileModel):
    """Limits instead of the URDF's, one value per joint from the base on. A null keeps the URDF's."""

    torque_nm: tuple[Positive | None, ...] | None = None
    """Largest torque, either way [N m] (prismatic joints: force [N])."""
    speed_rad_s: tuple[Positive | None, ...] | None = None
    """Largest speed, either way [rad/s] (prismatic joints: [m/s])."""
    acceleration_rad_s2: tuple[Positive | None, ...] | None = None
    """Largest acceleration, either way [rad/s^2] (prismatic joints: [m/s^2]); only URDF 1.2 has such limits."""
    jerk_rad_s3: tuple[Positive | None, ...] | None = None
    """Largest jerk, either way [rad/s^3] (prismatic joints: [m/s^3]); likewise. Kept by jerk-limited motions alone."""
    position_rad: tuple[tuple[Real, Real] | None, ...] | None = None
    """Lowest and highest position [rad] (prismatic joints: [m])."""
    tool_speed_m_s: Positive | None = None
    """Largest speed of the tip along its path [m/s]; segments of a path may have lower ones."""

    @field_validator("position_rad")
    @classmethod
    def _low_before_high(
        cls, ranges: tuple[tuple[float, float] | None, ...] | None
    ) -> tuple[tuple[float, float] | None, ...] | None:
        for low_high in ranges or ():
            if low_high is not None and not low_high[0] < low_high[1]:
                raise ValueError("each range must be [lowest, highest], the lowest first")
        return ranges


class FrictionConfig(FileModel):
    """Friction instead of the URDF's, one value per joint from the base on. A null keeps the URDF's."""

    viscous_nm_s_rad: tuple[NonNegative | None, ...] | None = None
    """Torque per speed [N m s/rad] (prismatic joints: [N s/m])."""
    coulomb_nm: tuple[NonNegative | None, ...] | None = None
    """Torque against the motion whatever its speed [N m] (prismatic joints: force [N])."""


Entries = TypeVar("Entries", LimitsConfig, FrictionConfig)


def _over(cell: Entries, sheet: Entries) -> Entries:
    """``cell``'s values, where it is null joint by joint the data sheet's."""
    merged: dict[str, Any] = {}
    for key in type(cell).model_fields:
        own, other = getattr(cell, key), getattr(sheet, key)
        if isinstance(own, tuple) and isinstance(other, tuple) and len(own) == len(other):
            own = tuple(o if c is None else c for c, o in zip(own, other, strict=True))
        merged[key] = other if own is None else own
    return type(cell)(**merged)


class RobotConfig(FileModel):
    """What a robot's data sheet says beyond its URDF; cells may replace any of it."""

    source: str
    """Where the numbers are from."""
    tip_link: str | None = None
    """Link that carries the tool, where the URDF branches."""
    limits: LimitsConfig = LimitsConfig()
    """Limits instead of the URDF's."""
    friction: FrictionConfig = FrictionConfig()
    """Friction instead of the URDF's."""
    substitute_mass_kg: Positive | None = None
    """Mass of all moving links [kg], where the URDF has no inertia; spread over them by volume."""
    ignored_pairs: tuple[tuple[str, str], ...] = ()
    """Pairs of links that are not looked at for self-collision."""
    unphysical_inertia: Literal["refuse", "point-mass"] = "refuse"
    """Links with moments of inertia that no body can have: an error, or taken for a point mass as PyBullet does."""


class MountedArmConfig(FileModel):
    """One arm and where it stands."""

    name: Name
    """Short name, unique in the cell; tables and errors use it."""
    urdf: str
    """URDF file: a path from the cell file, a bundled robot's name, or ``pybullet_data/...`` for one of PyBullet's."""
    base: PoseConfig = PoseConfig()
    """Pose of the URDF's root link in the world."""
    tip_link: str | None = None
    """Link that carries the tool; null: the end of the longest chain of joints, in front of a gripper. Asked for where
    that leaves a choice."""
    tool: ToolConfig | None = None
    """Body on the tip link; null: the bare tip link follows the path."""
    limits: LimitsConfig = LimitsConfig()
    """Limits instead of the URDF's."""
    friction: FrictionConfig = FrictionConfig()
    """Friction instead of the URDF's."""
    substitute_mass_kg: Positive | None = None
    """Mass of all moving links [kg], where the URDF has no inertia: spread over them by volume, for PyBullet. Such an
    arm is planned by its speed and acceleration limits alone, with this or without."""
    ignored_pairs: tuple[tuple[str, str], ...] = ()
    """Pairs of links that are not looked at for self-collision: those that touch by design."""
    locked: dict[str, Real] | None = None
    """Joints that are held, and where [rad] (prismatic joints: [m]): those of a torso, of a gripper. Joints that mimic
    them follow; all others off the arm are at zero."""
    srdf: str | None = None
    """SRDF file, a path from the cell file: its disabled pairs are not looked at for self-collision."""
    group: str | None = None
    """Group of the SRDF that the arm is: the end of it is the tip, where ``tip_link`` names none."""
    joint_limits: str | None = None
    """MoveIt's joint_limits.yaml, a path from the cell file: limits instead of the URDF's; ``limits`` go before it."""

    @model_validator(mode="after")
    def _group_of_a_file(self) -> Self:
        if self.group is not None and self.srdf is None:
            raise ValueError("group: belongs to srdf, which is missing")
        return self

    def over(self, sheet: RobotConfig | None) -> Self:
        """This arm, and what it leaves open from its robot's data sheet."""
        if sheet is None:
            return self
        return self.model_copy(
            update={
                "tip_link": self.tip_link or sheet.tip_link,
                "limits": _over(self.limits, sheet.limits),
                "friction": _over(self.friction, sheet.friction),
                "substitute_mass_kg": self.substitute_mass_kg or sheet.substitute_mass_kg,
                "ignored_pairs": (*sheet.ignored_pairs, *self.ignored_pairs),
            }
        )


class ArmConfig(MountedArmConfig):
    """One arm, where it stands and the path it is given."""

    elbow: Literal["negative", "positive"] | None = None
    """Sign of a two-link arm's elbow angle (its second joint); null where there is no such choice."""
    path: PathConfig
    """The given path."""

    @model_validator(mode="after")
    def _one_posture(self) -> Self:
        if self.elbow is not None and self.path.start_rad is not None:
            raise ValueError("elbow: give it or path.start_rad, not both")
        return self
