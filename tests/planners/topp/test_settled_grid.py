"""The grid that follows its path, against closed forms and much finer grids."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from armtempo.planners import CoordinationCell, JointPath, PathDynamics, PhasePlane, load_cell, minimum_time
from armtempo.planners.topp._settled_grid import is_settled, rest_to_rest_time
from armtempo.robots import Arm


def slide(folder: Path) -> Arm:
    """One joint, acceleration limit 1."""
    urdf = folder / "slide.urdf"
    urdf.write_text(
        '<robot name="slide"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="prismatic"><parent link="base"/>'
        '<child link="l"/><axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1e9" velocity="1e3"/></joint></robot>'
    )
    return Arm.from_urdf(urdf, gravity=(0, 0, 0), acceleration_max=[1.0])


@pytest.mark.parametrize("waypoints", [4, 11, 101])
def test_to_and_fro_takes_the_sum_of_its_swings(tmp_path: Path, waypoints: int) -> None:
    """Between turning points the joint is free: 2 sqrt(swing) each."""
    arm = slide(tmp_path)
    path = JointPath.through([[k % 2] for k in range(waypoints)], arm=arm)
    q = path.evaluate(np.linspace(0.0, path.length, 4000 * waypoints))[0][:, 0]
    turns = np.flatnonzero(np.diff(q)[1:] * np.diff(q)[:-1] < 0.0) + 1
    wanted = 2.0 * np.sqrt(np.abs(np.diff(np.concatenate([q[:1], q[turns], q[-1:]])))).sum()
    motion = minimum_time(PathDynamics.from_path(arm, path))
    assert motion.duration == pytest.approx(wanted, rel=1e-3)
    assert motion.duration >= wanted * (1.0 - 1e-9)
    assert motion.certificate.excess <= 1e-3


@pytest.mark.parametrize("waypoints", [5, 60])
def test_many_waypoints_of_seven_axes_are_within_a_tenth_of_a_percent(waypoints: int) -> None:
    arm = load_cell("panda-pair").arms[0]
    low, high = arm.position_min, arm.position_max
    share = np.random.default_rng(waypoints).uniform(0.3, 0.7, (waypoints, arm.dof))
    path = JointPath.through(low + share * (high - low), arm=arm)
    coarse = PathDynamics.from_path(arm, path)
    fine = PathDynamics.from_path(arm, path, intervals=16 * len(coarse.grid))
    time = rest_to_rest_time(fine.rows)
    assert rest_to_rest_time(coarse.rows) == pytest.approx(time, rel=1.2e-3)


def test_a_path_that_a_thousand_intervals_do_for_keeps_them(
    lee1991: CoordinationCell, make_arm: Callable[..., Arm]
) -> None:
    arm, path = lee1991.arms[0], lee1991.paths[0]
    for dynamics in (PathDynamics.from_path(arm, path), PathDynamics.from_path(arm, path, intervals=1000)):
        np.testing.assert_array_equal(dynamics.grid, lee1991.dynamics[0].grid)
        assert is_settled(dynamics.rows)


def test_intervals_that_are_given_mean_what_they_say(tmp_path: Path) -> None:
    arm = slide(tmp_path)
    path = JointPath.through([[k % 2] for k in range(11)], arm=arm)
    dynamics = PathDynamics.from_path(arm, path, intervals=200)
    assert len(dynamics.grid) <= 201 + 2 * len(path.breakpoints)
    assert not is_settled(dynamics.rows)


def test_the_time_is_the_planes(lee1991: CoordinationCell) -> None:
    for dynamics in lee1991.dynamics:
        assert rest_to_rest_time(dynamics.rows) == pytest.approx(PhasePlane(dynamics).fastest().duration, rel=1e-12)


def test_a_path_that_cannot_be_is_left_as_it_is(make_arm: Callable[..., Arm], lee1991: CoordinationCell) -> None:
    arm = make_arm(gravity=(0.0, -9.81, 0.0), torque_max=(80.0, 1.0))
    dynamics = PathDynamics.from_path(arm, lee1991.paths[0])
    assert np.isnan(rest_to_rest_time(dynamics.rows))
    assert is_settled(dynamics.rows)
