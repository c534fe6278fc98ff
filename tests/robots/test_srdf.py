"""SRDF: groups as arms, states as places, pairs that need no look; and joints that are held."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import numpy as np
import pytest

from armtempo.errors import ArmtempoError, RobotError
from armtempo.robots import Arm, read_srdf
from tests.robots.torso import write_torso


@pytest.fixture
def torso(tmp_path: Path) -> tuple[Path, Path]:
    return write_torso(tmp_path)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_group_is_an_arm_on_a_torso_that_is_held(side: str, torso: tuple[Path, Path]) -> None:
    urdf, srdf = torso
    arm = Arm.from_urdf(urdf, srdf=srdf, group=side, locked={"torso": 0.1})
    assert arm.joint_names == tuple(f"{side}_joint{k}" for k in range(3))
    assert arm.tip_link == f"{side}_link2"
    np.testing.assert_allclose(arm.places["home"], [0.0, 0.1, 0.2])
    assert ("left_link0", "left_link2") in arm.ignored_pairs
    y = 0.3 if side == "left" else -0.3
    np.testing.assert_allclose(arm.tip_pose(np.zeros(3))[:3, 3], [0.0, y, 0.3 + 0.1 + 0.2 + 0.6])
    whole = Arm.from_urdf(urdf, tip_link=f"{side}_link2")
    assert whole.joint_names[0] == "torso"
    np.testing.assert_allclose(whole.tip_pose([0.1, 0.3, -0.2, 0.5]), arm.tip_pose([0.3, -0.2, 0.5]), atol=1e-12)
    again = pickle.loads(pickle.dumps(arm))
    assert again.locked == (("torso", 0.1),)
    np.testing.assert_array_equal(copy.deepcopy(arm).places["home"], arm.places["home"])


def test_joints_that_mimic_follow_what_is_held(torso: tuple[Path, Path]) -> None:
    urdf, _ = torso

    def jaws(locked: dict[str, float]) -> tuple[float, float]:
        arm = Arm.from_urdf(urdf, tip_link="left_link2", locked=locked)
        x = {shape.link_name: float(shape.T_link_shape[0, 3]) for shape in arm.shapes}
        return x["left_jaw"], x["left_other"]

    assert jaws({"left_finger": 0.04}) == pytest.approx((0.04, -0.03))
    assert jaws({}) == pytest.approx((0.0, 0.01))  # the drive at zero, what mimics it at its offset


def test_a_group_of_joints_ends_where_its_gripper_begins(torso: tuple[Path, Path]) -> None:
    urdf, srdf = torso
    arm = Arm.from_urdf(urdf, srdf=srdf, group="left_all", locked={"torso": 0.0})
    assert arm.tip_link == "left_link2"
    assert arm.places == {}


def test_what_moves_above_a_group_must_be_held(torso: tuple[Path, Path]) -> None:
    urdf, srdf = torso
    with pytest.raises(
        RobotError, match=r"joint 'torso' moves, and is not of group 'left' \(hold it: locked: \{torso: 0"
    ):
        Arm.from_urdf(urdf, srdf=srdf, group="left")


def test_names_that_are_unknown_are_told_with_the_known_ones(torso: tuple[Path, Path], tmp_path: Path) -> None:
    urdf, srdf = torso
    with pytest.raises(ArmtempoError, match=r"unknown group 'lift'.*did you mean 'left'"):
        Arm.from_urdf(urdf, srdf=srdf, group="lift")
    with pytest.raises(RobotError, match="group 'left' is of an SRDF, and none is given"):
        Arm.from_urdf(urdf, group="left")
    with pytest.raises(RobotError, match=r"locked joint 'torsoo' does not exist.*did you mean 'torso'"):
        Arm.from_urdf(urdf, locked={"torsoo": 0.0})
    with pytest.raises(RobotError, match="locked joint 'left_follows' is none that moves"):
        Arm.from_urdf(urdf, locked={"left_follows": 0.0})
    for wrong in (3.0, float("nan"), "high"):
        with pytest.raises(RobotError, match=r"locked joint 'torso' at .* is out of range .give -2 to 2"):
            Arm.from_urdf(urdf, locked={"torso": wrong})  # type: ignore[dict-item]
    text = srdf.read_text(encoding="utf-8")
    for old, new, words in (
        ('tip_link="left_link2"', 'tip_link="left_lonk2"', "group 'left' names the unknown link 'left_lonk2'"),
        ('base_link="chest" tip_link="left_link2"', 'base_link="left_jaw" tip_link="left_link0"', "is not on the way"),
        (
            '<joint name="left_joint0" value="0.0"/>',
            '<joint name="left_joint0" value="x"/>',
            "has no number as its value",
        ),
        ('tip_link="left_link2"', "", "has no tip_link"),
        ("<robot", "<robots", "cannot be read as XML"),
    ):
        bad = tmp_path / "bad.srdf"
        assert old in text
        bad.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(RobotError, match=words):
            Arm.from_urdf(urdf, srdf=bad, group="left", locked={"torso": 0.0})


def test_groups_that_hold_themselves_are_refused(tmp_path: Path) -> None:
    urdf, srdf = write_torso(tmp_path)
    ring = '<robot name="r"><group name="a"><group name="b"/></group><group name="b"><group name="a"/></group></robot>'
    srdf.write_text(ring, encoding="utf-8")
    assert list(read_srdf(srdf).groups) == ["a", "b"]
    with pytest.raises(RobotError, match="group 'a' is in itself"):
        Arm.from_urdf(urdf, srdf=srdf, group="a")
