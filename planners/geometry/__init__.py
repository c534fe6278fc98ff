"""Points, poses and paths in space: lines, arcs, targets over time, waypoint files; least times of ways."""

from __future__ import annotations

from armtempo.planners.geometry._cartesian_path import (
    SEGMENT_LENGTH_MIN,
    TANGENT_TOLERANCE,
    Arc,
    CartesianPath,
    Line,
    Segment,
    floats,
    number,
)
from armtempo.planners.geometry._duration import DurationBound, least_times
from armtempo.planners.geometry._pose_matrix import pose_matrix, rpy_matrix
from armtempo.planners.geometry._pose_motions import JointMotion, harmonic, smooth_step, through_poses
from armtempo.planners.geometry._pose_target import Motion, PoseTarget
from armtempo.planners.geometry._range_max import RangeMax
from armtempo.planners.geometry._smooth_fit import FIT_DEGREE, SmoothFit, checked_tolerance, smooth_fit
from armtempo.planners.geometry._waypoint_file import read_waypoints

__all__ = [
    "FIT_DEGREE",
    "SmoothFit",
    "checked_tolerance",
    "smooth_fit",
    "Arc",
    "CartesianPath",
    "DurationBound",
    "JointMotion",
    "Line",
    "Motion",
    "SEGMENT_LENGTH_MIN",
    "PoseTarget",
    "RangeMax",
    "Segment",
    "TANGENT_TOLERANCE",
    "floats",
    "harmonic",
    "least_times",
    "number",
    "pose_matrix",
    "read_waypoints",
    "rpy_matrix",
    "smooth_step",
    "through_poses",
]
