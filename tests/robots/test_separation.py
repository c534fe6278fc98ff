"""Bounds of the distance of convex shapes against coal, closed forms and each other."""

from __future__ import annotations

import importlib
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.robots import Shape, pack_bodies, separation, static_shape

coal: Any = importlib.import_module("coal")  # without types of its own

KINDS = {"capsule": 2, "sphere": 1, "box": 3, "cylinder": 2, "convex": 0}


def random_pose(generator: np.random.Generator, reach: float) -> Floats:
    T = np.eye(4)
    T[:3, :3] = Rotation.random(rng=generator).as_matrix()
    T[:3, 3] = generator.uniform(-reach, reach, 3)
    return T


def random_shape(generator: np.random.Generator, kind: str) -> Shape:
    vertices = generator.normal(size=(40, 3)) * generator.uniform(0.02, 0.2, 3) if kind == "convex" else None
    size = generator.uniform(0.02, 0.3, KINDS[kind])
    return static_shape(kind, list(size), T_world=random_pose(generator, 0.2), vertices=vertices)


def ask(a: Shape, T_a: Floats, b: Shape, T_b: Floats, far: float = math.inf, near: float = math.nan) -> Floats:
    bodies = pack_bodies([a, b])
    return np.array(separation(bodies, 0, T_a, bodies, 1, T_b, far, near, np.zeros(3), np.empty((4, 3))))


def coal_shape(shape: Shape) -> Any:
    if shape.vertices is None:
        name = {"capsule": "Capsule", "sphere": "Sphere", "box": "Box", "cylinder": "Cylinder"}[shape.kind]
        return getattr(coal, name)(*shape.size)
    points = coal.StdVec_Vec3s()
    for vertex in shape.vertices:
        points.append(vertex)
    return coal.Convex.convexHull(points, True, "Qt")


@example(seed=864, one="cylinder", other="cylinder")
@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), one=st.sampled_from(sorted(KINDS)), other=st.sampled_from(sorted(KINDS)))
def test_the_bounds_hold_coals_distance_and_meet(seed: int, one: str, other: str) -> None:
    generator = np.random.default_rng(seed)
    a, b = random_shape(generator, one), random_shape(generator, other)
    T_a, T_b = random_pose(generator, 0.4), random_pose(generator, 0.4)
    low, high = ask(a, T_a, b, T_b)
    assert low <= high + 1e-8  # rounding of a cylinder's rim seen along its axis
    frames = [coal.Transform3s(T[:3, :3].copy(), T[:3, 3].copy()) for T in (T_a @ a.T_link_shape, T_b @ b.T_link_shape)]
    theirs = coal.distance(
        coal_shape(a), frames[0], coal_shape(b), frames[1], coal.DistanceRequest(), coal.DistanceResult()
    )
    if high > 1e-6:
        assert high - low < 2e-7
        assert theirs == pytest.approx(high, abs=5e-6)  # coal's GJK of cylinders stops at some 1e-6
    else:
        assert theirs < 5e-6


@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), one=st.sampled_from(sorted(KINDS)), other=st.sampled_from(sorted(KINDS)))
def test_an_early_answer_is_the_full_answer(seed: int, one: str, other: str) -> None:
    """Bounds hold whenever the search stops, and whatever direction it starts from."""
    generator = np.random.default_rng(seed)
    shapes = [random_shape(generator, one), random_shape(generator, other)]
    T_a, T_b = random_pose(generator, 0.4), random_pose(generator, 0.4)
    low, high = ask(shapes[0], T_a, shapes[1], T_b)
    bodies = pack_bodies(shapes)
    for far, near in ((0.1, 0.05), (0.02, 0.01), (0.3, -0.3), (high + 0.01, high - 0.01)):
        guess = generator.normal(size=3)
        some = separation(bodies, 0, T_a, bodies, 1, T_b, far, near, guess, np.empty((4, 3)))
        assert some[0] <= high + 1e-8
        assert some[1] >= low - 1e-8
        decided = some[0] >= far or some[1] < near or (near <= some[0] and some[1] < far)
        assert decided or some[1] - some[0] < 2e-7 or some[1] < 1e-6
        assert not (some[0] >= far and high < far - 1e-7)
        assert not (some[1] < near and low >= near + 1e-7)


def test_a_ball_beside_a_cylinder_in_closed_form() -> None:
    generator = np.random.default_rng(0)
    for _ in range(500):
        T, C = random_pose(generator, 0.5), random_pose(generator, 0.2)
        radius, length = generator.uniform(0.02, 0.3, 2)
        x, y, z = (np.linalg.inv(C) @ T)[:3, 3]
        outside = math.hypot(max(math.hypot(x, y) - radius, 0.0), max(abs(z) - 0.5 * length, 0.0))
        cylinder = static_shape("cylinder", [radius, length], T_world=C)
        low, high = ask(cylinder, np.eye(4), static_shape("sphere", [0.05], T_world=T), np.eye(4))
        assert low - 1e-12 <= outside - 0.05 <= high + 1e-12
        assert high - low < 2e-7


def test_touching_and_equal_shapes() -> None:
    box = static_shape("box", (0.2, 0.2, 0.2))
    for x, wanted in ((0.0, 0.0), (0.2, 0.0), (0.2 + 1e-3, 1e-3), (1.2, 1.0)):
        T = np.eye(4)
        T[0, 3] = x
        low, high = ask(box, np.eye(4), box, T)
        assert low - 1e-12 <= wanted <= high + 1e-12
        assert high - low < 2e-7
    ball = static_shape("sphere", (0.1,))
    np.testing.assert_allclose(ask(ball, np.eye(4), ball, np.eye(4)), -0.2)
