"""Schedules with jerk limits: passing orders, certificates, and what cannot be had by delays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, build_cell, load_cell, schedule
from armtempo.planners.topp import SmoothTrajectory


def with_jerk(cell: CoordinationCell, ramp: float) -> CoordinationCell:
    """Limits from the largest accelerations of the minimum-time motions, reached in ``ramp`` [s]."""
    arms: list[Any] = []
    for config, path, motion in zip(cell.config.arms, cell.paths, cell.fastest, strict=True):
        lam, mu, mu_dot = motion.at(np.linspace(0.0, motion.duration, 500))
        _, dq, ddq = path.evaluate(lam)
        jerk = np.abs(dq * mu_dot[:, None] + ddq * mu[:, None] ** 2).max(axis=0) / ramp
        limits = config.limits.model_copy(update={"jerk_rad_s3": tuple(float(one) for one in jerk)})
        arms.append(config.model_copy(update={"limits": limits}))
    return build_cell(cell.config.model_copy(update={"arms": tuple(arms)}))


@pytest.fixture(scope="module")
def smooth_cell(lee1991: CoordinationCell) -> CoordinationCell:
    return with_jerk(lee1991, 0.02)


@pytest.fixture(scope="module")
def smooth_four() -> CoordinationCell:
    return with_jerk(load_cell("planar-four", CoordinationCell), 0.03)


@pytest.mark.parametrize("method", ["delay", "vci", "interval", "optimal"])
def test_two_arms_pass_in_the_same_order_within_all_limits(smooth_cell: CoordinationCell, method: str) -> None:
    plan = schedule(smooth_cell, method, smooth=True)
    assert plan.unsmoothed is not None
    assert plan.order == plan.unsmoothed.order
    certificate = plan.certificate
    assert certificate.certified_free
    assert certificate.torque_ratio_max <= 1.001
    assert 0.95 < certificate.jerk_ratio_max <= 1.001
    assert certificate.end_error == 0.0
    assert all(isinstance(motion, SmoothTrajectory) for motion in plan.trajectories)
    if method != "vci":  # which is not the shortest itself
        assert 0.0 < plan.smoothing_price_percent < 12.0
    assert plan.unsmoothed.smoothing_price_percent == 0.0
    for pair, limit in plan.precedence.limits.items():  # the same arm goes first
        np.testing.assert_array_equal(limit < np.inf, plan.unsmoothed.precedence.limits[pair] < np.inf)


def test_four_arms(smooth_four: CoordinationCell) -> None:
    plan = schedule(smooth_four, "delay", smooth=True)
    assert plan.certificate.certified_free
    assert plan.certificate.torque_ratio_max <= 1.001
    assert plan.certificate.jerk_ratio_max <= 1.001
    assert 0.0 < plan.smoothing_price_percent < 10.0


def test_one_after_the_other_stays_so(smooth_cell: CoordinationCell) -> None:
    plan = schedule(smooth_cell, "sequential", smooth=True)
    assert plan.makespan == pytest.approx(sum(motion.duration for motion in smooth_cell.fastest_smooth))
    assert plan.certificate.certified_free


def test_what_start_delays_cannot_do_is_said(smooth_cell: CoordinationCell) -> None:
    mixed = with_jerk(load_cell("mixed-priority", CoordinationCell), 0.03)
    with pytest.raises(InfeasibleError, match="arms 'master' and 'slave' wait for each other"):
        schedule(mixed, "interval", smooth=True)
    with pytest.raises(InfeasibleError, match=r"accelerations of constant-speed jump .*delay"):
        schedule(smooth_cell, "constant-speed", smooth=True)


def test_arms_without_jerk_limits_are_named(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match=r"arm 'master' has no jerk limits .*limits.jerk_rad_s3"):
        schedule(lee1991, "delay", smooth=True)
