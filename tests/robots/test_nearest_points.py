"""Nearest points of shapes, against distances."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.robots import nearest_points, shape_distance, static_shape

CUBE = np.array(list(np.ndindex(2, 2, 2)), dtype=np.float64)
SHAPES = {
    "capsule": static_shape("capsule", (0.1, 0.4)),
    "sphere": static_shape("sphere", (0.2,)),
    "box": static_shape("box", (0.2, 0.3, 0.4)),
    "cylinder": static_shape("cylinder", (0.1, 0.4)),
    "convex": static_shape("convex", vertices=0.3 * CUBE),
}


def at(x: float) -> np.ndarray:
    """A pose away from the origin, turned a little."""
    T = np.eye(4)
    T[:3, :3] = [[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]
    T[:3, 3] = [x, 0.1, -0.05]
    return T


@pytest.mark.parametrize("one", SHAPES)
@pytest.mark.parametrize("other", SHAPES)
def test_points_are_as_far_apart_as_the_shapes(one: str, other: str) -> None:
    a, b = SHAPES[one], SHAPES[other]
    points = nearest_points(a, np.eye(4), b, at(1.0))
    assert points is not None
    distance = shape_distance(a, np.eye(4), b, at(1.0))
    assert np.linalg.norm(points[1] - points[0]) == pytest.approx(distance, abs=1.5e-3)
    assert points[0, 0] < points[1, 0]  # in the order of the shapes


def test_shapes_that_overlap_have_none() -> None:
    assert nearest_points(SHAPES["capsule"], np.eye(4), SHAPES["box"], at(0.1)) is None
