"""Cells of kind ik."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import (
    Field,
    StrictBool,
    field_validator,
    model_validator,
)

from armtempo.configs.schema._arm import MountedArmConfig
from armtempo.configs.schema._base import (
    ZERO,
    FileModel,
    NonNegative,
    Point,
    Positive,
    Real,
    exactly_one,
)
from armtempo.configs.schema._cell import CellFileConfig
from armtempo.configs.schema._geometry import PoseConfig

MOST_TICKS = 1_000_000  # of a target, which is sampled as a whole: 0.3 GB


class StartedArmConfig(MountedArmConfig):
    """One arm, where it stands and the posture it starts from."""

    start_rad: Annotated[tuple[Real, ...], Field(min_length=1)]
    """Joint positions at the start [rad] (prismatic joints: [m]), one per joint from the base on."""


class HarmonicConfig(FileModel):
    """A pose that swings along a line, center_m + amplitude_m cos(rate_rad_s t), and does not turn."""

    center_m: Point
    """Middle of the line [m], world frame."""
    amplitude_m: Point
    """From there to the place at time 0 [m]."""
    rate_rad_s: Positive
    """Angular frequency [rad/s]."""
    rpy_rad: Point = ZERO
    """Orientation of the tip [rad]: roll, pitch, yaw about fixed x, y, z, as in URDF."""
    duration_s: Positive
    """How long it is followed [s]."""


class TimedPoseConfig(PoseConfig):
    """A pose of the tip in the world, and when it is to be there."""

    time_s: NonNegative
    """Instant [s]; the first pose's is 0."""


class TargetConfig(FileModel):
    """Where the tip is to be, over time."""

    harmonic: HarmonicConfig | None = None
    """A pose that swings along a line."""
    poses: Annotated[tuple[TimedPoseConfig, ...], Field(min_length=2)] | None = None
    """Poses with times: from each to the next straight and about one axis, at rest in all of them."""

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        exactly_one(self, "a target")
        return self

    @field_validator("poses")
    @classmethod
    def _times_rise(cls, poses: tuple[TimedPoseConfig, ...] | None) -> tuple[TimedPoseConfig, ...] | None:
        times = [pose.time_s for pose in poses or ()]
        if times and (times[0] != 0.0 or any(b <= a for a, b in pairwise(times))):
            raise ValueError(f"time_s must begin at 0 and rise, got {', '.join(f'{t:g}' for t in times)}")
        return poses


class FeedbackLawConfig(FileModel):
    """Inverse kinematics by feedback: its gains, which error it looks at, and when it is damped."""

    position_gain_1_s: Positive = 50.9
    """Gain of the position error [1/s]."""
    approach_gain_1_s: Positive = 20.0
    """Gain of the approach axis' error [1/s]; with quaternion errors that of all axes."""
    normal_gain_1_s: Positive = 25.5
    """Gain of the normal axis' error [1/s]."""
    error: Literal["axes", "quaternion"] = "axes"
    """Error of orientation: approach and normal axes, or the shortest way."""
    feed_forward: StrictBool = True
    """Whether the target's velocity is fed forward."""
    task: Literal["auto", "pose", "position"] = "auto"
    """What is controlled; auto: of the pose, what the arm can."""
    damping: Annotated[Positive, Field(lt=1)] = 0.02
    """Singular value of the Jacobian, lengths in units of the arm's, below which it is damped."""


class IKCellConfig(CellFileConfig):
    """One arm whose tip follows a pose over time."""

    kind: Literal["ik"]
    """What the cell is for."""
    arm: StartedArmConfig
    """The arm and where it starts."""
    target: TargetConfig
    """What its tip is to follow."""
    law: FeedbackLawConfig = FeedbackLawConfig()
    """Feedback that follows it, for the baselines and for actions that set its gains."""
    control_period_s: Positive = 0.01
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    error_scale_m: Positive = 0.01
    """Position error [m] that costs half of the most; observations are scaled by it, too."""
    error_scale_rad: Positive = 0.05
    """Orientation error [rad], likewise."""

    @property
    def arms(self) -> tuple[StartedArmConfig]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @model_validator(mode="after")
    def _no_limits_of_paths(self) -> Self:
        if self.arm.limits.tool_speed_m_s is not None:
            raise ValueError("arm: its tool_speed_m_s is for coordination cells; a target says how fast it moves")
        return self

    @model_validator(mode="after")
    def _target_can_be_sampled(self) -> Self:
        poses, harmonic = self.target.poses, self.target.harmonic
        if harmonic is not None:
            key, duration = "target.harmonic.duration_s", harmonic.duration_s
        else:
            assert poses is not None  # by the target's own check
            key, duration = f"target.poses.{len(poses) - 1}.time_s", poses[-1].time_s
        if self.control_period_s > duration:  # a target lasts whole periods
            key, duration = "control_period_s", self.control_period_s
        if duration > MOST_TICKS * self.physics_tick_s * (1.0 + 1e-9):
            raise ValueError(
                f"{key}: {duration:g} s are {duration / self.physics_tick_s:.3g} ticks of physics_tick_s = "
                f"{self.physics_tick_s:g}, and at most {MOST_TICKS} can be sampled; give at most "
                f"{MOST_TICKS * self.physics_tick_s:g} s"
            )
        return self
