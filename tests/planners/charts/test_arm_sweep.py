"""Displacements over intervals hold every point of an arm at every place in between."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.planners import AbstractJointPath, CoordinationCell, JointPath
from armtempo.planners.charts._arm_sweep import ArmSweep, swept_displacements
from armtempo.robots import Arm

Pair = tuple[tuple[Arm, Arm], tuple[AbstractJointPath, AbstractJointPath]]
FINEST = 64


def farthest(arm: Arm, path: AbstractJointPath, cells: int, c: int, points: list[Floats], count: int) -> Floats:
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
def test_no_point_gets_farther(panda_pair: Callable[[int], Pair], lee1991: CoordinationCell, which: str) -> None:
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


def test_the_farthest_of_all_shapes(lee1991: CoordinationCell) -> None:
    arm, path = lee1991.arms[1], lee1991.paths[1]
    swept = swept_displacements(arm, path, 32)
    assert sorted(swept) == [1, 2, 4, 8, 16, 32]
    moves = ArmSweep.of(arm, path, 32).shape_moves
    for cells, own in swept.items():
        np.testing.assert_array_equal(own, moves[cells].max(axis=1))


def test_a_slide_far_out_behind_a_turning_joint(tmp_path: Path) -> None:
    """The lever of the turning joint is how far the slide stands out, not the chain where all joints are zero."""
    body = """<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"""
    limit = """<limit lower="-3" upper="3" effort="1" velocity="1"/>"""
    urdf = tmp_path / "crane.urdf"
    urdf.write_text(
        f"""<robot name="crane"><link name="base"/><link name="boom">{body}</link><link name="ball">{body}
        <collision><geometry><sphere radius="0.01"/></geometry></collision></link>
        <joint name="turn" type="revolute"><parent link="base"/><child link="boom"/><axis xyz="0 0 1"/>{limit}</joint>
        <joint name="slide" type="prismatic"><parent link="boom"/><child link="ball"/><axis xyz="1 0 0"/>{limit}</joint>
        </robot>"""
    )
    arm = Arm.from_urdf(urdf)
    zigzag = [[0.02 * (-1.0) ** k, 2.0 + 0.001 * k] for k in range(60)]
    path = JointPath.through(zigzag, arm=arm)
    sweep = ArmSweep.of(arm, path, 16)
    points = [np.asarray(shape.points) for shape in arm.shapes]
    for cells in (1, 4, 16):
        for c in range(cells):
            assert (farthest(arm, path, cells, c, points, 3000) <= sweep.shape_moves[cells][c] + 1e-12).all()
