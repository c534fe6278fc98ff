"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.joint_paths._joint_path import PathTable, path_point

__all__ = ["PathTable", "path_point"]
