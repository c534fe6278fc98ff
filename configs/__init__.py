"""Cell files: what a cell is made of, checked and typed. Schemas and data only."""

from __future__ import annotations

from armtempo.configs._load import (
    bundled_cells,
    data_path,
    load_cell_config,
    parse_cell_config,
    resolve_file,
)
from armtempo.configs._schema import (
    ArcConfig,
    ArmConfig,
    BoxConfig,
    CapsuleConfig,
    CellConfig,
    CylinderConfig,
    FrictionConfig,
    LimitsConfig,
    LineConfig,
    MeshConfig,
    ObstacleConfig,
    PathConfig,
    PoseConfig,
    SegmentConfig,
    SphereConfig,
    ToolConfig,
)

__all__ = [
    "ArcConfig",
    "ArmConfig",
    "BoxConfig",
    "CapsuleConfig",
    "CellConfig",
    "CylinderConfig",
    "FrictionConfig",
    "LimitsConfig",
    "LineConfig",
    "MeshConfig",
    "ObstacleConfig",
    "PathConfig",
    "PoseConfig",
    "SegmentConfig",
    "SphereConfig",
    "ToolConfig",
    "bundled_cells",
    "data_path",
    "load_cell_config",
    "parse_cell_config",
    "resolve_file",
]
