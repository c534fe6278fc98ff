"""MoveIt's joint_limits.yaml: what counts behind its flags, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armtempo.errors import ArmtempoError, RobotError
from armtempo.robots import Arm, read_joint_limits
from tests.robots.torso import write_torso

TEXT = """
default_velocity_scaling_factor: 0.1
joint_limits:
  left_joint0: {has_velocity_limits: true, max_velocity: 1.5, has_acceleration_limits: true, max_acceleration: 4,
                has_deceleration_limits: true, max_deceleration: -3.5, has_jerk_limits: false, max_jerk: 0}
  left_joint1: {has_velocity_limits: false, max_velocity: 9.0, has_jerk_limits: true, max_jerk: 5.0e+2}
  left_joint2: {has_position_limits: true, min_position: -0.5, max_position: 1.25}
  left_finger: {has_velocity_limits: true, max_velocity: 0.1}
"""


@pytest.fixture
def files(tmp_path: Path) -> tuple[Path, Path]:
    (tmp_path / "joint_limits.yaml").write_text(TEXT, encoding="utf-8")
    return write_torso(tmp_path)[0], tmp_path / "joint_limits.yaml"


def test_limits_behind_their_flags_replace_the_urdfs(files: tuple[Path, Path]) -> None:
    urdf, limits = files
    arm = Arm.from_urdf(
        urdf, tip_link="left_link2", locked={"torso": 0.0}, joint_limits=limits, speed_max=[None, 2.0, None]
    )
    np.testing.assert_array_equal(arm.speed_max, [1.5, 2.0, 3.0])
    np.testing.assert_array_equal(arm.acceleration_max, [3.5, np.inf, np.inf])
    np.testing.assert_array_equal(arm.jerk_max, [np.inf, 500.0, np.inf])
    np.testing.assert_array_equal(arm.position_min, [-2.0, -2.0, -0.5])
    np.testing.assert_array_equal(arm.position_max, [2.0, 2.0, 1.25])
    np.testing.assert_array_equal(arm.torque_max, 50.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("joint_limits: [1", "is no YAML"),
        ("limits: {}", "holds no joint_limits"),
        ("joint_limits: {left_joint0: 3}", "holds no joint_limits"),
        ("joint_limits: {left_jiont0: {}}", "none of the joints left_joint0 is in it .did you mean 'left_jiont0'"),
        ("joint_limits: {left_joint0: {has_velocity_limits: true}}", "joint 'left_joint0': max_velocity is None"),
        ("joint_limits: {left_joint0: {has_jerk_limits: true, max_jerk: 0}}", "has max_jerk: 0"),
        ("joint_limits: {left_joint0: {has_effort_limits: true, max_effort: true}}", "max_effort is True"),
    ],
)
def test_what_is_no_limit_is_refused(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "limits.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(RobotError, match=words):
        read_joint_limits(file, ["left_joint0"])


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArmtempoError, match="nowhere"):
        read_joint_limits(tmp_path / "nowhere.yaml", ["a"])
