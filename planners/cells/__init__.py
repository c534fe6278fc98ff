"""Cells of every kind, built from their files and certified."""

from __future__ import annotations

from armtempo.planners.cells._arm_from_config import arm_from, located
from armtempo.planners.cells._blend_cell import PROFILES, BlendCell, ProfileName
from armtempo.planners.cells._blend_families import PATH_FAMILIES, FamilyName, draw_path
from armtempo.planners.cells._cell import Cell, CellBase, OneArmCell, Sweep, sweeps_along
from armtempo.planners.cells._coordination_cell import CONTROL_SHARE, CoordinationCell
from armtempo.planners.cells._ik_cell import IKCell
from armtempo.planners.cells._load import CELLS, as_cell, build_cell, load_cell
from armtempo.planners.cells._motion_demand import MotionDemand, motion_demand
from armtempo.planners.cells._pose_families import TARGET_FAMILIES, TargetFamilyName, draw_target
from armtempo.planners.cells._robot import load_robot
from armtempo.planners.cells._task import TaskEvent
from armtempo.planners.cells._task_cell import Task, TaskCell
from armtempo.planners.cells._torque_reserve import needed_torque_reserve, rate_that_holds

__all__ = [
    "OneArmCell",
    "arm_from",
    "located",
    "BlendCell",
    "CELLS",
    "CONTROL_SHARE",
    "Cell",
    "CellBase",
    "Sweep",
    "sweeps_along",
    "CoordinationCell",
    "FamilyName",
    "IKCell",
    "MotionDemand",
    "PATH_FAMILIES",
    "PROFILES",
    "ProfileName",
    "TARGET_FAMILIES",
    "TargetFamilyName",
    "Task",
    "TaskCell",
    "TaskEvent",
    "as_cell",
    "build_cell",
    "draw_path",
    "draw_target",
    "load_cell",
    "load_robot",
    "motion_demand",
    "needed_torque_reserve",
    "rate_that_holds",
]
