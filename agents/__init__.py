"""Agents: the policy protocol, baseline and learned policies, their training and their evaluation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.agents.blend import (
    BLEND_POLICIES,
    BlendBaseline,
    BlendResult,
    ConstantRate,
    blend_baseline,
    highest_rate,
    in_blends,
    reference_demand,
    speed_errors,
)
from armtempo.agents.coordination import (
    COORDINATION_POLICIES,
    SPLIT_POLICIES,
    CellComparison,
    CoordinationResult,
    ExecutionPolicy,
    PhasePlanePolicy,
    SplitComparison,
    compare_on,
    make_policy,
)
from armtempo.agents.evaluation import (
    Evaluation,
    Figure,
    Kind,
    asked_options,
    figure,
    figures_of,
    option_names,
    run_episode,
)
from armtempo.agents.ik import (
    IK_POLICIES,
    GainPolicy,
    IKResult,
    LawPolicy,
    NewtonPolicy,
    action_mode_of,
    ik_policy,
)
from armtempo.agents.kinds import (
    KINDS,
    BlendEvaluation,
    CoordinationEvaluation,
    IKEvaluation,
    evaluate,
    kind_named,
)
from armtempo.agents.policies import (
    Actions,
    Agent,
    AgentHeader,
    LearnedPolicy,
    Observations,
    Policy,
    RandomPolicy,
    find_agent,
    learned_policy,
    load_agent,
    save_agent,
    to_action,
)
from armtempo.agents.training import TRAINING, Objective, SweepTrial, load_training, sweep, training_gap

if TYPE_CHECKING:
    from armtempo.agents.training._graph_module import GraphNetwork
    from armtempo.agents.training._train import Training, train
    from armtempo.agents.training.vec_envs import ParallelVecEnv, VectorVecEnv

__all__ = [
    "BLEND_POLICIES",
    "COORDINATION_POLICIES",
    "IK_POLICIES",
    "KINDS",
    "SPLIT_POLICIES",
    "Actions",
    "Agent",
    "AgentHeader",
    "BlendBaseline",
    "BlendEvaluation",
    "BlendResult",
    "CellComparison",
    "ConstantRate",
    "CoordinationEvaluation",
    "CoordinationResult",
    "Evaluation",
    "ExecutionPolicy",
    "Figure",
    "GainPolicy",
    "GraphNetwork",
    "IKEvaluation",
    "IKResult",
    "Kind",
    "LawPolicy",
    "LearnedPolicy",
    "NewtonPolicy",
    "Objective",
    "Observations",
    "ParallelVecEnv",
    "PhasePlanePolicy",
    "Policy",
    "RandomPolicy",
    "SplitComparison",
    "SweepTrial",
    "Training",
    "VectorVecEnv",
    "action_mode_of",
    "asked_options",
    "blend_baseline",
    "compare_on",
    "evaluate",
    "figure",
    "figures_of",
    "find_agent",
    "highest_rate",
    "ik_policy",
    "in_blends",
    "kind_named",
    "learned_policy",
    "load_agent",
    "make_policy",
    "option_names",
    "reference_demand",
    "run_episode",
    "save_agent",
    "speed_errors",
    "sweep",
    "to_action",
    "train",
    "training_gap",
]


def __getattr__(name: str) -> object:
    """Import what needs torch and stable-baselines3 on first use (PEP 562)."""
    if name in TRAINING:
        return load_training(name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
