"""A vector environment of Gymnasium as a ``VecEnv`` of stable-baselines3."""

from __future__ import annotations

from typing import Any, final

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from armtempo.agents.training.vec_envs._whole import WholeVecEnv
from armtempo.arrays import Floats32
from armtempo.envs import FeedbackIKVectorEnv
from armtempo.errors import InputError


@final
class VectorVecEnv(WholeVecEnv):
    """One row per environment.

    Args:
        vector: The environments, which begin anew in the step that ends an episode (``SAME_STEP``).
        reward_scale: Multiplies rewards; the returns in infos are unscaled.

    Raises:
        InputError: The environments begin anew in the step after.
    """

    def __init__(self, vector: FeedbackIKVectorEnv, reward_scale: float = 1.0) -> None:
        if vector.autoreset_mode != AutoresetMode.SAME_STEP:
            raise InputError(
                f"autoreset_mode is {vector.autoreset_mode.value!r}", remedy="make them with autoreset_mode=SAME_STEP"
            )
        self.vector, self._scale = vector, reward_scale
        super().__init__(vector, vector.num_envs, vector.single_observation_space, vector.single_action_space)

    def reset(self) -> Floats32:
        """Start all episodes; uses up the seeds."""
        observations, _ = self.vector.reset(seed=self._seeds)
        self._reset_seeds()
        self._returns[:], self._steps[:] = 0.0, 0
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step all environments; episodes that have ended begin again."""
        observations, rewards, terminated, truncated, told = self.vector.step(self._actions)
        self._returns += rewards
        self._steps += 1
        infos = [self._nothing] * self.num_envs
        ended = terminated | truncated
        for e in np.flatnonzero(ended).tolist():
            infos[e] = {
                "terminal_observation": told["final_obs"][e].copy(),
                "TimeLimit.truncated": bool(truncated[e]),
                "is_success": bool(told["final_info"]["is_success"][e]),
                "episode": self._end(e),
            }
        return observations, (self._scale * rewards).astype(np.float32), ended, infos
