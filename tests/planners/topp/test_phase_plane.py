"""Minimum time against toppra, closed forms, symmetries and scaling laws."""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import Arc, CartesianPath, CoordinationCell, Line, PathDynamics, PhasePlane, minimum_time
from armtempo.planners.joint_paths import TwoLinkPath
from armtempo.robots import Arm

SplineDynamics = Callable[..., PathDynamics]

ta: Any = importlib.import_module("toppra")
constraint: Any = importlib.import_module("toppra.constraint")
algorithm: Any = importlib.import_module("toppra.algorithm")


def toppra_duration(dynamics: PathDynamics, mu_start: float = 0.0, mu_end: float = 0.0) -> float:
    """The oracle: toppra with the arm's own inverse dynamics, on the same grid."""
    arm, path = dynamics.arm, dynamics.path
    assert arm is not None
    assert path is not None
    evaluate = path.evaluate

    class Geometry(ta.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = dynamics.M.shape[1]
        path_interval = np.array([0.0, dynamics.length])
        waypoints = None

        def __call__(self, s: Floats, order: int = 0) -> Floats:
            return evaluate(s)[order]

    limits = np.stack([dynamics.torque_min[0], dynamics.torque_max[0]], axis=1)
    torque = constraint.JointTorqueConstraint(
        arm.inverse_dynamics, limits, np.zeros(path.dof),
        discretization_scheme=constraint.DiscretizationType.Interpolation,
    )  # fmt: skip
    solver = algorithm.TOPPRA(
        [torque],
        Geometry(),
        gridpoints=np.unique(dynamics.grid),
        solver_wrapper="seidel",
        parametrizer="ParametrizeConstAccel",
    )
    trajectory = solver.compute_trajectory(mu_start, mu_end)
    return math.nan if trajectory is None else float(trajectory.duration)


def integrator(length: float, limit: float, stations: int = 400, speed: float = math.inf) -> PathDynamics:
    """A single mass on a line: M = 1."""
    ones = np.ones((stations + 1, 1))
    return PathDynamics(
        np.linspace(0.0, length, stations + 1),
        ones,
        0 * ones,
        0 * ones,
        0 * ones,
        [-limit],
        [limit],
        speed * ones[:, 0],
    )


def test_the_papers_arm_takes_its_time(lee1991: CoordinationCell) -> None:
    for dynamics in lee1991.dynamics:
        motion = minimum_time(dynamics)
        assert motion.duration == pytest.approx(0.2862, abs=0.0003)
        assert motion.certificate.excess < 1e-6
        assert motion.certificate.torque_ratio_max > 0.999  # bang-bang
        assert motion.certificate.end_error == 0.0
        assert motion.certificate.end_speed_error == 0.0


def test_toppra_agrees_on_the_papers_arm(lee1991: CoordinationCell) -> None:
    dynamics = lee1991.dynamics[0]
    assert minimum_time(dynamics).duration == pytest.approx(toppra_duration(dynamics), abs=1e-4)
    assert minimum_time(dynamics, 0.3, 0.5).duration == pytest.approx(toppra_duration(dynamics, 0.3, 0.5), abs=1e-4)


def test_the_grid_is_fine_enough_for_the_papers_arm(lee1991: CoordinationCell) -> None:
    arm, path = lee1991.arms[0], lee1991.paths[0]
    fine = minimum_time(PathDynamics.from_path(arm, path, intervals=8000)).duration
    assert lee1991.fastest[0].duration == pytest.approx(fine, rel=1e-3)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.floats(0.0, 0.99), st.floats(0.0, 0.99), st.floats(0.05, 3.0))
def test_a_mass_on_a_line_takes_its_closed_form(
    length: float, limit: float, start: float, end: float, cap: float
) -> None:
    top = math.sqrt(limit * length)  # peak speed of the triangle from rest to rest
    assert minimum_time(integrator(length, limit)).duration == pytest.approx(2.0 * math.sqrt(length / limit), rel=1e-9)
    speed, v0, v1 = cap * top, min(start, cap) * top, min(end, cap) * top
    peak = min(speed, math.sqrt(limit * length + 0.5 * (v0**2 + v1**2)))
    flat = length - (2 * peak**2 - v0**2 - v1**2) / (2 * limit)
    wanted = (2 * peak - v0 - v1) / limit + max(flat, 0.0) / peak
    motion = minimum_time(integrator(length, limit, 800, speed), v0, v1)
    assert motion.duration == pytest.approx(wanted, rel=2e-3)
    assert motion.duration >= wanted * (1 - 1e-9)
    assert motion.mu[0] == pytest.approx(v0)
    assert motion.mu[-1] == pytest.approx(v1)
    assert motion.certificate.excess < 1e-6
    assert motion.certificate.speed_ratio_max < 1 + 1e-9


def test_random_paths_through_zero_inertia_points_keep_every_limit_and_agree_with_toppra(
    spline_dynamics: SplineDynamics,
) -> None:
    worst, crossings, solved = 0.0, 0, 0
    for seed in range(30):
        dynamics = spline_dynamics(seed, intervals=400)
        crossings += int((np.diff(np.sign(dynamics.M), axis=0) != 0).sum())
        motion = minimum_time(dynamics)
        solved += 1
        worst = max(worst, motion.certificate.excess)
    assert crossings > 30
    assert solved == 30
    assert worst < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_without_friction_the_time_is_toppras(spline_dynamics: SplineDynamics, seed: int) -> None:
    dynamics = spline_dynamics(seed, intervals=1000)
    assert PhasePlane(dynamics).fastest().duration == pytest.approx(toppra_duration(dynamics), rel=1e-4)


def test_the_paths_of_a_vertical_arm_that_toppra_refuses_are_refused(spline_dynamics: SplineDynamics) -> None:
    """Limits near the static torques: some random paths can be held everywhere, some cannot."""
    refused = 0
    for seed in range(12):
        dynamics = spline_dynamics(seed, intervals=150, limits=(26.0, 5.0))
        wanted = toppra_duration(dynamics)
        try:
            motion = minimum_time(dynamics)
        except InfeasibleError as refusal:
            refused += 1
            assert math.isnan(wanted), seed
            assert "station" in str(refusal)  # noqa: PT017
        else:
            assert motion.duration == pytest.approx(wanted, rel=2e-3), seed
            assert motion.certificate.excess < 5e-3  # a coarse grid
    assert 0 < refused < 12


def reversed_rows(d: PathDynamics) -> PathDynamics:
    return PathDynamics(
        d.length - d.grid[::-1],
        -d.M[::-1],
        d.Q[::-1],
        0 * d.R,
        d.S[::-1],
        d.torque_min[::-1],
        d.torque_max[::-1],
        d.speed_max[::-1],
    )


@pytest.mark.parametrize("gravity", [False, True])
def test_time_runs_backwards_as_well(spline_dynamics: SplineDynamics, gravity: bool) -> None:
    for seed in range(8):
        dynamics = spline_dynamics(seed, gravity=gravity)
        forward, backward = minimum_time(dynamics, 0.1, 0.2), minimum_time(reversed_rows(dynamics), 0.2, 0.1)
        assert backward.duration == pytest.approx(forward.duration, rel=1e-4)
        np.testing.assert_allclose(backward.mu[::-1], forward.mu, rtol=0.02)  # at zero-inertia points not unique


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 1000), st.floats(0.2, 5.0))
def test_limits_times_k_squared_are_k_times_as_fast(spline_dynamics: SplineDynamics, seed: int, k: float) -> None:
    slow = spline_dynamics(seed, gravity=False, intervals=200)
    fast = spline_dynamics(seed, gravity=False, intervals=200, limits=(80.0 * k**2, 20.0 * k**2))
    assert minimum_time(fast).duration == pytest.approx(minimum_time(slow).duration / k, rel=1e-6)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 1000), st.floats(1.0, 3.0))
def test_more_torque_is_never_slower(spline_dynamics: SplineDynamics, seed: int, k: float) -> None:
    weak = minimum_time(spline_dynamics(seed, intervals=150, limits=(60.0, 15.0))).duration
    strong = minimum_time(spline_dynamics(seed, intervals=150, limits=(60.0 * k, 15.0 * k))).duration
    assert strong <= weak * (1 + 1e-9)


def test_the_joint_speed_limit_is_kept_and_binds(make_arm: Callable[..., Arm], lee1991: CoordinationCell) -> None:
    arm = make_arm(speed_max=(4.0, 5.0))
    motion = minimum_time(PathDynamics.from_path(arm, lee1991.paths[0]))
    speed = np.abs(lee1991.paths[0].evaluate(motion.lam)[1]) * motion.mu[:, None]
    assert (speed.max(axis=0) <= np.array([4.0, 5.0]) * (1 + 1e-3)).all()
    assert (speed / [4.0, 5.0]).max() > 0.99
    assert motion.certificate.speed_ratio_max < 1 + 1e-3
    assert motion.duration > 0.29


@pytest.mark.parametrize("intervals", [60, 100, 1000])
@pytest.mark.parametrize("length", [0.1, 0.12, 0.3 / 7])
def test_breakpoints_hold_on_both_sides(make_arm: Callable[..., Arm], length: float, intervals: int) -> None:
    arm = make_arm()
    corner = np.array([0.2, 0.3, 0])
    cartesian = CartesianPath(
        [
            Line(corner - np.array([length, 0, 0]), corner),
            Line(corner, corner + np.array([length, 0, 0])),
            Arc(
                corner + np.array([length, 0, 0]),
                corner + np.array([length + 0.03, -0.03, 0]),
                corner + np.array([length, -0.03, 0]),
            ),
            Line(corner + np.array([length + 0.03, -0.03, 0]), corner + np.array([length + 0.03, -0.2, 0])),
        ]
    )
    dynamics = PathDynamics.from_path(arm, TwoLinkPath(arm, cartesian, "negative"), intervals=intervals)
    motion = minimum_time(dynamics)
    excess = 1e-3 * max((200 / intervals) ** 2, 1.0)  # inside the intervals of coarse grids: of second order
    assert motion.certificate.excess < excess
    assert np.abs(motion.mu_dot).max() < 1e3
    fine = PathDynamics.from_path(arm, TwoLinkPath(arm, cartesian, "negative"), intervals=4001)
    assert motion.duration == pytest.approx(minimum_time(fine).duration, rel=0.03 * 100 / intervals)
    assert (np.abs(motion.torque()).reshape(-1, 2) <= np.array([25.0, 7.0]) * (1 + excess)).all()


def test_too_little_torque_to_hold_names_station_and_joint(
    make_arm: Callable[..., Arm], lee1991: CoordinationCell
) -> None:
    arm = make_arm(name="left", gravity=(0.0, -9.81, 0.0), torque_max=(80.0, 1.0))
    with pytest.raises(
        InfeasibleError, match=r"joint 'joint_2' of arm 'left' needs .* N m to hold still at station .*raise limits"
    ) as refusal:
        minimum_time(PathDynamics.from_path(arm, lee1991.paths[0]))
    assert refusal.value.data["joint"] == 1
    station = refusal.value.data["station"]
    q = lee1991.paths[0].evaluate(station)[0]
    assert abs(arm.inverse_dynamics(q, np.zeros(2), np.zeros(2))[1]) > 1.0


def bare(**changes: Any) -> PathDynamics:
    ones = np.ones((11, 1))
    good: dict[str, Any] = {
        "M": ones,
        "Q": 0 * ones,
        "R": 0 * ones,
        "S": 0 * ones,
        "torque_min": [-1.0],
        "torque_max": [1.0],
    }
    return PathDynamics(np.linspace(0.0, 1.0, 11), **(good | changes))


def test_what_cannot_be_planned_is_refused() -> None:
    with pytest.raises(InputError, match=r"mu_end must be finite"):
        minimum_time(bare(), 0.0, math.nan)
    with pytest.raises(InputError, match=r"mu_end must be finite"):
        minimum_time(bare(), 0.0, -1.0)
    for wrong in (math.nan, -0.5, 9.0):
        with pytest.raises(InfeasibleError, match=r"mu_start = .* is outside \[0, 1.41421\]"):
            minimum_time(bare(), wrong)
    with pytest.raises(InfeasibleError, match=r"mu_end = 0.9 is above the speed limit 0.5 at the end, station 1"):
        minimum_time(bare(speed_max=np.full(11, 0.5)), 0.0, 0.9)
    with pytest.raises(InfeasibleError, match=r"cannot move on from rest"):
        minimum_time(bare(speed_max=np.zeros(11)))


@pytest.mark.parametrize("missing", ["torque_min", "torque_max"])
def test_a_missing_limit_leaves_the_other_one(missing: str) -> None:
    """Speeding up (or braking) is bounded by 1 alone; the other way by nothing but the grid."""
    limits = {"torque_min": [-1.0], "torque_max": [1.0]}
    huge = 1e3 if missing == "torque_max" else -1e3
    none = PhasePlane(bare(**{**limits, missing: [math.copysign(math.inf, huge)]})).fastest()
    wanted = PhasePlane(bare(**{**limits, missing: [huge]})).fastest()
    assert none.duration == pytest.approx(wanted.duration, rel=1e-6)
    bounded = none.mu_dot.max() if missing == "torque_min" else -none.mu_dot.min()
    assert bounded <= 1.0 + 1e-9


def test_a_station_without_speed_in_the_middle_is_refused() -> None:
    speed = np.full(11, np.inf)
    speed[5] = 0.0
    motion = minimum_time(bare(speed_max=speed))  # one may stop there and go on
    assert motion.duration == pytest.approx(4.0 * math.sqrt(0.5), rel=1e-2)


def test_acceleration_limits_are_rows_too(spline_dynamics: SplineDynamics) -> None:
    """Joint acceleration limits: M = f', Q = f''."""
    path = spline_dynamics(3).path
    assert path is not None
    grid = np.linspace(0.0, 1.0, 401)
    _, dq, ddq = path.evaluate(grid)
    motion = minimum_time(PathDynamics(grid, dq, ddq, 0 * dq, 0 * dq, [-5.0, -5.0], [5.0, 5.0]))
    middle = 0.5 * (motion.lam[1:] + motion.lam[:-1])
    mu2 = 0.5 * (motion.mu[1:] ** 2 + motion.mu[:-1] ** 2)
    _, dq, ddq = path.evaluate(middle)
    assert np.abs(dq * motion.mu_dot[:, None] + ddq * mu2[:, None]).max() <= 5.0 * (1 + 1e-3)


def test_limits_may_change_along_the_path() -> None:
    limit = np.linspace(1.0, 4.0, 11)[:, None]
    motion = minimum_time(bare(torque_min=-limit, torque_max=limit))
    assert 1.0 < motion.duration < 2.0
    assert motion.certificate.excess < 1e-9


def test_the_boundary_of_the_admissible_region_is_above_the_controllable_set(
    lee1991: CoordinationCell, spline_dynamics: SplineDynamics
) -> None:
    for plane in (lee1991.planes[0], PhasePlane(spline_dynamics(5))):
        limit = plane.speed_limit()
        assert (plane.upper(plane.dynamics.grid) <= limit * (1 + 1e-9)).all()
        for k in (10, 100, 333):
            low, high = plane.acceleration_bounds(plane.dynamics.grid[k], 0.99 * min(float(limit[k]), 1e3))
            assert low <= high
            if limit[k] < 100:
                low, high = plane.acceleration_bounds(plane.dynamics.grid[k], 1.01 * float(limit[k]))
                assert low > high
