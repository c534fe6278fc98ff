"""Baselines and evaluation in cells of several arms."""

from __future__ import annotations

from armtempo.agents.coordination._baselines import (
    POLICIES,
    ExecutionPolicy,
    PhasePlanePolicy,
    RandomPolicy,
    make_policy,
)
from armtempo.agents.coordination._evaluate import ONLINE, Evaluation, PolicyResult, evaluate, run_episode
from armtempo.agents.coordination._split_evaluation import SPLIT_POLICIES, CellComparison, SplitComparison, compare_on

__all__ = [
    "CellComparison",
    "Evaluation",
    "ExecutionPolicy",
    "ONLINE",
    "POLICIES",
    "PhasePlanePolicy",
    "PolicyResult",
    "RandomPolicy",
    "SPLIT_POLICIES",
    "SplitComparison",
    "compare_on",
    "evaluate",
    "make_policy",
    "run_episode",
]
