"""What the URDF reader accepts, and the messages for what it does not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from armtempo.errors import RobotError
from armtempo.robots import Arm

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="2" velocity="3"/>'


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="0 0 1"/>{inside}</joint>'
    )


def link(name: str, inside: str = INERTIAL) -> str:
    return f'<link name="{name}">{inside}</link>'


def collision(geometry: str) -> str:
    return f"<collision><geometry>{geometry}</geometry></collision>"


GOOD = link("base", "") + link("one") + joint("j1", "base", "one")


def write(folder: Path, body: str) -> Path:
    file = folder / "arm.urdf"
    file.write_text(f'<robot name="r">{body}</robot>')
    return file


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (GOOD + link("two", "") + joint("j2", "one", "two"), ["link 'two'", "<inertial>", "mass"]),
        (
            GOOD + link("two", collision('<sphere radius="1"/>')) + joint("f", "one", "two", "fixed", ""),
            ["link 'two'", "<inertial>"],
        ),
        (
            link("base", "") + link("one") + joint("j1", "base", "one", inside=""),
            ["joint 'j1'", "effort", "torque_max"],
        ),
        (
            link("base", "") + link("one") + joint("j1", "base", "one", inside='<limit effort="2" velocity="3"/>'),
            ["joint 'j1'", "lower < upper"],
        ),
        (
            link("base", "") + link("one") + joint("j1", "base", "one", inside=LIMIT.replace("3", "0")),
            ["joint 'j1'", "velocity=0", "speed_max"],
        ),
        (link("base", "") + link("one") + joint("j1", "base", "one", "fixed", ""), ["no movable joint"]),
        (GOOD + link("two") + joint("j2", "base", "two"), ["ends in 2 links", "tip_link", "one, two"]),
        (GOOD + joint("j2", "one", "missing"), ["joint 'j2'", "unknown link 'missing'", "base, one"]),
        (GOOD + link("alone"), ["2 root links"]),
        (GOOD + link("one"), ["link 'one'", "name of its own"]),
        (GOOD.replace('xyz="0 0 1"', 'xyz="0 0 0"'), ["joint 'j1'", "no axis"]),
        (GOOD.replace("revolute", "floating"), ["joint 'j1'", "floating", "revolute"]),
        (GOOD.replace('mass value="1"', 'mass value="-1"'), ["link 'one'", "negative"]),
        (GOOD.replace('mass value="1"', 'mass value="0"'), ["link 'one'", "no mass"]),
        (GOOD.replace('izz="1"', 'izz="2.1"'), ["link 'one'", "no body can have"]),
        (GOOD.replace("</link><joint", collision('<box size="0 1 1"/>') + "</link><joint"), ["'one'", "box", "metres"]),
        (GOOD.replace("</link><joint", collision('<capsule radius="1"/>') + "</link><joint"), ["'one'", "<capsule>"]),
        (GOOD.replace("</link><joint", collision('<mesh filename="no.stl"/>') + "</link><joint"), ["'one'", "no.stl"]),
        (GOOD.replace("</link><joint", collision("<cone/>") + "</link><joint"), ["not a valid URDF", "cone"]),
        (GOOD.replace("</joint>", '<dynamics damping="-2"/></joint>'), ["joint 'j1'", "damping"]),
    ],
)
def test_faults_are_named_with_a_remedy(tmp_path: Path, body: str, words: list[str]) -> None:
    file = write(tmp_path, body)
    with pytest.raises(RobotError) as caught:
        Arm.from_urdf(file)
    message = str(caught.value)
    assert all(word in message for word in [str(file), *words]), message
    assert "\n" not in message
    assert caught.value.data["file"] == str(file)


def test_files_that_are_no_urdf(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="does not exist"):
        Arm.from_urdf(tmp_path / "none.urdf")
    file = tmp_path / "arm.urdf"
    file.write_text("<robot")
    with pytest.raises(RobotError, match="XML"):
        Arm.from_urdf(file)
    file.write_text("<sdf/>")
    with pytest.raises(RobotError, match="<sdf>"):
        Arm.from_urdf(file)


def test_given_limits_stand_in_for_missing_ones(tmp_path: Path) -> None:
    file = write(tmp_path, link("base", "") + link("one") + joint("j1", "base", "one", inside=""))
    arm = Arm.from_urdf(file, torque_max=[1], speed_max=[2], position_limits=[(-3, 4)])
    assert (arm.torque_max[0], arm.speed_max[0], arm.position_min[0], arm.position_max[0]) == (1, 2, -3, 4)


def test_massless_frames_and_continuous_joints(tmp_path: Path) -> None:
    file = write(
        tmp_path, GOOD.replace("revolute", "continuous") + link("tip", "") + joint("f", "one", "tip", "fixed", "")
    )
    arm = Arm.from_urdf(file)
    assert arm.tip_link == "tip"
    assert np.isinf([arm.position_min[0], arm.position_max[0]]).all()
    assert arm.model.mass[0] == 1


def test_joints_off_the_chain_are_held_and_merged(tmp_path: Path) -> None:
    file = write(tmp_path, GOOD + link("two") + joint("j2", "one", "two") + link("three") + joint("j3", "one", "three"))
    arm = Arm.from_urdf(file, tip_link="two")
    assert arm.joint_names == ("j1", "j2")
    np.testing.assert_array_equal(arm.model.mass, [2, 1])


@pytest.mark.parametrize(
    "name", ["part.stl", "package://meshes/part.stl", "package://my_arm/meshes/part.stl", "file://{}/meshes/part.stl"]
)
def test_meshes_are_found_scaled_and_hulled(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "urdf"
    (tmp_path / "meshes").mkdir()
    folder.mkdir()
    for place in (folder, tmp_path / "meshes"):
        trimesh.creation.box((0.2, 0.4, 0.6)).export(place / "part.stl")
    mesh = f'<mesh filename="{name.format(tmp_path)}" scale="0.5 1 1"/>'
    arm = Arm.from_urdf(write(folder, GOOD.replace("</link><joint", collision(mesh) + "</link><joint")))
    assert arm.shapes[0].kind == "convex"
    assert arm.shapes[0].vertices is not None
    np.testing.assert_allclose(np.ptp(arm.shapes[0].vertices, axis=0), [0.1, 0.4, 0.6])


def test_flat_and_broken_meshes_are_refused(tmp_path: Path) -> None:
    body = GOOD.replace("</link><joint", collision('<mesh filename="part.stl"/>') + "</link><joint")
    file = write(tmp_path, body)
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(tmp_path / "part.stl")
    with pytest.raises(RobotError, match=r"'one'.*no volume"):
        Arm.from_urdf(file)
    (tmp_path / "part.stl").write_bytes(b"nonsense")
    with pytest.raises(RobotError, match=r"'one'.*part\.stl.*no triangles"):
        Arm.from_urdf(file)
