"""The batched simulator as a ``VecEnv`` of stable-baselines3: one row per episode and learning arm."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, Literal, Self, final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from armtempo.planners import Cell


@final
class BatchVecEnv(VecEnv):
    """A batch of episodes; row ``e L + k`` is learner k of L in episode e.

    An episode of a row is that of all its arms: ``dones`` of its rows are true together, when the last arm has arrived,
    and then only (see ``ParallelVecEnv``). An arm that has arrived earns 0 until then, or the team's share.

    Args:
        batch: A ``CoordinationVectorEnv``.
        learners: Numbers of the arms that learn: those of the batch.
    """

    def __init__(self, batch: Any, learners: Sequence[int]) -> None:
        self.batch = batch
        self.learners = np.array(learners, dtype=np.int64)
        self.episodes = int(batch.num_envs)
        self.render_mode = None
        observation, action = batch.single_observation_space, batch.single_action_space
        super().__init__(self.episodes * len(self.learners), _last_axis(observation), _last_axis(action))
        self._arms = int(batch.arms)
        self._actions = np.ones((self.episodes, self._arms, 1), dtype=np.float32)
        self._returns = np.zeros((self.episodes, len(self.learners)))
        self._steps = np.zeros(self.episodes, dtype=np.int64)
        self._nothing: dict[str, Any] = {}
        self._began = time.perf_counter()

    @classmethod
    def of(
        cls, cells: Sequence[Cell], num_envs: int, *, learners: Literal["last", "all"] = "all", **options: Any
    ) -> Self:
        """Of cells with as many arms; ``options`` as of ``CoordinationVectorEnv``."""
        from armtempo.envs import CoordinationVectorEnv

        arms = len(cells[0].arms)
        mine = (arms - 1,) if learners == "last" else tuple(range(arms))
        return cls(CoordinationVectorEnv(list(cells), num_envs, learners=mine, **options), mine)
