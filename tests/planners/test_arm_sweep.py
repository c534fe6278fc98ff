"""Displacements over intervals hold every point of an arm at every place in between."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from armtempo.planners import Cell, JointPath
from armtempo.planners._arm_sweep import ArmSweep, swept_displacements
from armtempo.robots import Arm

Floats = NDArray[np.float64]
Pair = tuple[tuple[Arm, Arm], tuple[JointPath, JointPath]]
FINEST = 64


def farthest(arm: Arm, path: JointPath, cells: int, c: int, points: list[Floats], count: int) -> Floats:
    """(shapes,) by dense sampling."""
    lam = np.concatenate([[(c + 0.5)], np.random.default_rng(c).uniform(c, c + 1, count), [c, c + 1]])
    poses = arm.link_poses(path.evaluate(lam * path.length / cells)[0])
    out = np.zeros(len(points))
    for k, (shape, own) in enumerate(zip(arm.shapes, points, strict=True)):
        if shape.link >= 0:
            T = poses[:, shape.link]
            world = own @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
            out[k] = np.linalg.norm(world - world[0], axis=2).max()
    return out


@pytest.mark.parametrize("which", ["panda", "lee1991"])
def test_no_point_gets_farther(panda_pair: Callable[[int], Pair], lee1991: Cell, which: str) -> None:
    arm, path = (lee1991.arms[0], lee1991.paths[0])
    if which == "panda":
        arms, paths = panda_pair(7)
        arm, path = arms[1], paths[1]
    sweep = ArmSweep.of(arm, path, FINEST)
    ends = [np.stack(shape.capsule[:2]) for shape in arm.shapes]
    body = [shape.vertices @ shape.T_link_shape[:3, :3].T + shape.T_link_shape[:3, 3] if shape.vertices is not None
            else np.asarray(shape.points) for shape in arm.shapes]  # fmt: skip
    ratios = []
    for cells in (1, 2, 8, 16, FINEST):
        assert sweep.capsule_moves[cells].shape == (cells, len(arm.shapes))
        for c in {0, cells // 3, cells - 1}:
            for moves, points in ((sweep.capsule_moves, ends), (sweep.shape_moves, body)):
                seen = farthest(arm, path, cells, c, points, 300)
                assert (seen <= moves[cells][c] + 1e-12).all()
                ratios.append(moves[cells][c].max() / seen.max())
    assert np.median(ratios) < 1.3  # tight too, boxes about hulls included


def test_the_farthest_of_all_shapes(lee1991: Cell) -> None:
    arm, path = lee1991.arms[1], lee1991.paths[1]
    swept = swept_displacements(arm, path, 32)
    assert sorted(swept) == [1, 2, 4, 8, 16, 32]
    moves = ArmSweep.of(arm, path, 32).shape_moves
    for cells, own in swept.items():
        np.testing.assert_array_equal(own, moves[cells].max(axis=1))
