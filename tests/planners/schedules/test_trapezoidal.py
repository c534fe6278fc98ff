"""Constant acceleration at the limits: closed forms, and the limit that is met but not passed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.schedules._trapezoidal import trapezoidal

GRID = np.linspace(0.0, 1.0, 401)
ONE, ZERO = np.ones((401, 1)), np.zeros((401, 1))


def integrator(force: float = 1.0, drag: float = 0.0, speed_max: Floats | None = None) -> PhasePlane:
    return PhasePlane(PathDynamics(GRID, ONE, ZERO, drag * ONE, ZERO, [-force], [force], speed_max=speed_max))


@settings(max_examples=30)
@given(st.floats(0.05, 0.5), st.floats(0.1, 10.0))
def test_a_mass_takes_its_closed_form(ramp: float, force: float) -> None:
    motion = trapezoidal(integrator(force), ramp)
    top = np.sqrt(2.0 * force * ramp)
    assert motion.duration == pytest.approx(2.0 * top / force + (1.0 - 2.0 * ramp) / top, rel=1e-6)
    assert motion.mu.max() == pytest.approx(top, rel=1e-6)
    assert (motion.mu[0], motion.mu[-1]) == (0.0, 0.0)


def test_half_and_half_is_the_fastest_motion_of_a_mass() -> None:
    plane = integrator()
    assert trapezoidal(plane, 0.5).duration == pytest.approx(plane.fastest().duration, rel=1e-6)


def test_the_speed_limit_counts() -> None:
    motion = trapezoidal(integrator(speed_max=np.full(401, 0.4)), 0.25)
    assert motion.mu.max() == pytest.approx(0.4, rel=1e-6)
    assert np.abs(motion.mu_dot).max() == pytest.approx(0.4**2 / (2.0 * 0.25), rel=1e-6)


def test_drag_is_met_at_the_end_of_the_ramp() -> None:
    """There the force is a + r sqrt(2 a ramp): all of it."""
    motion = trapezoidal(integrator(drag=0.5), 0.25)
    a = float(motion.mu_dot[0])
    assert a + 0.5 * np.sqrt(2.0 * a * 0.25) == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_a_real_arm_meets_its_limits_and_passes_none(spline_dynamics: Callable[..., PathDynamics], seed: int) -> None:
    plane = PhasePlane(spline_dynamics(seed))
    motion = trapezoidal(plane, 0.3)
    assert motion.certificate.torque_ratio_max == pytest.approx(1.0, abs=5e-3)
    assert motion.duration > plane.fastest().duration
    inside = 0.5 * (motion.lam[1:] + motion.lam[:-1]) / plane.length
    ramps = motion.mu_dot[(inside < 0.3) | (inside > 0.7)]
    assert np.ptp(np.abs(ramps)) < 1e-6 * np.abs(ramps).max()


def test_an_arm_that_cannot_hold_still_is_refused() -> None:
    pushed = np.where((GRID > 0.4) & (GRID < 0.6), -1.5, 0.0)[:, None]
    plane = PhasePlane(PathDynamics(GRID, ONE, ZERO, ZERO, pushed, [-1.0], [1.0]))
    with pytest.raises(InfeasibleError, match=r"cannot hold still cannot move .* \(use another method\)"):
        trapezoidal(plane, 0.25)
