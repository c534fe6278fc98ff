"""Joint paths ``q = f(lambda)`` (Lee1991 eq. 2): through waypoints, and along Cartesian paths."""

from __future__ import annotations

from armtempo.planners.joint_paths._cartesian_joint_path import CartesianJointPath
from armtempo.planners.joint_paths._construct import JointPath
from armtempo.planners.joint_paths._fitted_path import FittedPath
from armtempo.planners.joint_paths._joint_path import AbstractJointPath, Standing
from armtempo.planners.joint_paths._planar_pair import PlanarPair
from armtempo.planners.joint_paths._pose_path import PosePath, Poses, TipPosePath
from armtempo.planners.joint_paths._scara_path import ScaraPath
from armtempo.planners.joint_paths._sequence_path import Dwell, SequencePath, Wait
from armtempo.planners.joint_paths._two_link_path import TwoLinkPath
from armtempo.planners.joint_paths._waypoint_path import WaypointPath

__all__ = [
    "AbstractJointPath",
    "CartesianJointPath",
    "Dwell",
    "FittedPath",
    "JointPath",
    "PlanarPair",
    "PosePath",
    "Poses",
    "ScaraPath",
    "SequencePath",
    "Standing",
    "TipPosePath",
    "TwoLinkPath",
    "Wait",
    "WaypointPath",
]
