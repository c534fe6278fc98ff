"""Closed form of PUMA-like arms: every branch has the pose, one of them is the posture that made it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from scipy.optimize import brentq

from armtempo.arrays import Bools, Floats
from armtempo.configs import data_path
from armtempo.errors import InputError, RobotError
from armtempo.planners.ik import SphericalWristIK
from armtempo.robots import Arm, Tool


def finite(answers: Floats) -> Bools:
    return np.asarray(np.isfinite(answers).all(axis=-1))


def arm(name: str) -> Arm:
    """A PUMA, in a corner of the world and with a tool unless its name is plain."""
    if name.endswith("+tool"):
        T = np.eye(4)
        T[:3, :3] = [[0.0, -1.0, 0.0], [0.36, 0.0, -np.sqrt(1 - 0.36**2)], [np.sqrt(1 - 0.36**2), 0.0, 0.36]]
        T[:3, 3] = 0.1, -0.2, 0.3
        tool = Tool(T_link_tool=T)
        return Arm.from_urdf(data_path(f"robots/{name.removesuffix('+tool')}.urdf"), T_world_base=T, tool=tool)
    return Arm.from_urdf(data_path(f"robots/{name}.urdf"))


@pytest.mark.parametrize("name", ["puma560", "puma560_chung", "puma560+tool"])
def test_every_branch_has_the_pose(name: str) -> None:
    puma = arm(name)
    ik = SphericalWristIK(puma)
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (1000, 6))
    T = puma.tip_pose(q)
    answers = ik.solve(T)
    assert answers.shape == (1000, 8, 6)
    there = finite(answers)
    assert there.sum(axis=1).min() >= 4
    assert there.mean() > 0.7  # some branches do not reach; never the one that made the pose
    error = puma.tip_pose(np.where(there[..., None], answers, 0.0)) - T[:, None]
    assert np.abs(error[there]).max() < 1e-12
    branch = ik.branch(q)
    own = answers[np.arange(1000), branch]
    near_singular = 1e-9 / np.minimum(np.abs(np.sin(q[:, 4])), 0.1)
    assert (np.abs(np.sin(0.5 * (own - q))).max(axis=1) < 10 * near_singular).all()
    for k in range(8):
        found = there[:, k]
        assert (ik.branch(answers[found, k]) == k).all()


def over_the_shoulder(ik: SphericalWristIK, elbow: float) -> list[float]:
    """A posture whose wrist centre is as near to the waist's axis as it can be: both waists in one."""

    def forward(shoulder: float) -> float:
        T = ik.arm.tip_pose([0.3, shoulder, elbow, 0.2, 0.7, 0.1])
        x, y = (T[:3, 3] + T[:3, :3] @ ik.wrist_in_tip - ik.arm.link_poses(np.zeros(6))[0, :3, 3])[:2]
        return float(x * np.cos(0.3) + y * np.sin(0.3))

    grid = np.linspace(-3.0, 3.0, 61)
    sign = np.sign([forward(x) for x in grid])
    k = int(np.flatnonzero(sign[1:] != sign[:-1])[0])
    return [0.3, float(brentq(forward, grid[k], grid[k + 1], xtol=1e-15)), elbow, 0.2, 0.7, 0.1]


@pytest.mark.parametrize("base", [0.0, 30.0])
def test_edges_of_the_workspace_are_reached(base: float) -> None:
    """A straight wrist, stretched arms, the wrist over the shoulder."""
    T = np.eye(4)
    T[:3, 3] = base, 0.4 * base, 0.0
    puma = Arm.from_urdf(data_path("robots/puma560_chung.urdf"), T_world_base=T)
    other = Arm.from_urdf(data_path("robots/puma560.urdf"), T_world_base=T)
    random = np.random.default_rng(4)
    stretched = np.insert(random.uniform(-2.0, 2.0, (100, 5)), 2, -np.pi / 2, axis=1)
    over = [over_the_shoulder(SphericalWristIK(other), elbow) for elbow in random.uniform(-2.5, 1.0, 10)]
    for one, rows in ((puma, [[0.3, 0.4, -0.5, 0.7, 0.0, 0.2], *stretched]), (other, over)):
        answers, poses = SphericalWristIK(one).solve(one.tip_pose(rows)), one.tip_pose(rows)
        there = finite(answers)
        assert there.any(axis=1).all()
        error = one.tip_pose(np.where(there[..., None], answers, 0.0)) - poses[:, None]
        assert np.abs(error[there]).max() < 1e-11 * (1.0 + base)


def test_out_of_reach_is_nan_and_limits_are_asked_for() -> None:
    puma = arm("puma560")
    ik = SphericalWristIK(puma)
    far = np.eye(4)
    far[:3, 3] = 2.0, 0.0, 0.6
    assert np.isnan(ik.solve(far)).all()
    q = np.random.default_rng(2).uniform(puma.position_min, puma.position_max, (200, 6))
    allowed = ik.within_limits(ik.solve(puma.tip_pose(q)))
    inside = finite(allowed)
    assert inside.any(axis=1).all()
    assert (allowed[inside] >= puma.position_min).all()
    assert (allowed[inside] <= puma.position_max).all()


def test_other_arms_and_other_numbers_are_refused() -> None:
    panda = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    with pytest.raises(RobotError, match="has no closed form here: it has 7 joints"):
        SphericalWristIK(Arm.from_urdf(panda, tip_link="panda_hand"))
    with pytest.raises(RobotError, match="miss each other by"):
        SphericalWristIK(arm("ur5e_like"))
    with pytest.raises(InputError, match="finite"):
        SphericalWristIK(arm("puma560")).solve(np.full((4, 4), np.nan))
