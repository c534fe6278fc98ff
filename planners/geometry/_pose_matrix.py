"""Poses of cell files as matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.configs import PoseConfig


def rpy_matrix(rpy: ArrayLike) -> Floats:
    """Rotation (3, 3) of roll, pitch, yaw about fixed axes, as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def pose_matrix(pose: PoseConfig) -> Floats:
    """``T`` (4, 4) of a pose."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rpy_matrix(pose.rpy_rad), pose.position_m
    return T
