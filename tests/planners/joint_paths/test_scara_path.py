"""The closed-form joint path of a SCARA: the paper's figures, the path to rounding, derivatives, bounds, refusals."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from armtempo.configs import LimitsConfig, data_path
from armtempo.errors import InfeasibleError, PathError, UnknownNameError
from armtempo.planners import Arc, BlendCell, BlendedPath, CartesianPath, Line, build_cell
from armtempo.planners.joint_paths import ScaraPath
from armtempo.robots import Arm

Elbow = Literal["positive", "negative"]
ELBOWS: tuple[Elbow, ...] = ("positive", "negative")
TEXT = data_path("robots/scara_800.urdf").read_text()
WIDE = [(-7.0, 7.0), (-3.1, 3.1), (-0.2, 0.1), (-9.0, 9.0)]


def written(folder: Path, *changes: tuple[str, str]) -> Arm:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    file = folder / "scara.urdf"
    file.write_text(text)
    return Arm.from_urdf(file, name="scara", tip_link="tool", position_limits=WIDE)


def scara(**options: object) -> Arm:
    return Arm.from_urdf(data_path("robots/scara_800.urdf"), name="scara", tip_link="tool", **options)  # type: ignore[arg-type]


def straight(*points: tuple[float, float, float]) -> CartesianPath:
    a, b = (np.array(point) for point in points)
    return CartesianPath([Line(a, b)])


def test_drives_must_hold_the_arm_at_rest(lee2006: BlendCell) -> None:
    weak = lee2006.config.arm.model_copy(update={"limits": LimitsConfig(torque_nm=(None, None, 10.0, None))})
    words = r"arm.path: arm 'scara' cannot hold still at station .* m: joint '\w+' needs .* N, its limit is 10 N"
    with pytest.raises(InfeasibleError, match=words) as caught:
        build_cell(lee2006.config.model_copy(update={"arm": weak}))
    assert caught.value.data["joint"] == 2


def test_an_elbow_is_positive_or_negative(lee2006: BlendCell) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown elbow 'Positive' \(did you mean 'positive'"):
        ScaraPath(lee2006.arm, lee2006.blended, "Positive")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("elbow", "speeds", "accelerations"),
    [("positive", (3.42, 3.83), (91, 111)), ("negative", (3.47, 3.83), (66, 111))],
)
def test_joint_peaks_of_the_papers_run(
    lee2006: BlendCell, elbow: Elbow, speeds: tuple[float, float], accelerations: tuple[float, float]
) -> None:
    """ik_blend 1.4; the mirrored arm swaps the shoulder with the wrist, which turns as the forearm must not."""
    profile = lee2006.line_speed
    s, v, a, _ = (row[:, None] for row in profile.at(np.linspace(0.0, profile.duration, 40001)))
    _, dq, ddq = ScaraPath(lee2006.arm, lee2006.blended, elbow).evaluate(s[:, 0])
    np.testing.assert_allclose(np.abs(dq * v)[:, :2].max(axis=0), speeds, atol=0.005)
    peak = np.abs(ddq * v**2 + dq * a)[:, :2].max(axis=0)
    np.testing.assert_array_equal(np.floor(peak), accelerations)


@pytest.mark.parametrize("elbow", ELBOWS)
@pytest.mark.parametrize("turned", [False, True])
def test_the_tip_follows_the_path_and_the_derivatives_are_exact(lee2006: BlendCell, elbow: Elbow, turned: bool) -> None:
    ends = np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, math.sin(0.6), math.cos(0.6)]])  # 1.2 rad about z
    blended = BlendedPath(lee2006.segments, 0.15, curve="quintic", orientation=ends if turned else None)
    path = ScaraPath(scara(position_limits=WIDE), blended, elbow)
    lam = np.linspace(0.0, path.length, 1501)
    q, dq, ddq = path.evaluate(lam)
    pose = path.arm.tip_pose(q)
    np.testing.assert_allclose(pose[:, :3, 3], blended.position(lam), atol=1e-12)
    yaw = (1.2 if turned else 0.0) * lam / path.length
    yaw += math.atan2(pose[0, 1, 0], pose[0, 0, 0])
    np.testing.assert_allclose(pose[:, 0, 0], np.cos(yaw), atol=1e-12)
    np.testing.assert_allclose(pose[:, 1, 0], np.sin(yaw), atol=1e-12)
    np.testing.assert_allclose(path.inverse(blended.position(lam), lam), q, atol=1e-12)
    h = 1e-6
    inner = lam[np.abs(lam[:, None] - path.breakpoints).min(axis=1) > 1e-3]
    (q1, dq1, _), (q0, dq0, _), (_, dq, ddq) = (path.evaluate(inner + shift) for shift in (h, -h, 0.0))
    np.testing.assert_allclose(dq, (q1 - q0) / (2 * h), atol=1e-8 * (1 + np.abs(dq).max()))
    np.testing.assert_allclose(ddq, (dq1 - dq0) / (2 * h), atol=1e-8 * (1 + np.abs(ddq).max()))


def test_axes_that_point_the_other_way_and_a_wrist_before_the_slide(tmp_path: Path) -> None:
    blended = BlendedPath.through([(0.7, 0, 0.05), (0.3, 0.1, 0.02), (0.2, 0.5, 0.1)], 0.1)
    arms = [written(tmp_path)]
    for joint in ("joint_2", "joint_z", "joint_wrist"):
        at = TEXT.index(f'<joint name="{joint}"')
        flipped = TEXT[:at] + TEXT[at:].replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 -1"/>', 1)
        file = tmp_path / f"{joint}.urdf"
        file.write_text(flipped.replace('lower="-0.2" upper="0"', 'lower="-0.2" upper="0.2"'))
        arms.append(Arm.from_urdf(file, tip_link="tool", position_limits=[*WIDE[:2], (-0.2, 0.2), WIDE[3]]))
    swapped = TEXT.replace('"joint_z" type="prismatic"', '"joint_z" type="revolute"').replace(
        '"joint_wrist" type="revolute"', '"joint_wrist" type="prismatic"'
    )
    file = tmp_path / "swapped.urdf"
    file.write_text(swapped)
    arms.append(Arm.from_urdf(file, tip_link="tool", position_limits=[*WIDE[:2], WIDE[3], (-0.3, 0.3)]))
    lam = np.linspace(0.0, blended.length, 300)
    for arm in arms:
        for elbow in ELBOWS:
            path = ScaraPath(arm, blended, elbow)
            pose = arm.tip_pose(path.evaluate(lam)[0])
            np.testing.assert_allclose(pose[:, :3, 3], blended.position(lam), atol=1e-12)
            np.testing.assert_allclose(pose[:, :3, :3], np.broadcast_to(pose[0, :3, :3], (300, 3, 3)), atol=1e-12)


@pytest.mark.parametrize("elbow", ELBOWS)
def test_the_speed_bound_is_one(lee2006: BlendCell, elbow: Elbow) -> None:
    path = ScaraPath(lee2006.arm, lee2006.blended, elbow)
    ends = np.sort(np.random.default_rng(0).uniform(0.0, path.length, (300, 2)), axis=1)
    ends[150:, 1] = np.minimum(ends[150:, 0] + 0.01, path.length)
    bound = path.speed_bound(ends[:, 0], ends[:, 1])
    lam = ends[:, :1] + np.linspace(0.0, 1.0, 60) * (ends[:, 1:] - ends[:, :1])
    speed = np.abs(path.evaluate(lam)[1]).max(axis=1)
    assert (bound >= speed * (1 - 1e-12)).all()
    assert (bound[150:] <= 6.0 * speed[150:].max(axis=1, keepdims=True)).all()  # and not a wild one


REFUSED = {
    "far": (straight((0.5, 0, 0.05), (0.9, 0, 0.05)), r"unreachable at station 0.4 m: 0.9 m from its base, too far"),
    "stretched": (straight((0.5, 0, 0.05), (0.8, 0, 0.05)), r"singular at station 0.3 m: the arm is stretched"),
    "folded": (straight((0.3, 0, 0.05), (-0.3, 0, 0.05)), r"singular at station 0.3\d* m: the arm is folded"),
    "high": (straight((0.5, 0, 0.05), (0.5, 0.1, 0.3)), r"limit of joint 'joint_z' at station 0.2\d* m.*0.15 m is"),
    "elbow": (straight((0.5, 0, 0.05), (0.1, 0.1, 0.05)), r"limit of joint 'joint_2' at station .* rad is outside"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_paths_that_the_arm_cannot_follow_are_refused_with_the_station(case: str) -> None:
    cartesian, message = REFUSED[case]
    with pytest.raises(PathError, match=message) as refusal:
        ScaraPath(scara(), cartesian, "positive")
    assert refusal.value.remedy
    assert "'scara'" in str(refusal.value)
    assert isinstance(refusal.value.data["station"], float)


def test_orientations_that_the_wrist_cannot_turn_to_are_refused() -> None:
    tilted = BlendedPath.through(
        [(0.7, 0, 0.05), (0.3, 0.1, 0.05)], orientation=np.array([[0.0, 0, 0, 1], [math.sin(0.2), 0, 0, math.cos(0.2)]])
    )
    with pytest.raises(PathError, match=r"turns the tool about \[0.4, 0.0, 0.0\].*only"):
        ScaraPath(scara(), tilted, "positive")


def test_arms_that_are_no_scara_are_refused(tmp_path: Path) -> None:
    arc = CartesianPath([Arc(np.array([0.4, 0.35, 0]), np.array([0.4, 0.05, 0]), np.array([0.25, 0.2, 0]))])
    with pytest.raises(PathError, match=r"no SCARA: its joints are turn, turn \(use"):
        ScaraPath(Arm.from_urdf(data_path("robots/planar_two_link.urdf")), arc, "positive")
    at = TEXT.index('<joint name="joint_wrist"')
    tilted = written(tmp_path, (TEXT[at:], TEXT[at:].replace('<axis xyz="0 0 1"/>', '<axis xyz="1 0 0"/>', 1)))
    with pytest.raises(PathError, match=r"axis of joint 'joint_wrist' is not parallel"):
        ScaraPath(tilted, arc, "positive")
    off = written(tmp_path, ('<origin xyz="0 0 -0.06"/>', '<origin xyz="0.05 0 -0.06"/>'))
    with pytest.raises(PathError, match=r"0.05 m off the axis of its wrist"):
        ScaraPath(off, arc, "positive")


@pytest.mark.parametrize(
    ("spike", "complaint"),
    [((0.8001, 0.0, 0.05), "unreachable"), ((0.5, 0.01, 0.1508), "breaks the limit of joint 'joint_z'")],
)
def test_a_spike_between_even_samples_is_seen(spike: tuple[float, float, float], complaint: str) -> None:
    """37 m of path, of which a few millimetres are out of reach or beyond the slide's range."""
    points = [(0.45 + 0.02 * (i % 3), 0.3 if i % 2 else -0.3, 0.05) for i in range(60)]
    path = BlendedPath.through([*points, (0.5, 0.05, 0.05), spike, (0.5, -0.02, 0.05)], tolerance=1e-6)
    with pytest.raises(PathError, match=complaint):
        ScaraPath(scara(), path, "positive")
