"""A blend cell: one arm whose tip follows lines and arcs with blended corners, and its line-speed profiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal, final, get_args

import numpy as np

from armtempo.configs import BlendCellConfig, change_blend
from armtempo.errors import InfeasibleError, UnknownNameError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.cells._arm_from_config import arm_from, located, segments_from
from armtempo.planners.cells._cell import OneArmCell, Sweep, sweeps_along
from armtempo.planners.charts import check_path
from armtempo.planners.geometry import Arc, Line
from armtempo.planners.joint_paths import AbstractJointPath, CartesianJointPath, JointPath, ScaraPath, TwoLinkPath
from armtempo.planners.line_speed import LineSpeedLimits, LineSpeedProfile, limit_aware_profile
from armtempo.robots import Arm, Clearance

ProfileName = Literal["line-speed", "limit-aware"]
PROFILES: tuple[ProfileName, ...] = get_args(ProfileName)


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class BlendCell(OneArmCell[BlendCellConfig]):
    """One arm on a blended path. Make one with ``load_cell`` or ``build_cell``; nothing in it changes.

    Attributes:
        name: The cell's name.
        config: What it was built from; a ``variant`` has other corners or another path.
        arm: The arm.
        segments: Lines and arcs that meet in corners.
        blended: The same with the corners rounded.
        path: The arm's joints along it.
    """

    config_type: ClassVar = BlendCellConfig

    segments: tuple[Line | Arc, ...]
    blended: BlendedPath
    path: TwoLinkPath | ScaraPath | CartesianJointPath

    @classmethod
    def from_config(cls, config: BlendCellConfig) -> BlendCell:
        """Build the arm and its path, and certify it; raises as ``load_cell``."""
        with located(f"{config.source}, arm"):
            arm = arm_from(config, config.arm)
        with located(f"{config.source}, arm.path"):
            cell = cls.of(config, arm, segments_from(config.arm))
            cell.certify()
        return cell

    def certify(self) -> None:
        """Certify the path against the arm's own links, between samples too, and that it can be held at rest.

        Raises:
            CollisionError: The arm touches itself.
            InfeasibleError: The drives cannot hold it somewhere.
        """
        check_path(Clearance([self.arm], ()), 0, self.arm, self.path)
        self._check_holding()

    def _check_holding(self) -> None:
        """Raise InfeasibleError where the drives cannot hold the arm at rest on its path."""
        station = self.path.station
        q = self.path.evaluate(station)[0]
        rest = np.zeros_like(q)
        share = np.abs(self.arm.inverse_dynamics(q, rest, rest)) / self.arm.torque_max
        k, joint = np.unravel_index(int(share.argmax()), share.shape)
        if not share[k, joint] <= 1.0:
            unit = "N" if self.arm.model.prismatic[joint] else "N m"
            limit = float(self.arm.torque_max[joint])
            raise InfeasibleError(
                f"arm {self.arm.name!r} cannot hold still at station {station[k]:.4g} m: joint "
                f"{self.arm.joint_names[joint]!r} needs {share[k, joint] * limit:.4g} {unit}, "
                f"its limit is {limit:.4g} {unit}",
                remedy="raise that limit, or move the path or the base",
                station=float(station[k]),
                joint=int(joint),
            )

    @classmethod
    def of(cls, config: BlendCellConfig, arm: Arm, segments: Sequence[Line | Arc]) -> BlendCell:
        """Blend the segments as ``config`` says and find the joints along them: its elbow or its start chooses them.

        Raises:
            PathError: A corner cannot be blended, or the arm cannot follow.
        """
        blend = config.blend
        blended = BlendedPath(
            segments,
            blend.remaining_distance_m,
            shape_factor=blend.shape_factor,
            tolerance=blend.tolerance_m,
            curve=blend.curve,
            limits=_given_limits(config),
        )
        path = JointPath.along(blended, arm, elbow=config.arm.elbow, start=config.arm.path.start_rad)
        return cls(
            name=config.name,
            config=config,
            arm=arm,
            segments=tuple(segments),
            blended=blended,
            path=path,
        )

    def variant(
        self,
        *,
        segments: Sequence[Line | Arc] | None = None,
        curve: str | None = None,
        shape_factor: float | None = None,
        remaining_distance: float | None = None,
    ) -> BlendCell:
        """The same cell with another path or other corners; None keeps what it has.

        Args:
            segments: Lines and arcs in order.
            curve: Family of the blends.
            shape_factor: Of cubics.
            remaining_distance: What a blend takes off each segment [m]; takes the place of a tolerance, too.

        Raises:
            PathError: As ``of``.
            ConfigError: A value that a cell file could not have.
        """
        config = change_blend(
            self.config, curve=curve, shape_factor=shape_factor, remaining_distance_m=remaining_distance
        )
        return self.of(config, self.arm, self.segments if segments is None else segments)

    def sweeps(self, count: int) -> tuple[Sweep, ...]:
        """So many postures of the arm along its path, for pictures."""
        return sweeps_along(self.arms, self.paths, count)

    @property
    def paths(self) -> tuple[AbstractJointPath]:
        """Its joint path."""
        return (self.path,)

    @property
    def contour_error_max(self) -> float:
        """Distance of the tip from the path at which an episode ends [m]."""
        return self.config.contour_error_max_m

    @cached_property
    def line_speed(self) -> LineSpeedProfile:
        """The paper's profile: limits along the path only."""
        reading = self.config.line_speed.acceleration_reading
        return LineSpeedProfile.plan(self.blended.length, _given_limits(self.config), reading=reading)

    @property
    def limits(self) -> LineSpeedLimits:
        """Limits of the tip; the acceleration is the peak that goes with the given one."""
        return self.line_speed.limits

    @cached_property
    def limit_aware(self) -> LineSpeedProfile:
        """The profile that keeps normal acceleration and the vector's jerk, too."""
        return limit_aware_profile(self.blended, self.limits)

    def profile(self, name: str) -> LineSpeedProfile:
        """A profile by name: ``line-speed`` or ``limit-aware``.

        Raises:
            UnknownNameError: No such profile.
        """
        if not isinstance(name, str) or name not in PROFILES:
            raise UnknownNameError("profile", name, PROFILES)
        return self.line_speed if name == "line-speed" else self.limit_aware


def _given_limits(config: BlendCellConfig) -> LineSpeedLimits:
    given = config.line_speed
    return LineSpeedLimits(
        speed=given.speed_m_s,
        acceleration=given.acceleration_m_s2,
        jerk=given.jerk_m_s3,
        normal_acceleration=given.normal_acceleration_m_s2,
    )
