"""An arm written as a URDF is the same arm, whoever reads it."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.robots import Arm, Tool, principal_moments, urdf_text
from armtempo.robots._urdf_text import _rpy

pin: Any = importlib.import_module("pinocchio")  # without types of its own

FILES = ("planar_two_link.urdf", "puma560.urdf", "scara_800.urdf", "ur5e_like.urdf")


def _arm(name: str) -> Arm:
    tool = Tool(mass=0.7, com=np.array([0.02, -0.01, 0.05]), inertia=np.diag([2e-3, 3e-3, 4e-3]) + 1e-4)
    return Arm.from_urdf(data_path(f"robots/{name}"), tool=tool, tip_link="tool" if "planar" in name else None)


@pytest.mark.parametrize("name", FILES)
def test_read_back_it_is_the_same_arm(name: str, tmp_path: Path) -> None:
    arm = _arm(name)
    file = tmp_path / "again.urdf"
    file.write_text(urdf_text(arm))
    limits = np.stack([arm.position_min, arm.position_max], axis=1)
    again = Arm.from_urdf(file, torque_max=arm.torque_max, speed_max=arm.speed_max, position_limits=limits)
    for field in ("placement_R", "placement_p", "axis", "mass", "com", "inertia"):
        np.testing.assert_allclose(getattr(again.model, field), getattr(arm.model, field), atol=1e-15, err_msg=field)
    assert again.dof == arm.dof


@pytest.mark.parametrize("name", FILES)
def test_pinocchio_reads_the_same_dynamics(name: str) -> None:
    arm, random = _arm(name), np.random.default_rng(0)
    model = pin.buildModelFromXML(urdf_text(arm))
    data = model.createData()
    for _ in range(5):
        q, qd, qdd = random.uniform(-2.0, 2.0, (3, arm.dof))
        theirs = np.concatenate(
            [[x] if slides else [np.cos(x), np.sin(x)] for x, slides in zip(q, arm.model.prismatic, strict=True)]
        )
        torque = pin.rnea(model, data, theirs, qd, qdd)
        np.testing.assert_allclose(arm.inverse_dynamics(q, qd, qdd, friction=False), torque, atol=1e-12 * 1e3)


angle = st.one_of(st.floats(-np.pi, np.pi), st.sampled_from([0.0, np.pi / 2, -np.pi / 2, np.pi, np.pi / 2 + 1e-9]))


@given(st.tuples(angle, angle, angle))
def test_angles_give_their_rotation_back_at_right_angles_too(angles: tuple[float, float, float]) -> None:
    R = Rotation.from_euler("xyz", angles).as_matrix()
    np.testing.assert_allclose(Rotation.from_euler("xyz", _rpy(R)).as_matrix(), R, atol=1e-14)


@given(st.lists(st.floats(1e-6, 10.0), min_size=3, max_size=3), st.tuples(angle, angle, angle))
def test_principal_moments_make_up_the_tensor(sizes: list[float], angles: tuple[float, float, float]) -> None:
    R = Rotation.from_euler("xyz", angles).as_matrix()
    tensor: Floats = R @ np.diag(sizes) @ R.T
    tensor = 0.5 * (tensor + tensor.T)
    moments, axes = principal_moments(tensor)
    np.testing.assert_allclose(axes @ np.diag(moments) @ axes.T, tensor, atol=1e-14 * max(sizes))
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_diagonal_tensor_keeps_its_axes() -> None:
    moments, axes = principal_moments(np.diag([3.0, 1.0, 2.0]))
    np.testing.assert_array_equal(moments, [3.0, 1.0, 2.0])
    np.testing.assert_array_equal(axes, np.eye(3))
