"""Motions of robots that the tests export."""

from __future__ import annotations

import pytest

from armtempo.configs import data_path
from armtempo.planners import CoordinationCell, JointPath, PathDynamics, minimum_time, schedule
from armtempo.planners.exports import MotionEvent, RobotMotion
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm


@pytest.fixture(scope="session")
def pair_motion(lee1991: CoordinationCell) -> RobotMotion:
    """The delay plan of the paper's cell at 500 Hz, with an event."""
    event = MotionEvent(time=0.2, arm="slave", name="placed", gripper="open")
    return RobotMotion.of_schedule(schedule(lee1991, "delay"), 500.0, [event])


@pytest.fixture(scope="session")
def ur() -> Arm:
    return Arm.from_urdf(data_path("robots/ur5e_like.urdf"), name="ur", acceleration_max=[8.0] * 6)


@pytest.fixture(scope="session")
def ur_motion(ur: Arm) -> RobotMotion:
    """A motion of six joints at 125 Hz."""
    path = JointPath.through([[0, -1.5, 1.2, 0, 1, 0], [0.3, -1.2, 1.0, 0.2, 1.1, 0.4], [0.6, -1.5, 1.2, 0, 1, 0]])
    motion = minimum_time(PathDynamics.from_path(ur, path))
    event = MotionEvent(time=motion.duration, arm="ur", name='say "placed"')
    return RobotMotion.sampled(
        [ur],
        [lambda time: JointTrajectory.sample_at(motion, time)],
        duration=motion.duration,
        rate_hz=125.0,
        events=[event],
    )
