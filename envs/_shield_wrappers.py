"""The shield as wrappers: in front of environments that were made without."""

from __future__ import annotations

from typing import Any, cast, final

import gymnasium
import numpy as np
from numpy.typing import NDArray
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from armtempo.envs._coordination import CoordinationEnv
from armtempo.envs._episode import read_action
from armtempo.envs._shield import EpisodeShield
from armtempo.envs._yielding import YieldingEnv
from armtempo.errors import InputError

Observation = NDArray[np.float32]
Action = NDArray[np.float32]


def _action(asked: Action, command: float, admitted: float) -> Action:
    """The action of an admitted command: cut commands are such that it is exact."""
    return asked if admitted == command else np.array([2.0 * admitted - 1.0], dtype=np.float32)


@final
class ShieldWrapper(gymnasium.Wrapper[Observation, Action, Observation, Action]):
    """Lets through only actions of the learning arm of a ``YieldingEnv`` that leave a way out.

    Args:
        env: A ``YieldingEnv``, wrapped or not; wrappers below this one must not change actions.
        tube_m: How far arms may be off their references beyond what plans keep in reserve [m].

    Raises:
        InputError: The environment is another one.
        InfeasibleError: The learning arm cannot arrive behind the others.
    """

    def __init__(self, env: gymnasium.Env[Observation, Action], tube_m: float = 0.0) -> None:
        super().__init__(env)
        below = env.unwrapped
        if not isinstance(below, YieldingEnv):
            raise InputError(f"{type(below).__name__} has no shield", remedy="give a YieldingEnv")
        self._below: YieldingEnv = below
        self.shield: EpisodeShield = below.make_shield(tube_m)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """As the environment's."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.shield.reset()
        return observation, info

    def step(self, action: Action) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """As the environment's, with the action that is let through."""
        i = self._below.learner
        commands = np.ones(self._below.simulation.arms)  # those of the others do not count
        commands[i] = read_action(action, self._below.cell.arms[i].name)
        admitted = self.shield.commands(commands)
        observation, reward, terminated, truncated, info = self.env.step(_action(action, commands[i], admitted[i]))
        self.shield.report(i, info, terminated or truncated)
        return observation, reward, terminated, truncated, info


@final
class ShieldParallelWrapper(BaseParallelWrapper[str, Observation, Action]):  # type: ignore[misc]  # untyped library
    """Lets through only actions of the arms of a ``CoordinationEnv`` that leave a way out.

    Args:
        env: A ``CoordinationEnv``, wrapped or not; wrappers below this one must not change actions.
        tube_m: How far arms may be off their references beyond what plans keep in reserve [m].

    Raises:
        InputError: The environment is another one.
        InfeasibleError: No passing order leads all arms to their ends.
    """

    def __init__(self, env: ParallelEnv[str, Observation, Action], tube_m: float = 0.0) -> None:
        super().__init__(env)
        below = env.unwrapped
        if not isinstance(below, CoordinationEnv):
            raise InputError(f"{type(below).__name__} has no shield", remedy="give a CoordinationEnv")
        self._below: CoordinationEnv = below
        self.shield: EpisodeShield = EpisodeShield(below.simulation, tube_m=tube_m)

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """As the environment's."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self.shield.reset()
        return observations, infos

    def step(self, actions: dict[str, Action]) -> tuple[Any, ...]:
        """As the environment's, with the actions that are let through."""
        names = self._below.possible_agents
        commands = np.ones(len(names))  # who has arrived stays where it is
        for agent in self.env.agents:
            if agent in actions:  # the environment complains of those that are missing
                commands[names.index(agent)] = read_action(actions[agent], agent)
        admitted = self.shield.commands(commands)
        passed = {}
        for agent, action in actions.items():
            i = names.index(agent) if agent in names else -1
            passed[agent] = _action(action, commands[i], admitted[i]) if i >= 0 else action
        results = self.env.step(passed)
        for agent, info in results[4].items():
            self.shield.report(names.index(agent), info, results[2][agent] or results[3][agent])
        return cast("tuple[Any, ...]", results)
