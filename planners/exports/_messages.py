"""Motions as ROS messages: plain dictionaries with the fields of the message types, as ``ros2 topic pub`` takes them.

``effort`` stays empty: controllers that command positions or speeds refuse trajectories that have it. Stamps are 0,
which starts a motion when it arrives; for several arms set all stamps to one instant a little ahead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.exports._robot_motion import NANOSECONDS, MotionEvent, RobotMotion

Message = dict[str, Any]


def duration(seconds: float) -> Message:
    """``builtin_interfaces/Duration``, to the nearest nanosecond."""
    whole, rest = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return {"sec": whole, "nanosec": rest}


def header() -> Message:
    """``std_msgs/Header``."""
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}


def _joint_trajectory(names: Sequence[str], time: Floats, rows: Sequence[Floats], accelerations: bool) -> Message:
    q, qd, qdd = (table.tolist() for table in rows)
    points = [
        {
            "positions": q[k],
            "velocities": qd[k],
            "accelerations": qdd[k] if accelerations else [],
            "effort": [],
            "time_from_start": duration(t),
        }
        for k, t in enumerate(time.tolist())
    ]
    return {"header": header(), "joint_names": list(names), "points": points}


def joint_trajectories(motion: RobotMotion, accelerations: bool = True) -> dict[str, Message]:
    """``trajectory_msgs/JointTrajectory`` of every arm, by its name, with the joints' names of its robot file."""
    return {
        arm.name: _joint_trajectory(own.joint_names, own.time, (own.q, own.qd, own.qdd), accelerations)
        for arm, own in zip(motion.arms, motion.motions, strict=True)
    }


def robot_trajectory(motion: RobotMotion, accelerations: bool = True) -> Message:
    """``moveit_msgs/RobotTrajectory`` of all arms together."""
    names = [name for own in motion.joint_names for name in own]
    rows = [np.hstack([getattr(own, key) for own in motion.motions]) for key in ("q", "qd", "qdd")]
    return {
        "joint_trajectory": _joint_trajectory(names, motion.time, rows, accelerations),
        "multi_dof_joint_trajectory": {"header": header(), "joint_names": [], "points": []},
    }


def events(motion: RobotMotion) -> list[Message]:
    """The events, units in the keys."""
    return [_event(event) for event in motion.events]


def _event(event: MotionEvent) -> Message:
    told = asdict(event)
    return {"time_s": told.pop("time"), "duration_s": told.pop("duration"), **told}
