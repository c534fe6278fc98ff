"""Walks over the cells of a chart, compiled: along a curve, and everywhere that a monotone walk can get."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats
from armtempo.robots import njit

States = NDArray[np.uint8]

BORDER_TOLERANCE = 1e-9  # cells: a point this close to a border touches the cells on both sides


@njit
def _span(low: float, high: float, cells: int) -> tuple[int, int]:
    """First cell touched by [low, high], in cells, and the one after the last."""
    start = max(int(np.ceil(low - BORDER_TOLERANCE)) - 1, 0)
    return min(start, cells - 1), min(int(np.floor(high + BORDER_TOLERANCE)) + 1, cells)


@njit
def free_along(states: States, a: Floats, b: Floats, straight: bool) -> bool:
    """Whether all cells are free that the curve through (a, b), in cells, touches.

    Between two points it is the straight segment, or else anything inside their box.
    """
    rows, columns = states.shape
    for k in range(max(a.shape[0] - 1, 1)):
        last = min(k + 1, a.shape[0] - 1)
        a0, a1, b0, b1 = a[k], a[last], b[k], b[last]
        if a1 < a0:  # either way along
            a0, a1, b0, b1 = a1, a0, b1, b0
        start, stop = _span(a0, a1, rows)
        for i in range(start, stop):
            low, high = min(b0, b1), max(b0, b1)
            if straight and a1 > a0:
                at = b0 + (b1 - b0) * min(max((i - BORDER_TOLERANCE - a0) / (a1 - a0), 0.0), 1.0)
                to = b0 + (b1 - b0) * min(max((i + 1 + BORDER_TOLERANCE - a0) / (a1 - a0), 0.0), 1.0)
                low, high = min(at, to), max(at, to)
            first, end = _span(low, high, columns)
            for j in range(first, end):
                if states[i, j] != 0:
                    return False
    return True


@njit
def passable(states: States) -> Bools:
    """(R, R) free cells on some walk of steps (1, 0) and (0, 1) over free cells from the first to the last cell."""
    rows, columns = states.shape
    reached = np.zeros((rows, columns), dtype=np.bool_)
    for i in range(rows):
        for j in range(columns):
            if states[i, j] == 0:
                reached[i, j] = (i == 0 and j == 0) or (i > 0 and reached[i - 1, j]) or (j > 0 and reached[i, j - 1])
    for i in range(rows - 1, -1, -1):
        for j in range(columns - 1, -1, -1):
            if reached[i, j] and not (i == rows - 1 and j == columns - 1):
                reached[i, j] = (i < rows - 1 and reached[i + 1, j]) or (j < columns - 1 and reached[i, j + 1])
    return reached
