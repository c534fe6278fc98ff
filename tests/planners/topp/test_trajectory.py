"""Motions as functions of time, and the certificate, which must be able to fail."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, PathDynamics, PhasePlane, PhaseTrajectory, minimum_time


def test_time_and_place_are_inverse(lee1991: CoordinationCell) -> None:
    for motion in (lee1991.fastest[0], lee1991.fastest[0].delayed(0.1)):
        t = np.linspace(motion.duration - 0.286, motion.duration, 997).reshape(-1, 1)
        lam, mu, _ = motion.at(t)
        np.testing.assert_allclose(motion.time_at(lam), t, atol=1e-9)
        np.testing.assert_allclose(motion.at(motion.time_at(motion.lam[1:-1]))[1], motion.mu[1:-1], atol=1e-6)
        h = 1e-6
        inner = t[2:-2]
        np.testing.assert_allclose((motion.at(inner + h)[0] - motion.at(inner - h)[0]) / (2 * h), mu[2:-2], atol=1e-4)


def test_before_and_after_the_motion_stands_still(lee1991: CoordinationCell) -> None:
    motion = lee1991.fastest[1]
    lam, mu, mu_dot = motion.at(np.array([-1.0, 0.0, motion.duration + 1.0]))
    assert lam.tolist() == [0.0, 0.0, motion.lam[-1]]
    assert mu.tolist() == [0.0, 0.0, 0.0]
    assert (mu_dot[0], mu_dot[2]) == (0.0, 0.0)
    assert motion.at(0.1)[0].shape == ()
    assert motion.time_at(0.0) == 0.0
    assert motion.time_at(motion.lam[-1]) == pytest.approx(motion.duration, abs=1e-12)
    assert motion.time_at(motion.lam[-1] + 1e-6) == np.inf


@given(st.floats(0.0, 10.0))
def test_delays_add_up(delay: float) -> None:
    ones = np.ones((11, 1))
    motion = minimum_time(PathDynamics(np.linspace(0, 1, 11), ones, 0 * ones, 0 * ones, 0 * ones, [-1.0], [1.0]))
    late = motion.delayed(delay)
    assert late.duration == pytest.approx(motion.duration + delay)
    assert late.certificate.torque_ratio_max == pytest.approx(motion.certificate.torque_ratio_max)
    t = np.linspace(0, motion.duration, 50)[1:-1]
    np.testing.assert_allclose(late.at(t + delay)[0], motion.at(t)[0], atol=1e-9)
    assert late.at(0.5 * delay)[0] == pytest.approx(0.0, abs=1e-12)
    again = PhaseTrajectory.from_profile(motion.lam, motion.mu, motion.dynamics, delay=delay)
    np.testing.assert_allclose(again.time, late.time, atol=1e-9)


def test_a_motion_that_starts_with_speed_cannot_wait(lee1991: CoordinationCell) -> None:
    motion = minimum_time(lee1991.dynamics[0], 0.3)
    assert motion.delayed(0.0) is motion
    with pytest.raises(InfeasibleError, match=r"mu = 0\.3 cannot wait"):
        motion.delayed(0.1)


def test_a_dwell_on_the_way_is_one(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    motion = plane.motion([1.0, 0.0, 1.0], [0.1, 0.3, np.inf])
    still = motion.at(np.array([0.3, 0.35, 0.3999]))
    assert np.ptp(still[0]) == 0.0
    assert not still[1].any()
    place = float(still[0][0])
    assert motion.time_at(place) < 0.3  # the first instant there
    assert motion.time_at(place + 1e-4) > 0.4
    assert motion.certificate.excess < 1e-3


def test_torques_at_both_ends_of_every_interval(lee1991: CoordinationCell) -> None:
    motion = lee1991.fastest[0]
    torque = motion.torque()
    assert torque.shape == (len(motion.lam) - 1, 2, 2)
    limit = np.array([25.0, 7.0])
    assert (np.abs(torque) <= limit * (1 + 1e-6)).all()
    full = (np.abs(torque) / limit).max(axis=(1, 2)) > 0.999
    assert full.mean() > 0.99  # one joint at its limit all the way, but for the switches


def changed(motion: PhaseTrajectory, lam: Floats | None = None, mu: Floats | None = None) -> PhaseTrajectory:
    return PhaseTrajectory.from_profile(
        motion.lam if lam is None else lam, motion.mu if mu is None else mu, motion.dynamics
    )


def test_the_certificate_catches_what_is_wrong(lee1991: CoordinationCell) -> None:
    motion = lee1991.fastest[0]
    good = motion.certificate
    assert good.excess < 1e-6
    assert good.end_error == good.end_speed_error == 0.0
    assert changed(motion, mu=1.01 * motion.mu).certificate.torque_ratio_max == pytest.approx(1.01**2, abs=1e-3)
    bumped = motion.mu.copy()
    bumped[500] *= 1.01
    certificate = changed(motion, mu=bumped).certificate
    assert certificate.torque_ratio_max > 2.0
    assert certificate.worst_station == pytest.approx(motion.lam[500], abs=2 * motion.lam[1])
    assert certificate.worst_joint in (0, 1)
    short = changed(motion, motion.lam[:-10], motion.mu[:-10]).certificate
    assert short.end_error == pytest.approx(motion.lam[-1] - motion.lam[-11])
    assert short.end_speed_error == motion.mu[-11] > 0.0


def test_the_certificate_asks_the_robot_not_the_rows(lee1991: CoordinationCell) -> None:
    """Wrong coefficients: the planner believes them, the certificate does not."""
    good = lee1991.dynamics[0]
    wrong = PathDynamics(good.grid, 0.5 * good.M, good.Q, good.R, good.S, good.torque_min, good.torque_max)
    believed = minimum_time(wrong)
    assert believed.certificate.excess < 1e-3  # rows only: nothing better to ask
    assert changed(believed).certificate.excess < 1e-3
    asked = PhaseTrajectory.from_profile(believed.lam, believed.mu, good)
    assert asked.certificate.torque_ratio_max > 1.5


def test_the_certificate_sees_inside_the_intervals(spline_dynamics: Callable[..., PathDynamics]) -> None:
    """On a coarse grid the rows hold at every station, and not between them."""
    motion = PhasePlane(spline_dynamics(1, intervals=12)).fastest()
    limit = np.array([80.0, 20.0])
    at_stations = (np.abs(motion.torque()) / limit).max()
    assert motion.certificate.torque_ratio_max > at_stations + 0.005
    refined = minimum_time(motion.dynamics)  # looks inside, and refines the grid there
    assert refined.certificate.excess <= 1e-3
    assert len(refined.lam) > len(motion.lam)


def test_arrays_are_read_only(lee1991: CoordinationCell) -> None:
    with pytest.raises(ValueError, match="read-only"):
        lee1991.fastest[0].mu[3] = 0.0
    with pytest.raises(ValueError, match="read-only"):
        lee1991.fastest[0].mu_dot[3] = 0.0
