"""Minimum time along one joint path: path dynamics, phase plane, trajectories (Lee1991 section 2.2)."""

from __future__ import annotations

from armtempo.planners.topp._diagnostics import Island, PhaseDiagnostics, diagnose
from armtempo.planners.topp._minimum_time import minimum_time
from armtempo.planners.topp._path_dynamics import PathDynamics, SpeedCap
from armtempo.planners.topp._phase_plane import LIMIT_EXCESS_MAX, Mode, PhasePlane, refined_plane
from armtempo.planners.topp._smooth_trajectory import SmoothTrajectory
from armtempo.planners.topp._trajectory import MotionCertificate, PhaseTrajectory
from armtempo.planners.topp._trajectory_file import JointTrajectory, read_trajectory, write_trajectory

__all__ = [
    "LIMIT_EXCESS_MAX",
    "Island",
    "JointTrajectory",
    "Mode",
    "MotionCertificate",
    "PathDynamics",
    "PhaseDiagnostics",
    "PhasePlane",
    "PhaseTrajectory",
    "SmoothTrajectory",
    "SpeedCap",
    "diagnose",
    "minimum_time",
    "read_trajectory",
    "refined_plane",
    "write_trajectory",
]
