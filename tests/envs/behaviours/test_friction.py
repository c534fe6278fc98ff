"""Friction of an arm acts in PyBullet as in the plans, and the controller makes up for it within the true limits."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from armtempo.envs import CoordinationOptions, CoordinationSimulation, CoordinationTrace
from armtempo.envs.bodies._bullet import pybullet
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.planners import CoordinationCell, build_cell
from armtempo.robots import Arm


def with_friction(cell: CoordinationCell, damping: float, coulomb: float) -> CoordinationCell:
    """The cell's motions, planned without friction and with half of the torque, for arms that have some."""
    arms = [
        Arm.from_urdf(
            arm.urdf,
            name=arm.name,
            T_world_base=arm.T_world_base,
            tip_link="tool",
            torque_max=arm.torque_max,
            damping=[damping] * arm.dof,
            coulomb=[coulomb] * arm.dof,
        )
        for arm in cell.arms
    ]
    return dataclasses.replace(cell, arms=tuple(arms))


@pytest.fixture(scope="module")
def slow(lee1991: CoordinationCell) -> CoordinationCell:
    return build_cell(lee1991.config.model_copy(update={"torque_reserve": 0.5}))


def run(cell: CoordinationCell) -> CoordinationTrace:
    simulation = CoordinationSimulation(cell, CoordinationOptions(physics="bullet"), record=True)
    simulation.reset([0.0, 0.6])  # the slave stands until the master is past: friction holds it there
    try:
        while not np.isfinite(simulation.arrival).all() and simulation.time < 2.0:
            simulation.step(np.ones(2))
        return simulation.trace()
    finally:
        simulation.close()


@pytest.mark.parametrize(("damping", "coulomb"), [(0.3, 0.0), (1.0, 0.0), (0.0, 0.2), (0.5, 0.2), (0.0, 1.0)])
def test_the_path_is_kept_as_without_friction(slow: CoordinationCell, damping: float, coulomb: float) -> None:
    free = run(with_friction(slow, 0.0, 0.0))
    rough = run(with_friction(slow, damping, coulomb))
    assert free.violations == rough.violations == 0
    # Late by a little where friction that is not planned for needs more than the limits.
    np.testing.assert_allclose(rough.arrival, free.arrival, atol=3e-3)
    assert free.path_error.max() < 1e-6
    assert rough.path_error.max() < 1e-5
    assert rough.torque_ratio_max <= 1.0
    # The torques are those of the model with friction, not smaller ones: nothing else slows the arm down.
    assert rough.torque_ratio_max > free.torque_ratio_max + 0.02
    q, qd = rough.q[0], np.diff(rough.q[0], axis=0) / rough.time[1]
    moving = np.flatnonzero((np.abs(qd[1:-1]) > 0.3).all(axis=1)) + 1  # rows in mid motion, both joints on the move
    k = moving[len(moving) // 2]
    arm = with_friction(slow, damping, coulomb).arms[0]
    # torque[k + 1] acts from k to k + 1, from the speed of the step before to that of this one
    expected = arm.inverse_dynamics(q[k], qd[k - 1], (qd[k] - qd[k - 1]) / rough.time[1])
    np.testing.assert_allclose(rough.torque[0][k + 1], expected, atol=0.02 * float(np.abs(expected).max()))


def test_friction_is_not_the_urdfs_where_the_arm_has_its_own(slow: CoordinationCell) -> None:
    """An arm that is let go coasts to rest under dry friction alone as Newton has it."""
    cell = with_friction(slow, 0.0, 0.2)
    scene = BulletScene(cell)
    try:
        body = scene.bodies[0]
        q = np.zeros((2, 2))
        qd = np.zeros((2, 2))
        scene.put_joints(q, np.zeros_like(q))
        for name in scene.joints[0]:
            pybullet.resetJointState(body, name, 0.0, 0.2, physicsClientId=scene.client)
        for _ in range(2000):
            scene.apply_torque(np.zeros((2, 2)))
        scene.read_joints(q, qd)
        assert np.abs(qd[0]).max() < 1e-9
        assert q[0, 0] > 0.0
        resting = q.copy()
        scene.apply_torque(np.full((2, 2), 0.1))  # less than the friction: it stays
        scene.read_joints(q, qd)
        np.testing.assert_allclose(q, resting, atol=1e-6)
    finally:
        scene.close()


def test_resets_stay_exact_with_friction(slow: CoordinationCell) -> None:
    simulation = CoordinationSimulation(
        with_friction(slow, 0.5, 0.2), CoordinationOptions(physics="bullet"), record=True
    )
    runs = []
    for _ in range(2):
        simulation.reset([0.0, 0.6])
        for _ in range(60):
            simulation.step(np.ones(2))
        runs.append(simulation.trace())
    np.testing.assert_array_equal(runs[0].q[0], runs[1].q[0])
    simulation.close()
