"""The joint controller: inverse dynamics of a second difference, friction by the reference, clipped at the limits."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.envs.bodies import joint_torques
from armtempo.envs.bodies._joint_control import tip_of
from armtempo.planners import IKCell

DT = 1e-3


def torques(
    cell: IKCell,
    references: Floats,
    q: Floats,
    qd: Floats,
    *,
    gain: float = 0.0,
    limit: float = 1e9,
    dry: float = 0.0,
) -> tuple[Floats, Floats]:
    n = cell.arm.dof
    demand, torque = np.empty(n), np.empty(n)
    before, now, after = references
    joint_torques(
        cell.arm.model, before, now, after, q, qd, np.full(n, dry), np.full(n, limit), gain, DT, demand, torque
    )
    return demand, torque


@pytest.fixture(scope="module")
def references(chung: IKCell) -> Floats:
    q = np.random.default_rng(0).uniform(-1.0, 1.0, chung.arm.dof)
    return q + DT * np.arange(-1.0, 2.0)[:, None] * np.linspace(-1.0, 1.0, chung.arm.dof) + [[1e-6], [0.0], [2e-6]]


def test_on_the_plan_it_is_the_inverse_dynamics_of_the_second_difference(chung: IKCell, references: Floats) -> None:
    before, now, after = references
    qd, qdd = (now - before) / DT, (after - 2.0 * now + before) / DT**2
    demand, torque = torques(chung, references, now, qd, gain=200.0)
    expected = chung.arm.inverse_dynamics(now, qd, qdd, friction=False) + chung.arm.damping * qd
    np.testing.assert_allclose(demand, expected, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(torque, demand)


def test_errors_are_pulled_back_critically_damped(chung: IKCell, references: Floats) -> None:
    """With gain k they obey e'' + 2 k e' + k^2 e = 0."""
    before, now, after = references
    off, off_speed = 1e-3 * np.ones(chung.arm.dof), -0.02 * np.ones(chung.arm.dof)
    q, qd = now + off, (now - before) / DT + off_speed
    demand, _ = torques(chung, references, q, qd, gain=50.0)
    qdd = (after - 2.0 * now + before) / DT**2 - 50.0**2 * off - 2.0 * 50.0 * off_speed
    expected = chung.arm.inverse_dynamics(q, qd, qdd, friction=False) + chung.arm.damping * qd
    np.testing.assert_allclose(demand, expected, rtol=1e-9, atol=1e-9)


def test_dry_friction_goes_with_the_reference_and_is_none_where_it_stands(chung: IKCell, references: Floats) -> None:
    references = references.copy()
    references[2, 0] = references[1, 0]  # joint 0 is to stand
    now, qd = references[1], np.zeros(chung.arm.dof)
    without, _ = torques(chung, references, now, qd)
    with_it, _ = torques(chung, references, now, qd, dry=3.0)
    np.testing.assert_allclose(with_it - without, 3.0 * np.sign(references[2] - now), atol=1e-9)
    assert with_it[0] == without[0]


def test_torques_are_clipped_and_demands_are_not(chung: IKCell, references: Floats) -> None:
    demand, torque = torques(chung, references, references[1] + 0.1, np.zeros(chung.arm.dof), gain=100.0, limit=2.0)
    assert np.abs(demand).max() > 2.0
    np.testing.assert_array_equal(torque, np.clip(demand, -2.0, 2.0))


def test_the_tip_is_where_the_arm_says(chung: IKCell) -> None:
    for q in np.random.default_rng(1).uniform(-2.0, 2.0, (20, chung.arm.dof)):
        np.testing.assert_allclose(tip_of(chung.arm.model, q), chung.arm.tip_pose(q)[:3, 3], atol=1e-12)
