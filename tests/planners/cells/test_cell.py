"""What pictures show of a cell: postures of every arm along its way."""

from __future__ import annotations

import numpy as np

from armtempo.planners import BlendCell, CoordinationCell, IKCell

COUNT = 7


def test_sweeps_go_from_the_start_to_the_end_of_every_path(lee1991: CoordinationCell, lee2006: BlendCell) -> None:
    for cell in (lee1991, lee2006):
        sweeps = cell.sweeps(COUNT)
        assert not cell.follows_poses
        for arm, path, sweep in zip(cell.arms, cell.paths, sweeps, strict=True):
            assert (sweep.q.shape, sweep.tip.shape) == ((COUNT, arm.dof), (COUNT, 3))
            ends = path.evaluate(np.array([0.0, path.length]))[0]
            np.testing.assert_array_equal(sweep.q[[0, -1]], ends)
            np.testing.assert_array_equal(sweep.tip, arm.tip_pose(sweep.q)[:, :3, 3])
    np.testing.assert_allclose(lee2006.sweeps(COUNT)[0].tip[-1], lee2006.blended.position(lee2006.blended.length))


def test_the_sweep_of_a_pose_is_the_laws_run_beside_its_target(chung: IKCell) -> None:
    (sweep,) = chung.sweeps(COUNT)
    assert chung.follows_poses
    np.testing.assert_array_equal(sweep.q[0], chung.start)
    np.testing.assert_array_equal(sweep.q[-1], chung.nominal.q[-1])
    np.testing.assert_array_equal(sweep.tip[[0, -1]], chung.target.position[[0, -1]])
    reached = chung.arm.tip_pose(sweep.q[1:])[:, :3, 3]
    np.testing.assert_allclose(reached, sweep.tip[1:], atol=5e-3)  # it starts off its target
