"""Percentile bootstrap: how sure a mean, or a ratio of two means over the same episodes, is.

Episodes of one cell are alike: where there are many cells, cells are drawn first, and then episodes of each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats

Interval = tuple[float, float]

BOOTSTRAP_DRAWS = 10_000
CONFIDENCE_LEVEL = 0.95


def mean_interval(values: ArrayLike, seed: int = 0) -> Interval:
    """The interval that holds the mean of ``values`` (n,), or (C, n): n episodes of each of C cells, with 95 %."""
    x = np.asarray(values, dtype=np.float64)
    return _percentiles(_means(x[None], seed)[0])


def ratio_interval(values: ArrayLike, reference: ArrayLike, seed: int = 0) -> Interval:
    """That of mean(values) / mean(reference); both (n,) or (C, n), of the same episodes, which are drawn together."""
    both = np.stack([np.asarray(values, dtype=np.float64), np.asarray(reference, dtype=np.float64)])
    means = _means(both, seed)
    return _percentiles(means[0] / means[1])


def _means(rows: Floats, seed: int) -> Floats:
    """(m, BOOTSTRAP_DRAWS) means of ``rows`` (m, n) or (m, C, n), drawn with replacement.

    Each over n columns, or over C cells and n of the columns of each. One episode per cell, or one cell, is a row.
    """
    if rows.ndim == 3 and 1 in rows.shape[1:]:
        rows = rows.reshape(len(rows), -1)
    cells, n = rows.shape[1], rows[0, 0].size
    random = np.random.default_rng(seed)
    draws = max(1, 2_000_000 // (cells * n))  # at once: memory
    blocks = []
    for first in range(0, BOOTSTRAP_DRAWS, draws):
        count = min(draws, BOOTSTRAP_DRAWS - first)
        chosen = random.integers(cells, size=(count, cells))
        if rows.ndim == 2:
            blocks.append(rows[:, chosen].mean(axis=2))
        else:
            columns = random.integers(n, size=(count, cells, n))
            blocks.append(rows[:, chosen[..., None], columns].mean(axis=(2, 3)))
    return np.concatenate(blocks, axis=1)


def _percentiles(values: Floats) -> Interval:
    low, high = np.quantile(values, [0.5 - 0.5 * CONFIDENCE_LEVEL, 0.5 + 0.5 * CONFIDENCE_LEVEL])
    return float(low), float(high)
