"""Bootstrap intervals against what is known of means."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.agents.evaluation._bootstrap import mean_interval, ratio_interval


def test_the_interval_of_a_mean_is_that_of_the_normal_law() -> None:
    x = np.random.default_rng(1).normal(5.0, 2.0, 400)
    low, high = mean_interval(x)
    half = 1.96 * x.std() / np.sqrt(len(x))
    assert (low, high) == pytest.approx((x.mean() - half, x.mean() + half), abs=0.02)


def test_it_covers_the_truth_about_nineteen_times_in_twenty() -> None:
    random = np.random.default_rng(2)
    hits = 0
    for _ in range(100):
        low, high = mean_interval(random.exponential(1.0, 60))
        hits += low <= 1.0 <= high
    assert 85 <= hits <= 99


def test_episodes_are_drawn_in_pairs() -> None:
    x = np.random.default_rng(3).uniform(1.0, 9.0, 50)
    assert ratio_interval(0.9 * x, x) == pytest.approx((0.9, 0.9))
    low, high = ratio_interval(x[::-1], x)
    assert low < 0.95 < 1.05 < high


def test_cells_are_drawn_before_their_episodes() -> None:
    """The variance of a mean in closed form: of the cells' means, and what drawing inside of them adds."""
    random = np.random.default_rng(7)
    x = 10.0 + random.normal(0.0, 1.0, (40, 1)) + random.normal(0.0, 2.0, (40, 8))
    low, high = mean_interval(x)
    variance = x.mean(axis=1).var() / 40 + x.var(axis=1).mean() / (40 * 8)
    half = 1.96 * np.sqrt(variance)
    assert (low, high) == pytest.approx((x.mean() - half, x.mean() + half), abs=0.03)
    alike = 10.0 + random.normal(0.0, 1.0, (40, 1)) + random.normal(0.0, 0.1, (40, 8))  # as good as 40, not 320
    low, high = mean_interval(alike)
    assert high - low == pytest.approx(2.0 * 1.96 * alike.mean(axis=1).std() / np.sqrt(40), rel=0.05)
    flat_low, flat_high = mean_interval(alike.ravel())
    assert high - low > 2.5 * (flat_high - flat_low)


def test_over_cells_it_covers_the_truth_too() -> None:
    """A ratio of two means whose truth is known, cells and episodes drawn anew; flat intervals miss it."""
    random = np.random.default_rng(8)
    hits, flat = 0, 0
    for _ in range(100):
        base = random.uniform(1.0, 2.0, (30, 6))
        own = base * (0.98 + random.normal(0.0, 0.02, (30, 1)) + random.normal(0.0, 0.01, (30, 6)))
        low, high = ratio_interval(own, base)
        hits += low <= 0.98 <= high
        low, high = ratio_interval(own.ravel(), base.ravel())
        flat += low <= 0.98 <= high
    assert hits >= 88
    assert flat < 75


def test_pairs_of_many_cells_stay_together() -> None:
    x = np.random.default_rng(9).uniform(1.0, 9.0, (12, 5))
    assert ratio_interval(0.9 * x, x) == pytest.approx((0.9, 0.9))
    assert ratio_interval(x[:, :1], x[:, 1:2]) == ratio_interval(x[:, 0], x[:, 1])
    assert mean_interval(x[:1]) == mean_interval(x[0])


def test_the_same_seed_gives_the_same_interval_and_one_value_a_point() -> None:
    x = np.random.default_rng(4).uniform(size=30)
    assert mean_interval(x, 5) == mean_interval(x, 5) != mean_interval(x, 6)
    assert mean_interval([2.5]) == (2.5, 2.5)
