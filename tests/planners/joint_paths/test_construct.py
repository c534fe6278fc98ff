"""The doors to joint paths: which class answers what is asked, and what is refused before any is tried."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from armtempo.configs import data_path
from armtempo.errors import InputError, PathError, UnknownNameError
from armtempo.planners.blends import BlendedPath
from armtempo.planners.geometry import CartesianPath, Line
from armtempo.planners.joint_paths import CartesianJointPath, JointPath, ScaraPath, TwoLinkPath, WaypointPath
from armtempo.robots import Arm

START, CORNER, END = (np.array([0.45, y, 0.0]) for y in (-0.1, 0.0, 0.1))
LINE = Line(START, END)


@pytest.fixture(scope="module")
def planar(make_arm: Callable[..., Arm]) -> Arm:
    return make_arm()


@pytest.mark.parametrize(
    "cartesian",
    [
        LINE,
        CartesianPath([LINE]),
        BlendedPath([Line(START, CORNER), Line(CORNER, END + np.array([0.02, 0.0, 0.0]))], 0.02),
    ],
    ids=["line", "chain", "blended"],
)
def test_with_an_elbow_two_links_take_their_closed_form_and_with_a_start_the_general_one(
    planar: Arm, cartesian: Line | CartesianPath | BlendedPath
) -> None:
    closed = JointPath.along(cartesian, planar, elbow="negative")
    assert isinstance(closed, TwoLinkPath)
    general = JointPath.along(cartesian, planar, start=closed.evaluate(0.0)[0])
    assert isinstance(general, CartesianJointPath)
    lam = np.linspace(0.0, closed.length, 21)
    assert general.length == pytest.approx(closed.length, rel=1e-12)
    np.testing.assert_allclose(general.evaluate(lam)[0], closed.evaluate(lam)[0], atol=1e-9)


def test_four_joints_with_an_elbow_are_a_scara() -> None:
    arm = Arm.from_urdf(data_path("robots/scara_800.urdf"), name="scara", tip_link="tool")
    home = arm.tip_pose(np.array([0.3, 0.9, *arm.position_min[2:3], 0.0]))[:3, 3]
    path = JointPath.along(Line(home, home + np.array([0.0, 0.05, 0.0])), arm, elbow="positive")
    assert isinstance(path, ScaraPath)


def test_waypoints_in_memory_and_in_a_file_are_the_same_path(planar: Arm, tmp_path: Path) -> None:
    points = [[0.1, 0.2], [0.5, 1.0], [0.4, 1.3]]
    file = tmp_path / "points.csv"
    first, second = planar.joint_names
    file.write_text("\n".join([f"{second},{first}", *(f"{b},{a}" for a, b in points)]))
    path = JointPath.through(points, arm=planar)
    assert isinstance(path, WaypointPath)
    read = JointPath.from_file(file, arm=planar)
    lam = np.linspace(0.0, path.length, 11)
    np.testing.assert_array_equal(read.evaluate(lam)[0], path.evaluate(lam)[0])
    turned = JointPath.from_file(str(file))  # nobody to ask for names: as they stand
    np.testing.assert_array_equal(turned.evaluate(0.0)[0], points[0][::-1])


def test_one_of_elbow_and_start_is_needed_and_not_both(planar: Arm) -> None:
    for options in ({}, {"elbow": "positive", "start": [0.0, 1.0]}):
        with pytest.raises(InputError, match="arm 'planar' needs its elbow or its start posture, one of the two"):
            JointPath.along(LINE, planar, **options)  # type: ignore[arg-type]


def test_closed_forms_are_for_lines_arcs_and_blends_only(planar: Arm) -> None:
    class Own:
        length = 1.0

    with pytest.raises(InputError, match="closed forms are for lines, arcs and blended paths, not for a Own"):
        JointPath.along(Own(), planar, elbow="positive")  # type: ignore[arg-type]


def test_an_elbow_that_is_none_and_a_line_out_of_reach_are_named(planar: Arm) -> None:
    with pytest.raises(UnknownNameError, match="negativ"):
        JointPath.along(LINE, planar, elbow="negativ")  # type: ignore[arg-type]
    with pytest.raises(PathError, match="unreachable at station"):
        JointPath.along(Line(START, START + np.array([1.0, 0.0, 0.0])), planar, elbow="negative")
