"""Motions of poses over time: rates are derivatives, legs begin and end at rest in their poses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.planners.geometry import JointMotion, Motion, harmonic, smooth_step, through_poses
from armtempo.robots import Arm

TIMES = (0.5, 1.5, 3.0, 3.4)


@pytest.fixture(scope="module")
def poses() -> tuple[Floats, Floats]:
    generator = np.random.default_rng(5)
    return generator.uniform(-1.0, 1.0, (4, 3)), Rotation.random(4, rng=generator).as_matrix()


def at(motion: Motion, *times: float) -> tuple[Floats, Floats, Floats, Floats]:
    """What a motion with rates says, as arrays."""
    p, R, v, w = (np.asarray(part, dtype=np.float64) for part in motion(np.array(times)) if part is not None)
    return p, R, v, w


def check_rates(motion: Motion, t: Floats) -> None:
    """Compare the rates of a motion with central differences of its poses."""
    h = 1e-5
    _, R, v, w = at(motion, *t)
    p0, R0, _, _ = at(motion, *(t - h))
    p1, R1, _, _ = at(motion, *(t + h))
    np.testing.assert_allclose(v, (p1 - p0) / (2 * h), atol=1e-7)
    turn = (Rotation.from_matrix(R1) * Rotation.from_matrix(R0).inv()).as_rotvec()
    np.testing.assert_allclose(w, turn / (2 * h), atol=1e-7)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)


def test_the_smooth_step_has_no_slope_nor_curvature_at_its_ends_and_is_steepest_in_the_middle() -> None:
    x = np.linspace(-0.5, 1.5, 401)
    value, slope = smooth_step(x)
    np.testing.assert_allclose(slope[1:-1], (value[2:] - value[:-2]) / (x[2:] - x[:-2]), atol=3e-4)
    np.testing.assert_array_equal(value[x <= 0.0], 0.0)
    np.testing.assert_array_equal(value[x >= 1.0], 1.0)
    assert slope.max() == pytest.approx(15 / 8)
    assert x[slope.argmax()] == pytest.approx(0.5)
    ends = np.array([0.0, 1e-4, 1.0 - 1e-4, 1.0])
    assert (smooth_step(ends)[1] < 4e-7).all()  # of second order: no curvature


@given(st.floats(0.0, 1.0))
def test_the_smooth_step_is_the_same_backwards(x: float) -> None:
    assert float(smooth_step(x)[0] + smooth_step(1.0 - x)[0]) == pytest.approx(1.0, abs=1e-14)


def test_a_harmonic_motion_is_its_cosine_and_does_not_turn() -> None:
    center, swing, rotation = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.0, -0.2]), Rotation.from_rotvec([0.3, 0, 1])
    motion = harmonic(center, swing, 4.0, rotation.as_matrix())
    t = np.linspace(0.1, 3.0, 50)
    check_rates(motion, t)
    p, R, _, w = at(motion, 0.0, np.pi / 4)
    np.testing.assert_allclose(p, [center + swing, center - swing], atol=1e-15)
    np.testing.assert_array_equal(R, np.stack([rotation.as_matrix()] * 2))
    np.testing.assert_array_equal(w, 0.0)


def test_poses_are_passed_at_rest_in_straight_lines_about_one_axis(poses: tuple[Floats, Floats]) -> None:
    positions, rotations = poses
    motion = through_poses(TIMES, positions, rotations)
    p, R, v, w = at(motion, *TIMES)
    np.testing.assert_allclose(p, positions, atol=1e-14)
    np.testing.assert_allclose(R, rotations, atol=1e-14)
    np.testing.assert_allclose([v, w], 0.0, atol=1e-13)
    inside = np.linspace(1.55, 2.95, 30)
    check_rates(motion, inside)
    p, _, v, w = at(motion, *inside)
    way = (positions[2] - positions[1]) / np.linalg.norm(positions[2] - positions[1])
    np.testing.assert_allclose(np.cross(p - positions[1], way), 0.0, atol=1e-14)
    axis = w / np.linalg.norm(w, axis=1, keepdims=True)
    np.testing.assert_allclose(axis, np.broadcast_to(axis[0], axis.shape), atol=1e-9)


def test_before_the_first_pose_and_after_the_last_it_stands(poses: tuple[Floats, Floats]) -> None:
    positions, rotations = poses
    p, R, v, w = at(through_poses(TIMES, positions, rotations), 0.0, 9.0)
    np.testing.assert_allclose(p, positions[[0, -1]], atol=1e-14)
    np.testing.assert_allclose(R, rotations[[0, -1]], atol=1e-14)
    np.testing.assert_array_equal([v, w], np.zeros((2, 2, 3)))


def test_a_joint_motion_passes_its_postures_and_its_rates_are_those_of_the_tip(make_arm: Callable[..., Arm]) -> None:
    postures = np.array([[0.1, 0.4], [0.8, 1.2], [-0.3, 0.9]])
    motion = JointMotion(make_arm(), postures, 2.0)
    q, qd = motion.joints(np.array([0.0, 1.0, 2.0, 5.0]))  # the step is at its half at half the time
    np.testing.assert_allclose(q, postures[[0, 1, 2, 2]], atol=1e-14)
    np.testing.assert_array_equal(qd[[0, 2, 3]], 0.0)
    t = np.linspace(0.05, 1.95, 40)
    check_rates(motion, t)
    h = 1e-6
    differences = (motion.joints(t + h)[0] - motion.joints(t - h)[0]) / (2 * h)
    np.testing.assert_allclose(motion.joints(t)[1], differences, atol=1e-8)
