"""Planning along given paths: paths, path dynamics, the phase plane, coordination charts and schedules."""

from __future__ import annotations

from armtempo.planners import _phase_kernels as phase_kernels
from armtempo.planners._build_cell import build_cell, load_cell
from armtempo.planners._cartesian_path import Arc, CartesianPath, Line, Segment
from armtempo.planners._cell import Cell
from armtempo.planners._clearance_table import ClearanceTable, clearance_table, tabulated_clearance
from armtempo.planners._coordination_chart import CoordinationChart
from armtempo.planners._execution import Execution, ScheduleExecution
from armtempo.planners._joint_path import JointPath, PathTable, path_point
from armtempo.planners._makespan_bound import makespan_bound
from armtempo.planners._path_dynamics import PathDynamics
from armtempo.planners._phase_plane import Mode, PhasePlane, minimum_time
from armtempo.planners._phase_trajectory import MotionCertificate, PhaseTrajectory
from armtempo.planners._precedence import Precedence, precedence
from armtempo.planners._schedule import METHODS, Schedule, ScheduleCertificate, schedule
from armtempo.planners._two_link_path import TwoLinkPath
from armtempo.planners._vci import VciPlan, VelocityControl, plan_vci
from armtempo.planners._vci_execution import VciExecution

__all__ = [
    "METHODS",
    "Arc",
    "CartesianPath",
    "Cell",
    "ClearanceTable",
    "CoordinationChart",
    "Execution",
    "JointPath",
    "Line",
    "Mode",
    "MotionCertificate",
    "PathDynamics",
    "PathTable",
    "PhasePlane",
    "PhaseTrajectory",
    "Precedence",
    "Schedule",
    "ScheduleCertificate",
    "ScheduleExecution",
    "Segment",
    "TwoLinkPath",
    "VciExecution",
    "VciPlan",
    "VelocityControl",
    "build_cell",
    "clearance_table",
    "load_cell",
    "makespan_bound",
    "minimum_time",
    "path_point",
    "phase_kernels",
    "plan_vci",
    "precedence",
    "schedule",
    "tabulated_clearance",
]
