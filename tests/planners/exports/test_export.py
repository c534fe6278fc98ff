"""Files for other programs: read back, they are what was planned, to the last bit."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from armtempo.errors import ArmtempoError, InputError
from armtempo.planners.exports import RobotMotion, export_motion
from armtempo.planners.exports._mcap import _topic


def read(file: Path) -> Any:
    text = file.read_text(encoding="utf-8")
    return json.loads(text) if file.suffix == ".json" else yaml.safe_load(text)


def check_message(message: Any, names: tuple[str, ...], motion: Any) -> None:
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert tuple(message["joint_names"]) == names
    points = message["points"]
    assert [set(point) for point in points] == [
        {"positions", "velocities", "accelerations", "effort", "time_from_start"}
    ] * len(points)
    time = [point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in points]
    np.testing.assert_allclose(time, motion.time, atol=1e-12)
    for key, table in (("positions", motion.q), ("velocities", motion.qd), ("accelerations", motion.qdd)):
        np.testing.assert_array_equal([point[key] for point in points], table)
    assert all(point["effort"] == [] for point in points)
    assert points[-1]["velocities"] == [0.0] * len(names)


@pytest.mark.parametrize("ending", ["json", "yaml"])
def test_joint_trajectories_round_trip(ending: str, pair_motion: RobotMotion, tmp_path: Path) -> None:
    assert export_motion(tmp_path / f"deep/a.{ending}", pair_motion) == [tmp_path / f"deep/a.{ending}"]
    document = read(tmp_path / f"deep/a.{ending}")
    assert list(document) == ["joint_trajectories", "events"]
    for arm, own in zip(pair_motion.arms, pair_motion.motions, strict=True):
        check_message(document["joint_trajectories"][arm.name], arm.joint_names, own)
    assert document["events"] == [
        {"time_s": 0.2, "duration_s": 0.0, "arm": "slave", "name": "placed", "gripper": "open", "holds": None}
    ]


@pytest.mark.parametrize("ending", ["json", "yml"])
def test_robot_trajectories_round_trip(ending: str, pair_motion: RobotMotion, tmp_path: Path) -> None:
    export_motion(tmp_path / f"a.{ending}", pair_motion, "robot-trajectory")
    message = read(tmp_path / f"a.{ending}")["robot_trajectory"]
    assert message["multi_dof_joint_trajectory"]["points"] == []
    points = message["joint_trajectory"]["points"]
    assert message["joint_trajectory"]["joint_names"] == [name for own in pair_motion.joint_names for name in own]
    np.testing.assert_array_equal(
        [point["positions"] for point in points], np.hstack([own.q for own in pair_motion.motions])
    )


def test_without_accelerations_controllers_take_cubics(pair_motion: RobotMotion, tmp_path: Path) -> None:
    export_motion(tmp_path / "a.json", pair_motion, accelerations=False)
    points = read(tmp_path / "a.json")["joint_trajectories"]["master"]["points"]
    assert all(point["accelerations"] == [] and len(point["velocities"]) == 2 for point in points)


def test_bags_are_read_back_by_another_library(pair_motion: RobotMotion, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    reader = pytest.importorskip("mcap_ros2.reader")
    file = tmp_path / "deep" / "a.mcap"
    assert export_motion(file, pair_motion) == [file]
    assert list(file.parent.iterdir()) == [file]
    found = {one.channel.topic: one for one in reader.read_ros2_messages(str(file))}
    assert set(found) == {"/master/joint_trajectory", "/slave/joint_trajectory", "/robot_trajectory", "/events"}
    for arm, own in zip(pair_motion.arms, pair_motion.motions, strict=True):
        message = found[f"/{arm.name}/joint_trajectory"].ros_msg
        assert tuple(message.joint_names) == arm.joint_names
        for key, table in (("positions", own.q), ("velocities", own.qd), ("accelerations", own.qdd)):
            np.testing.assert_array_equal([getattr(point, key) for point in message.points], table)
        stamps = [point.time_from_start.sec * 10**9 + point.time_from_start.nanosec for point in message.points]
        np.testing.assert_array_equal(stamps, np.round(own.time * 1e9))
    together = found["/robot_trajectory"].ros_msg.joint_trajectory
    np.testing.assert_array_equal(
        [point.positions for point in together.points], np.hstack([own.q for own in pair_motion.motions])
    )
    event = found["/events"]
    assert json.loads(event.ros_msg.data)["name"] == "placed"
    assert event.log_time_ns == 200_000_000


def test_topics_are_what_ros_allows() -> None:
    assert [_topic(name) for name in ("left", "7 left-arm", "ü")] == ["left", "arm_7_left_arm", "arm__"]


def test_a_missing_extra_is_named(pair_motion: RobotMotion, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(InputError, match=r'pip install "armtempo\[ros\]"'):
        export_motion(tmp_path / "a.mcap", pair_motion)
    assert list(tmp_path.iterdir()) == []


def test_programs_of_universal_robots_hold_every_point(ur_motion: RobotMotion, tmp_path: Path) -> None:
    (file,) = export_motion(tmp_path / "a.script", ur_motion)
    program = file.read_text(encoding="utf-8")
    commands = re.findall(r"servoj\(\[(.*?)\], t=0.008, lookahead_time=0.03, gain=1000\)", program)
    q = np.array([[float(value) for value in command.split(", ")] for command in commands])
    np.testing.assert_allclose(q, ur_motion.motions[0].q[1:], atol=1e-9)
    lines = program.splitlines()
    assert lines[0] == "def armtempo_motion():"
    assert lines[-1] == "end"
    assert lines[-2] == "  stopj(4)"
    assert '  armtempo_event("say \'placed\'", "")' in lines
    opened = sum(line.lstrip().startswith(("def ", "if ")) for line in lines)
    assert opened == sum(line.strip() == "end" for line in lines)
    start = re.findall(r"norm\(q\[(\d)\] - (\S+)\) > 0.01", program)
    np.testing.assert_allclose([float(value) for _, value in start], ur_motion.motions[0].q[0], atol=1e-9)


def test_what_is_no_ur_has_no_program(pair_motion: RobotMotion, ur_motion: RobotMotion, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"arm 'master' has 2 joints \(export it as joint-trajectory\)"):
        export_motion(tmp_path / "a.script", pair_motion)
    slow = replace(ur_motion.motions[0], time=2.0 * ur_motion.time)
    odd = replace(ur_motion, motions=(slow,), finer=(slow,))
    with pytest.raises(InputError, match=r"500 Hz \(e-Series\) or 125 Hz \(CB3\), not at 62.5 Hz"):
        export_motion(tmp_path / "a.script", odd)
    assert list(tmp_path.iterdir()) == []


def test_forms_and_endings_that_do_not_fit_are_refused(pair_motion: RobotMotion, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"mcap is not kept in \.json \(give it one of the endings \.mcap"):
        export_motion(tmp_path / "a.json", pair_motion, "mcap")
    with pytest.raises(InputError, match="not kept in a file without ending"):
        export_motion(tmp_path / "a", pair_motion)
    with pytest.raises(ArmtempoError, match="unknown form of export 'mcpa'"):
        export_motion(tmp_path / "a.mcap", pair_motion, "mcpa")  # type: ignore[arg-type]
