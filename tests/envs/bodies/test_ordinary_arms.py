"""Robot files as people have them are simulated as they are planned, and planned as another library reads them."""

from __future__ import annotations

import importlib
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pybullet_data
import pytest
import yaml

from armtempo.envs import CoordinationEnv
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.errors import RobotError
from armtempo.planners import load_cell
from armtempo.robots import Arm

pin: Any = importlib.import_module("pinocchio")  # without types of its own

PYBULLET = Path(pybullet_data.getDataPath())
EXAMPLES = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share/example-robot-data/robots")))


class File(NamedTuple):
    """A robot and what is special about its file."""

    urdf: Path
    tip: str | None
    frames: int = 0
    """Links without <inertial>."""
    mimics: int = 0
    """Joints that follow others, at a gripper."""
    slides: int = 0
    """Sliding joints on the way to the tip: a rail."""
    turns: int = 0
    """Joints on it that turn without end."""


ARMS = {
    "panda": File(PYBULLET / "franka_panda/panda.urdf", "panda_grasptarget", mimics=1),
    "iiwa 14": File(PYBULLET / "kuka_iiwa/model.urdf", None),
    "xarm6 with gripper": File(PYBULLET / "xarm/xarm6_with_gripper.urdf", "link6", frames=1, mimics=5),
    "xarm7": File(EXAMPLES / "xarm_description/urdf/xarm7.urdf", "link_eef", frames=2),
    "ur3 with gripper": File(EXAMPLES / "ur_description/urdf/ur3_gripper.urdf", "tool0", frames=1),
    "ur5": File(EXAMPLES / "ur_description/urdf/ur5_robot.urdf", "tool0", frames=1),
    "ur10": File(EXAMPLES / "ur_description/urdf/ur10_robot.urdf", "tool0", frames=1),
    "kinova": File(EXAMPLES / "kinova_description/robots/kinova.urdf", "j2s6s200_end_effector", turns=3),
    "baxter": File(EXAMPLES / "baxter_description/urdf/baxter.urdf", "left_gripper", mimics=2),
    "z1": File(EXAMPLES / "z1_description/urdf/z1.urdf", None, frames=1),
    "tiago on its lift": File(EXAMPLES / "tiago_description/robots/tiago.urdf", "arm_tool_link", slides=1),
    "tiago pro": File(
        EXAMPLES / "tiago_pro_description/robots/tiago_pro.urdf", "arm_left_tool_link", frames=10, mimics=10, slides=1
    ),
    "pr2": File(
        EXAMPLES / "pr2_description/urdf/pr2.urdf", "r_gripper_tool_frame", frames=12, mimics=10, slides=1, turns=2
    ),
}
BASE = np.array([[0.0, 0.0, 1.0, 0.3], [0.0, -1.0, 0.0, -0.2], [1.0, 0.0, 0.0, 1.1], [0.0, 0.0, 0.0, 1.0]])  # on a wall


GRAVITY = (1.0, 2.0, -9.0)


@pytest.fixture(scope="module", params=list(ARMS))
def file(request: pytest.FixtureRequest) -> File:
    return ARMS[request.param]


@pytest.fixture(scope="module")
def arm(file: File) -> Arm:
    return Arm.from_urdf(
        file.urdf, tip_link=file.tip, unphysical_inertia="point-mass", T_world_base=BASE, gravity=GRAVITY
    )


def test_the_files_are_as_various_as_they_are_said_to_be(file: File, arm: Arm) -> None:
    links = ElementTree.parse(file.urdf).getroot().findall("link")
    assert len([link for link in links if link.find("inertial") is None]) >= file.frames
    assert file.urdf.read_text(encoding="utf-8").count("<mimic") >= file.mimics
    assert int(arm.model.prismatic.sum()) == file.slides
    assert int(np.isinf(arm.position_max).sum()) == file.turns


def test_a_tick_moves_the_bodies_as_the_planner_says(arm: Arm) -> None:
    """At states and ticks of our own, not those that the scene compares at when it is made."""
    tick, random = 2e-3, np.random.default_rng(7)
    cell: Any = SimpleNamespace(arms=(_without_friction(arm),), gravity=GRAVITY, physics_tick=tick)
    scene, n = BulletScene(cell), arm.dof
    found, speeds = np.zeros((2, 1, n))
    for _ in range(5):
        q, qd, qdd = random.uniform(-2.0, 2.0, (3, n))
        torque = arm.inverse_dynamics(q, qd, qdd, friction=False)
        scene.put_joints(q[None], qd[None])
        scene.apply_torque(torque[None])
        scene.read_joints(found, speeds)
        np.testing.assert_allclose(found[0], q + tick * speeds[0], atol=1e-14)
        asked = arm.inverse_dynamics(q, qd, (speeds[0] - qd) / tick, friction=False)
        np.testing.assert_allclose(asked, torque, atol=1e-9 * np.abs(torque).max())
    scene.close()


def _without_friction(arm: Arm) -> Arm:
    return replace(arm, damping=np.zeros(arm.dof), coulomb=np.zeros(arm.dof))


def test_the_planner_reads_the_file_as_pinocchio_does(file: File, arm: Arm) -> None:
    """Frames and torques; joints off the chain are locked at zero, gripper and all. Odd inertias differ by intent."""
    if file.urdf.parent.name == "xarm":
        with pytest.raises(RobotError, match="which no body can have"):
            Arm.from_urdf(file.urdf, tip_link=file.tip)
        return
    whole = pin.buildModelFromUrdf(str(file.urdf))
    locked = [j for j, name in enumerate(whole.names) if j and name not in arm.joint_names]
    model = pin.buildReducedModel(whole, locked, pin.neutral(whole)) if locked else whole
    model.gravity.linear = BASE[:3, :3].T @ np.array(GRAVITY)
    data, random = model.createData(), np.random.default_rng(1)
    order = [model.getJointId(name) for name in arm.joint_names]
    speed_of = [model.joints[j].idx_v for j in order]
    for _ in range(5):
        q, qd, qdd = random.uniform(-2.0, 2.0, (3, arm.dof))
        theirs, speeds, accelerations = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for value, j in zip(q, order, strict=True):
            k = model.joints[j].idx_q
            theirs[k : k + model.joints[j].nq] = value if model.joints[j].nq == 1 else (np.cos(value), np.sin(value))
        speeds[speed_of], accelerations[speed_of] = qd, qdd
        torque = pin.rnea(model, data, theirs, speeds, accelerations)[speed_of]
        ours = arm.inverse_dynamics(q, qd, qdd, friction=False)
        np.testing.assert_allclose(ours, torque, atol=1e-9 * np.abs(torque).max())
        pin.framesForwardKinematics(model, data, theirs)
        tip = data.oMf[model.getFrameId(arm.tip_link)]
        np.testing.assert_allclose(arm.tip_pose(q), BASE @ tip.homogeneous, atol=1e-12)


def test_a_cell_of_ordinary_arms_runs_on_its_paths(tmp_path: Path) -> None:
    """Two UR5 with tool frames that weigh nothing, side by side: PyBullet's own reading gives each frame a kilogram."""
    path = {"waypoints_rad": [[0.0, -1.2, 1.2, -1.5, -1.5, 0.0], [0.8, -1.0, 1.4, -1.7, -1.3, 0.6]]}
    arms = [
        {
            "name": name,
            "urdf": str(EXAMPLES / "ur_description/urdf/ur5_robot.urdf"),
            "tip_link": "tool0",
            "base": {"position_m": [x, 0.0, 0.0]},
            "path": path,
        }
        for name, x in (("left", 0.0), ("right", 2.5))
    ]
    file = tmp_path / "ur5.yaml"
    file.write_text(yaml.safe_dump({"kind": "coordination", "name": "ur5", "d_min_m": 0.02, "arms": arms}))
    env = CoordinationEnv(load_cell(file), physics="bullet", record=True)
    env.reset(seed=0)
    while env.agents:
        *_, infos = env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
    assert all(info["is_success"] for info in infos.values())
    assert env.trace.path_error.max() < 1e-5
    assert env.trace.torque_demand_ratio_max < 1.01
    env.close()
