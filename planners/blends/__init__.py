"""Rounded corners of lines and arcs (Lee2006), their arc length and its inverse."""

from __future__ import annotations

from armtempo.planners.blends._blend import Blend, blend, least_time_blend
from armtempo.planners.blends._blended_path import BlendedPath
from armtempo.planners.blends._families import CURVES, PassingLimits
from armtempo.planners.blends._length_mapping import (
    ExactMapping,
    LengthMapping,
    PredictorCorrector,
    arc_length,
    rk4_length,
)
from armtempo.planners.blends._passing_cost import passing_cost

__all__ = [
    "Blend",
    "BlendedPath",
    "CURVES",
    "ExactMapping",
    "LengthMapping",
    "PassingLimits",
    "PredictorCorrector",
    "arc_length",
    "blend",
    "least_time_blend",
    "passing_cost",
    "rk4_length",
]
