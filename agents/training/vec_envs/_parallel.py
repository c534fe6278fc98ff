"""Any parallel environment as a ``VecEnv`` of stable-baselines3: one row per agent, one policy for all of them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, final

import gymnasium
import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvStepReturn

from armtempo.errors import InputError

AnyParallelEnv = Any  # PettingZoo has no types


@final
class ParallelVecEnv(VecEnv):
    """Copies of a parallel environment; row ``k A + i`` is agent i of A in copy k.

    **An episode of a row is the episode of its environment**: ``dones`` of all rows of a copy are true together, when
    its last agent has ended, and then only. The row of an agent that ended before goes on with observations and rewards
    of zero. Returns are right so, whatever the discount: nothing is added after the end, the row's last true reward
    stands where it was earned, and no episode of nothing but waiting enters the statistics. The value of the zero
    observation is learnt, and is 0.

    At the end ``info`` has what SB3 asks for: ``terminal_observation``; ``TimeLimit.truncated``, true for agents that
    were truncated and not for those that had terminated, so that only the former are bootstrapped; ``episode`` (sum of
    rewards ``r``, steps ``l`` of the agent itself, seconds ``t``) as ``Monitor`` has it; and the agent's own last info.

    Args:
        make_env: Makes one copy; all agents must share one observation space and one action space (1-D boxes).
        n: How many copies. Copy k gets seed + k.

    Raises:
        InputError: Less than one copy, or agents of different spaces.
    """

    def __init__(self, make_env: Callable[[], AnyParallelEnv], n: int = 1) -> None:
        if n < 1:
            raise InputError(f"ParallelVecEnv needs at least one environment, got {n}")
        self.envs = [make_env() for _ in range(n)]
        self.agents: list[str] = list(self.envs[0].possible_agents)
        spaces = [(self.envs[0].observation_space(agent), self.envs[0].action_space(agent)) for agent in self.agents]
        if any(space != spaces[0] for space in spaces):
            raise InputError(
                "agents with different observation or action spaces cannot share a policy",
                remedy="give an environment whose agents all have the same spaces",
            )
        observation, action = spaces[0]
        rows = n * len(self.agents)
        super().__init__(rows, observation, action)
        assert observation.shape is not None
        self._observations = np.zeros((rows, *observation.shape), dtype=observation.dtype)
        self._rewards = np.zeros(rows, dtype=np.float32)
        self._dones = np.zeros(rows, dtype=np.bool_)
        self._row = {agent: i for i, agent in enumerate(self.agents)}
        self._returns, self._steps = [0.0] * rows, [0] * rows
        self._last: list[dict[str, Any]] = [{} for _ in range(rows)]  # of agents that have ended
        self._cut = [False] * rows  # truncated, not terminated
        self._began = time.perf_counter()

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seed the next reset: copy k gets seed + k; None: something random."""
        drawn = int(np.random.default_rng().integers(2**31)) if seed is None else seed
        A = len(self.agents)
        self._seeds = [drawn + row // A for row in range(self.num_envs)]
        return self._seeds

    def reset(self) -> NDArray[Any]:
        """Start all copies; uses up the seeds and options."""
        A = len(self.agents)
        for k in range(len(self.envs)):
            infos = self._start(k, seed=self._seeds[k * A], options=self._options[k * A] or None)
            for agent, i in self._row.items():
                self.reset_infos[k * A + i] = infos.get(agent, {})
        self._reset_seeds()
        self._reset_options()
        return self._observations.copy()

    def _start(self, k: int, **how: Any) -> Any:
        """A new episode of copy k; its infos by agent."""
        observations, infos = self.envs[k].reset(**how)
        first = k * len(self.agents)
        for agent, i in self._row.items():
            row = first + i
            self._observations[row] = observations[agent]
            self._returns[row], self._steps[row], self._last[row], self._cut[row] = 0.0, 0, {}, False
        return infos

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (rows, n) for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Step all copies; one whose last agent has ended begins a new episode."""
        actions, observations, rewards, dones = self._actions, self._observations, self._rewards, self._dones
        rewards[:], dones[:] = 0.0, False
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        A, row_of = len(self.agents), self._row
        for k, env in enumerate(self.envs):
            first = k * A
            seen, earned, terminated, truncated, told = env.step(
                {agent: actions[first + row_of[agent]] for agent in env.agents}
            )
            for agent, reward in earned.items():
                row = first + row_of[agent]
                rewards[row], infos[row] = reward, told[agent]
                self._returns[row] += reward
                self._steps[row] += 1
                observations[row] = seen[agent]
                if terminated[agent] or truncated[agent]:
                    self._last[row] = infos[row]
                    self._cut[row] = truncated[agent] and not terminated[agent]
                    if env.agents:  # others go on: this row waits for them
                        observations[row] = 0.0
            if not env.agents:
                self._finish(k, infos)
        return observations.copy(), rewards.copy(), dones.copy(), infos

    def _finish(self, k: int, infos: list[dict[str, Any]]) -> None:
        """The end of an episode of copy k, and the start of the next."""
        A = len(self.agents)
        seconds = round(time.perf_counter() - self._began, 6)
        for row in range(k * A, (k + 1) * A):
            self._dones[row] = True
            infos[row] = self._last[row] | {
                "terminal_observation": self._observations[row].copy(),
                "TimeLimit.truncated": self._cut[row],
                "episode": {"r": self._returns[row], "l": self._steps[row], "t": seconds},
            }
        told = self._start(k)
        for agent, i in self._row.items():
            self.reset_infos[k * A + i] = told.get(agent, {})

    def close(self) -> None:
        """Close all copies."""
        for env in self.envs:
            env.close()

    def _of(self, indices: VecEnvIndices) -> list[AnyParallelEnv]:
        return [self.envs[row // len(self.agents)] for row in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of each row's environment."""
        return [getattr(env, attr_name) for env in self._of(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of each row's environment, which it shares with the rows of its other agents."""
        for env in self._of(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of each environment that has a row among ``indices``, once; its result for each row."""
        results = {
            id(env): getattr(env, method_name)(*method_args, **method_kwargs) for env in _once(self._of(indices))
        }
        return [results[id(env)] for env in self._of(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Parallel environments have no Gymnasium wrappers."""
        return [False for _ in self._of(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """One image per copy."""
        return [env.render() for env in self.envs]


def _once(envs: Sequence[AnyParallelEnv]) -> list[AnyParallelEnv]:
    return list({id(env): env for env in envs}.values())
