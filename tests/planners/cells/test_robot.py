"""A robot by itself: bundled, from a file, or an arm of a cell."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from armtempo.configs import data_path
from armtempo.errors import InputError, RobotError, UnknownNameError
from armtempo.planners import load_cell, load_robot


def test_a_bundled_robot_has_the_limits_of_its_data_sheet() -> None:
    arm = load_robot("pybullet_data/franka_panda/panda.urdf")
    pair = load_cell("panda-pair").arms[0]
    for name in ("torque_max", "speed_max", "acceleration_max", "position_min", "position_max"):
        np.testing.assert_array_equal(getattr(arm, name), getattr(pair, name))
    np.testing.assert_array_equal(arm.T_world_base, np.eye(4))


def test_an_arm_of_a_cell_stands_where_it_stands_there(tmp_path: Path) -> None:
    arm, there = load_robot("lee1991:slave"), load_cell("lee1991").arms[1]
    np.testing.assert_array_equal(arm.T_world_base, there.T_world_base)
    np.testing.assert_array_equal(arm.torque_max, there.torque_max)
    copied = tmp_path / "mine.yaml"
    shutil.copy(data_path("cells/lee1991.yaml"), copied)
    np.testing.assert_array_equal(load_robot(f"{copied}:slave").T_world_base, there.T_world_base)


def test_a_file_is_found_from_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copy(data_path("robots/ur5e_like.urdf"), tmp_path / "my robot (2).urdf")
    monkeypatch.chdir(tmp_path)
    assert load_robot("my robot (2).urdf").dof == 6
    assert load_robot(tmp_path / "my robot (2).urdf").dof == 6


def test_what_there_is_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no robot 'ur5.urdf'.*did you mean 'ur5e_like.urdf'.*a bundled robot"):
        load_robot("ur5.urdf")
    with pytest.raises(UnknownNameError, match=r"arm of cell 'lee1991' 'slav'.*did you mean 'slave'"):
        load_robot("lee1991:slav")
    with pytest.raises(InputError, match="tip_link 'tool' for an arm of a cell"):
        load_robot("lee1991:slave", tip_link="tool")
    with pytest.raises(RobotError, match="tip"):
        load_robot("planar_two_link.urdf", tip_link="nothing")
