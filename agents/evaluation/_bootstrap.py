"""Percentile bootstrap: how sure a mean, or a ratio of two means over the same episodes, is."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats

Interval = tuple[float, float]

BOOTSTRAP_DRAWS = 10_000
CONFIDENCE_LEVEL = 0.95


def mean_interval(values: ArrayLike, seed: int = 0) -> Interval:
    """The interval that holds the mean of ``values`` (n,) with 95 %."""
    x = np.asarray(values, dtype=np.float64)
    return _percentiles(_means(x[None], seed)[0])


def ratio_interval(values: ArrayLike, reference: ArrayLike, seed: int = 0) -> Interval:
    """That of mean(values) / mean(reference); both (n,), of the same episodes, which are drawn together."""
    both = np.stack([np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)])
    means = _means(both, seed)
    return _percentiles(means[0] / means[1])


def _means(rows: Floats, seed: int) -> Floats:
    """(m, BOOTSTRAP_DRAWS) means of ``rows`` (m, n), each over n of its columns drawn with replacement."""
    n = rows.shape[1]
    random = np.random.default_rng(seed)
    draws = max(1, 2_000_000 // n)  # at once: memory
    blocks = []
    for first in range(0, BOOTSTRAP_DRAWS, draws):
        columns = random.integers(n, size=(min(draws, BOOTSTRAP_DRAWS - first), n))
        blocks.append(rows[:, columns].mean(axis=2))
    return np.concatenate(blocks, axis=1)


def _percentiles(values: Floats) -> Interval:
    low, high = np.quantile(values, [0.5 - 0.5 * CONFIDENCE_LEVEL, 0.5 + 0.5 * CONFIDENCE_LEVEL])
    return float(low), float(high)
