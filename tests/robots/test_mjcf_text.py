"""MuJoCo's model of arms is the planners': what torques their motions take, and how friction acts."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from scipy.spatial.transform import Rotation

from armtempo.configs import data_path
from armtempo.robots import Arm, Tool, mjcf_text

mujoco: Any = importlib.import_module("mujoco")  # its types are of C

GRAVITY = (0.3, -0.2, -9.81)
FILES = ("planar_two_link.urdf", "puma560.urdf", "scara_800.urdf", "ur5e_like.urdf", "panda.urdf")


def _arm(name: str) -> Arm:
    """On a tilted base, with a tool."""
    panda = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    file = panda if name == "panda.urdf" else data_path(f"robots/{name}")
    tip = {"planar_two_link.urdf": "tool", "panda.urdf": "panda_hand"}.get(name)
    tool = Tool(mass=0.7, com=np.array([0.02, -0.01, 0.05]), inertia=np.diag([2e-3, 3e-3, 4e-3]) + 1e-4)
    base = np.eye(4)
    base[:3, :3], base[:3, 3] = Rotation.from_euler("xyz", [0.3, -0.4, 1.0]).as_matrix(), (0.1, -0.2, 0.5)
    return Arm.from_urdf(file, tool=tool, tip_link=tip, T_world_base=base, gravity=GRAVITY)


@pytest.mark.parametrize("names", [*((name,) for name in FILES), ("panda.urdf", "scara_800.urdf")])
def test_inverse_dynamics_are_ours(names: tuple[str, ...]) -> None:
    """Two arms, too: in one model they do not know of each other."""
    arms = [_arm(name) for name in names]
    model = mujoco.MjModel.from_xml_string(mjcf_text(arms, GRAVITY, 1e-3, friction=0.0))
    data, random = mujoco.MjData(model), np.random.default_rng(1)
    ends = np.cumsum([arm.dof for arm in arms])
    assert model.nv == ends[-1]
    for _ in range(20):
        data.qpos[:], data.qvel[:], data.qacc[:] = random.uniform(-2.0, 2.0, (3, model.nv))
        mujoco.mj_inverse(model, data)
        q, qd, qdd = (np.split(row, ends[:-1]) for row in (data.qpos, data.qvel, data.qacc))
        torque = [arm.inverse_dynamics(*rows, friction=False) for arm, *rows in zip(arms, q, qd, qdd, strict=True)]
        most = max(float(np.abs(one).max()) for one in torque)
        np.testing.assert_allclose(data.qfrc_inverse, np.concatenate(torque), rtol=0.0, atol=1e-12 * most)


def test_a_step_takes_damping_and_torques_as_they_are_at_its_start() -> None:
    arm, step = Arm.from_urdf(data_path("robots/ur5e_like.urdf"), damping=[0.5, 1.0, 0.0, 2.0, 0.1, 0.2]), 1e-3
    model = mujoco.MjModel.from_xml_string(mjcf_text([arm], (0.0, 0.0, -9.81), step, mass=1.5, friction=3.0))
    data, random = mujoco.MjData(model), np.random.default_rng(2)
    q, qd, qdd = random.uniform(-1.0, 1.0, (3, arm.dof))
    data.qpos[:], data.qvel[:] = q, qd
    data.qfrc_applied[:] = 1.5 * arm.inverse_dynamics(q, qd, qdd, friction=False) + 3.0 * arm.damping * qd
    mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.qvel, qd + step * qdd, atol=1e-13)
    np.testing.assert_allclose(data.qpos, q + step * data.qvel, atol=1e-15)


def test_links_without_mass_are_taken() -> None:
    """Robots whose mass is in points alone, and those that put several axes in one place."""
    arm = _arm("puma560.urdf")
    mass, inertia = arm.model.mass.copy(), arm.model.inertia.copy()
    mass[0], inertia[0] = 0.0, 0.0
    text = mjcf_text([replace(arm, model=arm.model._replace(mass=mass, inertia=inertia))], GRAVITY, 1e-3)
    assert mujoco.MjModel.from_xml_string(text).nv == arm.dof
