"""Robot files with xacro elements: expanded where they lie, with their includes and packages, or told why not."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from armtempo.errors import RobotError
from armtempo.robots import Arm
from tests.robots.test_urdf import GOOD

pytest.importorskip("xacrodoc")

XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MACRO = f"""<robot {XACRO}>
  <xacro:macro name="arm" params="prefix length">
    <link name="${{prefix}}base"/>
    <link name="${{prefix}}one">
      <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    </link>
    <joint name="${{prefix}}j" type="revolute">
      <parent link="${{prefix}}base"/><child link="${{prefix}}one"/>
      <origin xyz="${{2 * length}} 0 0"/><axis xyz="0 0 1"/>
      <limit lower="-1" upper="1" effort="2" velocity="3"/>
    </joint>
  </xacro:macro>
</robot>"""


def main(include: str) -> str:
    return (
        f'<robot name="r" {XACRO}><xacro:include filename="{include}"/><xacro:arg name="length" default="0.5"/>'
        '<xacro:arm prefix="left_" length="$(arg length)"/></robot>'
    )


@pytest.mark.parametrize(
    ("folder", "include", "macro"),
    [
        (".", "macros.xacro", "macros.xacro"),  # beside the file, wherever the process is
        ("maker_description/urdf", "$(find maker_description)/macros/arm.xacro", "maker_description/macros/arm.xacro"),
        ("robots/cell", "$(find maker_description)/arm.xacro", "robots/maker_description/arm.xacro"),
    ],
)
def test_it_is_expanded_with_what_it_includes(tmp_path: Path, folder: str, include: str, macro: str) -> None:
    for name in ("arm.urdf.xacro", "arm.urdf"):  # some say nothing of it
        file, other = tmp_path / folder / name, tmp_path / macro
        for one in (file, other):
            one.parent.mkdir(parents=True, exist_ok=True)
        other.write_text(MACRO)
        file.write_text(main(include))
        arm = Arm.from_urdf(file)
        assert arm.joint_names == ("left_j",)
        np.testing.assert_allclose(arm.tip_pose(np.zeros(1))[:3, 3], [1.0, 0.0, 0.0])


def test_what_is_missing_or_wrong_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "arm.xacro"
    for text, message, remedy in (
        (
            main("$(find nowhere_description)/arm.xacro"),
            "Package not found: nowhere_description",
            "'nowhere_description'",
        ),
        (main("no.xacro"), "xacro cannot expand it", "beside it"),
        (f'<robot name="r" {XACRO}><xacro:nothing/></robot>', "xacro cannot expand it", "repair it"),
        (
            f'<robot name="r" {XACRO}><link name="${{1 / 0}}"/><xacro:if value="1"/></robot>',
            "cannot expand",
            "repair it",
        ),
    ):
        file.write_text(text)
        with pytest.raises(RobotError, match=message) as caught:
            Arm.from_urdf(file)
        assert remedy in caught.value.remedy
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(RobotError, match="xacrodoc is not installed") as caught:
        Arm.from_urdf(file)
    assert "armtempo[xacro]" in caught.value.remedy
    file.write_text(f'<robot {XACRO} name="r">{GOOD}</robot>')  # as xacro writes it
    assert Arm.from_urdf(file).dof == 1
