"""Planning along given paths: paths, path dynamics, the phase plane, coordination charts and schedules."""

from __future__ import annotations

from armtempo.planners.blends._blend import Blend, blend, least_time_blend
from armtempo.planners.blends._blended_path import BlendedPath
from armtempo.planners.blends._corners import CURVES, PassingLimits
from armtempo.planners.blends._kernels_all import PackedPath, blended_point
from armtempo.planners.blends._least_time import passing_cost
from armtempo.planners.blends._length_mapping import (
    ExactMapping,
    LengthMapping,
    PredictorCorrector,
    arc_length,
    rk4_length,
)
from armtempo.planners.cells._blend_cell import PROFILES, BlendCell, ProfileName
from armtempo.planners.cells._blend_families import PATH_FAMILIES, FamilyName, draw_path
from armtempo.planners.cells._coordination_cell import Cell
from armtempo.planners.cells._ik_cell import IKCell
from armtempo.planners.cells._load import build_cell, load_cell
from armtempo.planners.cells._motion_demand import MotionDemand, motion_demand
from armtempo.planners.cells._pose_families import TARGET_FAMILIES, TargetFamilyName, draw_target
from armtempo.planners.charts._clearance_table import ClearanceTable, clearance_table, tabulated_clearance
from armtempo.planners.charts._coordination_chart import ChartRegion, CoordinationChart
from armtempo.planners.coordination._interval_search import IntervalSearch
from armtempo.planners.coordination._makespan_bound import (
    MakespanBound,
    PairBound,
    PriorityClass,
    makespan_bound,
    pair_bound,
)
from armtempo.planners.coordination._passing_orders import PassingOrders, PassingRegion
from armtempo.planners.coordination._precedence import Precedence, precedence
from armtempo.planners.coordination._timing_problem import TimingProblem
from armtempo.planners.coordination._vci import VciPlan, VelocityControl, plan_vci
from armtempo.planners.geometry._cartesian_path import Arc, CartesianPath, Line, Segment
from armtempo.planners.geometry._pose_target import PoseTarget
from armtempo.planners.geometry._waypoint_file import read_waypoints
from armtempo.planners.ik._classical import ClosedFormIK, NewtonIK, ResolvedRateIK
from armtempo.planners.ik._feedback import INTEGRATORS, FeedbackIK, IKBounds, IKGains, IKRun, Integrator
from armtempo.planners.ik._kernels_all import Law as IKLaw
from armtempo.planners.ik._kernels_all import Targets as IKTargets
from armtempo.planners.ik._kernels_all import law_within
from armtempo.planners.ik._kernels_all import scratch as law_scratch
from armtempo.planners.ik._spherical_wrist import SphericalWristIK
from armtempo.planners.instances._bench import BenchResult, Claim, bench_cell, bench_claims
from armtempo.planners.instances._benchmark_set import (
    SPLITS,
    BenchmarkInstance,
    benchmark_instances,
    draw_benchmark,
)
from armtempo.planners.instances._generator import (
    FAMILIES,
    CellLabels,
    GeneratedCell,
    cell_name,
    generate_cell,
    label_cell,
)
from armtempo.planners.instances._instance_file import PLANNED, Instance, load_instance, save_instance
from armtempo.planners.joint_paths._cartesian_joint_path import CartesianJointPath
from armtempo.planners.joint_paths._joint_path import JointPath, PathTable, path_point
from armtempo.planners.joint_paths._pose_path import PosePath, Poses, TipPosePath
from armtempo.planners.joint_paths._scara_path import ScaraPath
from armtempo.planners.joint_paths._two_link_path import TwoLinkPath
from armtempo.planners.joint_paths._waypoint_path import WaypointPath
from armtempo.planners.line_speed._feed_override import FeedOverride
from armtempo.planners.line_speed._limit_aware import limit_aware_profile
from armtempo.planners.line_speed._profile import LineSpeedCertificate, LineSpeedLimits, LineSpeedProfile
from armtempo.planners.schedules._audit import ENGINES, Audit, audit_clearance, default_engine
from armtempo.planners.schedules._clairvoyant import clairvoyant
from armtempo.planners.schedules._execution import Execution, ScheduleExecution
from armtempo.planners.schedules._schedule import METHODS, Schedule, ScheduleCertificate, schedule
from armtempo.planners.schedules._vci_execution import VciExecution, execution_of
from armtempo.planners.topp import _kernels_all as phase_kernels
from armtempo.planners.topp._diagnostics import Island, PhaseDiagnostics, diagnose
from armtempo.planners.topp._path_dynamics import PathDynamics
from armtempo.planners.topp._phase_plane import Mode, PhasePlane, minimum_time, refined_plane
from armtempo.planners.topp._trajectory import MotionCertificate, PhaseTrajectory
from armtempo.planners.topp._trajectory_file import JointTrajectory, read_trajectory, write_trajectory

__all__ = [
    "CURVES",
    "ENGINES",
    "FAMILIES",
    "INTEGRATORS",
    "METHODS",
    "PATH_FAMILIES",
    "PLANNED",
    "PROFILES",
    "SPLITS",
    "Arc",
    "Audit",
    "BenchResult",
    "BenchmarkInstance",
    "Blend",
    "BlendCell",
    "BlendedPath",
    "CartesianJointPath",
    "CartesianPath",
    "Cell",
    "CellLabels",
    "ChartRegion",
    "Claim",
    "ClearanceTable",
    "ClosedFormIK",
    "CoordinationChart",
    "ExactMapping",
    "Execution",
    "FamilyName",
    "FeedOverride",
    "FeedbackIK",
    "IKBounds",
    "IKGains",
    "IKLaw",
    "IKRun",
    "IKTargets",
    "GeneratedCell",
    "Instance",
    "Integrator",
    "IntervalSearch",
    "Island",
    "JointPath",
    "JointTrajectory",
    "LengthMapping",
    "Line",
    "LineSpeedCertificate",
    "LineSpeedLimits",
    "LineSpeedProfile",
    "MakespanBound",
    "Mode",
    "MotionCertificate",
    "MotionDemand",
    "NewtonIK",
    "PackedPath",
    "PairBound",
    "PassingLimits",
    "PathDynamics",
    "PathTable",
    "PhaseDiagnostics",
    "PhasePlane",
    "PhaseTrajectory",
    "PosePath",
    "PoseTarget",
    "Poses",
    "PassingOrders",
    "PassingRegion",
    "Precedence",
    "PredictorCorrector",
    "PriorityClass",
    "ProfileName",
    "ResolvedRateIK",
    "ScaraPath",
    "Schedule",
    "ScheduleCertificate",
    "ScheduleExecution",
    "Segment",
    "SphericalWristIK",
    "TimingProblem",
    "TipPosePath",
    "TwoLinkPath",
    "VciExecution",
    "VciPlan",
    "VelocityControl",
    "WaypointPath",
    "arc_length",
    "audit_clearance",
    "bench_cell",
    "bench_claims",
    "benchmark_instances",
    "blend",
    "blended_point",
    "build_cell",
    "cell_name",
    "clairvoyant",
    "clearance_table",
    "default_engine",
    "diagnose",
    "draw_benchmark",
    "draw_path",
    "execution_of",
    "generate_cell",
    "law_scratch",
    "law_within",
    "label_cell",
    "least_time_blend",
    "limit_aware_profile",
    "load_cell",
    "load_instance",
    "makespan_bound",
    "minimum_time",
    "motion_demand",
    "pair_bound",
    "passing_cost",
    "path_point",
    "phase_kernels",
    "plan_vci",
    "precedence",
    "read_trajectory",
    "read_waypoints",
    "refined_plane",
    "rk4_length",
    "save_instance",
    "schedule",
    "tabulated_clearance",
    "write_trajectory",
    "IKCell",
    "TARGET_FAMILIES",
    "TargetFamilyName",
    "draw_target",
]
