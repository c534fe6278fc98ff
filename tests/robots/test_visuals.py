"""What arms look like: visuals as they are, and collision shapes where they cannot be had, with one line each."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
import trimesh

from armtempo.robots import Arm, Visual, read_visuals

BOX = '<box size="0.1 0.2 0.3"/>'
URDF = """<robot name="one"><link name="base">{base}</link><link name="arm">
<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><geometry>{visual}</geometry></visual>
<collision><geometry><sphere radius="0.25"/></geometry></collision></link>
<link name="flange"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="bolt" type="fixed"><parent link="arm"/><child link="flange"/><origin xyz="0 0 1"/></joint></robot>"""


def drawn(folder: Path, visual: str, base: str = "") -> tuple[Visual, ...]:
    """The visuals of an arm with these shapes; files of others go to a folder of their own."""
    file = folder / "robot" / "urdf" / "one.urdf"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(URDF.format(visual=visual, base=base))
    arm = Arm.from_urdf(file)
    (folder / "made").mkdir(exist_ok=True)
    return read_visuals(arm, folder / "made")


@pytest.fixture(autouse=True)
def quiet_until_asked(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "armtempo")


@pytest.mark.parametrize(
    ("element", "kind", "size"),
    [
        (BOX, "box", (0.1, 0.2, 0.3)),
        ('<sphere radius="0.5"/>', "sphere", (0.5,)),
        ('<cylinder radius="0.5" length="2"/>', "cylinder", (0.5, 2.0)),
        ('<capsule radius="0.5" length="2"/>', "capsule", (0.5, 2.0)),
    ],
)
def test_primitives(
    tmp_path: Path, element: str, kind: str, size: tuple[float, ...], caplog: pytest.LogCaptureFixture
) -> None:
    (visual,) = drawn(tmp_path, element)
    assert (visual.link, visual.kind, visual.size) == (0, kind, size)
    np.testing.assert_allclose(visual.T_link_shape[:3, 3], [1.0, 2.0, 3.0])
    np.testing.assert_allclose(visual.T_link_shape[:3, 0], [0.0, 1.0, 0.0], atol=1e-15)
    assert not caplog.records


@pytest.mark.parametrize("scheme", ["package://another_name/meshes", "../meshes", "model://x/meshes"])
@pytest.mark.parametrize("suffix", ["stl", "ply", "glb"])
def test_meshes_are_found_as_the_planner_finds_them(tmp_path: Path, scheme: str, suffix: str) -> None:
    meshes = tmp_path / "robot" / "meshes"
    meshes.mkdir(parents=True)
    trimesh.creation.box((1.0, 2.0, 4.0)).export(meshes / f"body.{suffix}")
    (visual,) = drawn(tmp_path, f'<mesh filename="{scheme}/body.{suffix}" scale="0.1 0.2 0.3"/>')
    assert visual.mesh is not None
    assert visual.mesh.suffix == ".obj"
    np.testing.assert_allclose(trimesh.load_mesh(visual.mesh).extents, [1.0, 2.0, 4.0], rtol=1e-6)
    assert visual.size == (0.1, 0.2, 0.3)


@pytest.mark.parametrize(
    ("element", "said"),
    [
        ('<mesh filename="package://somewhere/absent.stl"/>', "wants the mesh 'package://somewhere/absent.stl'"),
        ('<mesh filename="absent.dae"/>', "wants the mesh 'absent.dae'"),
        ("<mesh/>", "wants the mesh ''"),
        ('<mesh filename="../broken.ply"/>', "cannot read the mesh"),
        ('<mesh filename="../broken.stl"/>', "cannot read the mesh"),
        ('<mesh filename="../broken.dae"/>', "cannot read the mesh"),
        ('<mesh filename="../broken.obj"/>', "cannot read the mesh"),
        ('<mesh filename="../empty.stl"/>', "cannot read the mesh"),
        ('<mesh filename="../far.obj"/>', "cannot read the mesh"),
        ('<mesh filename="../nan.obj"/>', "cannot read the mesh"),
        ("", "has a <visual> without a shape"),
        ('<box size="1 2"/>', "has <visual> <box size='1 2'>: 2 numbers"),
        ('<sphere radius="nan"/>', "has <visual> <sphere radius='nan'>: 'nan' is not finite"),
        ('<sphere radius="-0.05"/>', "has a <visual> <sphere> that is not larger than 0"),
        ("<cone/>", "has a <visual> that is a <cone>"),
    ],
)
def test_what_cannot_be_drawn_is_drawn_as_its_collision_shape(
    tmp_path: Path, element: str, said: str, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "robot").mkdir()
    for suffix in ("ply", "stl", "dae", "obj"):
        (tmp_path / "robot" / f"broken.{suffix}").write_bytes(b"not a mesh")
    (tmp_path / "robot" / "empty.stl").write_bytes(b"")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    (tmp_path / "robot" / "far.obj").write_text(f"{corners}f 1 2 900000\n")  # would end PyBullet's process
    (tmp_path / "robot" / "nan.obj").write_text(f"{corners.replace('1 0 0', 'nan 0 0')}f 1 2 3\n")
    (visual,) = drawn(tmp_path, element)
    assert (visual.link, visual.kind, visual.size) == (0, "sphere", (0.25,))
    (line,) = caplog.messages
    assert said in line
    assert "link 'arm'" in line
    assert line.endswith("its collision shape is drawn instead")
    assert "\n" not in line


def test_a_base_that_cannot_be_drawn_and_has_no_shape_is_not(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    visuals = drawn(tmp_path, BOX, base='<visual><geometry><mesh filename="x.stl"/></geometry></visual>')
    assert [visual.kind for visual in visuals] == ["box"]
    assert caplog.messages[0].endswith("it is not drawn")


def test_an_arm_whose_file_is_gone_is_still_drawn(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    drawn(tmp_path, BOX)
    file = tmp_path / "robot" / "urdf" / "one.urdf"
    arm = Arm.from_urdf(file)
    file.unlink()
    assert [visual.kind for visual in read_visuals(arm, tmp_path)] == ["sphere"]
    assert "drawn from its collision shapes" in caplog.messages[0]
