"""Baselines and evaluation in blend cells."""

from __future__ import annotations

from armtempo.agents.blend._baselines import (
    BLEND_POLICIES,
    BlendBaseline,
    BlendPolicy,
    ConstantRate,
    blend_baseline,
    highest_rate,
)
from armtempo.agents.blend._evaluate import (
    BlendEvaluation,
    BlendPolicyResult,
    evaluate_blend,
    in_blends,
    reference_demand,
    run_blend_episode,
    speed_errors,
)

__all__ = [
    "BLEND_POLICIES",
    "BlendBaseline",
    "BlendEvaluation",
    "BlendPolicy",
    "BlendPolicyResult",
    "ConstantRate",
    "blend_baseline",
    "evaluate_blend",
    "highest_rate",
    "in_blends",
    "reference_demand",
    "run_blend_episode",
    "speed_errors",
]
