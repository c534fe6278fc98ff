"""Bodies that are not as the plans believe: in PyBullet they really are so, and a torque reserve is what copes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from armtempo.envs import CoordinationEnv, CoordinationOptions, CoordinationSimulation, CoordinationTrace
from armtempo.envs.bodies._bullet import pybullet
from armtempo.planners import CoordinationCell, build_cell
from armtempo.robots import Arm


@pytest.fixture(scope="module")
def reserved(lee1991: CoordinationCell) -> CoordinationCell:
    return build_cell(lee1991.config.model_copy(update={"torque_reserve": 0.1}))


@pytest.fixture(scope="module")
def slow(lee1991: CoordinationCell) -> CoordinationCell:
    return build_cell(lee1991.config.model_copy(update={"torque_reserve": 0.5}))


def with_friction(cell: CoordinationCell, damping: float, coulomb: float) -> CoordinationCell:
    """The cell's motions, planned without friction, for arms that have some."""
    arms = [
        Arm.from_urdf(
            arm.urdf, name=arm.name, T_world_base=arm.T_world_base, tip_link="tool", torque_max=arm.torque_max,
            damping=[damping] * arm.dof, coulomb=[coulomb] * arm.dof,
        )
        for arm in cell.arms
    ]  # fmt: skip
    return dataclasses.replace(cell, arms=tuple(arms))


def run(cell: CoordinationCell, *, model_error: float = 0.0, friction_error: float = 0.0) -> CoordinationTrace:
    simulation = CoordinationSimulation(
        cell, CoordinationOptions(physics="bullet", model_error=model_error, friction_error=friction_error), record=True
    )
    simulation.reset([0.0, 0.6])  # the slave stands until the master is past
    try:
        while not np.isfinite(simulation.arrival).all() and simulation.time < 2.0:
            simulation.step(np.ones(2))
        return simulation.trace()
    finally:
        simulation.close()


def test_bodies_are_heavier_by_the_share_told(lee1991: CoordinationCell) -> None:
    def of(model_error: float) -> list[tuple[float, ...]]:
        env = CoordinationEnv(lee1991, physics="bullet", model_error=model_error)
        env.reset(seed=0)
        scene = env.simulation._controller.scene
        assert scene is not None
        found = []
        for body in scene.bodies:
            for link in range(pybullet.getNumJoints(body, physicsClientId=scene.client)):
                mass, _, inertia = pybullet.getDynamicsInfo(body, link, physicsClientId=scene.client)[:3]
                found.append((mass, *inertia))
        env.close()
        return found

    plain = np.array(of(0.0))
    assert plain[:, 0].any()
    np.testing.assert_allclose(of(0.1), 1.1 * plain, rtol=1e-9)


def test_with_a_reserve_the_path_error_is_small_and_grows_with_the_model_error(reserved: CoordinationCell) -> None:
    """The controller is a spring of the reference: half the error of the masses, half of that of the path."""
    right = run(reserved)
    traces = {share: run(reserved, model_error=share) for share in (-0.1, 0.05, 0.1)}
    assert right.path_error.max() < 1e-7
    errors = {share: float(trace.path_error.max()) for share, trace in traces.items()}
    assert 1e-6 < errors[0.05] < errors[0.1] < 1e-3
    assert errors[0.1] / errors[0.05] == pytest.approx(2.0, rel=0.1)
    assert errors[-0.1] == pytest.approx(errors[0.1], rel=0.1)
    for trace in traces.values():
        assert trace.violations == 0
        np.testing.assert_allclose(trace.arrival, right.arrival, atol=1e-3)
    # The largest torques are where mass is sped up: off by as much as it is, until they are clipped.
    ratio = {share: trace.torque_demand_ratio_max / right.torque_demand_ratio_max for share, trace in traces.items()}
    assert 1.04 < ratio[0.05] < 1.07
    assert 1.08 < ratio[0.1] < 1.15
    assert 0.9 < ratio[-0.1] < 1.0


def test_without_a_reserve_heavier_bodies_leave_the_path(lee1991: CoordinationCell, reserved: CoordinationCell) -> None:
    plain = run(lee1991, model_error=0.05)
    assert plain.torque_demand_ratio_max > 1.2
    assert plain.path_error.max() > 20.0 * run(reserved, model_error=0.05).path_error.max()


@pytest.mark.parametrize("friction", [(0.5, 0.0), (0.0, 0.2)])
def test_friction_that_the_plans_do_not_know_of(slow: CoordinationCell, friction: tuple[float, float]) -> None:
    cell = with_friction(slow, *friction)
    right, rougher, smoother = run(cell), run(cell, friction_error=0.5), run(cell, friction_error=-0.5)
    assert right.path_error.max() < 1e-5
    for trace in (rougher, smoother):
        assert 3.0 * right.path_error.max() < trace.path_error.max() < 1e-3
        assert trace.violations == 0
    assert rougher.torque_demand_ratio_max > right.torque_demand_ratio_max * 1.002
    assert smoother.torque_demand_ratio_max < right.torque_demand_ratio_max * 0.998
