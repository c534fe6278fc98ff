"""Smooth fits: what they are certified for, against dense samples; circles, noise, corners, recordings that rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PPoly
from scipy.spatial import cKDTree

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners.geometry import SmoothFit, checked_tolerance, smooth_fit


def curve(fit: SmoothFit) -> PPoly:
    return PPoly(np.moveaxis(fit.coefficients, 1, 0)[::-1], fit.knots)


def chords(points: Floats, count: int = 40) -> Floats:
    share = np.linspace(0.0, 1.0, count, endpoint=False)[:, None]
    return np.concatenate([*(a + share * (b - a) for a, b in pairwise(points)), points[-1:]])


def apart(fit: SmoothFit, points: Floats) -> float:
    """The larger of both one-sided distances, by nearest of dense samples: too large by their spacing at most."""
    way = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(fit.knots)])
    one, other = curve(fit)(way), chords(points)
    return max(np.max(cKDTree(b).query(a)[0]) for a, b in ((one, other), (other, one)))


def half_circle(radius: float, count: int) -> Floats:
    turn = np.linspace(0.0, np.pi, count + 1)
    return radius * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)


def recording(count: int = 2000) -> Floats:
    """Six joints that start and end at rest."""
    s = np.linspace(0.0, 1.0, count)
    s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
    return np.stack([np.sin(3.0 * s), np.cos(2.0 * s), s, s * s, 0.3 * np.sin(6.0 * s), 1.0 - s], axis=1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_chords_of_a_circle_become_few_pieces_far_closer_than_the_tolerance(tolerance: float) -> None:
    points = half_circle(0.1, 1000)
    fit = smooth_fit(points, tolerance)
    assert len(fit.knots) <= 20
    t = np.linspace(0.0, fit.knots[-1], 5001)
    p, d1, d2 = (curve(fit)(t, nu) for nu in range(3))
    np.testing.assert_allclose(np.linalg.norm(p, axis=1), 0.1, atol=1e-6)
    bend = np.linalg.norm(np.cross(d1, d2), axis=1) / np.linalg.norm(d1, axis=1) ** 3
    np.testing.assert_allclose(bend, 10.0, rtol=0.01)


def test_ends_are_kept_and_four_derivatives_are_continuous() -> None:
    points = np.cumsum(np.random.default_rng(1).normal(size=(30, 3)), axis=0)
    fit = smooth_fit(points, 0.05)
    np.testing.assert_allclose(curve(fit)(fit.knots[[0, -1]]), points[[0, -1]], atol=1e-12)
    steps = np.diff(fit.knots)[:, None]
    for order in range(5):
        falling = [np.prod(np.arange(k, k - order, -1)) for k in range(6)]
        ends = np.sum([falling[k] * fit.coefficients[:, k] * steps ** (k - order) for k in range(order, 6)], axis=0)
        starts = np.prod(np.arange(order, 0, -1)) * fit.coefficients[:, order]
        size = np.abs(starts).max() + 1e-9
        np.testing.assert_allclose(ends[:-1] / size, starts[1:] / size, atol=1e-9)


@given(st.integers(0, 10**6), st.integers(2, 12), st.floats(-4.0, -1.0))
@settings(max_examples=25, deadline=None)
def test_the_deviation_is_a_bound_whatever_the_points(seed: int, count: int, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-2.0, 0.0, (count, 1)), axis=0)
    tolerance = 10.0**exponent
    fit = smooth_fit(points, tolerance)
    assert fit.deviation <= tolerance
    spacing = np.linalg.norm(np.diff(chords(points), axis=0), axis=1).max()
    assert apart(fit, points) <= fit.deviation + spacing


@pytest.mark.parametrize("tolerance", [6e-5, 1e-3])
def test_noise_is_smoothed_where_a_recording_rests_too(tolerance: float) -> None:
    clean = recording()
    noisy = clean + 1e-5 * np.random.default_rng(0).normal(size=clean.shape)
    fit = smooth_fit(noisy, tolerance)
    assert fit.deviation <= tolerance
    assert len(fit.knots) <= 60
    assert fit.knots[-1] == pytest.approx(smooth_fit(clean, tolerance).knots[-1], rel=2e-3)
    t = np.linspace(0.0, fit.knots[-1], 20001)
    assert np.max(cKDTree(curve(fit)(t)).query(noisy)[0]) <= fit.deviation + fit.knots[-1] / 20000


def test_points_may_be_given_twice_and_rest_may_be_noise() -> None:
    points = np.repeat(half_circle(0.1, 50), 3, axis=0)
    assert smooth_fit(points, 1e-3).deviation <= 1e-3
    resting = np.concatenate([1e-6 * np.random.default_rng(0).normal(size=(500, 3)), [[0.1, 0.0, 0.0]]])
    fit = smooth_fit(resting, 1e-4)
    assert len(fit.knots) == 2
    assert fit.knots[-1] == pytest.approx(0.1, abs=1e-5)


def test_what_is_no_path_and_no_tolerance_is_refused() -> None:
    with pytest.raises(PathError, match="all points are the same"):
        smooth_fit(np.zeros((5, 3)), 1e-3)
    for wrong in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="tolerance must be positive and finite"):
            checked_tolerance(wrong)
