"""Closed forms against quadrature and finite differences; files; what a certificate says of jerk."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from armtempo.configs import data_path
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import JointPath, PathDynamics, minimum_time, read_trajectory, write_trajectory
from armtempo.planners.topp import SmoothTrajectory
from armtempo.planners.topp._smooth_trajectory import passing_time
from armtempo.robots import Arm


@pytest.fixture(scope="module")
def motion() -> SmoothTrajectory:
    arm = Arm.from_urdf(data_path("robots/planar_two_link.urdf"), speed_max=[2.0, 2.5], damping=[0.3, 0.1])
    path = JointPath.through([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4], [0.2, 0.1]])
    motion = minimum_time(PathDynamics.from_path(arm, path, intervals=300), jerk=[500.0, 900.0])
    assert isinstance(motion, SmoothTrajectory)
    return motion


@settings(max_examples=100, deadline=None)
@given(st.floats(0.0, 3.0), st.floats(0.01, 3.0), st.floats(-0.999, 0.999), st.floats(1e-3, 10.0))
def test_the_time_of_an_interval_is_that_of_quadrature(low: float, high: float, bend: float, way: float) -> None:
    """``x`` from low^2 to high^2, a parabola that stays positive."""
    mu_0, mu_1 = max(low, 0.05), high
    growth = bend * ((mu_0 + mu_1) / way) ** 2
    u_0 = 0.5 * ((mu_1**2 - mu_0**2) / way - growth * way)
    ours = float(passing_time(np.array([way]), np.array([mu_0]), np.array([mu_1]), np.array([growth]))[0])
    theirs = quad(lambda w: (mu_0**2 + w * (2.0 * u_0 + growth * w)) ** -0.5, 0.0, way, epsabs=1e-13, limit=500)[0]
    assert ours == pytest.approx(theirs, rel=1e-8)


def test_states_over_time_are_derivatives_of_each_other(motion: SmoothTrajectory) -> None:
    t = np.linspace(0.0, motion.duration, 40001)
    lam, mu, mu_dot = motion.at(t)
    h = t[1]
    assert (np.diff(lam) >= 0.0).all()
    assert np.abs((lam[2:] - lam[:-2]) / (2 * h) - mu[1:-1]).max() < 1e-5 * mu.max()
    assert np.abs((mu[2:] - mu[:-2]) / (2 * h) - mu_dot[1:-1]).max() < 2e-3 * np.abs(mu_dot).max()
    np.testing.assert_allclose([lam[0], mu[0], mu_dot[0]], 0.0, atol=1e-12)
    np.testing.assert_allclose([lam[-1], mu[-1], mu_dot[-1]], [motion.lam[-1], 0.0, 0.0], atol=1e-6)
    np.testing.assert_array_equal(np.array(motion.at([-1.0, motion.duration + 1.0]))[1:], 0.0)


def test_times_of_stations_are_the_inverse(motion: SmoothTrajectory) -> None:
    lam = np.linspace(0.0, motion.lam[-1], 3001)
    np.testing.assert_allclose(motion.at(motion.time_at(lam))[0], lam, atol=1e-9)
    np.testing.assert_allclose(motion.time_at(motion.lam), motion.time, atol=1e-9)
    assert motion.time_at(motion.lam[-1] + 0.1) == np.inf


def test_rows_and_samples_agree(motion: SmoothTrajectory) -> None:
    lam, mu, mu_dot = motion.inside([0.0, 0.3, 0.7, 1.0])
    there = motion.at(motion.time_at(lam))
    np.testing.assert_allclose(there[1], mu, atol=1e-6 * mu.max())
    np.testing.assert_allclose(there[2], mu_dot, atol=1e-4 * np.abs(mu_dot).max())
    assert (motion.torque()[:, 0] - motion.torque()[:, 1]).shape == (len(motion.lam) - 1, 2)
    assert motion.torque() == pytest.approx(motion.dynamics.torque(lam, mu, mu_dot)[:, [0, -1]], abs=1e-5)


def test_a_delay_is_a_wait(motion: SmoothTrajectory) -> None:
    late = motion.delayed(0.25)
    assert isinstance(late, SmoothTrajectory)
    assert motion.delayed(0.0) is motion
    assert late.duration == pytest.approx(motion.duration + 0.25)
    t = np.linspace(0.0, motion.duration, 200)
    np.testing.assert_allclose(np.array(late.at(t + 0.25)), np.array(motion.at(t)), atol=1e-9)
    np.testing.assert_array_equal(np.array(late.at(np.linspace(0.0, 0.25, 5)))[1:], 0.0)
    assert late.certificate.jerk_ratio_max == pytest.approx(motion.certificate.jerk_ratio_max)


def test_a_certificate_tells_of_jerk(motion: SmoothTrajectory) -> None:
    assert 0.99 < motion.certificate.jerk_ratio_max < 1.001
    assert not len(motion.stations_above(1e-3))
    strict = copy.copy(motion)
    for name in ("certificate", "_jerk_ratio"):
        strict.__dict__.pop(name, None)
    object.__setattr__(strict, "jerk_max", motion.jerk_max / 2.0)
    assert strict.certificate.jerk_ratio_max == pytest.approx(2.0 * motion.certificate.jerk_ratio_max)
    assert strict.certificate.excess > 0.9
    assert len(strict.stations_above(0.5))


def test_what_is_exported_keeps_the_limits(motion: SmoothTrajectory, tmp_path: Path) -> None:
    """Differences of what a controller gets at 1 kHz, and the torques that go with it."""
    write_trajectory(tmp_path / "motion.csv", motion)
    samples = read_trajectory(tmp_path / "motion.csv")
    arm = motion.dynamics.arm
    assert arm is not None
    even = slice(0, -1)  # the last one comes earlier
    jerk = np.abs(np.diff(samples.qdd[even], axis=0)) / 0.001
    assert (jerk <= motion.jerk_max * (1.0 + 1e-3)).all()
    third = np.abs(np.diff(samples.q[even], 3, axis=0)) / 0.001**3
    assert (third <= motion.jerk_max * (1.0 + 1e-3)).all()
    assert (np.abs(samples.torque) <= arm.torque_max * (1.0 + 1e-3)).all()
    assert (np.abs(samples.qd) <= arm.speed_max * (1.0 + 1e-3)).all()
    np.testing.assert_allclose(samples.qdd[[0, -1]], 0.0, atol=1e-3)


def test_what_does_not_fit_is_refused(motion: SmoothTrajectory) -> None:
    fields: dict[str, Any] = {
        name: getattr(motion, name) for name in ("lam", "mu", "time", "dynamics", "growth", "path_jerk", "jerk_max")
    }
    with pytest.raises(InputError, match="mu_dot_start has shape"):
        SmoothTrajectory(**fields, mu_dot_start=motion.mu_dot_start[:-1])
    moving = SmoothTrajectory(**{**fields, "mu": np.append(1.0, motion.mu[1:])}, mu_dot_start=motion.mu_dot_start)
    with pytest.raises(InfeasibleError, match="cannot wait"):
        moving.delayed(1.0)
