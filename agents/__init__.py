"""Agents: the policy protocol, baseline and learned policies, their training and their evaluation."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from armtempo.agents.coordination._baselines import (
    POLICIES,
    ExecutionPolicy,
    PhasePlanePolicy,
    RandomPolicy,
    make_policy,
)
from armtempo.agents.coordination._evaluate import ONLINE, Evaluation, PolicyResult, evaluate, run_episode
from armtempo.agents.coordination._split_evaluation import SPLIT_POLICIES, CellComparison, SplitComparison, compare_on
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
from armtempo.agents.policies._agent_file import Agent, AgentHeader, find_agent, load_agent, save_agent, shipped_agents
from armtempo.agents.policies._learned import LearnedOneArmPolicy, LearnedPolicy, learned_policy
from armtempo.agents.policies._policy import Actions, Observations, Policy, RandomActions, SingleArmPolicy, to_action
from armtempo.agents.training._extra import TRAINING, load_training
from armtempo.agents.training._sweep import Objective, SweepTrial, sweep
from armtempo.agents.training._sweep_objective import training_gap

if TYPE_CHECKING:
    from armtempo.agents.training._train import Training, train
    from armtempo.agents.training.vec_envs._batch import BatchVecEnv
    from armtempo.agents.training.vec_envs._parallel import ParallelVecEnv
    from armtempo.agents.training.vec_envs._vector import VectorVecEnv

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
    "BatchVecEnv",
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
