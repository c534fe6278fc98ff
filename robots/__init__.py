"""What an arm is: kinematics, dynamics and limits from a URDF; collision shapes and the clearance between them."""

from __future__ import annotations

from armtempo.robots._arm import Arm, Tool
from armtempo.robots._clearance import Clearance, Nearest, shape_distance
from armtempo.robots._joint_limits import read_joint_limits
from armtempo.robots._mjcf_text import mjcf_text
from armtempo.robots._model import ArmModel, Capsules
from armtempo.robots._nearest_points import nearest_points
from armtempo.robots._numba import inlined, njit, uncounted, unlocked
from armtempo.robots._separation import Bodies, pack_bodies, separation
from armtempo.robots._shapes import Shape, static_shape
from armtempo.robots._shared_base import share_bases
from armtempo.robots._sizes import UNLIMITED
from armtempo.robots._srdf import Srdf, read_srdf
from armtempo.robots._urdf_text import principal_moments, urdf_text
from armtempo.robots._visuals import Visual, read_visuals

__all__ = [
    "UNLIMITED",
    "Arm",
    "ArmModel",
    "Bodies",
    "Capsules",
    "Clearance",
    "Nearest",
    "Shape",
    "Srdf",
    "Tool",
    "Visual",
    "inlined",
    "mjcf_text",
    "nearest_points",
    "njit",
    "pack_bodies",
    "principal_moments",
    "read_joint_limits",
    "read_srdf",
    "read_visuals",
    "separation",
    "shape_distance",
    "share_bases",
    "static_shape",
    "uncounted",
    "unlocked",
    "urdf_text",
]
