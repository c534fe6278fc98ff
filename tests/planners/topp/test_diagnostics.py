"""What a solve tells about its motion: which limit holds it where, and the islands that friction cuts out."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners import PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.planners.topp import Island, diagnose
from armtempo.planners.topp._diagnostics import _islands


def integrator(speed_max: float = np.inf) -> PhasePlane:
    grid, one, zero = np.linspace(0.0, 1.0, 41), np.ones((41, 1)), np.zeros((41, 1))
    return PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-1.0], [1.0], speed_max=np.full(41, speed_max)))


def test_full_thrust_then_full_braking_is_told_in_words() -> None:
    told = diagnose(integrator())
    assert told.describe(3) == "the torque of joint 0, upper end"
    assert told.describe(37) == "the torque of joint 0, lower end"
    np.testing.assert_array_equal(told.side, [1] * 20 + [-1] * 20)
    assert told.islands == ()


def test_between_the_ramps_a_speed_limit_holds_it() -> None:
    told = diagnose(integrator(speed_max=0.5))
    ramp = round(0.5 * 0.5**2 * 40)  # mu^2 = 2 u lambda
    np.testing.assert_array_equal(told.active, [0] * ramp + [-1] * (40 - 2 * ramp) + [0] * ramp)
    assert told.describe(20) == "speed limit"


def test_a_motion_at_half_the_speed_is_held_by_nothing() -> None:
    plane = integrator()
    fastest = plane.fastest()
    slow = PhaseTrajectory.from_profile(fastest.lam, 0.5 * fastest.mu, plane.dynamics)
    told = diagnose(plane, slow)
    assert {told.describe(k) for k in range(40)} == {"none"}


def bands(rows: list[list[tuple[float, float]]]) -> Floats:
    """Admissible intervals with these gaps between 0 and 10, as ``PhasePlane.admissible`` has them."""
    out = np.full((len(rows), 3, 2), np.nan)
    for k, gaps in enumerate(rows):
        ends = [0.0, *(end for gap in gaps for end in gap), 10.0]
        out[k, : len(gaps) + 1] = np.reshape(ends, (-1, 2))
    return out


def test_gaps_of_neighbours_that_overlap_are_one_island() -> None:
    station = np.arange(5.0)
    found = _islands(station, bands([[], [(2.0, 3.0)], [(2.5, 4.0)], [(3.9, 4.1)], []]))
    assert found == (Island(1.0, 3.0, 2.0, 4.1),)


def test_gaps_that_are_apart_in_speed_or_along_the_path_are_islands_of_their_own() -> None:
    found = _islands(np.arange(4.0), bands([[(1.0, 2.0), (5.0, 6.0)], [(1.5, 2.5)], [], [(1.5, 2.5)]]))
    assert set(found) == {Island(0.0, 0.0, 5.0, 6.0), Island(0.0, 1.0, 1.0, 2.5), Island(3.0, 3.0, 1.5, 2.5)}


def test_two_gaps_that_run_together_are_one_island() -> None:
    found = _islands(np.arange(2.0), bands([[(1.0, 2.0), (5.0, 6.0)], [(1.5, 5.5)]]))
    assert found == (Island(0.0, 1.0, 1.0, 6.0),)
