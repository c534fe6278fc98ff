"""Paths through waypoints against scipy, finite differences and dense samples; their files; their errors."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import InputError, PathError
from armtempo.planners import JointPath
from armtempo.planners.joint_paths import WaypointPath
from armtempo.robots import Arm


def walk(seed: int, count: int, joints: int) -> Floats:
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, joints)), axis=0)


def planar() -> Arm:
    return Arm.from_urdf(data_path("robots/planar_two_link.urdf"))


@pytest.mark.parametrize("ends", ["natural", "not-a-knot"])
def test_is_scipys_spline_over_the_chord_length(ends: Literal["natural", "not-a-knot"]) -> None:
    points = walk(0, 6, 7)
    path = JointPath.through(points, ends=ends)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert path.length == pytest.approx(chords.sum(), rel=1e-14)
    assert (path.dof, path.unit) == (7, "rad")
    np.testing.assert_allclose(path.breakpoints, np.concatenate([[0.0], np.cumsum(chords)]), atol=1e-12)
    np.testing.assert_allclose(path.evaluate(path.breakpoints)[0], points, atol=1e-12)
    theirs = CubicSpline(path.breakpoints, points, bc_type=ends)
    lam = np.linspace(0.0, path.length, 401).reshape(1, 401)
    for order, ours in enumerate(path.evaluate(lam)):
        assert ours.shape == (1, 401, 7)
        np.testing.assert_allclose(ours, theirs(lam, order), atol=1e-9)
    if ends == "natural":
        np.testing.assert_allclose(path.evaluate([0.0, path.length])[2], 0.0, atol=1e-10)


@given(seed=st.integers(0, 10**6), count=st.integers(2, 9), centripetal=st.booleans())
@settings(max_examples=40, deadline=None)
def test_smooth_and_bounded(seed: int, count: int, centripetal: bool) -> None:
    path = JointPath.through(walk(seed, count, 3), spacing="centripetal" if centripetal else "chord")
    lam = np.random.default_rng(seed).uniform(1e-4, path.length - 1e-4, 60)
    h = 1e-5
    _, dq, ddq = path.evaluate(lam)
    (before, slow, _), (after, fast, _) = path.evaluate(lam - h), path.evaluate(lam + h)
    scale = 1.0 + np.abs(ddq).max()
    np.testing.assert_allclose((after - before) / (2 * h), dq, atol=1e-6 * scale)
    np.testing.assert_allclose((fast - slow) / (2 * h), ddq, atol=1e-2 * scale)
    knots = path.breakpoints[1:-1]
    for one, other in zip(path.evaluate(knots - 1e-9), path.evaluate(knots + 1e-9), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5 * scale)

    low = np.sort(np.random.default_rng(seed + 1).uniform(0, path.length, (2, 30)), axis=0)
    bound = path.speed_bound(low[0], low[1])
    assert bound.shape == (30, 3)
    dense = np.abs(path.evaluate(np.linspace(low[0], low[1], 2001))[1]).max(axis=0)
    assert (bound >= dense).all()
    np.testing.assert_allclose(bound, dense, rtol=1e-4, atol=1e-4)  # and it is the maximum, not more
    lam = low[0]
    np.testing.assert_allclose(path.speed_bound(lam, lam), np.abs(path.evaluate(lam)[1]), atol=1e-9)


def test_two_waypoints_are_a_line_at_unit_speed() -> None:
    for path in (JointPath.through([[0, 0], [3, 4]]), JointPath.through([[0, 0], [3, 4]], ends="not-a-knot")):
        _, dq, ddq = path.evaluate(np.linspace(0.0, 5.0, 11))
        np.testing.assert_allclose(dq, np.tile([0.6, 0.8], (11, 1)), atol=1e-14)
        np.testing.assert_allclose(ddq, 0.0, atol=1e-14)
        np.testing.assert_allclose(path.speed_bound(1.0, 2.0), [0.6, 0.8], atol=1e-9)


def test_tables_reproduce_the_path() -> None:
    from armtempo.planners.joint_paths.kernels import path_point

    path = JointPath.through(walk(3, 5, 4))
    table = path.table(64)
    q = np.empty(4)
    for lam in np.linspace(0.0, path.length, 57):
        path_point(table, float(lam), q)
        np.testing.assert_allclose(q, path.evaluate(lam)[0], atol=1e-12)


def test_limits_hold_all_along_the_spline() -> None:
    points = np.array([[0.0, 0.0], [1.0, 1.0], [1.1, 0.0], [2.0, 0.0]])
    free = JointPath.through(points)
    dense = free.evaluate(np.linspace(0, free.length, 200_001))[0][:, 0]
    peak = float(free.evaluate(np.linspace(0, free.length, 200_001))[0][:, 1].max())
    assert peak > 1.0 + 1e-3  # it swings out between waypoints
    assert dense.max() <= 2.0 + 1e-9
    urdf = data_path("robots/planar_two_link.urdf")
    JointPath.through(points, arm=Arm.from_urdf(urdf, position_limits=[(-3, 3), (-3, peak + 1e-8)]))
    with pytest.raises(PathError, match=r"joint 'joint_2' reaches .* between two waypoints") as caught:
        JointPath.through(points, arm=Arm.from_urdf(urdf, position_limits=[(-3, 3), (-3, peak - 1e-4)]))
    data = caught.value.data
    assert data["joint"] == 1
    assert data["value"] == pytest.approx(peak, abs=1e-9)
    assert data["limit"] == pytest.approx(peak - 1e-4)
    assert free.evaluate(data["station"])[0][1] == pytest.approx(peak, abs=1e-9)
    with pytest.raises(
        PathError, match=r"joint 'joint_1' reaches 2 at station .* rad, at a waypoint; its limit is 1.5"
    ):
        JointPath.through(points, arm=Arm.from_urdf(urdf, position_limits=[(-3, 1.5), (-3, 3)]))


@pytest.mark.parametrize(
    ("waypoints", "error", "words"),
    [
        ([[0.0, 0.0]], InputError, "at least 2 waypoints, got 1"),
        ([0.0, 1.0], InputError, r"shape \(2,\)"),
        ([[0.0, 0.0], [1.0]], InputError, "no table of numbers"),
        ([["a", 0.0], [1.0, 2.0]], InputError, "no table of numbers"),
        ([[0.0, 0.0], [np.nan, 1.0]], InputError, "waypoint 1 is not finite at joint 0"),
        ([[0.0], [1.0]], InputError, "1 joint positions each, arm 'planar_two_link' has 2"),
        ([[0.0, 0.0], [1.0, 0.5], [1.0, 0.5], [2.0, 0.0]], PathError, "waypoints 1 and 2 are the same: 1, 0.5"),
    ],
)
def test_bad_waypoints_are_named(waypoints: object, error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        JointPath.through(waypoints, arm=planar())  # type: ignore[arg-type]


def test_unknown_options_are_named() -> None:
    with pytest.raises(InputError, match="natural or not-a-knot"):
        JointPath.through([[0.0], [1.0]], ends="clamped")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="chord or centripetal"):
        JointPath.through([[0.0], [1.0]], spacing="uniform")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.csv", "0, 0.5\n1, 0.25\n\n2, -0.125\n"),
        ("a.csv", "# recorded\njoint_2,time,joint_1\n0.5,0,0\n0.25,1,1\n-0.125,2,2\n"),
        ("a.CSV", "\ufeffjoint_1,joint_2\r\n0,0.5\r\n1,0.25\r\n2,-0.125\r\n"),
        ("a.json", "[[0, 0.5], [1, 0.25], [2, -0.125]]"),
        ("a.json", '{"joints": ["joint_2", "joint_1"], "waypoints_rad": [[0.5, 0], [0.25, 1], [-0.125, 2]]}'),
        ("a.json", '{"waypoints_rad": [[0, 0.5], [1, 0.25], [2, -0.125]]}'),
    ],
)
def test_files_hold_waypoints(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    path = JointPath.from_file(tmp_path / name, arm=planar())
    assert isinstance(path, WaypointPath)
    np.testing.assert_array_equal(path.waypoints, [[0, 0.5], [1, 0.25], [2, -0.125]])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "0,1\n1,x\n", ["a.csv, line 2", "'x' is no number"]),
        ("a.csv", "0,1\n1\n", ["a.csv, line 2", "has 1 numbers", "give 2"]),
        ("a.csv", "joint_1,joint_3\n0,1\n1,2\n", ["no column for joint 'joint_2'", "did you mean 'joint_"]),
        ("a.csv", "joint_1,joint_1,joint_2\n0,1,2\n", ["joint 'joint_1' has 2 columns"]),
        ("a.csv", "joint_1,3\n0,1\n", ["line 1", "mixes names and numbers"]),
        ("a.csv", "\n", ["holds no waypoints"]),
        ("a.csv", "0,1\nnan,1\n", ["a.csv, line 2", "[nan, 1.0] are no joint positions"]),
        ("a.json", "[[0, 1],\n [1, 2]", ["a.json, line 2", "not JSON"]),
        ("a.json", '[[0, 1], [1, "2"]]', ["waypoint 1", "no list of numbers"]),
        ("a.json", "[[0, 1], [1]]", ["waypoint 1", "has 1 numbers"]),
        ("a.json", '{"waypoints": []}', ["unknown key 'waypoints'", "waypoints_rad"]),
        ("a.json", "3", ["no list of waypoints"]),
        ("a.txt", "", [".csv and .json, not .txt"]),
    ],
)
def test_bad_files_are_named(name: str, text: str, words: list[str], tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        JointPath.from_file(tmp_path / name, arm=planar())
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: cannot be read: no such file"):
        JointPath.from_file(tmp_path / "none.csv")


def test_files_keep_every_digit(tmp_path: Path) -> None:
    points = walk(1, 5, 3)
    (tmp_path / "a.json").write_text(json.dumps(points.tolist()))
    path = JointPath.from_file(tmp_path / "a.json")
    assert isinstance(path, WaypointPath)
    np.testing.assert_array_equal(path.waypoints, points)
