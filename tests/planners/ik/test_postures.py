"""Joint positions for a pose: true to it, within limits, different from each other, and all of them where known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners import find_postures, load_robot
from armtempo.planners.ik import SphericalWristIK
from armtempo.robots import Arm

ROBOTS = (
    "planar_two_link.urdf", "scara_800.urdf", "puma560.urdf", "ur5e_like.urdf", "pybullet_data/franka_panda/panda.urdf",
    "pybullet_data/kuka_iiwa/model.urdf",
)  # fmt: skip


def _posture(arm: Arm, seed: int) -> Floats:
    """Well within the limits."""
    low = np.maximum(arm.position_min, -2.5)
    high = np.minimum(arm.position_max, 2.5)
    return low + (high - low) * np.random.default_rng(seed).uniform(0.2, 0.8, arm.dof)


def _check(arm: Arm, found: Floats, T: Floats, whole: bool) -> None:
    poses = arm.tip_pose(found)
    np.testing.assert_allclose(poses[:, :3, 3], np.broadcast_to(T[:3, 3], (len(found), 3)), atol=1e-9)
    if whole:
        np.testing.assert_allclose(poses[:, :3, :3], np.broadcast_to(T[:3, :3], (len(found), 3, 3)), atol=1e-9)
    assert ((found >= arm.position_min) & (found <= arm.position_max)).all()
    for k, one in enumerate(found):
        assert all(np.abs(one - other).max() >= 1e-3 for other in found[:k])


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("whole", [True, False])
def test_any_reachable_pose_is_reached(name: str, whole: bool) -> None:
    arm = load_robot(name)
    for seed in range(6):
        T = arm.tip_pose(_posture(arm, seed))
        found = find_postures(arm, T[:3, 3], T[:3, :3] if whole else None)
        assert 1 <= len(found) <= 8
        _check(arm, found, T, whole)


@given(st.integers(0, 10**6))
def test_eight_of_a_spherical_wrist_are_those_of_the_closed_form(seed: int) -> None:
    arm = load_robot("puma560.urdf")
    q = _posture(arm, seed)
    T = arm.tip_pose(q)
    solver = SphericalWristIK(arm)
    every = solver.within_limits(solver.solve(T))
    every = every[np.isfinite(every).all(axis=1)]
    found = find_postures(arm, T[:3, 3], T[:3, :3])
    assert min(np.abs(found - q).max(axis=1)) < 1.1e-3 or abs(np.sin(q[4])) < 2e-3  # nearly equal ones are one
    for one in found:
        assert np.abs(every - one).max(axis=1).min() == 0.0


def test_both_elbows_of_two_links() -> None:
    arm = load_robot("lee1991:slave")
    q = np.array([0.3, 0.5])
    found = find_postures(arm, arm.tip_pose(q)[:3, 3])
    assert len(found) == 2
    assert sorted(found[:, 1].tolist()) == pytest.approx([-0.5, 0.5], abs=1e-8)


def test_of_infinitely_many_those_are_given_that_differ_most() -> None:
    arm = load_robot("pybullet_data/franka_panda/panda.urdf")
    T = arm.tip_pose(_posture(arm, 0))
    few, many = (find_postures(arm, T[:3, 3], T[:3, :3], count=count) for count in (3, 12))
    assert (len(few), len(many)) == (3, 12)
    spread = [min(np.abs(a - b).max() for k, a in enumerate(rows) for b in rows[:k]) for rows in (few, many)]
    assert spread[0] > spread[1] > 0.2
    assert find_postures(arm, T[:3, 3], T[:3, :3], count=3).tobytes() == few.tobytes()


def test_limits_are_kept_where_only_a_corner_is_left() -> None:
    full = load_robot("planar_two_link.urdf", tip_link="tool")
    arm = Arm.from_urdf(full.urdf, tip_link="tool", position_limits=[[0.0, 0.4], [0.0, 0.6]])
    found = find_postures(arm, full.tip_pose(np.array([0.3, 0.5]))[:3, 3])
    np.testing.assert_allclose(found, [[0.3, 0.5]], atol=1e-8)
    with pytest.raises(PathError, match="was found in no posture"):
        find_postures(arm, full.tip_pose(np.array([0.3, -0.5]))[:3, 3])


def test_what_is_out_of_reach_says_by_how_much() -> None:
    arm = load_robot("scara_800.urdf")
    reach = 0.8
    with pytest.raises(PathError, match=r"the nearest misses it by \d+ mm") as refused:
        find_postures(arm, [reach + 0.1, 0.0, 0.1])
    assert refused.value.data["nearest"].shape == (4,)
    with pytest.raises(PathError, match=r"misses it by .* mm and .* degrees"):
        find_postures(arm, [0.4, 0.2, 0.1], Rotation.from_euler("x", 90.0, degrees=True).as_matrix())
    with pytest.raises(PathError, match="has no posture for this pose within its limits"):
        find_postures(load_robot("puma560.urdf"), [9.0, 0.0, 0.0], np.eye(3))


@pytest.mark.parametrize(
    ("position", "rotation", "more", "said"),
    [
        ([0.0, 0.0], None, {}, r"position of shape \(2,\)"),
        ([0.0, 0.0, np.nan], None, {}, "not finite"),
        ([0.0, 0.0, 0.0], np.eye(2), {}, r"rotation of shape \(2, 2\) is none"),
        ([0.0, 0.0, 0.0], -np.eye(3), {}, "rotation of shape"),
        ([0.4, 0.0, 0.1], None, {"count": 0}, "count 0"),
        ([0.4, 0.0, 0.1], None, {"seed": -1}, "seed -1"),
        ([0.4, 0.0, 0.1], None, {"count": float("nan")}, "count nan"),
        ([0.4, 0.0, 0.1], None, {"seed": 1.5}, "seed 1.5"),
    ],
)
def test_what_is_no_pose_is_refused(position: object, rotation: object, more: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        find_postures(load_robot("scara_800.urdf"), position, rotation, **more)  # type: ignore[arg-type]
