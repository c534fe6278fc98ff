"""Two arms of one file: the torso is one static body, each arm's links are its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.errors import RobotError
from armtempo.robots import Arm, Clearance, share_bases
from tests.robots.torso import write_torso


def pair(folder: Path, **right: Any) -> list[Arm]:
    urdf, srdf = write_torso(folder)
    options: dict[str, Any] = {"srdf": srdf, "locked": {"torso": 0.1}}
    other: dict[str, Any] = {**options, "group": "right", **right}
    return [
        Arm.from_urdf(urdf, name="left", group="left", **options),
        Arm.from_urdf(urdf, name="right", **other),
    ]


def test_read_alone_each_arm_carries_the_other(tmp_path: Path) -> None:
    arms = pair(tmp_path)
    assert Clearance(arms).arms([np.zeros(3), np.zeros(3)]).distance <= 0.0
    assert {shape.link_name for shape in arms[0].shapes if shape.link < 0} >= {"base", "chest", "right_link2"}


def test_what_none_of_them_moves_is_static(tmp_path: Path) -> None:
    arms, bodies = share_bases(pair(tmp_path))
    assert [body.link_name for body in bodies] == ["left+/base", "left+/chest"]
    for arm, side in zip(arms, ("left", "right"), strict=True):
        assert {shape.link_name for shape in arm.shapes} == {
            *(f"{side}_link{k}" for k in range(3)), f"{side}_jaw", f"{side}_other",
        }  # fmt: skip
        assert arm.shared_base == (("left+/base", "base"), ("left+/chest", "chest"))
    clearance = Clearance(arms, bodies)
    up = np.zeros(3)
    nearest = clearance.arms([up, up]).distance
    assert 0.4 < nearest < 0.6 - 2 * 0.03 + 1e-9  # 0.6 m apart, cylinders of 30 mm
    assert ("left/left_link0", "left+/chest") in clearance.ignored_pairs(0)
    # Over the chest the arms reach each other; bent down an arm reaches the torso.
    assert clearance.obstacles(0, up).distance > 0.05
    bent = min(clearance.obstacles(0, np.array([a, b, 1.5])).distance for a in (1.8, 1.9, 2.0) for b in (1.5, 2.0))
    assert bent < clearance.obstacles(0, up).distance


def test_arms_of_other_places_stay_as_they_are(tmp_path: Path) -> None:
    T = np.eye(4)
    T[0, 3] = 2.0
    arms = pair(tmp_path, T_world_base=T)
    same, bodies = share_bases(arms)
    assert same == tuple(arms)
    assert bodies == ()


def test_what_cannot_be_shared_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"'left' and 'right' are the same arm of torso.urdf at the same place"):
        share_bases(pair(tmp_path, group="left"))
    with pytest.raises(RobotError, match=r"hold joint 'torso' of torso.urdf at 0.1 and 0.2 .hold it at one place"):
        share_bases(pair(tmp_path, locked={"torso": 0.2}))
    urdf, _ = write_torso(tmp_path)
    arms = [Arm.from_urdf(urdf, name=side, tip_link=f"{side}_link2") for side in ("left", "right")]
    with pytest.raises(RobotError, match=r"joint 'torso' of torso.urdf moves both 'left' and 'right'"):
        share_bases(arms)
