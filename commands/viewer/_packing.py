"""Arrays as JSON can hold them: base64 of little-endian numbers, with type and shape."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["packed", "unpacked"]

TYPES = {"f": "<f4", "u": "<u4", "i": "<u4"}


def packed(values: ArrayLike) -> dict[str, Any]:
    """Numbers as float32, indices as uint32."""
    array = np.asarray(values)
    array = np.ascontiguousarray(array, dtype=TYPES[array.dtype.kind])
    return {
        "type": array.dtype.str[1:],
        "shape": list(array.shape),
        "base64": base64.b64encode(array.tobytes()).decode("ascii"),
    }


def unpacked(value: dict[str, Any]) -> Any:
    """The array that was packed."""
    return np.frombuffer(base64.b64decode(value["base64"]), dtype="<" + value["type"]).reshape(value["shape"])
