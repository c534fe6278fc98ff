"""Baselines and evaluation in IK cells."""

from __future__ import annotations

from armtempo.agents.ik._baselines import (
    IK_POLICIES,
    GainPolicy,
    IKPolicy,
    LawPolicy,
    NewtonPolicy,
    action_mode_of,
    ik_policy,
)
from armtempo.agents.ik._evaluate import IKEvaluation, IKPolicyResult, evaluate_ik

__all__ = [
    "GainPolicy",
    "IKEvaluation",
    "IKPolicy",
    "IKPolicyResult",
    "IK_POLICIES",
    "LawPolicy",
    "NewtonPolicy",
    "action_mode_of",
    "evaluate_ik",
    "ik_policy",
]
