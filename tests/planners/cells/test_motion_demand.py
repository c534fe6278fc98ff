"""What a motion asks of a blend cell: closed forms on a straight part, and what grows with which power of the speed."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.planners import BlendCell
from armtempo.planners.cells import MotionDemand, motion_demand


def steady(cell: BlendCell, speed: float, share: tuple[float, float] = (0.0, 1.0)) -> MotionDemand:
    """At one speed over a share of the path."""
    s = np.linspace(share[0], share[1], 2001) * cell.blended.length
    zero = np.zeros_like(s)
    return motion_demand(cell, s, speed + zero, zero, zero)


def test_on_a_straight_part_only_the_given_jerk_is_felt(lee2006: BlendCell) -> None:
    s = np.array([0.1, 0.2]) * lee2006.segments[0].length
    zero = np.zeros(2)
    told = motion_demand(lee2006, s, zero + 0.3, zero + 1.0, zero + 0.5 * lee2006.limits.jerk)
    assert told.normal_ratio_max == pytest.approx(0.0, abs=1e-9)
    assert told.jerk_ratio_max == pytest.approx(0.5)


def test_at_constant_speed_normal_goes_with_its_square_and_jerk_with_its_cube(lee2006: BlendCell) -> None:
    one, twice = steady(lee2006, 0.1), steady(lee2006, 0.2)
    assert twice.normal_ratio_max == pytest.approx(4.0 * one.normal_ratio_max)
    assert twice.jerk_ratio_max == pytest.approx(8.0 * one.jerk_ratio_max)
    assert twice.joint_speed_ratio_max == pytest.approx(2.0 * one.joint_speed_ratio_max)


def test_normal_acceleration_is_the_curvature_times_the_square_of_the_speed(lee2006: BlendCell) -> None:
    told = steady(lee2006, 0.25)
    s = np.linspace(0.0, 1.0, 2001) * lee2006.blended.length
    h = 1e-4
    inside = s[(s > h) & (s < lee2006.blended.length - h)]
    p0, p1, p2 = (lee2006.blended.position(inside + k * h) for k in (-1, 0, 1))
    curvature = np.linalg.norm(p0 - 2.0 * p1 + p2, axis=1) / h**2
    assert told.normal_ratio_max == pytest.approx(curvature.max() * 0.25**2 / lee2006.limits.normal, rel=2e-2)


def test_joint_ratios_are_those_of_inverse_dynamics(lee2006: BlendCell) -> None:
    told = steady(lee2006, 0.2)
    arm, path = lee2006.arm, lee2006.path
    s = np.linspace(0.0, 1.0, 2001) * lee2006.blended.length
    q, dq, ddq = path.evaluate(s)
    shares = np.abs(arm.inverse_dynamics(q, 0.2 * dq, 0.04 * ddq)) / arm.torque_max
    assert told.torque_ratio_max == pytest.approx(shares.max())
    assert told.joint_speed_ratio_max == pytest.approx((0.2 * np.abs(dq) / arm.speed_max).max())
    assert told.ratio_max == max(
        told.normal_ratio_max, told.jerk_ratio_max, told.torque_ratio_max, told.joint_speed_ratio_max
    )


def test_the_limit_aware_profile_keeps_what_the_papers_breaks(lee2006: BlendCell) -> None:
    def demand(name: str) -> MotionDemand:
        profile = lee2006.profile(name)
        s, v, a, j = profile.at(np.linspace(0.0, profile.duration, 4001))
        return motion_demand(lee2006, s, v, a, j)

    aware, papers = demand("limit-aware"), demand("line-speed")
    assert max(aware.normal_ratio_max, aware.jerk_ratio_max) <= 1.0 + 2e-3
    assert max(papers.normal_ratio_max, papers.jerk_ratio_max) > 1.0
