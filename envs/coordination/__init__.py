"""Several arms on given paths: the multi-agent, the yielding and the vector environments."""

from __future__ import annotations

from armtempo.envs.coordination._batch import REWARDS, BatchSimulation
from armtempo.envs.coordination._episode import time_limit
from armtempo.envs.coordination._multi_agent_env import CoordinationEnv
from armtempo.envs.coordination._shield_wrappers import ShieldParallelWrapper, ShieldWrapper
from armtempo.envs.coordination._vector_envs import CoordinationVectorEnv, YieldingVectorEnv
from armtempo.envs.coordination._yielding_env import YieldingEnv
from armtempo.envs.coordination.world import CoordinationKeywords, CoordinationOptions

__all__ = [
    "CoordinationKeywords",
    "CoordinationOptions",
    "BatchSimulation",
    "CoordinationEnv",
    "CoordinationVectorEnv",
    "REWARDS",
    "ShieldParallelWrapper",
    "ShieldWrapper",
    "YieldingEnv",
    "YieldingVectorEnv",
    "time_limit",
]
