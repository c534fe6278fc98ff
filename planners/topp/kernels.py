"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.topp._kernels_all import Edges, Rows, run

__all__ = [
    "Edges",
    "Rows",
    "run",
]
