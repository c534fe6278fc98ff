"""The bundled PUMA 560 and its variant: published kinematics, what PyBullet and Pinocchio read from the same files."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet
import pytest

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.robots import Arm, Clearance

pin: Any = importlib.import_module("pinocchio")  # without types of its own

NAMES = ("puma560", "puma560_chung")
HALF = np.pi / 2
# Standard Denavit-Hartenberg rows (d, a, alpha): Corke, Armstrong-Helouvry 1994; the lengths of Chung et al.
DH = {
    "puma560": [
        (0.672, 0, HALF),
        (0, 0.4318, 0),
        (0.15005, 0.0203, -HALF),
        (0.4318, 0, HALF),
        (0, 0, -HALF),
        (0, 0, 0),
    ],
    "puma560_chung": [(0.66, 0, HALF), (0, 0.55, 0), (0.13, 0, -HALF), (0.45, 0, HALF), (0, 0, -HALF), (0, 0, 0)],
}


@pytest.fixture(scope="module", params=NAMES)
def puma(request: pytest.FixtureRequest) -> Arm:
    return Arm.from_urdf(data_path(f"robots/{request.param}.urdf"))


@pytest.fixture(scope="module")
def client() -> Iterator[int]:
    number = pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=number)
    yield number
    pybullet.disconnect(number)


def states(arm: Arm, count: int) -> tuple[Floats, ...]:
    random = np.random.default_rng(0)
    q = random.uniform(arm.position_min, arm.position_max, (count, 6))
    return q, random.normal(size=q.shape), random.normal(size=q.shape)


def test_the_published_denavit_hartenberg_chain(puma: Arm) -> None:
    for q in states(puma, 50)[0]:
        T = np.eye(4)
        for angle, (d, a, alpha) in zip(q, DH[puma.name], strict=True):
            (s, c), (sa, ca) = (np.sin(angle), np.cos(angle)), (np.sin(alpha), np.cos(alpha))
            T = T @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        np.testing.assert_allclose(puma.tip_pose(q), T, atol=1e-14)


def test_inertias_of_bodies_that_can_be(puma: Arm) -> None:
    moments = np.linalg.eigvalsh(puma.model.inertia)
    assert (moments[:, 0] > 0).all()
    assert (moments[:, 2] <= moments[:, :2].sum(axis=1) * (1 + 1e-9)).all()
    np.testing.assert_allclose(puma.model.mass, [12.96, 17.4, 4.8, 0.82, 0.34, 0.09])


def test_pybullet_reads_the_same_arm(puma: Arm, client: int) -> None:
    body = pybullet.loadURDF(
        str(puma.urdf), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client
    )
    for q, qd, qdd in zip(*states(puma, 50), strict=True):
        for joint, (position, speed) in enumerate(zip(q, qd, strict=True)):
            pybullet.resetJointState(body, joint, position, speed, physicsClientId=client)
        place = pybullet.getLinkState(body, 6, computeForwardKinematics=True, physicsClientId=client)[4]
        np.testing.assert_allclose(place, puma.tip_pose(q)[:3, 3], atol=1e-6)
        torque = pybullet.calculateInverseDynamics(body, list(q), list(qd), list(qdd), physicsClientId=client)
        np.testing.assert_allclose(torque, puma.inverse_dynamics(q, qd, qdd), atol=1e-9)


def test_jacobian_is_pinocchios_and_that_of_differences(puma: Arm) -> None:
    text = puma.urdf.read_text().replace("<capsule ", "<cylinder ")  # its parser refuses PyBullet's capsules
    model = pin.buildModelFromXML(text)
    data = model.createData()
    tip = model.getFrameId("tool0")
    h = 1e-5
    for q in states(puma, 20)[0]:
        J = puma.jacobian(q)
        theirs = pin.computeFrameJacobian(model, data, q, tip, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(J, theirs, atol=1e-12)
        steps = h * np.eye(6)
        T = puma.tip_pose(q)
        rate = (
            8 * (puma.tip_pose(q + steps) - puma.tip_pose(q - steps))
            - puma.tip_pose(q + 2 * steps)
            + puma.tip_pose(q - 2 * steps)
        ) / (12 * h)  # (6, 4, 4)
        spin = rate[:, :3, :3] @ T[:3, :3].T
        np.testing.assert_allclose(J[:3].T, rate[:, :3, 3], atol=1e-8)
        np.testing.assert_allclose(J[3:].T, np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1), atol=1e-8)


def test_it_can_hold_itself_and_keeps_clear_of_itself(puma: Arm) -> None:
    q = states(puma, 200)[0]
    q[:, 1:3] = np.random.default_rng(1).uniform((-0.3, -1.6), (1.6, 0.3), (200, 2))
    hold = puma.inverse_dynamics(q, np.zeros_like(q), np.zeros_like(q))
    assert (np.abs(hold) < 0.6 * puma.torque_max).all()
    clearance = Clearance([puma], ())
    assert all(clearance.self_collision(0, row).distance > 0.0 for row in q[:50])
