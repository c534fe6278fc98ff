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


def test_the_same_seed_gives_the_same_interval_and_one_value_a_point() -> None:
    x = np.random.default_rng(4).uniform(size=30)
    assert mean_interval(x, 5) == mean_interval(x, 5) != mean_interval(x, 6)
    assert mean_interval([2.5]) == (2.5, 2.5)
