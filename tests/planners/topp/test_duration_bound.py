"""Lower bounds of durations against closed forms, much finer grids, and motions of all kinds."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.planners import CoordinationCell, PathDynamics, PhasePlane, minimum_time

SplineDynamics = Callable[..., PathDynamics]


def mass(stations: int, cap: float = math.inf, limit: float = 1.0) -> PathDynamics:
    one = np.ones((stations + 1, 1))
    return PathDynamics(
        np.linspace(0.0, 1.0, stations + 1), one, 0 * one, 0 * one, 0 * one, [-limit], [limit], cap * one[:, 0]
    )


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 50), st.floats(0.05, 3.0), st.floats(0.0, 0.9), st.floats(0.0, 0.9), st.floats(0.1, 10.0))
def test_a_mass_on_a_line_is_bounded_by_its_closed_form(
    stations: int, cap: float, start: float, end: float, limit: float
) -> None:
    v0, v1 = min(start * math.sqrt(limit), cap), min(end * math.sqrt(limit), cap)
    peak = min(cap, math.sqrt(limit + 0.5 * (v0**2 + v1**2)))
    flat = 1.0 - (2 * peak**2 - v0**2 - v1**2) / (2 * limit)
    wanted = (2 * peak - v0 - v1) / limit + max(flat, 0.0) / peak
    bound = PhasePlane(mass(stations, cap, limit), v1).fastest(v0).bound
    assert bound.proven
    assert wanted * (1.0 - 1e-3) <= bound.seconds <= wanted * (1.0 + 1e-12)


def bare(dynamics: PathDynamics, *, every: int = 1, parts: int = 1) -> PathDynamics:
    """The rows as arrays alone, without friction, every so-manyth; cut in parts on the straight lines between them."""
    grid = dynamics.grid[::every]
    fine = np.unique(np.concatenate([grid[:-1] + w * np.diff(grid) for w in np.arange(parts) / parts] + [grid[-1:]]))

    def rows(values: Floats) -> Floats:
        columns = values[::every].reshape(len(grid), -1).T
        return np.stack([np.interp(fine, grid, column) for column in columns], axis=-1)

    d = dynamics
    return PathDynamics(
        fine, rows(d.M), rows(d.Q), 0 * rows(d.R), rows(d.S), rows(d.torque_min), rows(d.torque_max)
    )  # fmt: skip


def test_proven_bounds_are_below_the_time_on_any_grid_and_near_it(spline_dynamics: SplineDynamics) -> None:
    proven = 0
    for seed in range(8):
        dynamics = spline_dynamics(seed, intervals=400)
        coarse, fine = bare(dynamics), bare(dynamics, parts=40)
        bound, best = PhasePlane(coarse).fastest().bound, PhasePlane(fine).fastest().duration
        assert 0.94 * best < bound.seconds < best
        proven += bound.proven
    assert proven >= 6  # elsewhere all inertias vanish at once: an estimate


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("gravity", [False, True])
def test_estimates_for_arms_are_below_the_time_on_much_finer_grids(
    spline_dynamics: SplineDynamics, seed: int, gravity: bool
) -> None:
    motion = minimum_time(spline_dynamics(seed, gravity=gravity, intervals=400))
    fine = PhasePlane(spline_dynamics(seed, gravity=gravity, intervals=20000)).fastest().duration
    assert not motion.bound.proven
    assert 0.98 * fine < motion.bound.seconds < fine


def test_the_bound_is_of_the_motions_own_ends(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    fastest = plane.fastest()
    slow = plane.with_duration(3.0 * fastest.duration)
    assert slow.bound == fastest.bound
    assert slow.bound.seconds < fastest.duration
    braking = plane.braking(0.1, 0.5)
    assert 0.0 < braking.bound.seconds <= braking.duration
    moving = plane.fastest(0.5)
    assert moving.bound.seconds <= moving.duration < fastest.duration


def test_what_is_not_proven_is_called_an_estimate() -> None:
    one = np.ones((101, 1))
    grid = np.linspace(0.0, 1.0, 101)
    viscous = PathDynamics(grid, one, 0 * one, 0.3 * one, 0 * one, [-1.0], [1.0])
    pulled = PathDynamics(grid, one, 0 * one, 0 * one, 0 * one, [0.1], [1.0])
    for plane in (PhasePlane(viscous), PhasePlane(pulled, 1.0)):
        motion = plane.fastest()
        assert not motion.bound.proven
        assert 0.9 * motion.duration < motion.bound.seconds <= motion.duration
