"""Every number of a URDF, wherever it stands: a bad one is told by its place, a good one gives a finite arm."""

from __future__ import annotations

import logging
import re
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armtempo.configs import data_path
from armtempo.errors import RobotError
from armtempo.robots import Arm
from armtempo.robots._urdf_numbers import RULES

BUNDLED = ("planar_two_link", "puma560", "puma560_chung", "scara_800", "ur5e_like")
BAD = (
    "nan",
    "inf",
    "-inf",
    "1e308",
    "",
    "1 2",
    "1 2 3 4",
    "0x10",
    "1,2,3",
    "1_0",
    "one",
    "NaN 0 0",
    "0 1e300 0",
    "9" * 400,
)
LEGAL_SOMEWHERE = ("1", "1 2 3", "-1", "0", "0 0 0", "-0.5 1e-3 +2.")


@cache
def source(robot: str) -> str:
    return data_path(f"robots/{robot}.urdf").read_text()


def places(root: ET.Element) -> list[tuple[str, ET.Element, str]]:
    """Owner, element and name of every attribute that holds numbers."""
    return [
        (f"{owner.tag} {owner.get('name')!r}", element, name)
        for owner in root
        if owner.tag in ("link", "joint")
        for child in owner
        if child.tag != "visual"
        for element in child.iter()
        for name in element.attrib
        if name in RULES.get(element.tag, {})
    ]


def finite(arm: Arm) -> bool:
    arrays: list[Any] = [*arm.model, arm.T_link_tip, arm.torque_max, arm.speed_max, arm.damping, arm.coulomb]
    for shape in arm.shapes:
        arrays += [shape.T_link_shape, shape.size, shape.points, *shape.capsule]
    return all(np.isfinite(np.asarray(array, dtype=np.float64)).all() for array in arrays)


def load(folder: Path, root: ET.Element) -> Arm:
    file = folder / "arm.urdf"
    file.write_text(ET.tostring(root, encoding="unicode"))
    return Arm.from_urdf(file)


@pytest.mark.parametrize("robot", BUNDLED)
def test_all_numbers_of_the_bundled_robots_are_looked_at(robot: str) -> None:
    root = ET.fromstring(source(robot))
    held = {
        (element.tag, name)
        for owner in root
        if owner.tag in ("link", "joint")
        for child in owner
        if child.tag != "visual"
        for element in child.iter()
        for name, value in element.attrib.items()
        if re.fullmatch(r"[-+.\deE ]+", value)
    }
    assert held == {(element.tag, name) for _, element, name in places(root)}


def test_a_bad_number_anywhere_is_told_by_its_place(tmp_path: Path) -> None:
    count = len(places(ET.fromstring(source("planar_two_link"))))
    assert count > 40
    for k in range(count):
        for bad in BAD:
            root = ET.fromstring(source("planar_two_link"))
            owner, element, name = places(root)[k]
            element.set(name, bad)
            with pytest.raises(RobotError) as caught:
                load(tmp_path, root)
            message = str(caught.value)
            words = [f"{tmp_path / 'arm.urdf'}: {owner} has", f"<{element.tag} {name}=", "finite number"]
            assert all(word in message for word in words), message
            assert len(message) < 400
            assert caught.value.data["element"] == owner


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(BUNDLED), st.data())
def test_any_text_anywhere_is_refused_or_gives_a_finite_arm(tmp_path: Path, robot: str, data: st.DataObject) -> None:
    root = ET.fromstring(source(robot))
    for _ in range(data.draw(st.integers(1, 3))):
        _, element, name = data.draw(st.sampled_from(places(root)))
        number = st.floats().map(repr) | st.integers().map(str)
        text = data.draw(st.sampled_from(BAD + LEGAL_SOMEWHERE) | st.lists(number, max_size=4).map(" ".join))
        element.set(name, text)
    try:
        arm = load(tmp_path, root)
    except RobotError as error:
        assert str(tmp_path / "arm.urdf") in str(error)  # noqa: PT017 - or there is none
    else:
        assert finite(arm)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(BUNDLED), st.data())
def test_a_number_that_urdf_asks_for_may_not_be_left_out(tmp_path: Path, robot: str, data: st.DataObject) -> None:
    root = ET.fromstring(source(robot))
    owner, element, name = data.draw(st.sampled_from(places(root)))
    del element.attrib[name]
    needed = RULES[element.tag][name].needed
    try:
        arm = load(tmp_path, root)
    except RobotError as error:
        if needed:
            assert f"{owner} has" in str(error)  # noqa: PT017
            assert f"without {name}" in str(error)  # noqa: PT017
    else:
        assert not needed
        assert finite(arm)


LINK = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-1" upper="1" effort="2" velocity="3"/>'


def write(folder: Path, *, base: str = "", moving: str = "", joint: str = LIMIT, axis: str = "0 0 1") -> Path:
    file = folder / "arm.urdf"
    file.write_text(
        f'<robot name="r"><link name="base">{base}</link><link name="one">{LINK}{moving}</link>'
        f'<joint name="j1" type="revolute"><parent link="base"/><child link="one"/><axis xyz="{axis}"/>{joint}</joint>'
        "</robot>"
    )
    return file


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"joint": '<origin xyz="0.37"/>' + LIMIT}, "joint 'j1' has <origin xyz='0.37'>: 1 number (give 3 finite"),
        ({"joint": '<origin rpy="0 nan 0"/>' + LIMIT}, "joint 'j1' has <origin rpy='0 nan 0'>: 'nan' is not finite"),
        ({"axis": "1"}, "joint 'j1' has <axis xyz='1'>: 1 number"),
        (
            {"moving": '<collision><origin xyz="0 1e308 0"/><geometry><sphere radius="1"/></geometry></collision>'},
            "link 'one' has <collision> <origin xyz='0 1e308 0'>: '1e308' is beyond 10000 (give 3 finite",
        ),
        (
            {"moving": '<collision><geometry><box size="1 2"/></geometry></collision>'},
            "link 'one' has <collision> <box size='1 2'>: 2 numbers",
        ),
        (
            {"moving": '<collision><geometry><cylinder radius="1"/></geometry></collision>'},
            "link 'one' has a <collision> <cylinder> without length",
        ),
        (
            {"moving": '<collision><geometry><mesh filename="a.stl" scale="0.001 0.001"/></geometry></collision>'},
            "<mesh scale='0.001 0.001'>: 2 numbers (give 1 or 3 finite numbers",
        ),
        (
            {"moving": '<collision><geometry><mesh filename="a.stl" scale="1 0 1"/></geometry></collision>'},
            "<mesh scale='1 0 1'>: a scale of 0 leaves nothing of the mesh",
        ),
        ({"joint": LIMIT + '<mimic joint="j2" multiplier="nan"/>'}, "joint 'j1' has <mimic multiplier='nan'>"),
        ({"joint": LIMIT + '<dynamics damping="1e300"/>'}, "<dynamics damping='1e300'>: '1e300' is beyond 1e+12"),
        ({"joint": LIMIT.replace('"2"', '"inf"')}, "joint 'j1' has <limit effort='inf'>: 'inf' is not finite"),
        ({"joint": LIMIT + '<safety_controller k_velocity="x"/>'}, "<safety_controller k_velocity='x'>"),
        ({"joint": '<limit effort="2" velocity="3" acceleration="0"/>'}, "joint 'j1' has acceleration=0 (give a limit"),
    ],
)  # fmt: skip
def test_messages(tmp_path: Path, parts: dict[str, str], message: str) -> None:
    file = write(tmp_path, **parts)
    with pytest.raises(RobotError) as caught:
        Arm.from_urdf(file)
    assert str(caught.value).startswith(f"{file}: ")
    assert message in str(caught.value)


@pytest.mark.parametrize("end", ["parent", "child"])
def test_a_joint_says_what_it_joins(tmp_path: Path, end: str) -> None:
    file = write(tmp_path)
    text = file.read_text()
    for other in (f"<{end}/>", ""):
        file.write_text(re.sub(rf"<{end} link=[^>]*>", other, text))
        with pytest.raises(RobotError, match=rf"joint 'j1' has no <{end} link=\.\.\.>"):
            Arm.from_urdf(file)


@pytest.mark.parametrize(
    "dummy",
    [
        '<box size="0 0 0"/>',
        '<sphere radius="0"/>',
        '<cylinder radius="0" length="0.0"/>',
        '<capsule radius="0" length="0"/>',
    ],
)
def test_a_body_without_size_collides_with_nothing(
    tmp_path: Path, dummy: str, caplog: pytest.LogCaptureFixture
) -> None:
    bodies = f"<collision><geometry>{dummy}</geometry></collision>"
    bodies += '<collision><geometry><capsule radius="0.1" length="0.3"/></geometry></collision>'
    arm = Arm.from_urdf(write(tmp_path, base=bodies))
    assert [(shape.kind, shape.size) for shape in arm.shapes] == [("capsule", (0.1, 0.3))]
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert "link 'base' has a collision" in record.getMessage()
    assert "without any size: left out" in record.getMessage()


@pytest.mark.parametrize(
    "half",
    [
        '<box size="0 1 1"/>',
        '<box size="1 1 -1"/>',
        '<cylinder radius="0" length="1"/>',
        '<cylinder radius="1" length="0"/>',
    ],
)
def test_a_body_with_some_of_its_sizes_is_refused(tmp_path: Path, half: str) -> None:
    with pytest.raises(RobotError, match="cannot have the size"):
        Arm.from_urdf(write(tmp_path, base=f"<collision><geometry>{half}</geometry></collision>"))


def test_acceleration_limits_of_urdf_1_2_are_kept(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    file = write(tmp_path, joint=LIMIT.replace("/>", ' acceleration="3"/>'))
    assert Arm.from_urdf(file).acceleration_max.tolist() == [3.0]
    assert Arm.from_urdf(file, acceleration_max=[None]).acceleration_max.tolist() == [3.0]
    assert Arm.from_urdf(file, acceleration_max=[2.0]).acceleration_max.tolist() == [2.0]
    assert Arm.from_urdf(write(tmp_path)).acceleration_max.tolist() == [np.inf]
    assert not caplog.records


@pytest.mark.parametrize(
    ("limits", "acceleration", "jerk"),
    [
        ('acceleration="3" deceleration="4"', 3.0, np.inf),
        ('acceleration="3" deceleration="2"', 2.0, np.inf),
        ('deceleration="2.5"', 2.5, np.inf),
        ('jerk="9"', np.inf, 9.0),
        ('jerk="9" deceleration="5" acceleration="6"', 5.0, 9.0),
    ],
)
def test_one_limit_for_both_directions_is_the_smaller_one_and_jerk_limits_are_kept(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, limits: str, acceleration: float, jerk: float
) -> None:
    file = write(tmp_path, joint=LIMIT.replace("/>", f" {limits}/>"))
    arm = Arm.from_urdf(file)
    assert (arm.acceleration_max.tolist(), arm.jerk_max.tolist()) == ([acceleration], [jerk])
    given = Arm.from_urdf(file, jerk_max=[50.0], acceleration_max=[7.0])
    assert (given.acceleration_max.tolist(), given.jerk_max.tolist()) == ([7.0], [50.0])
    assert not caplog.records


def box(folder: Path, scale: str, file: str = "part.stl") -> Path:
    return write(folder, base=f'<collision><geometry><mesh filename="{file}" scale="{scale}"/></geometry></collision>')


def test_meshes_that_look_like_millimetres_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    trimesh.creation.box((200.0, 400.0, 600.0)).export(tmp_path / "part.stl")
    Arm.from_urdf(box(tmp_path, "0.001 0.001 0.001"))
    assert not caplog.records
    Arm.from_urdf(box(tmp_path, "1 1 1"))
    (record,) = caplog.records
    for words in ("'part.stl' of link 'base' is 600 m long", "millimetres", 'scale="0.001 0.001 0.001"'):
        assert words in record.getMessage()


def test_a_scale_may_be_one_number_or_mirror(tmp_path: Path) -> None:
    wedge = trimesh.creation.box((2.0, 4.0, 6.0)).vertices[:6] + 1.0
    trimesh.convex.convex_hull(wedge).export(tmp_path / "part.stl")
    sizes = {}
    for scale in ("0.1", "0.1 0.1 0.1", "0.1 -0.1 0.1"):
        (shape,) = Arm.from_urdf(box(tmp_path, scale)).shapes
        assert shape.vertices is not None
        sizes[scale] = np.sort(shape.vertices, axis=0)
        assert np.ptp(shape.vertices, axis=0).tolist() == pytest.approx([0.2, 0.4, 0.6], rel=1e-6)
    np.testing.assert_array_equal(sizes["0.1"], sizes["0.1 0.1 0.1"])
    np.testing.assert_allclose(sizes["0.1 -0.1 0.1"][:, 1], -sizes["0.1"][::-1, 1])


def test_robots_of_pybullet_load_as_before() -> None:
    panda = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    arm = Arm.from_urdf(panda, tip_link="panda_grasptarget", unphysical_inertia="point-mass")
    assert arm.dof == 7
    assert finite(arm)
