"""Pictures of arms in space."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from armtempo.commands.figures._workspace import bodies, surface_points, workspace
from armtempo.planners import Cell, CoordinationCell, IKCell, build_cell
from armtempo.robots import static_shape

CUBE = np.array(list(np.ndindex(2, 2, 2)), dtype=np.float64)


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        (static_shape("box", (0.2, 0.3, 0.4)), 0.024),
        (static_shape("sphere", (0.3,)), 4.0 / 3.0 * np.pi * 0.027),
        (static_shape("cylinder", (0.2, 0.5)), np.pi * 0.04 * 0.5),
        (static_shape("capsule", (0.2, 0.5)), np.pi * 0.04 * 0.5 + 4.0 / 3.0 * np.pi * 0.008),
        (static_shape("convex", vertices=0.5 * CUBE), 0.125),
    ],
)
def test_points_of_a_surface_are_those_of_the_shape(shape: object, volume: float) -> None:
    T = np.eye(4)
    T[:3, 3] = [1.0, 2.0, 3.0]
    hull = ConvexHull(surface_points(shape, T))  # type: ignore[arg-type]
    assert hull.volume == pytest.approx(volume, rel=0.06)
    assert hull.volume <= volume * (1.0 + 1e-9)


def test_bodies_are_where_the_arm_is(lee1991: CoordinationCell) -> None:
    arm, q = lee1991.arms[0], np.array([0.3, 0.8])
    points = np.concatenate(bodies(arm, q))
    assert np.linalg.norm(points - arm.tip_pose(q)[:3, 3], axis=1).min() < 0.03


def test_flat_cells_are_seen_from_above_and_tall_ones_from_three_sides(
    lee1991: CoordinationCell, chung: IKCell
) -> None:
    def titles(cell: Cell) -> list[str]:
        return [axes.get_title() or axes.get_title("left") for axes in workspace(cell).axes]

    assert titles(lee1991) == ["Arms and their paths"]
    assert titles(chung) == ["The arm and its path", "From above", "From the side"]


def test_obstacles_are_in_the_picture(lee1991: CoordinationCell) -> None:
    box = {"name": "post", "box": {"size_m": [0.1, 0.1, 0.1]}, "pose": {"position_m": [0.0, -0.6, 0.0]}}
    config = type(lee1991.config).model_validate({**lee1991.config.model_dump(exclude_none=True), "obstacles": [box]})
    (axes,) = workspace(build_cell(config)).axes
    assert axes.get_ylim()[0] < -0.64
