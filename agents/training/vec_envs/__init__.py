"""Our environments as vectors of Stable-Baselines3."""

from __future__ import annotations

from armtempo.agents.training.vec_envs._parallel import ParallelVecEnv
from armtempo.agents.training.vec_envs._team import TeamVecEnv
from armtempo.agents.training.vec_envs._vector import VectorVecEnv

__all__ = [
    "ParallelVecEnv",
    "TeamVecEnv",
    "VectorVecEnv",
]
