"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.topp._kernels_all import FIXED, Edges, Rows, bounds_in, find, run

__all__ = [
    "FIXED",
    "Edges",
    "Rows",
    "bounds_in",
    "find",
    "run",
]
