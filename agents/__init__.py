"""Agents: the policy protocol, baseline and learned policies, their training and their evaluation."""

from __future__ import annotations

from typing import TYPE_CHECKING

from armtempo.agents.blend import (
    BLEND_POLICIES,
    BlendBaseline,
    BlendEvaluation,
    BlendPolicy,
    BlendPolicyResult,
    ConstantRate,
    blend_baseline,
    evaluate_blend,
    highest_rate,
    in_blends,
    reference_demand,
    run_blend_episode,
    speed_errors,
)
from armtempo.agents.coordination import (
    ONLINE,
    POLICIES,
    SPLIT_POLICIES,
    CellComparison,
    Evaluation,
    ExecutionPolicy,
    PhasePlanePolicy,
    PolicyResult,
    RandomPolicy,
    SplitComparison,
    compare_on,
    evaluate,
    make_policy,
    run_episode,
)
from armtempo.agents.ik import (
    IK_POLICIES,
    GainPolicy,
    IKEvaluation,
    IKPolicy,
    IKPolicyResult,
    LawPolicy,
    NewtonPolicy,
    action_mode_of,
    evaluate_ik,
    ik_policy,
)
from armtempo.agents.policies import (
    Actions,
    Agent,
    AgentHeader,
    LearnedOneArmPolicy,
    LearnedPolicy,
    Observations,
    Policy,
    RandomActions,
    SingleArmPolicy,
    find_agent,
    learned_policy,
    load_agent,
    save_agent,
    shipped_agents,
    to_action,
)
from armtempo.agents.training import TRAINING, Objective, SweepTrial, load_training, sweep, training_gap

if TYPE_CHECKING:
    from armtempo.agents.training._train import Training, train
    from armtempo.agents.training.vec_envs import ParallelVecEnv, VectorVecEnv

__all__ = [
    "SPLIT_POLICIES",
    "CellComparison",
    "SplitComparison",
    "compare_on",
    "BLEND_POLICIES",
    "ONLINE",
    "POLICIES",
    "Actions",
    "BlendBaseline",
    "BlendEvaluation",
    "BlendPolicy",
    "BlendPolicyResult",
    "ConstantRate",
    "Evaluation",
    "ExecutionPolicy",
    "Observations",
    "PhasePlanePolicy",
    "Policy",
    "PolicyResult",
    "RandomPolicy",
    "blend_baseline",
    "evaluate",
    "evaluate_blend",
    "highest_rate",
    "in_blends",
    "make_policy",
    "reference_demand",
    "run_blend_episode",
    "run_episode",
    "speed_errors",
    "to_action",
    "IKEvaluation",
    "IKPolicyResult",
    "evaluate_ik",
    "IK_POLICIES",
    "IKPolicy",
    "GainPolicy",
    "LawPolicy",
    "action_mode_of",
    "NewtonPolicy",
    "ik_policy",
    "RandomActions",
    "SingleArmPolicy",
    "ParallelVecEnv",
    "VectorVecEnv",
    "Training",
    "train",
    "Agent",
    "AgentHeader",
    "LearnedOneArmPolicy",
    "LearnedPolicy",
    "find_agent",
    "learned_policy",
    "load_agent",
    "save_agent",
    "shipped_agents",
    "Objective",
    "SweepTrial",
    "sweep",
    "training_gap",
]


def __getattr__(name: str) -> object:
    """Import what needs torch and stable-baselines3 on first use (PEP 562)."""
    if name in TRAINING:
        return load_training(name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
