"""Compiled loops that other rooms call. Not public: they change without notice."""

from __future__ import annotations

from armtempo.planners.ik._law import LIMIT, Law, Scratch, Targets, law_within, scaled, scratch, tip_and_jacobian

__all__ = [
    "LIMIT",
    "Law",
    "Scratch",
    "Targets",
    "law_within",
    "scaled",
    "scratch",
    "tip_and_jacobian",
]
