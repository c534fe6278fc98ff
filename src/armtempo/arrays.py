"""The names of array types, and what may not be written to. Shapes and units are said where a name is used."""

from __future__ import annotations

import math
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

__all__ = ["Bools", "Floats", "Floats32", "Ints", "all_finite", "read_only"]


def all_finite(*arrays: NDArray[Any]) -> bool:
    """Whether none of their numbers is NaN or infinite."""
    with np.errstate(over="ignore", invalid="ignore"):  # the sum alone is quick, and tells of most arrays
        return all(math.isfinite(array.sum()) or bool(np.isfinite(array).all()) for array in arrays)


def read_only(value: object) -> None:
    """Forbid writing to every array in it, in tuples and dataclasses too."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for part in value:
            read_only(part)
    elif is_dataclass(value):
        for field in fields(value):
            read_only(getattr(value, field.name))
