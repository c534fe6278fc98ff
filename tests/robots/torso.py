"""A torso with two arms of three joints and grippers whose second finger mimics the first, as URDF and SRDF."""

from __future__ import annotations

from pathlib import Path


def _link(name: str) -> str:
    inertia = '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>'
    body = '<collision><geometry><cylinder radius="0.03" length="0.2"/></geometry><origin xyz="0 0 0.15"/></collision>'
    return f'<link name="{name}"><inertial><mass value="1"/>{inertia}</inertial>{body}</link>'


def _joint(
    name: str,
    parent: str,
    child: str,
    *,
    kind: str = "revolute",
    at: str = "0 0 0.3",
    axis: str = "0 1 0",
    more: str = "",
) -> str:
    limit = '<limit lower="-2" upper="2" effort="50" velocity="3"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/>{limit}{more}</joint>'
    )


def write_torso(folder: Path) -> tuple[Path, Path]:
    """The files."""
    parts = [_link("base"), _link("chest"), _joint("torso", "base", "chest", kind="prismatic", axis="0 0 1")]
    for side, y in (("left", 0.3), ("right", -0.3)):
        before, at = "chest", f"0 {y} 0.2"
        for k in range(3):
            parts += [_link(f"{side}_link{k}"), _joint(f"{side}_joint{k}", before, f"{side}_link{k}", at=at)]
            before, at = f"{side}_link{k}", "0 0 0.3"
        mimic = f'<mimic joint="{side}_finger" multiplier="-1" offset="0.01"/>'
        parts += [_link(f"{side}_jaw"), _joint(f"{side}_finger", before, f"{side}_jaw", kind="prismatic", axis="1 0 0")]
        parts += [
            _link(f"{side}_other"),
            _joint(f"{side}_follows", before, f"{side}_other", kind="prismatic", axis="1 0 0", more=mimic),
        ]
    urdf, srdf = folder / "torso.urdf", folder / "torso.srdf"
    urdf.write_text(f'<robot name="torso">{"".join(parts)}</robot>', encoding="utf-8")
    groups = "".join(
        f'<group name="{side}"><chain base_link="chest" tip_link="{side}_link2"/></group>'
        f'<group name="{side}_hand"><joint name="{side}_finger"/></group>'
        f'<end_effector name="{side}_gripper" parent_link="{side}_link2" group="{side}_hand" '
        f'parent_group="{side}_all"/>'
        f'<group name="{side}_all"><joint name="{side}_joint0"/><joint name="{side}_joint1"/>'
        f'<joint name="{side}_joint2"/><group name="{side}_hand"/></group>'
        f'<group_state name="home" group="{side}">'
        + "".join(f'<joint name="{side}_joint{k}" value="{0.1 * k}"/>' for k in range(3))
        + "</group_state>"
        for side in ("left", "right")
    )
    pairs = '<disable_collisions link1="left_link0" link2="left_link2" reason="Never"/>'
    srdf.write_text(f'<robot name="torso">{groups}{pairs}</robot>', encoding="utf-8")
    return urdf, srdf
