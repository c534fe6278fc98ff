"""Motions as a bag of ROS messages in one MCAP file, written by rosbags, without ROS (the extra ``ros``)."""

from __future__ import annotations

import json
import shutil
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np

from armtempo.errors import InputError
from armtempo.planners.exports._messages import events, joint_trajectories, robot_trajectory
from armtempo.planners.exports._robot_motion import NANOSECONDS, RobotMotion

ROBOT_TRAJECTORY = "moveit_msgs/msg/RobotTrajectory"
DEFINITION = """trajectory_msgs/JointTrajectory joint_trajectory
trajectory_msgs/MultiDOFJointTrajectory multi_dof_joint_trajectory
"""
BAG_VERSION: Final = 9  # of rosbag2's layout


def write_mcap(file: Path, motion: RobotMotion, accelerations: bool) -> None:
    """Topics: ``/ARM/joint_trajectory`` of every arm, ``/robot_trajectory``, and ``/events`` as JSON in strings.

    Trajectories stand at instant 0 of the bag, events at their own.

    Raises:
        InputError: rosbags is not installed.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ModuleNotFoundError as error:
        raise InputError(
            f"MCAP is written by rosbags, and {error.name} is not installed", remedy='pip install "armtempo[ros]"'
        ) from error
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(DEFINITION, ROBOT_TRAJECTORY))
    messages: list[tuple[str, str, int, Any]] = [
        (f"/{_topic(name)}/joint_trajectory", "trajectory_msgs/msg/JointTrajectory", 0, message)
        for name, message in joint_trajectories(motion, accelerations).items()
    ]
    messages.append(("/robot_trajectory", ROBOT_TRAJECTORY, 0, robot_trajectory(motion, accelerations)))
    for event in events(motion):
        at = round(event["time_s"] * NANOSECONDS)
        messages.append(("/events", "std_msgs/msg/String", at, {"data": json.dumps(event)}))
    with tempfile.TemporaryDirectory(dir=file.parent) as scratch:
        bag = Path(scratch) / "bag"  # rosbags writes a folder: of it we keep the one file that tells all
        with Writer(bag, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP) as writer:
            kinds = {topic: kind for topic, kind, _, _ in messages} | {"/events": "std_msgs/msg/String"}
            topics = {topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in kinds.items()}
            for topic, kind, at, message in messages:
                writer.write(topics[topic], at, store.serialize_cdr(_typed(store, kind, message), kind))
        (written,) = bag.glob("*.mcap")
        shutil.move(written, file)


def _topic(name: str) -> str:
    """An arm's name as ROS allows it in a topic."""
    plain = "".join(c if c.isascii() and c.isalnum() else "_" for c in name)
    return plain if plain[:1].isalpha() else f"arm_{plain}"


def _typed(store: Any, kind: str, message: Any) -> Any:
    """A message of a type from a dictionary with its fields."""
    values = {}
    for name, (node, described) in store.fielddefs[kind][1]:
        values[name] = _value(store, node.name, described, message[name])
    return store.types[kind](**values)


def _value(store: Any, node: str, described: Any, value: Any) -> Any:
    if node == "NAME":
        return _typed(store, described, value)
    if node == "BASE":
        return value
    inner = described[0]
    if inner[0].name == "NAME":
        return [_typed(store, inner[1], one) for one in value]
    return list(value) if inner[1][0] == "string" else np.array(value, dtype=inner[1][0])
