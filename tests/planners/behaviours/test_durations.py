"""Motions that take as long as is asked, also from a moving start: brake, wait, go; what is to blame if none does."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError
from armtempo.planners import AbstractJointPath, JointPath, PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.robots import Arm

UPRIGHT = (0.0, -9.81, 0.0)


def free_mass(limit: float = 1.0, mu_end: float = 0.0, stations: int = 1000) -> PhasePlane:
    """|mu_dot| <= limit on a path of length 1."""
    one = np.ones((stations + 1, 1))
    zero = 0.0 * one
    return PhasePlane(
        PathDynamics(np.linspace(0.0, 1.0, stations + 1), one, zero, zero, zero, [-limit], [limit]), mu_end
    )


def check(motion: PhaseTrajectory, duration: float, mu_start: float) -> None:
    assert motion.duration == pytest.approx(duration, rel=1e-9)
    assert motion.mu[0] == pytest.approx(mu_start, abs=1e-9)
    assert motion.lam[0] == 0.0
    assert motion.certificate.end_error == 0.0
    assert motion.certificate.end_speed_error <= 1e-9
    assert motion.certificate.excess <= 1e-3
    # the rows tell one story: every way is covered in its time at its mean speed
    np.testing.assert_allclose(
        np.diff(motion.lam), 0.5 * (motion.mu[1:] + motion.mu[:-1]) * np.diff(motion.time), atol=1e-9
    )


@settings(max_examples=60, deadline=None)
@given(st.floats(1e-3, 1.35), st.floats(0.0, 0.3), st.floats(1.0, 1e3))
def test_a_moving_mass_takes_any_time_from_the_shortest_on(mu_start: float, mu_end: float, longer: float) -> None:
    plane = free_mass(mu_end=mu_end)
    peak = math.sqrt(1.0 + 0.5 * (mu_start**2 + mu_end**2))
    shortest = 2.0 * peak - mu_start - mu_end
    duration = longer * 1.002 * shortest  # a grid's shortest time is a little longer
    check(plane.with_duration(duration, mu_start), duration, mu_start)


def test_it_brakes_waits_and_goes_no_later_than_that_takes() -> None:
    """Braking from 0.3 takes 0.3 s and 0.045, the rest of the way 2 sqrt(0.955) s."""
    plane, brake_and_go = free_mass(), 0.3 + 2.0 * math.sqrt(0.955)
    for duration in (brake_and_go, 2.4, 3.0, 3.5, 10.0, 1e4):
        check(plane.with_duration(duration, 0.3), duration, 0.3)


def test_a_start_that_needs_the_whole_way_to_brake_has_one_time_only() -> None:
    plane = free_mass()
    start = math.sqrt(2.0) * (1.0 - 1e-9)
    fastest = plane.fastest(start).duration
    check(plane.with_duration(fastest, start), fastest, start)
    with pytest.raises(
        InfeasibleError, match=r"the torque of joint 0 limits, does not stop before the end .*start more slowly"
    ):
        plane.with_duration(1.2 * fastest, start)


def slide_arm(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    urdf = tmp_path_factory.mktemp("slide") / "slide.urdf"
    urdf.write_text(
        '<robot name="slide"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia ixx="1" iyy="1" '
        'izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="prismatic"><parent link="base"/>'
        '<child link="l"/><axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1e9" velocity="2"/></joint></robot>'
    )
    return Arm.from_urdf(urdf, gravity=(0, 0, 0), acceleration_max=[1.0])


def test_the_limit_that_is_to_blame_is_named(tmp_path_factory: pytest.TempPathFactory) -> None:
    arm = slide_arm(tmp_path_factory)
    plane = PhasePlane(PathDynamics.from_path(arm, JointPath.through([[0.0], [1.0]], arm=arm)))
    check(plane.with_duration(10.0, 0.3), 10.0, 0.3)
    with pytest.raises(
        InfeasibleError, match=r"whose braking the acceleration of joint 'j' of arm 'slide' limits"
    ) as told:
        plane.with_duration(10.0, math.sqrt(2.0) - 1e-6)
    assert "torque" not in str(told.value)


def random_path(seed: int) -> AbstractJointPath:
    knots = np.random.default_rng(seed).uniform(-1.2, 1.2, (5, 2))
    return JointPath.through(knots)


@pytest.mark.parametrize("viscous", [0.0, 1.0])
@pytest.mark.parametrize("share", [0.1, 0.6, 0.95])
def test_arms_with_gravity_and_friction_do_so_too(make_arm: Callable[..., Arm], viscous: float, share: float) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=(80.0, 20.0), damping=(viscous, viscous), coulomb=(0.5, 0.2))
    for seed in range(3):
        dynamics = PathDynamics.from_path(arm, random_path(seed))
        plane = PhasePlane(dynamics)
        mu_start = share * float(plane.upper(0.0))
        fastest = plane.fastest(mu_start).duration
        for longer in (1.0001, 1.1, 1.5, 3.0, 100.0):
            check(plane.with_duration(longer * fastest, mu_start), longer * fastest, mu_start)


def weak_planes(make_arm: Callable[..., Arm]) -> list[PhasePlane]:
    """Arms that swing through postures that they cannot hold."""
    found = []
    for seed in range(300):
        arm = make_arm(gravity=UPRIGHT, torque_max=(26.0, 7.0), damping=(0.3, 0.3))
        try:
            plane = PhasePlane(PathDynamics.from_path(arm, random_path(seed)))
        except InfeasibleError:
            continue
        if not plane.holdable.all():
            found.append(plane)
        if len(found) == 6:
            return found
    pytest.fail("no such paths among the seeds")


def test_arms_that_cannot_hold_everywhere_wait_where_they_can(make_arm: Callable[..., Arm]) -> None:
    for plane in weak_planes(make_arm):
        for share in (0.0, 0.3, 0.9):
            low, high = float(plane.lower(0.0)), float(plane.upper(0.0))
            mu_start = low + share * (high - low)
            fastest = plane.fastest(mu_start).duration
            for longer in (1.001, 1.3, 30.0):
                check(plane.with_duration(longer * fastest, mu_start), longer * fastest, mu_start)


def pulled(mu_end: float, pull: float = 0.2) -> PhasePlane:
    """mu_dot between ``pull`` and 2 on a path of length 1: nothing holds still anywhere."""
    one = np.ones((1001, 1))
    return PhasePlane(PathDynamics(np.linspace(0.0, 1.0, 1001), one, 0 * one, 0 * one, 0 * one, [pull], [2.0]), mu_end)


@pytest.mark.parametrize("mu_start", [0.0, 0.4])
def test_an_arm_that_can_stop_nowhere_has_a_slowest_motion_in_closed_form(mu_start: float) -> None:
    """mu_dot = 0.2 up to the station from where 2 is needed to end with 1.5."""
    plane, x0 = pulled(1.5), mu_start**2
    switch = (2.25 - x0 - 4.0) / (0.4 - 4.0)
    top = math.sqrt(x0 + 0.4 * switch)
    slowest = (top - mu_start) / 0.2 + (1.5 - top) / 2.0
    fastest = plane.fastest(mu_start).duration
    for share in (0.0, 0.3, 0.99):
        duration = fastest + share * (slowest - fastest)
        check(plane.with_duration(duration, mu_start), duration, mu_start)
    with pytest.raises(
        InfeasibleError,
        match=r"cannot hold still everywhere: at station .* the torque of joint 0 is too small by 0.2 .*raise that",
    ) as told:
        plane.with_duration(1.01 * slowest, mu_start)
    assert float(str(told.value).split("slowest motion takes ")[1].split()[0]) == pytest.approx(slowest, rel=2e-3)
