"""Agents: the policy protocol, baseline policies, and their evaluation."""

from __future__ import annotations

from armtempo.agents._baselines import (
    POLICIES,
    ExecutionPolicy,
    PhasePlanePolicy,
    RandomPolicy,
    make_policy,
)
from armtempo.agents._evaluate import Evaluation, PolicyResult, evaluate, run_episode
from armtempo.agents._policy import Actions, Observations, Policy, to_action

__all__ = [
    "POLICIES",
    "Actions",
    "Evaluation",
    "Observations",
    "ExecutionPolicy",
    "PhasePlanePolicy",
    "Policy",
    "PolicyResult",
    "RandomPolicy",
    "evaluate",
    "make_policy",
    "run_episode",
    "to_action",
]
