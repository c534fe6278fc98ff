"""Fitted joint paths: derivatives, bounds of the speed, limits, and what noise costs in time."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners import JointPath, PathDynamics, minimum_time
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.joint_paths import AbstractJointPath


def recording(count: int = 2000) -> Floats:
    """Six joints that start and end at rest."""
    s = np.linspace(0.0, 1.0, count)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    return np.stack([np.sin(3.0 * s), np.cos(2.0 * s), s, s * s, 0.3 * np.sin(6.0 * s), 1.0 - s], axis=1)


def least_time(path: AbstractJointPath) -> float:
    """With joint accelerations of 5 and speeds of 1 [s]."""
    lam = np.linspace(0.0, path.length, 1001)
    _, dq, ddq = path.evaluate(lam)
    none, most = np.zeros_like(dq), np.full_like(dq, 5.0)
    speed = (1.0 / np.maximum(np.abs(dq), 1e-9)).min(axis=1)
    return minimum_time(PathDynamics(lam, dq, ddq, none, none, -most, most, speed_max=speed)).duration


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("tolerance", [6e-5, 1e-3])
def test_a_noisy_recording_takes_as_long_as_the_clean_one(tolerance: float, seed: int) -> None:
    clean = recording()
    noisy = clean + 1e-5 * np.random.default_rng(seed).normal(size=clean.shape)
    path = JointPath.fit(noisy, tolerance)
    assert path.deviation <= tolerance
    assert least_time(path) == pytest.approx(least_time(JointPath.through(clean[::111])), rel=0.01)


def test_derivatives_are_true_and_bounds_of_the_speed_hold_and_are_close() -> None:
    path = JointPath.fit(recording(), 1e-4)
    path.check_stations()
    lam, h = np.linspace(0.01, path.length - 0.01, 999), 1e-6
    _, dq, ddq = path.evaluate(lam)
    np.testing.assert_allclose((path.evaluate(lam + h)[0] - path.evaluate(lam - h)[0]) / (2.0 * h), dq, atol=1e-8)
    np.testing.assert_allclose((path.evaluate(lam + h)[1] - path.evaluate(lam - h)[1]) / (2.0 * h), ddq, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(dq, axis=1), 1.0, atol=0.01)
    rng = np.random.default_rng(0)
    low, high = np.sort(rng.uniform(0.0, path.length, (2, 200)), axis=0)
    bound = path.speed_bound(low, high)
    for a, b, most in zip(low, high, bound, strict=True):
        inside = np.abs(path.evaluate(np.linspace(a, b, 200))[1]).max(axis=0)
        assert (inside <= most).all()
    whole = np.abs(path.evaluate(np.linspace(0.0, path.length, 5001))[1]).max(axis=0)
    np.testing.assert_allclose(path.speed_bound(0.0, path.length), whole, rtol=0.01)


def test_limits_and_shapes_are_checked(lee1991: CoordinationCell) -> None:
    arm = lee1991.arms[0]
    wide = np.linspace([0.0, 0.0], [0.0, 10.0], 50)
    with pytest.raises(PathError, match=r"joint .* reaches .* at station .* rad; its limit is"):
        JointPath.fit(wide, 1e-3, arm=arm)
    with pytest.raises(InputError, match="points have 3 joint positions each"):
        JointPath.fit(np.zeros((4, 3)), 1e-3, arm=arm)
    for points in (np.zeros((1, 2)), np.zeros(3), [[0.0, np.nan], [1.0, 1.0]]):
        with pytest.raises(InputError, match=r"points must be \(N, n\)"):
            JointPath.fit(points, 1e-3)
    with pytest.raises(PathError, match="all points are the same"):
        JointPath.fit(np.zeros((4, 2)), 1e-3)
