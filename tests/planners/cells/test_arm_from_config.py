"""Arms of cell files as MoveIt describes them: a group on a torso that is held, within its joint_limits.yaml."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
import yaml

from armtempo.errors import ConfigError
from armtempo.planners import CoordinationCell, load_cell, schedule
from tests.robots.torso import write_torso


def write(folder: Path, **changes: object) -> Path:
    write_torso(folder)
    (folder / "limits.yaml").write_text(
        "joint_limits: {left_joint1: {has_acceleration_limits: true, max_acceleration: 5.0}}", encoding="utf-8"
    )
    arm = {
        "name": "left", "urdf": "torso.urdf", "srdf": "torso.srdf", "group": "left", "locked": {"torso": 0.25},
        "joint_limits": "limits.yaml", "path": {"waypoints_rad": [[0.3, 0.4, 0.2], [0.7, 0.9, 0.5]]}, **changes,
    }  # fmt: skip
    cell = {"kind": "coordination", "name": "torso", "d_min_m": 0.01, "physics_tick_s": 0.001,
            "control_period_s": 0.004, "arms": [arm]}  # fmt: skip
    file = folder / "cell.yaml"
    file.write_text(yaml.safe_dump(cell), encoding="utf-8")
    return file


def test_a_cell_takes_an_srdf_with_a_group_held_joints_and_moveits_limits(tmp_path: Path) -> None:
    cell = load_cell(write(tmp_path), CoordinationCell)
    (arm,) = cell.arms
    assert arm.joint_names == ("left_joint0", "left_joint1", "left_joint2")
    np.testing.assert_array_equal(arm.acceleration_max, [np.inf, 5.0, np.inf])
    np.testing.assert_allclose(arm.tip_pose(np.zeros(3))[:3, 3], [0.0, 0.3, 0.3 + 0.25 + 0.2 + 0.6])
    (motion,) = cell.fastest
    assert motion.certificate.acceleration_ratio_max == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"srdf": None}, "arms.0..group: belongs to srdf, which is missing"),
        ({"srdf": "nowhere.srdf"}, "nowhere.srdf"),
        ({"group": "lift"}, "unknown group 'lift'"),
        ({"locked": None}, "joint 'torso' moves, and is not of group 'left'"),
        ({"locked": {"torso": "up"}}, "locked.torso: must be a number"),
    ],
)
def test_what_does_not_fit_is_said_with_its_place(changes: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises((ConfigError, LookupError, ValueError), match=words) as caught:
        load_cell(write(tmp_path, **changes))
    assert "cell.yaml" in str(caught.value)


def test_two_arms_of_a_torso_are_coordinated(tmp_path: Path) -> None:
    """They swing towards each other and back; read alone, each would carry the other one at zero."""
    file = write(tmp_path)
    data = yaml.safe_load(file.read_text(encoding="utf-8"))
    left = data["arms"][0]
    right = left | {"name": "right", "group": "right", "path": {"waypoints_rad": [[-0.3, 0.4, 0.2], [0.4, 0.9, 0.5]]}}
    right.pop("joint_limits")
    data["arms"] = [left, right]
    file.write_text(yaml.safe_dump(data), encoding="utf-8")
    cell = load_cell(file, CoordinationCell)
    assert [body.link_name for body in cell.obstacles] == ["left+/base", "left+/chest"]
    plan = schedule(cell, "optimal")
    assert plan.certificate.min_clearance > cell.d_min
    assert plan.certificate.certified_free
    again = pickle.loads(pickle.dumps(cell))
    assert [len(arm.shapes) for arm in again.arms] == [len(arm.shapes) for arm in cell.arms]
