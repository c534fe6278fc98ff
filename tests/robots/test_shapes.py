"""Shapes: enclosing capsules in closed form, hulls with outward faces, and what is no shape."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.errors import RobotError, UnknownNameError
from armtempo.robots import static_shape
from armtempo.robots._shapes import _spindle, load_mesh, make_shape, pack

size = st.floats(0.01, 1.0)


def pose(seed: int) -> Any:
    generator = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = Rotation.random(rng=generator).as_matrix(), generator.uniform(-1.0, 1.0, 3)
    return T


@given(size, size)
def test_the_least_capsule_about_a_cylinder_touches_its_rim_or_its_side(radius: float, length: float) -> None:
    wide, half = _spindle(radius, length)
    assert radius <= wide <= math.hypot(radius, length / 2) + 1e-12
    if half > 0.0:  # the round end passes through the rim
        assert math.hypot(radius, length / 2 - half) == pytest.approx(wide)
    volume = math.pi * wide**2 * (2 * half + 4 / 3 * wide)
    for other in (radius, math.hypot(radius, length / 2)):  # the narrowest and the shortest
        rest = max(length / 2 - math.sqrt(max(other**2 - radius**2, 0.0)), 0.0)
        assert volume <= math.pi * other**2 * (2 * rest + 4 / 3 * other) * (1 + 1e-12)


@given(size, size, st.integers(0, 100))
def test_a_capsule_and_a_ball_are_their_own_capsules(radius: float, length: float, seed: int) -> None:
    T = pose(seed)
    shape = static_shape("capsule", [radius, length], T_world=T)
    p0, p1, told = shape.capsule
    assert (shape.exact, told) == (True, radius)
    np.testing.assert_allclose([p0, p1], T[:3, 3] + np.outer([-length / 2, length / 2], T[:3, 2]), atol=1e-12)
    ball = static_shape("sphere", [radius], T_world=T)
    np.testing.assert_allclose(ball.capsule[0], ball.capsule[1])
    assert ball.points.shape == (1, 3)


@settings(max_examples=20)
@given(st.integers(0, 1000))
def test_a_hull_holds_its_points_and_its_faces_look_outwards(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-0.5, 0.5, (20, 3))
    shape = static_shape("convex", vertices=points, T_world=pose(seed))
    assert shape.vertices is not None
    assert shape.faces is not None
    corners = shape.vertices[shape.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outside = np.einsum("fi,fpi->fp", normals, points[None] - corners[:, :1])
    assert (outside <= 1e-12).all()
    p0, p1, radius = shape.capsule
    world = points @ shape.T_link_shape[:3, :3].T + shape.T_link_shape[:3, 3]
    along = np.clip((world - p0) @ (p1 - p0) / max(float((p1 - p0) @ (p1 - p0)), 1e-300), 0.0, 1.0)
    assert np.linalg.norm(world - p0 - along[:, None] * (p1 - p0), axis=1).max() <= radius + 1e-12


def test_packed_capsules_are_read_only_and_in_order() -> None:
    shapes = [make_shape("sphere", [0.1 * k], np.eye(4), link=k, link_name=f"link{k}") for k in (1, 2, 3)]
    packed = pack(shapes)
    np.testing.assert_array_equal(packed.link, [1, 2, 3])
    np.testing.assert_allclose(packed.radius, [0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="read-only"):
        packed.p0[0] = 1.0
    assert pack([]).p0.shape == (0, 3)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        ("sphere", [0.0], "a sphere cannot have the size .*give radius in metres"),
        ("box", [1.0, 1.0], "a box cannot have the size .*give x, y, z in metres"),
        ("capsule", [1.0, -0.1], "a capsule cannot have the size"),
        ("cylinder", [1.0, 0.0], "a cylinder cannot have the size"),
        ("sphere", [math.inf], "a sphere cannot have the size"),
        ("sphere", [math.nan], "a sphere cannot have the size"),
        ("convex", [1.0], "a convex cannot have the size"),
    ],
)
def test_sizes_that_no_body_has_are_refused(kind: str, values: list[float], message: str) -> None:
    with pytest.raises(RobotError, match=rf"collision shape of 'pin': {message}"):
        static_shape(kind, values, name="pin")


def test_a_capsule_may_have_no_length_but_three_points_are_no_hull() -> None:
    assert static_shape("capsule", [0.1, 0.0]).points.shape == (1, 3)
    for vertices in (np.eye(3), None):
        with pytest.raises(RobotError, match="collision hull of 'plate': its points span no volume"):
            static_shape("convex", vertices=vertices, name="plate")


def test_other_kinds_and_poses_that_are_none_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="'cone'"):
        static_shape("cone", [1.0, 1.0])
    for T in (np.eye(3), 2.0 * np.eye(4), np.diag([1.0, 1.0, -1.0, 1.0])):
        with pytest.raises(RobotError, match="pose of 'pin' is not a rigid transform"):
            static_shape("sphere", [0.1], T_world=T, name="pin")


CLOUD = np.random.default_rng(0).normal(size=(50, 3))
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("turn", [np.eye(3), Rotation.from_euler("xyz", [0.3, 0.4, 0.5]).as_matrix()])
@pytest.mark.parametrize(
    "points",
    [
        np.outer(np.arange(5), [1.0, 0.0, 0.0]),
        np.full((4, 3), 0.7),
        1e-7 * CLOUD,
        SQUARE,
        1e3 * SQUARE,
        np.vstack([SQUARE, SQUARE]),
        CLOUD * [1.0, 1.0, 0.0],
        CLOUD * [1.0, 1e-8, 1.0],
        CLOUD[:3],
        np.zeros((0, 3)),
    ],
)
def test_points_without_volume_are_no_hull(points: Any, turn: Any) -> None:
    for offset in (0.0, 0.3):
        with pytest.raises(RobotError, match=r"'plate': its points span no volume \(give at least four"):
            static_shape("convex", vertices=points @ turn.T + offset, name="plate")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "points",
    [
        np.where(np.arange(150).reshape(50, 3) == 7, np.nan, CLOUD),
        np.where(np.arange(150).reshape(50, 3) == 7, np.inf, CLOUD),
        1e307 * CLOUD,
        1e5 * CLOUD,
        CLOUD[:, :2],
        CLOUD.ravel(),
        [[1, 2, 3], [4, 5]],
        "points",
    ],
)
def test_points_that_are_none_are_no_hull(points: Any) -> None:
    with pytest.raises(RobotError, match=r"hull of 'plate': the list of its points is not \(any, 3\) finite numbers"):
        static_shape("convex", vertices=points, name="plate")


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 10**6), st.lists(st.floats(-9.0, 3.0), min_size=3, max_size=3))
def test_every_cloud_has_a_finite_hull_or_none(seed: int, magnitude: list[float]) -> None:
    """From nanometres to kilometres, whatever the proportions."""
    points = np.random.default_rng(seed).normal(size=(12, 3)) * 10.0 ** np.array(magnitude)
    points = points @ Rotation.random(rng=seed).as_matrix()
    try:
        shape = static_shape("convex", vertices=points)
    except RobotError as error:
        assert "no volume" in str(error)  # noqa: PT017 - or there is none
        assert min(magnitude) < -4.0
    else:
        assert shape.vertices is not None
        for array in (shape.vertices, shape.points, *shape.capsule):
            assert np.isfinite(array).all()


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 1e308, 1e5, "wide", None])
def test_sizes_are_finite_and_sane(value: Any) -> None:
    for kind, size in (("sphere", [value]), ("box", [1.0, value, 1.0]), ("capsule", [0.1, value])):
        with pytest.raises(RobotError, match=f"a {kind} cannot have the size"):
            static_shape(kind, size)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e308, 1e5])
def test_poses_are_finite_and_sane(value: float) -> None:
    for place in ((0, 3), (1, 1), (3, 3)):
        T = np.eye(4)
        T[place] = value
        with pytest.raises(RobotError, match="pose of 'pin' is not a rigid transform"):
            static_shape("sphere", [0.1], T_world=T, name="pin")
    for other in ("here", [[1, 2], [3]], np.eye(4)[:, :, None]):
        with pytest.raises(RobotError, match="pose of 'pin' is not a rigid transform"):
            static_shape("sphere", [0.1], T_world=other, name="pin")


def test_a_mesh_whose_points_have_two_numbers_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "cut.obj"
    file.write_text("v 0 1\nv 1 0\nv 1 1\nv 0 0\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    with pytest.raises(RobotError, match=r"link 'one': cannot read the mesh .*cut\.obj"):
        load_mesh(file, element="link 'one'")
