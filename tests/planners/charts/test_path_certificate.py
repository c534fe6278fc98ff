"""Certificates of single paths: an obstacle anywhere beside the path is found, and named with its station."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import CollisionError
from armtempo.planners import CoordinationCell
from armtempo.planners.charts import check_path
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Clearance, static_shape


def at(x: float, y: float, z: float) -> Floats:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def least_distance(clearance: Clearance, path: AbstractJointPath) -> float:
    """The least of many samples [m]."""
    lam = np.linspace(0.0, path.length, 2001)
    return min(clearance.obstacles(0, q).distance for q in path.evaluate(lam)[0])


@pytest.mark.parametrize("share", [0.0, 0.31, 0.77, 1.0])
def test_a_pin_beside_the_path_is_refused_exactly_from_the_distance_that_is_required(
    lee1991: CoordinationCell, share: float
) -> None:
    arm, path = lee1991.arms[0], lee1991.paths[0]
    tip = arm.tip_pose(path.evaluate(share * path.length)[0])[:3, 3]
    away = tip - arm.T_world_base[:3, 3]
    pin = tip + 0.06 * away / np.linalg.norm(away)
    clearance = Clearance([arm], [static_shape("sphere", [0.005], T_world=at(*pin), name="pin")])
    least = least_distance(clearance, path)
    assert least > 0.0
    check_path(clearance, 0, arm, path, obstacle_distance=0.99 * least - 1e-4)
    with pytest.raises(CollisionError, match=r"comes too close to an obstacle at station .*pin") as caught:
        check_path(clearance, 0, arm, path, obstacle_distance=1.01 * least + 1e-4)
    told = caught.value.data
    q = path.evaluate(told["station"])[0]
    assert clearance.obstacles(0, q).distance == pytest.approx(told["clearance_m"])
    assert told["required_m"] == pytest.approx(1.01 * least + 1e-4)
    assert "pin" in told["bodies"]


def test_without_a_distance_obstacles_are_not_asked(lee1991: CoordinationCell) -> None:
    arm, path = lee1991.arms[0], lee1991.paths[0]
    tip = arm.tip_pose(path.evaluate(0.5 * path.length)[0])[:3, 3]
    clearance = Clearance([arm], [static_shape("sphere", [0.05], T_world=at(*tip), name="ball")])
    check_path(clearance, 0, arm, path)
    with pytest.raises(CollisionError, match="ball"):
        check_path(clearance, 0, arm, path, obstacle_distance=0.0)


def test_a_needle_between_the_samples_of_any_grid_is_found(lee1991: CoordinationCell) -> None:
    """The path sweeps over it at one place only."""
    arm, path = lee1991.arms[0], lee1991.paths[0]
    for share in np.random.default_rng(3).uniform(0.05, 0.95, 5):
        tip = arm.tip_pose(path.evaluate(share * path.length)[0])[:3, 3]
        needle = static_shape("capsule", [1e-4, 0.2], T_world=at(*tip), name="needle")
        with pytest.raises(CollisionError, match="needle"):
            check_path(Clearance([arm], [needle]), 0, arm, path, obstacle_distance=0.0)
