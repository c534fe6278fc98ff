"""Planning along given paths: paths, path dynamics, the phase plane, coordination charts and schedules.

Here is what a person types; each room has the rest: ``geometry``, ``blends``, ``ik``, ``line_speed``, ``joint_paths``,
``topp``, ``charts``, ``coordination``, ``cells``, ``schedules``, ``instances``.
"""

from __future__ import annotations

from armtempo.planners.blends import BlendedPath, PredictorCorrector, blend, least_time_blend
from armtempo.planners.cells import (
    BlendCell,
    Cell,
    CoordinationCell,
    IKCell,
    Task,
    TaskCell,
    build_cell,
    load_cell,
    load_robot,
)
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.coordination import Precedence, VelocityControl
from armtempo.planners.geometry import Arc, CartesianPath, Line, PoseTarget
from armtempo.planners.ik import ClosedFormIK, FeedbackIK, IKGains, NewtonIK, ResolvedRateIK, find_postures
from armtempo.planners.instances import benchmark_instances, generate_cell
from armtempo.planners.joint_paths import AbstractJointPath, JointPath, PosePath
from armtempo.planners.line_speed import FeedOverride, LineSpeedLimits, LineSpeedProfile, limit_aware_profile
from armtempo.planners.schedules import METHODS, Execution, Schedule, audit_clearance, execution_of, schedule
from armtempo.planners.topp import (
    PathDynamics,
    PhasePlane,
    PhaseTrajectory,
    SmoothTrajectory,
    diagnose,
    minimum_time,
    read_trajectory,
    write_trajectory,
)

__all__ = [
    "AbstractJointPath",
    "Arc",
    "BlendCell",
    "BlendedPath",
    "CartesianPath",
    "Cell",
    "ClosedFormIK",
    "CoordinationCell",
    "CoordinationChart",
    "Execution",
    "FeedOverride",
    "FeedbackIK",
    "IKCell",
    "IKGains",
    "JointPath",
    "Line",
    "LineSpeedLimits",
    "LineSpeedProfile",
    "METHODS",
    "NewtonIK",
    "PathDynamics",
    "PhasePlane",
    "PhaseTrajectory",
    "SmoothTrajectory",
    "PosePath",
    "PoseTarget",
    "Precedence",
    "PredictorCorrector",
    "ResolvedRateIK",
    "Schedule",
    "Task",
    "TaskCell",
    "VelocityControl",
    "audit_clearance",
    "benchmark_instances",
    "blend",
    "build_cell",
    "diagnose",
    "execution_of",
    "find_postures",
    "generate_cell",
    "least_time_blend",
    "limit_aware_profile",
    "load_cell",
    "load_robot",
    "minimum_time",
    "read_trajectory",
    "schedule",
    "write_trajectory",
]
