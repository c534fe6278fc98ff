"""The largest rows of a table between two of its rows, in constant time."""

from __future__ import annotations

from typing import final

import numpy as np

from armtempo.arrays import Floats, Ints

__all__ = ["RangeMax"]


@final
class RangeMax:
    """Largest values of columns over ranges of rows: entry [k, i] has those of 2^k rows from i on."""

    def __init__(self, values: Floats) -> None:
        levels = [values]
        while 2 ** len(levels) <= len(values):
            shift = 2 ** (len(levels) - 1)
            row = levels[-1].copy()
            row[:-shift] = np.maximum(row[:-shift], row[shift:])
            levels.append(row)
        self._levels = np.array(levels)

    def over(self, first: Ints, last: Ints) -> Floats:
        """The largest of the rows first..last (...,), both counted: (..., columns)."""
        count = last - first + 1
        level = np.log2(count).astype(np.int64)
        return np.asarray(np.maximum(self._levels[level, first], self._levels[level, last + 1 - 2**level]))
