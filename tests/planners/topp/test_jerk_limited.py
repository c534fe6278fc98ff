"""Minimum time with jerk limits: ruckig's profiles, laws of scaling, limits by samplers that share no code."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
import ruckig
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo import load_cell
from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import ArmtempoError, InfeasibleError
from armtempo.planners import Arc, CartesianPath, CoordinationCell, JointPath, Line, PathDynamics, minimum_time
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.planners.topp import PhaseTrajectory, SmoothTrajectory
from armtempo.robots import Arm

MakeArm = Callable[..., Arm]
STRONG = 1e6  # N m: no limit here


def ruckigs_time(way: float, speed: float, acceleration: float, jerk: float) -> float:
    """The least time of one axis from rest to rest, by ruckig."""
    given, found = ruckig.InputParameter(1), ruckig.Trajectory(1)
    given.current_position, given.target_position = [0.0], [way]
    given.max_velocity, given.max_acceleration, given.max_jerk = [speed], [acceleration], [jerk]
    assert ruckig.Ruckig(1).calculate(given, found) in (ruckig.Result.Working, ruckig.Result.Finished)
    return float(found.duration)


def solved(arm: Arm, path: AbstractJointPath, jerk: Floats, intervals: int = 1000) -> SmoothTrajectory:
    motion = minimum_time(PathDynamics.from_path(arm, path, intervals=intervals), jerk=jerk)
    assert isinstance(motion, SmoothTrajectory)
    return motion


def excess_in_time(motion: PhaseTrajectory, jerk_max: Floats, samples: int = 20000) -> dict[str, float]:
    """How far above its limit each quantity gets, by differences of q(t) and the arm's inverse dynamics alone."""
    arm, path = motion.dynamics.arm, motion.dynamics.path
    assert arm is not None
    assert path is not None
    t, h = np.linspace(0.0, motion.duration, samples, retstep=True)
    lam, mu, mu_dot = motion.at(t)
    q, dq, ddq = path.evaluate(lam)
    qd, qdd = dq * mu[:, None], dq * mu_dot[:, None] + ddq * mu[:, None] ** 2
    steps = np.diff(q, axis=0) / h  # mean speeds cannot be above the largest one
    moving = np.where(np.abs(qd) > 1e-9 * np.abs(qd).max(), qd, 0.0)
    return {
        "speed": float((np.abs(steps) / arm.speed_max).max()) - 1.0,
        "acceleration": float((np.abs(np.diff(qd, axis=0)) / h / arm.acceleration_max).max()) - 1.0,
        "jerk": float((np.abs(np.diff(qdd, axis=0)) / h / jerk_max).max()) - 1.0,
        "torque": float((np.abs(arm.inverse_dynamics(q, moving, qdd)) / arm.torque_max).max()) - 1.0,
    }


@settings(max_examples=40, deadline=None)
@given(
    st.tuples(st.floats(0.5, 4.0), st.floats(0.5, 4.0)), st.tuples(st.floats(3.0, 30.0), st.floats(3.0, 30.0)),
    st.floats(-3.0, 0.5), st.floats(-3.0, 3.0), st.floats(0.05, 2.0),
)  # fmt: skip
def test_a_straight_line_takes_ruckigs_time(
    speed: tuple[float, float], acceleration: tuple[float, float], ramp: float, angle: float, way: float
) -> None:
    """From jerk that hardly binds to jerk alone."""
    direction = np.array([np.cos(angle), np.sin(angle)])
    v, a = np.array(speed), np.array(acceleration)
    jerk = a / 10.0**ramp
    arm = Arm.from_urdf(
        data_path("robots/planar_two_link.urdf"), torque_max=[STRONG] * 2, speed_max=v, acceleration_max=a
    )
    motion = solved(arm, JointPath.through([np.zeros(2), way * direction]), jerk)
    along = np.maximum(np.abs(direction), 1e-12)
    wanted = ruckigs_time(way, float((v / along).min()), float((a / along).min()), float((jerk / along).min()))
    assert 1.0 - 1e-4 < motion.duration / wanted < 1.001
    assert motion.certificate.excess <= 1e-3


def test_fewer_intervals_cost_little(make_arm: MakeArm) -> None:
    arm = make_arm(torque_max=[STRONG] * 2, speed_max=[2.0, 2.0], acceleration_max=[10.0, 10.0])
    path = JointPath.through([[0.0, 0.0], [1.5, 0.0]])
    wanted = ruckigs_time(1.5, 2.0, 10.0, 100.0)
    for intervals, most in ((10, 1.02), (100, 1.004), (300, 1.002)):
        assert 1.0 - 1e-4 < solved(arm, path, np.array([100.0, 100.0]), intervals).duration / wanted < most


@cache
def arms() -> dict[str, Arm]:
    return {
        "planar": Arm.from_urdf(data_path("robots/planar_two_link.urdf"), torque_max=[25.0, 7.0], damping=[0.5, 0.2]),
        "ur5e_like": Arm.from_urdf(data_path("robots/ur5e_like.urdf"), acceleration_max=[20.0] * 6),
        "panda": load_cell("panda-pair", CoordinationCell).arms[0],
    }


def spline_of(arm: Arm, seed: int, count: int) -> AbstractJointPath:
    """Waypoints in the inner three fifths of the joints' ranges."""
    low, high = np.maximum(arm.position_min, -3.0), np.minimum(arm.position_max, 3.0)
    points = np.random.default_rng(seed).uniform(-0.3, 0.3, (count, arm.dof))
    return JointPath.through(0.5 * (low + high) + points * (high - low), arm=arm)


@pytest.mark.parametrize("name", ["planar", "ur5e_like", "panda"])
@settings(max_examples=12, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 7), st.sampled_from([0.002, 0.03, 0.2]))
def test_random_splines_keep_every_limit(name: str, seed: int, count: int, ramp: float) -> None:
    """Jerk hardly binds, binds in the ramps, binds everywhere; friction, too."""
    arm = arms()[name]
    try:
        dynamics = PathDynamics.from_path(arm, spline_of(arm, seed, count))
        fastest = minimum_time(dynamics)
    except ArmtempoError:
        return  # a path that this arm cannot follow
    lam, mu, mu_dot = fastest.at(np.linspace(0.0, fastest.duration, 400))
    assert dynamics.path is not None
    _, dq, ddq = dynamics.path.evaluate(lam)
    jerk = np.abs(dq * mu_dot[:, None] + ddq * mu[:, None] ** 2).max(axis=0) / ramp
    motion = minimum_time(dynamics, jerk=jerk)
    assert motion.certificate.excess <= 1e-3
    assert motion.certificate.jerk_ratio_max > 0.9
    assert max(excess_in_time(motion, jerk).values()) <= 1e-3
    assert motion.duration > fastest.duration * (1.0 - 2e-3)  # their grids differ
    assert motion.lam[-1] == fastest.lam[-1]


def test_jerk_without_end_gives_the_motion_without_jerk_limits() -> None:
    for name, arm in arms().items():
        dynamics = PathDynamics.from_path(arm, spline_of(arm, 3, 4), intervals=2000)
        fastest = minimum_time(PathDynamics.from_path(arm, spline_of(arm, 3, 4), intervals=8000)).duration
        nearly = minimum_time(dynamics, jerk=np.full(arm.dof, 1e7)).duration
        assert nearly == pytest.approx(fastest, rel=1e-3), name
        none = minimum_time(dynamics, jerk=np.full(arm.dof, np.inf)).duration
        assert none == pytest.approx(nearly, rel=1e-3), name


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000), st.floats(0.3, 3.0))
def test_time_scales(seed: int, factor: float) -> None:
    """Limits (v, a, J) times (c, c^2, c^3) give T / c where torque has no say."""
    times = []
    for c in (1.0, factor):
        arm = Arm.from_urdf(
            data_path("robots/ur5e_like.urdf"), torque_max=[STRONG] * 6, speed_max=[2.0 * c] * 6,
            acceleration_max=[10.0 * c**2] * 6,
        )  # fmt: skip
        times.append(solved(arm, spline_of(arm, seed, 4), np.full(6, 150.0 * c**3), 400).duration)
    assert times[1] * factor == pytest.approx(times[0], rel=5e-4)


def test_more_jerk_is_never_slower_and_a_way_back_takes_as_long(make_arm: MakeArm) -> None:
    arm = make_arm(torque_max=[25.0, 7.0])  # without friction
    points = np.array([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4]])
    there = [solved(arm, JointPath.through(points), np.full(2, jerk)).duration for jerk in (50.0, 500.0, 5000.0)]
    assert there[0] > there[1] > there[2]
    back = solved(arm, JointPath.through(points[::-1]), np.full(2, 500.0)).duration
    assert back == pytest.approx(there[1], rel=5e-4)


def test_a_line_that_meets_an_arc_is_left_at_rest(make_arm: MakeArm) -> None:
    """Where f'' jumps only a stop keeps jerk; each part takes what it takes alone."""
    arm = make_arm(torque_max=[25.0, 7.0])
    start, middle, end = np.array([[0.3, 0.1, 0.0], [0.4, 0.1, 0.0], [0.5, 0.2, 0.0]])
    line, arc = Line(start, middle), Arc(middle, end, np.array([0.4, 0.2, 0.0]))
    jerk = np.array([3000.0, 3000.0])
    parts: dict[str, list[Line | Arc]] = {"line": [line], "arc": [arc], "both": [line, arc]}
    along = {what: JointPath.along(CartesianPath(one), arm, elbow="positive") for what, one in parts.items()}
    motions = {what: solved(arm, path, jerk) for what, path in along.items()}
    both = motions["both"]
    assert both.duration == pytest.approx(motions["line"].duration + motions["arc"].duration, rel=1e-3)
    stop = float(both.time_at(0.1))
    np.testing.assert_allclose(np.array(both.at(stop))[1:], 0.0, atol=0.01)  # the cube root of rounding
    assert both.certificate.excess <= 1e-3
    assert excess_in_time(both, jerk)["jerk"] <= 1e-3


def test_coulomb_friction_and_joints_that_turn_back(make_arm: MakeArm) -> None:
    arm = make_arm(torque_max=[25.0, 7.0], coulomb=[1.0, 0.4], damping=[0.5, 0.2])
    path = JointPath.through([[0.0, 0.5], [0.6, 1.0], [0.1, 0.2], [0.8, 0.9]])
    jerk = np.array([2000.0, 2000.0])
    motion = solved(arm, path, jerk)
    assert motion.certificate.excess <= 1e-3
    assert excess_in_time(motion, jerk)["torque"] <= 1e-3


def test_speed_caps_and_reserves_are_kept(make_arm: MakeArm) -> None:
    path = JointPath.through([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4]])
    arm = make_arm(torque_max=[25.0, 7.0])
    dynamics = PathDynamics.from_path(arm, path, torque_reserve=0.2, speed_max=lambda s: 1.0 + 0.5 * np.cos(9.0 * s))
    motion = minimum_time(dynamics, jerk=[3000.0, 3000.0])
    lam, mu, _ = motion.at(np.linspace(0.0, motion.duration, 2000))
    assert (mu <= (1.0 + 0.5 * np.cos(9.0 * lam)) * (1.0 + 1e-3)).all()
    assert excess_in_time(motion, np.full(2, 3000.0))["torque"] <= -0.2 + 1e-3


def test_a_part_of_a_path_is_timed_as_well(make_arm: MakeArm) -> None:
    arm = make_arm(torque_max=[25.0, 7.0])
    whole = PathDynamics.from_path(arm, JointPath.through([[0.0, 0.5], [0.6, 1.0], [1.0, 0.4]]))
    motion = minimum_time(whole.between(0.2, 0.9, intervals=500), jerk=[3000.0, 3000.0])
    assert (motion.lam[0], motion.lam[-1]) == (0.2, 0.9)
    assert motion.certificate.excess <= 1e-3


def test_what_cannot_be_held_at_rest_is_refused(make_arm: MakeArm) -> None:
    arm = make_arm(torque_max=[1.0, 1.0], gravity=(0.0, -9.81, 0.0))
    dynamics = PathDynamics.from_path(arm, JointPath.through([[0.0, 0.0], [1.0, 0.0]]), intervals=50)
    with pytest.raises(InfeasibleError, match="hold still"):
        minimum_time(dynamics, jerk=[100.0, 100.0])
