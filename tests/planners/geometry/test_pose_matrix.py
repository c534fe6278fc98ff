"""Poses of cell files as matrices, against scipy."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.configs import PoseConfig
from armtempo.planners.geometry import pose_matrix, rpy_matrix

angle = st.floats(-10.0, 10.0)


@given(st.tuples(angle, angle, angle))
def test_roll_pitch_yaw_turn_about_fixed_axes_in_this_order(rpy: tuple[float, float, float]) -> None:
    expected = Rotation.from_euler("xyz", rpy).as_matrix()  # scipy's small letters: axes that do not turn along
    np.testing.assert_allclose(rpy_matrix(rpy), expected, atol=1e-14)


def test_a_quarter_of_yaw_takes_x_to_y() -> None:
    pose = PoseConfig(position_m=(1.0, 2.0, 3.0), rpy_rad=(0.0, 0.0, math.pi / 2))
    np.testing.assert_allclose(pose_matrix(pose) @ [1.0, 0.0, 0.0, 1.0], [1.0, 3.0, 3.0, 1.0], atol=1e-15)
    np.testing.assert_array_equal(pose_matrix(pose)[3], [0.0, 0.0, 0.0, 1.0])
