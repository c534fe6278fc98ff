"""The batched simulator as a ``VecEnv`` of stable-baselines3: one row per episode and learning arm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from armtempo.agents.training.vec_envs._whole import WholeVecEnv
from armtempo.arrays import Bools, Floats32, Ints
from armtempo.envs import CoordinationVectorEnv


@final
class BatchVecEnv(WholeVecEnv):
    """A batch of episodes; row ``e L + k`` is learner k of L in episode e.

    An episode of a row is that of all its arms: ``dones`` of its rows are true together, when the last arm has arrived,
    and then only (see ``ParallelVecEnv``). An arm that has arrived earns 0 until then, or the team's share.

    Args:
        batch: The episodes. Episode e gets seed + e.
        cut_penalty: What it costs to ask for 1 more than the shield lets through, per step. Held by the shield, an arm
            may ask for what it likes; this way it learns to slow down by itself.
    """

    def __init__(self, batch: CoordinationVectorEnv, cut_penalty: float = 0.0) -> None:
        self.batch, self._cut_penalty = batch, cut_penalty
        self.learners = np.array(batch.learners, dtype=np.int64)
        self.episodes = batch.num_envs
        super().__init__(batch, self.episodes * len(self.learners), batch.observation_space, batch.action_space)
        self._actions = np.ones((self.episodes, batch.arms, 1), dtype=np.float32)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: episode e gets seed + e; None: something random."""
        drawn = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        self._seeds = [drawn + row // len(self.learners) for row in range(self.num_envs)]
        return self._seeds

    def reset(self) -> Floats32:
        """Start all episodes; uses up the seeds."""
        observations, _ = self.batch.reset(seed=self._seeds[0])
        self._reset_seeds()
        self._returns[:], self._steps[:] = 0.0, 0
        return self._rows(observations)

    def _rows(self, values: NDArray[Any]) -> NDArray[Any]:
        """(E, A, ...) to (E L, ...), a copy."""
        mine = values[:, self.learners]
        return np.ascontiguousarray(mine.reshape(-1, *mine.shape[2:]))

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (rows, 1) for ``step_wait``."""
        self._actions[:, self.learners] = actions.reshape(self.episodes, -1, 1)

    def step_wait(self) -> VecEnvStepReturn:
        """Step the batch; episodes that have ended begin again."""
        observations, rewards, terminated, truncated, told = self.batch.step(self._actions)
        if self._cut_penalty:
            rewards = rewards - self._cut_penalty * np.concatenate([one.shield_cut for one in self.batch.simulations])
        self._returns += self._rows(rewards)
        self._steps += 1
        infos = [self._nothing] * self.num_envs
        ended = (terminated | truncated).all(axis=1)
        if ended.any():
            self._finish(np.flatnonzero(ended), truncated & ~terminated, told, infos)
        dones = np.repeat(ended, len(self.learners))
        return self._rows(observations), self._rows(rewards).astype(np.float32), dones, infos

    def _finish(self, ended: Ints, cut: Bools, told: dict[str, Any], infos: list[dict[str, Any]]) -> None:
        """Tell the rows of these episodes about their end."""
        final, last = told["final_info"], told["final_obs"]
        L = len(self.learners)
        for e in ended:
            for k, arm in enumerate(self.learners):
                infos[e * L + k] = {
                    "terminal_observation": np.array(last[e][arm]),
                    "TimeLimit.truncated": bool(cut[e, arm]),
                    "is_success": bool(final["is_success"][e]),
                    "violation": bool(final["violation"][e]),
                    "makespan_s": float(final["makespan_s"][e]),
                    "episode": self._end(e * L + k),
                }
