"""Compiled functions that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.charts._regions import cell_at

__all__ = ["cell_at"]
