"""Collision regions of a chart, and limits that they mean."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats

HERE = 1e-9  # of a cell: an arm on the border of two cells counts as in the earlier one


def limit_at(limit: Floats, length: float, lam: Floats) -> Floats:
    """A limit over the cells of a path of ``length`` at places ``lam`` (any shape)."""
    cells = len(limit)
    cell = np.clip((lam * (cells / length) - HERE).astype(np.int64), 0, cells - 1)
    return limit[cell]
