"""The joint controllers of all arms at once."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.envs.bodies import Controller, Physics, joint_torques, pybullet
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.envs.bodies._joint_control import control, stack_models
from armtempo.errors import InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell


def test_arms_of_different_sizes_are_controlled_as_each_alone(lee1991: CoordinationCell, chung: IKCell) -> None:
    """Padding changes no bit: two joints beside six."""
    arms, random = (lee1991.arms[0], chung.arm, lee1991.arms[1]), np.random.default_rng(3)
    dofs = np.array([arm.dof for arm in arms])
    joints, measured, reference = (random.uniform(-1.0, 1.0, (*shape, 3, 6)) for shape in ((), (2,), (3,)))
    before = reference.copy()
    limit, coulomb, demand, torque = np.full((3, 6), 5.0), np.full((3, 6), 0.1), np.zeros((3, 6)), np.zeros((3, 6))
    control(
        stack_models([arm.model for arm in arms]), dofs, joints, 200.0, 1e-3, measured, reference, coulomb, limit,
        demand, torque,
    )  # fmt: skip
    np.testing.assert_array_equal(reference, np.stack([before[1], before[2], joints]))
    for i, arm in enumerate(arms):
        n = arm.dof
        asked, given = np.zeros(n), np.zeros(n)
        earlier, now, later = np.ascontiguousarray(reference[:, i, :n])
        joint_torques(
            arm.model, earlier, now, later, measured[0, i, :n].copy(), measured[1, i, :n].copy(),
            coulomb[i, :n].copy(), limit[i, :n].copy(), 200.0, 1e-3, asked, given,
        )  # fmt: skip
        np.testing.assert_array_equal(demand[i, :n], asked)
        np.testing.assert_array_equal(torque[i, :n], given)
        assert not demand[i, n:].any()
    assert (np.abs(torque) <= 5.0).all()
    assert (np.abs(demand) > 5.0).any()


@pytest.mark.parametrize("physics", ["bullet", "mujoco"])
def test_arms_at_rest_are_held_where_they_are(
    lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell, physics: Physics
) -> None:
    for cell in (lee1991, lee2006, chung):
        controller = Controller(cell, physics)
        assert controller.scene is not None
        q = cell.start[None] if isinstance(cell, IKCell) else np.array([path.evaluate(0.0)[0] for path in cell.paths])
        controller.reset(q)
        for _ in range(50):
            controller.track(q)
        np.testing.assert_allclose(controller.q, q, atol=1e-9)
        assert not controller.clipped
        controller.close()
        controller.close()
        assert not isinstance(controller.scene, BulletScene) or controller.scene.client < 0


@pytest.mark.parametrize("physics", ["bullet", "mujoco"])
def test_heavier_bodies_sag_until_the_controller_holds_them(chung: IKCell, physics: Physics) -> None:
    sag = []
    for error in (0.0, 0.1):
        controller = Controller(chung, physics, model_error=error)
        controller.reset(chung.start[None])
        for _ in range(200):
            controller.track(chung.start[None])
        sag.append(float(np.abs(controller.q - chung.start).max()))
        controller.close()
    assert sag[0] < 1e-9
    assert 1e-6 < sag[1] < 1e-2


def test_without_bodies_an_arm_is_put_on_its_reference(lee2006: BlendCell) -> None:
    controller = Controller(lee2006, "ideal")
    assert controller.scene is None
    n = lee2006.arm.dof
    controller.reference[:] = np.arange(3.0)[:, None, None] ** 2
    controller.put(np.full((1, n), 4.0), np.full((1, n), 2.0), np.full((1, n), 3.0))
    np.testing.assert_allclose(controller.qd, 3.0 / lee2006.physics_tick)
    assert controller.clipped
    controller.reset(np.zeros(n))
    assert not np.stack([controller.q, controller.qd, controller.torque, controller.demand]).any()
    assert not controller.reference.any()
    controller.close()


@pytest.mark.parametrize("friction_error", [-0.5, 0.5])
def test_joints_rub_by_the_share_told(lee2006: BlendCell, friction_error: float) -> None:
    controller = Controller(lee2006, "bullet", friction_error=friction_error)
    scene = controller.scene
    assert isinstance(scene, BulletScene)
    for joint, damping in zip(scene.joints[0], lee2006.arm.damping, strict=True):
        found = pybullet.getJointInfo(scene.bodies[0], joint, physicsClientId=scene.client)[6]
        assert found == pytest.approx((1.0 + friction_error) * damping)
    controller.close()


def test_bodies_too_light_for_the_feedback_are_refused(lee1991: CoordinationCell) -> None:
    """A fifth of the mass: the gain times five, a tick late."""
    with pytest.raises(InputError, match=r"model_error is -0\.8: .*unstable.*give -0\.77 or more"):
        Controller(lee1991, "bullet", model_error=-0.8)
    controller = Controller(lee1991, "bullet", model_error=-0.76)
    q = np.array([path.evaluate(0.0)[0] for path in lee1991.paths])
    controller.reset(q)
    for _ in range(400):
        controller.track(q + 1e-3)
    np.testing.assert_allclose(controller.q, q + 1e-3, atol=1e-6)
    controller.close()
