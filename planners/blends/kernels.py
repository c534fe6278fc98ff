"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.blends._length_mapping import corrected_parameters, mapped_positions
from armtempo.planners.blends._path_kernels import PackedPath, blended_point

__all__ = [
    "PackedPath",
    "blended_point",
    "corrected_parameters",
    "mapped_positions",
]
