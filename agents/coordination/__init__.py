"""Baselines and evaluation in cells of several arms."""

from __future__ import annotations

from armtempo.agents.coordination._baselines import (
    COORDINATION_POLICIES,
    ExecutionPolicy,
    PhasePlanePolicy,
    make_policy,
)
from armtempo.agents.coordination._kind import ONLINE, CoordinationKind, CoordinationRunner
from armtempo.agents.coordination._result import CoordinationResult, safe_makespan
from armtempo.agents.coordination._split_evaluation import SPLIT_POLICIES, CellComparison, SplitComparison, compare_on

__all__ = [
    "COORDINATION_POLICIES",
    "CellComparison",
    "CoordinationKind",
    "CoordinationResult",
    "CoordinationRunner",
    "ExecutionPolicy",
    "ONLINE",
    "PhasePlanePolicy",
    "SPLIT_POLICIES",
    "SplitComparison",
    "compare_on",
    "make_policy",
    "safe_makespan",
]
