"""Baselines and evaluation in IK cells."""

from __future__ import annotations

from armtempo.agents.ik._baselines import (
    IK_POLICIES,
    GainPolicy,
    LawPolicy,
    NewtonPolicy,
    action_mode_of,
    ik_policy,
)
from armtempo.agents.ik._kind import IKKind
from armtempo.agents.ik._result import IKResult

__all__ = [
    "GainPolicy",
    "IKKind",
    "IKResult",
    "IK_POLICIES",
    "LawPolicy",
    "NewtonPolicy",
    "action_mode_of",
    "ik_policy",
]
