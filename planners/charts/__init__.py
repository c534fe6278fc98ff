"""Where two arms collide: coordination charts certified between samples, clearance tables."""

from __future__ import annotations

from armtempo.planners.charts._clearance_table import ClearanceTable, clearance_table, tabulated_clearance
from armtempo.planners.charts._coordination_chart import (
    BLOCKED,
    FREE,
    MAX_RESOLUTION,
    UNDECIDED,
    CoordinationChart,
)
from armtempo.planners.charts._exclusions import Exclusion, after, inside_zone, zone_exclusions
from armtempo.planners.charts._joined_cores import with_joined_cores
from armtempo.planners.charts._path_certificate import check_path
from armtempo.planners.charts._regions import CollisionRegion, cells_at, limit_at

__all__ = [
    "BLOCKED",
    "ClearanceTable",
    "CollisionRegion",
    "CoordinationChart",
    "Exclusion",
    "FREE",
    "MAX_RESOLUTION",
    "UNDECIDED",
    "after",
    "cells_at",
    "check_path",
    "clearance_table",
    "inside_zone",
    "limit_at",
    "tabulated_clearance",
    "with_joined_cores",
    "zone_exclusions",
]
