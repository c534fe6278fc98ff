"""Motions of all arms on one clock: the planned ones, at every rate, and refused where controllers would refuse."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, Schedule, load_cell, minimum_time, schedule
from armtempo.planners.exports import MotionEvent, RobotMotion, time_base
from armtempo.planners.topp import JointTrajectory


@given(duration=st.floats(0.0, 1e3), rate=st.floats(0.01, 1e3))
def test_a_time_base_is_even_to_the_nanosecond_and_covers_the_motion(duration: float, rate: float) -> None:
    time = time_base(duration, rate)
    assert time[0] == 0.0
    assert len(time) >= 2
    assert time[-1] >= duration * (1.0 - 1e-9)
    assert len(time) == 2 or time[-2] < duration
    assert np.abs(time - np.arange(len(time)) / rate).max() <= 0.6e-9
    whole = time * 1e9
    assert np.abs(whole - np.round(whole)).max() <= 1e-3


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf"), 1e8, 1e9])
def test_rates_that_are_none_are_refused(rate: float) -> None:
    with pytest.raises(InputError, match="Hz"):
        time_base(2.0, rate)


@pytest.mark.parametrize("rate", [37.0, 500.0])
@pytest.mark.parametrize("smooth", [False, True])
def test_points_are_the_plan_at_one_clock(smooth: bool, rate: float, lee1991: CoordinationCell) -> None:
    plan = schedule(lee1991, "delay")
    if smooth:
        jerk = np.array([4000.0, 8000.0])
        motions = tuple(
            minimum_time(motion.dynamics, jerk=jerk).delayed(0.05 * k) for k, motion in enumerate(lee1991.fastest)
        )
        plan = Schedule(method="delay", cell=lee1991, trajectories=motions, order=(0, 1))
    motion = RobotMotion.of_schedule(plan, rate)
    for path, planned, own in zip(lee1991.paths, plan.trajectories, motion.motions, strict=True):
        np.testing.assert_array_equal(own.time, motion.time)
        np.testing.assert_array_equal(own.q, path.evaluate(planned.at(motion.time)[0])[0])
        np.testing.assert_allclose(own.q[-1], path.evaluate(path.length)[0], atol=1e-9)
        np.testing.assert_array_equal(own.qd[[0, -1]], 0.0)
    assert plan.makespan <= motion.duration < plan.makespan + 1.0 / rate + 1e-9
    assert motion.events == ()


def test_exported_points_differentiated_keep_the_limits(lee1991: CoordinationCell) -> None:
    motion = RobotMotion.of_schedule(schedule(lee1991, "delay"), 10000.0)
    for arm, own in zip(lee1991.arms, motion.motions, strict=True):
        step = np.diff(own.time)[:, None]
        speed = np.diff(own.q, axis=0) / step
        acceleration = np.diff(speed, axis=0) / step[1:]
        assert (np.abs(speed) <= arm.speed_max * 1.001).all()
        torque = arm.inverse_dynamics(own.q[1:-1], 0.5 * (speed[1:] + speed[:-1]), acceleration)
        assert (np.abs(torque) <= arm.torque_max * 1.02).all()


def test_names_are_told_apart_only_where_they_must_be(pair_motion: RobotMotion, ur_motion: RobotMotion) -> None:
    assert pair_motion.joint_names == (("master_joint_1", "master_joint_2"), ("slave_joint_1", "slave_joint_2"))
    assert ur_motion.joint_names == (ur_motion.arms[0].joint_names,)


def test_events_are_sorted_and_of_the_motion(pair_motion: RobotMotion, lee1991: CoordinationCell) -> None:
    late, early = (MotionEvent(time=t, arm="slave", name=f"at {t}") for t in (0.2, 0.1))
    assert pair_motion.events[0].gripper == "open"
    plan = schedule(lee1991, "delay")
    assert RobotMotion.of_schedule(plan, 100.0, [late, early]).events == (early, late)
    for event in (replace(late, arm="nobody"), replace(late, time=9.0), replace(late, time=float("nan"))):
        with pytest.raises(InputError, match="not within the motion"):
            replace(pair_motion, events=(event,))


def test_what_moves_at_its_ends_is_refused(ur_motion: RobotMotion) -> None:
    whole = ur_motion.motions[0]
    half = JointTrajectory(
        joint_names=whole.joint_names,
        **{name: getattr(whole, name)[:5] for name in ("time", "q", "qd", "qdd", "torque")},
    )
    with pytest.raises(InputError, match=r"arm 'ur' moves where the motion ends: joint '.*' at .* \(plan from rest"):
        replace(ur_motion, motions=(half,), finer=(half,), events=())


def test_motions_of_other_clocks_or_arms_are_refused(pair_motion: RobotMotion, ur_motion: RobotMotion) -> None:
    one, other = pair_motion.motions
    later = replace(other, time=other.time * 1.01)
    with pytest.raises(InputError, match="not at the instants of the others"):
        replace(pair_motion, motions=(one, later), finer=(one, later))
    with pytest.raises(InputError, match="1 motions of 2 arms"):
        replace(pair_motion, motions=(one,), finer=(one,))
    with pytest.raises(InputError, match="is not of arm 'ur'"):
        replace(ur_motion, motions=(one,), finer=(one,), events=())


def test_events_of_tasks_are_told_when_the_plan_has_them() -> None:
    """For exactly their time, the second arm's after what it waits for."""
    plan = schedule(load_cell("scara-pair"), "delay")
    motion = RobotMotion.of_schedule(plan)
    assert [(event.arm, event.name) for event in sorted(motion.events, key=lambda one: (one.arm, one.time))] == [
        (name, event) for name in ("left", "right") for event in ("picked", "placed")
    ]
    for event in motion.events:
        assert event.duration == pytest.approx({"picked": 0.15, "placed": 0.1}[event.name], abs=1e-6)
        arm = [one.name for one in motion.arms].index(event.arm)
        rows = (motion.time > event.time + 1e-6) & (motion.time < event.time + event.duration - 1e-6)
        assert rows.any()
        np.testing.assert_allclose(motion.motions[arm].qd[rows], 0.0, atol=1e-9)
