"""The bundled SCARA: its reach, what the paper's run asks of its drives, and PyBullet's reading of the same file."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pybullet
import pytest

from armtempo.configs import data_path
from armtempo.planners import BlendCell
from armtempo.planners.joint_paths import ScaraPath
from armtempo.robots import Arm, Clearance

URDF = data_path("robots/scara_800.urdf")


@pytest.fixture(scope="module")
def scara() -> Arm:
    return Arm.from_urdf(URDF, tip_link="tool")


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=number)
    yield number
    pybullet.disconnect(number)


def test_two_links_of_400_mm_a_slide_and_a_wrist(scara: Arm) -> None:
    assert scara.joint_names == ("joint_1", "joint_2", "joint_z", "joint_wrist")
    assert scara.model.prismatic.tolist() == [False, False, True, False]
    np.testing.assert_allclose(scara.tip_pose(np.zeros(4))[:3, 3], [0.8, 0.0, 0.15], atol=1e-15)
    np.testing.assert_allclose(scara.tip_pose([0.0, np.pi / 2, -0.15, 1.0])[:3, 3], [0.4, 0.4, 0.0], atol=1e-15)
    inertia = np.linalg.eigvalsh(scara.model.inertia)
    assert (inertia[:, 0] > 0).all()
    assert (inertia[:, 2] <= inertia[:, :2].sum(axis=1) * (1 + 1e-9)).all()  # of a body that can be


def test_pybullet_reads_the_same_arm(scara: Arm, client: int) -> None:
    body = pybullet.loadURDF(
        str(URDF), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
    )
    tool = pybullet.getNumJoints(body, physicsClientId=client) - 1
    random = np.random.default_rng(0)
    for _ in range(50):
        q = random.uniform(scara.position_min, scara.position_max)
        qd, qdd = random.uniform(-3.0, 3.0, (2, 4))
        for joint, (position, speed) in enumerate(zip(q, qd, strict=True)):
            pybullet.resetJointState(body, joint, position, speed, physicsClientId=client)
        place = pybullet.getLinkState(body, tool, computeForwardKinematics=True, physicsClientId=client)[4]
        np.testing.assert_allclose(place, scara.tip_pose(q)[:3, 3], atol=1e-7)
        torque = pybullet.calculateInverseDynamics(body, list(q), list(qd), list(qdd), physicsClientId=client)
        np.testing.assert_allclose(torque, scara.inverse_dynamics(q, qd, qdd), atol=1e-9)


@pytest.mark.parametrize("elbow", ["positive", "negative"])
def test_its_drives_can_do_the_papers_run(lee2006: BlendCell, elbow: str) -> None:
    cell = lee2006
    profile = cell.line_speed
    s, v, a, _ = (row[:, None] for row in profile.at(np.linspace(0.0, profile.duration, 20001)))
    q, dq, ddq = ScaraPath(cell.arm, cell.blended, "positive" if elbow == "positive" else "negative").evaluate(s[:, 0])
    torque = cell.arm.inverse_dynamics(q, dq * v, ddq * v**2 + dq * a)
    peak = np.abs(torque).max(axis=0)
    assert (peak[:3] < [135.0, 48.0, 44.0]).all()  # as the file says
    assert (peak < 0.75 * cell.arm.torque_max).all()
    assert (np.abs(dq * v).max(axis=0) < cell.arm.speed_max).all()


def test_its_links_keep_clear_of_each_other_all_over_its_range(scara: Arm) -> None:
    """Those that are not neighbours; the end of the quill stays out of the first arm up to a sharp fold."""
    clearance = Clearance([scara], ())
    assert clearance.self_pairs(0)
    for elbow in np.linspace(-2.4, 2.4, 25):
        for slide in (-0.2, -0.1, 0.0):
            assert clearance.self_collision(0, np.array([0.3, elbow, slide, 0.0])).distance > 0.0
