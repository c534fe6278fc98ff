"""The tip's speed kept along joint paths: between stations, where it jumps from segment to segment, by all planners."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import InputError
from armtempo.planners import (
    BlendedPath,
    JointPath,
    Line,
    PathDynamics,
    PhasePlane,
    PhaseTrajectory,
    load_cell,
    minimum_time,
)
from armtempo.planners.topp import refined_plane
from armtempo.robots import Arm


def tip_speed(motion: PhaseTrajectory, arm: Arm, t: Floats) -> Floats:
    """[m/s] by central differences of the tip's place over time: shares no code with caps or certificate."""
    path, h = motion.dynamics.path, 1e-6
    assert path is not None
    ahead, behind = (arm.tip_pose(path.evaluate(motion.at(t + side)[0])[0])[:, :3, 3] for side in (h, -h))
    return np.asarray(np.linalg.norm(ahead - behind, axis=1) / (2 * h))


@pytest.mark.parametrize("limit", [0.1, 0.5])
def test_a_tool_speed_holds_at_every_instant_and_binds(limit: float) -> None:
    arm = load_cell("panda-pair").arms[0]
    low, high = arm.position_min, arm.position_max
    share = np.random.default_rng(3).uniform(0.3, 0.7, (5, arm.dof))
    path = JointPath.through(low + share * (high - low), arm=arm)
    motion = minimum_time(PathDynamics.from_path(arm, path, tool_speed_m_s=limit))
    speed = tip_speed(motion, arm, np.linspace(1e-5, motion.duration - 1e-5, 4001))
    assert speed.max() <= limit * (1 + 1e-5)
    assert np.median(speed) > 0.95 * limit  # slow enough to bind most of the way
    assert motion.certificate.excess <= 1e-3
    assert motion.certificate.speed_ratio_max == pytest.approx(1.0, abs=1e-3)
    free = minimum_time(PathDynamics.from_path(arm, path))
    assert free.duration < motion.duration
    unaware = PhaseTrajectory(lam=free.lam, mu=free.mu, time=free.time, dynamics=motion.dynamics)
    wanted = tip_speed(free, arm, np.linspace(1e-5, free.duration - 1e-5, 4001)).max() / limit
    assert unaware.certificate.speed_ratio_max == pytest.approx(wanted, rel=1e-2)


def seam() -> tuple[Arm, JointPath, Callable[[Floats], Floats], tuple[float, float]]:
    """A UR5e-like arm that comes, welds 60 mm at 20 mm/s, and goes: three lines with blended corners."""
    arm = Arm.from_urdf(data_path("robots/ur5e_like.urdf"), acceleration_max=(20.0,) * 6)
    start = np.array([0.3, -1.2, 1.5, -1.8, -1.4, 0.2])
    T = arm.tip_pose(start)
    points = T[:3, 3] + np.array([[0, 0, 0], [0, 0, -0.1], [0.06, 0.02, -0.1], [0.06, 0.02, 0.05]])
    keep = Rotation.from_matrix(T[:3, :3]).as_quat()
    lines = [Line(a, b) for a, b in pairwise(points)]
    path = BlendedPath(lines, 0.005, curve="quintic", orientation=[keep, keep])
    first, last = float(path.breakpoints[2]), float(path.breakpoints[3])  # the straight part of the seam
    joints: Any = JointPath.along(path, arm, start=start)
    return arm, joints, lambda lam: np.where((lam >= first) & (lam <= last), 0.02, np.inf), (first, last)


def test_a_seam_is_welded_at_its_speed_and_the_rest_is_not() -> None:
    arm, path, speed_of, (first, last) = seam()
    dynamics = PathDynamics.from_path(arm, path, tool_speed_m_s=speed_of)
    for motion in (minimum_time(dynamics), refined_plane(dynamics, tick=1e-3).motion([1.0], [60.0])):
        assert motion.certificate.excess <= 1e-3
        assert motion.lam[-1] == pytest.approx(path.length)
        begin, end = motion.time_at(first), motion.time_at(last)
        assert end - begin == pytest.approx((last - first) / 0.02, rel=1e-3)
        weld = tip_speed(motion, arm, np.linspace(begin + 1e-4, end - 1e-4, 3001))
        np.testing.assert_allclose(weld, 0.02, rtol=1e-3)
        rest = tip_speed(
            motion, arm, np.concatenate([np.linspace(1e-5, begin, 999), np.linspace(end, motion.duration - 1e-5, 999)])
        )
        assert rest.max() > 0.3


def test_slower_motions_and_parts_of_the_path_keep_it_too() -> None:
    arm, path, speed_of, (first, last) = seam()
    dynamics = PathDynamics.from_path(arm, path, tool_speed_m_s=speed_of)
    plane = PhasePlane(dynamics)
    assert (plane.upper(np.linspace(first, last - 1e-9, 999)) <= 0.02 * (1 + 1e-9)).all()
    slow = plane.with_duration(1.5 * plane.fastest().duration)
    assert slow.certificate.excess <= 1e-3
    part = PhasePlane(dynamics.between(0.5 * first, 0.5 * (first + last)))
    assert part.fastest().certificate.speed_ratio_max <= 1 + 1e-3


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, [0.1, 0.2], "fast", lambda lam: lam[:-1], lambda lam: 0.0 * lam])
def test_what_is_no_speed_is_refused(bad: Any) -> None:
    arm = load_cell("panda-pair").arms[0]
    path = load_cell("panda-pair").paths[0]
    with pytest.raises(InputError, match="tool_speed_m_s"):
        PathDynamics.from_path(arm, path, intervals=100, tool_speed_m_s=bad)
