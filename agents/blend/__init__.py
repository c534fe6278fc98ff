"""Baselines and evaluation in blend cells."""

from __future__ import annotations

from armtempo.agents.blend._baselines import (
    BLEND_POLICIES,
    BlendBaseline,
    ConstantRate,
    blend_baseline,
    highest_rate,
)
from armtempo.agents.blend._kind import BlendKind
from armtempo.agents.blend._result import BlendResult, in_blends, reference_demand, speed_errors

__all__ = [
    "BLEND_POLICIES",
    "BlendBaseline",
    "BlendKind",
    "BlendResult",
    "ConstantRate",
    "blend_baseline",
    "highest_rate",
    "in_blends",
    "reference_demand",
    "speed_errors",
]
