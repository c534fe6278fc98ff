"""Which link carries the tool where the file does not say: arms with grippers, frames, heads, wheels, two arms."""

from __future__ import annotations

from pathlib import Path

import pytest

from armtempo.errors import RobotError
from armtempo.robots import Arm
from tests.robots.test_urdf import INERTIAL, joint, link, write


def chain(names: str, root: str, kind: str = "revolute") -> str:
    """Links of these names, one behind the other."""
    body, before = "", root
    for name in names.split():
        body += link(name) + joint(f"to_{name}", before, name, kind, *([""] if kind == "fixed" else []))
        before = name
    return body


def fixed(name: str, parent: str) -> str:
    return f'<link name="{name}"/>' + joint(f"to_{name}", parent, name, "fixed", "")


MIMIC = '<limit lower="-1" upper="1" effort="2" velocity="3"/><mimic joint="to_left"/>'
SIX = link("base", INERTIAL) + chain("a b c d e f", "base")


@pytest.mark.parametrize(
    ("body", "tip", "joints"),
    [
        (SIX + fixed("tool0", "f") + fixed("camera", "e"), "tool0", 6),
        (SIX + fixed("flange", "f") + fixed("tool0", "f") + fixed("base_frame", "base"), "tool0", 6),
        (SIX + fixed("hand", "f") + chain("left", "hand") + chain("right", "hand"), "hand", 6),
        (SIX + fixed("hand", "f") + fixed("hand_tcp", "hand") + chain("left", "hand")
         + link("right") + joint("to_right", "hand", "right", "prismatic", MIMIC), "hand_tcp", 6),
        (SIX + chain("wheel_1", "base") + chain("wheel_2", "base"), "f", 6),
        (link("base") + chain("lift a b c d e f", "base") + chain("head_1 head_2", "lift"), "f", 7),
        (SIX + fixed("marker", "f") + fixed("tool_frame", "marker") + fixed("lens", "marker"), "tool_frame", 6),
        (SIX + "".join(chain(f"{k}_1 {k}_2 {k}_3 {k}_4", "f") for k in "xyz"), "f", 6),
    ],
)  # fmt: skip
def test_the_tip_is_the_end_of_the_arm_in_front_of_its_gripper(
    tmp_path: Path, body: str, tip: str, joints: int
) -> None:
    arm = Arm.from_urdf(write(tmp_path, body))
    assert (arm.tip_link, arm.dof) == (tip, joints)


@pytest.mark.parametrize(
    ("body", "candidates"),
    [
        (link("base") + chain("torso", "base") + chain("l1 l2 l3 l4 l5 l6", "torso") + fixed("l_tcp", "l6")
         + chain("r1 r2 r3 r4 r5 r6", "torso") + chain("l_a", "l6") + chain("l_b", "l6"), "l_tcp, r6"),
        (SIX + fixed("one", "f") + fixed("two", "f"), "one, two"),
        (link("base") + chain("one", "base") + chain("two", "base"), "one, two"),
    ],
)  # fmt: skip
def test_where_there_is_a_choice_it_is_asked_for(tmp_path: Path, body: str, candidates: str) -> None:
    with pytest.raises(RobotError, match="ends in") as caught:
        Arm.from_urdf(write(tmp_path, body))
    assert caught.value.remedy == f"choose the tip with tip_link: {candidates}"


def test_a_chain_of_thousands_of_links_is_no_matter(tmp_path: Path) -> None:
    body = link("base") + chain(" ".join(f"x{k}" for k in range(3000)), "base", "fixed") + chain("a", "x2999")
    assert Arm.from_urdf(write(tmp_path, body + fixed("camera", "x5"))).tip_link == "a"
