"""How much torque has to be left for arms that are heavier or rougher than planned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.planners import CoordinationCell, build_cell, load_cell
from armtempo.planners.cells import CONTROL_SHARE, needed_torque_reserve, rate_that_holds


def variant(cell: CoordinationCell, **changes: object) -> CoordinationCell:
    return build_cell(cell.config.model_copy(update=changes))


def test_masses_alone_need_what_they_add(lee1991: CoordinationCell) -> None:
    """Without friction torques grow as masses do, and feedback overshoots: (1 + 1.31 e) (1 - reserve) = 0.99."""
    for error in (0.02, 0.05, 0.1, 0.5):
        reserve = needed_torque_reserve(lee1991, error)
        assert (1.0 + 1.31 * error) * (1.0 - reserve) == pytest.approx(0.99)
    assert needed_torque_reserve(lee1991) == pytest.approx(CONTROL_SHARE)
    assert needed_torque_reserve(lee1991, -0.2) == 0.0
    assert needed_torque_reserve(lee1991, 0.0, 5.0) == pytest.approx(CONTROL_SHARE)  # there is no friction
    assert needed_torque_reserve(lee1991, 15.0) == math.inf


def test_friction_of_the_plan_counts_where_it_is_larger() -> None:
    """The largest friction torque on the path: dry, and viscous at the highest speeds."""
    cell, most = load_cell("panda-pair"), 0.0
    for arm, path, plane in zip(cell.arms, cell.paths, cell.planes, strict=True):
        _, dq, _ = path.evaluate(plane.dynamics.grid)
        speed = dq * np.sqrt(np.maximum(plane.edges.high, 0.0))[:, None]
        friction = np.abs(arm.damping * speed) + arm.coulomb
        most = max(most, float((friction / arm.torque_max).max()))
    assert most > 0.01
    assert needed_torque_reserve(cell, 0.0, 0.3) == pytest.approx(CONTROL_SHARE + 1.31 * 0.3 * most, rel=1e-3)
    both = (1.0 - CONTROL_SHARE) / (1.0 + 1.31 * 0.3)  # all torques grow by as much
    assert needed_torque_reserve(cell, 0.3, 0.3) == pytest.approx(1.0 - both)


def test_arms_that_hardly_hold_themselves_cannot_be_much_heavier(lee1991: CoordinationCell) -> None:
    upright = variant(lee1991, gravity_m_s2=(0.0, -9.81, 0.0))
    held = 0.0
    for arm, path, plane in zip(upright.arms, upright.paths, upright.planes, strict=True):
        q = path.evaluate(plane.dynamics.grid)[0]
        held = max(held, float((np.abs(arm.inverse_dynamics(q, 0.0 * q, 0.0 * q)) / arm.torque_max).max()))
    assert 0.2 < held < 0.99
    most = (1.0 - CONTROL_SHARE) / held - 1.0
    assert 0.0 < rate_that_holds(upright, 0.8 * most) < 0.9
    assert rate_that_holds(upright, most + 1e-3) == 0.0
    assert needed_torque_reserve(upright, most + 1e-3) == math.inf
    assert rate_that_holds(lee1991, 10.0) > 0.2  # nothing to hold across gravity


def test_the_rate_that_holds_is_that_of_heavier_bodies(lee1991: CoordinationCell) -> None:
    """Without gravity and friction torques go with the square of the rate: (1 + 1.31 e) rate^2 (1 - reserve) = 0.99."""
    for reserve in (0.0, 0.05):
        cell = variant(lee1991, torque_reserve=reserve)
        for error in (0.05, 0.1):
            rate = rate_that_holds(cell, error)
            assert rate == pytest.approx(math.sqrt(0.99 / (1.0 + 1.31 * error) / (1.0 - reserve)), abs=0.0026)
    assert rate_that_holds(variant(lee1991, torque_reserve=0.04), 0.02) == 1.0
