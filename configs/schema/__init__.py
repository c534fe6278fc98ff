"""What a cell file may say."""

from __future__ import annotations

from collections.abc import Mapping

from armtempo.configs.schema._arm import (
    ArmConfig,
    FrictionConfig,
    LimitsConfig,
    MountedArmConfig,
    RobotConfig,
    ToolConfig,
)
from armtempo.configs.schema._base import CHOICE, CellTitle, FileModel, NonNegative, Positive, Real
from armtempo.configs.schema._blend import BlendCellConfig, LineSpeedConfig
from armtempo.configs.schema._cell import CellFileConfig
from armtempo.configs.schema._coordination import CellConfig, SharedSpaceConfig
from armtempo.configs.schema._geometry import ArcConfig, BlendConfig, LineConfig, PathConfig, PoseConfig, SegmentConfig
from armtempo.configs.schema._ik import (
    FeedbackLawConfig,
    HarmonicConfig,
    IKCellConfig,
    StartedArmConfig,
    TargetConfig,
    TimedPoseConfig,
)
from armtempo.configs.schema._obstacles import (
    BoxConfig,
    CapsuleConfig,
    CylinderConfig,
    MeshConfig,
    ObstacleConfig,
    SphereConfig,
)
from armtempo.configs.schema._task import (
    CornerConfig,
    EventConfig,
    MoveConfig,
    PlaceConfig,
    RepeatConfig,
    StepConfig,
    SyncConfig,
    TaskArcConfig,
    TaskArmConfig,
    TaskCellConfig,
    TaskLineConfig,
)

AnyCellConfig = CellConfig | BlendCellConfig | IKCellConfig | TaskCellConfig

CELL_CONFIGS: Mapping[str, type[CellConfig] | type[BlendCellConfig] | type[IKCellConfig] | type[TaskCellConfig]] = {
    "coordination": CellConfig,
    "blend": BlendCellConfig,
    "ik": IKCellConfig,
    "task": TaskCellConfig,
}
"""What a cell file may say, by its ``kind``."""

__all__ = [
    "CHOICE",
    "AnyCellConfig",
    "ArcConfig",
    "ArmConfig",
    "BlendCellConfig",
    "BlendConfig",
    "BoxConfig",
    "CapsuleConfig",
    "CellConfig",
    "CellTitle",
    "CylinderConfig",
    "FeedbackLawConfig",
    "FrictionConfig",
    "HarmonicConfig",
    "IKCellConfig",
    "LimitsConfig",
    "LineConfig",
    "LineSpeedConfig",
    "MeshConfig",
    "MountedArmConfig",
    "NonNegative",
    "ObstacleConfig",
    "CELL_CONFIGS",
    "CellFileConfig",
    "PathConfig",
    "PoseConfig",
    "Positive",
    "Real",
    "RobotConfig",
    "SegmentConfig",
    "SphereConfig",
    "StartedArmConfig",
    "TargetConfig",
    "TimedPoseConfig",
    "ToolConfig",
    "CornerConfig",
    "EventConfig",
    "MoveConfig",
    "PlaceConfig",
    "RepeatConfig",
    "SharedSpaceConfig",
    "StepConfig",
    "SyncConfig",
    "TaskArcConfig",
    "TaskArmConfig",
    "TaskCellConfig",
    "TaskLineConfig",
    "FileModel",
]
