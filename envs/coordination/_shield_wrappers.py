"""The shield as wrappers: in front of environments that were made without."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast, final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv
from pettingzoo.utils import BaseParallelWrapper

from armtempo.arrays import Floats32
from armtempo.envs.common import SavedEnv, action_space, check_names, read_command
from armtempo.envs.coordination._multi_agent_env import CoordinationEnv
from armtempo.envs.coordination._yielding_env import YieldingEnv
from armtempo.envs.coordination.shield import EpisodeShield
from armtempo.envs.coordination.world import ACTION_FORMS, ActionForm
from armtempo.errors import InputError
from armtempo.state import State, Stateful


def _action(asked: Floats32, command: float, admitted: float, size: int) -> Floats32:
    """The action of an admitted command: cut commands are such that it is exact."""
    if admitted != command:
        return np.array([2.0 * admitted - 1.0], dtype=np.float32)
    return asked if size == 1 else np.array(asked[:1], dtype=np.float32)


def _size(below: YieldingEnv | CoordinationEnv, action: ActionForm) -> int:
    """How many numbers actions have, in front of an environment where they have one."""
    if below.options.shield:
        raise InputError(
            "the environment has a shield of its own", remedy="make it with shield=False, or do not wrap it"
        )
    check_names(("action", action, ACTION_FORMS))
    return 1 + ACTION_FORMS.index(action)


class _SavedShield(Stateful):
    """The state of a shield and of the environment that it is in front of."""

    changing = ("_below", "shield")
    _below: SavedEnv
    shield: EpisodeShield

    def get_state(self) -> State:
        """All that changes, of the environment too; ``set_state`` goes on from there. Raises InputError as its own."""
        self._below.get_state()
        return super().get_state()


@final
class ShieldWrapper(_SavedShield, gymnasium.Wrapper[Floats32, Floats32, Floats32, Floats32]):
    """Lets through only actions of the learning arm of a ``YieldingEnv`` that leave a way out.

    Args:
        env: A ``YieldingEnv``, wrapped or not; wrappers below this one must not change actions.
        tube_m: How far arms may be off their references beyond what plans keep in reserve [m].
        action: ``speed``, or ``speed+priority``: what actions have here; the environment gets (1,).

    Raises:
        UnknownNameError: No such form of actions.
        InputError: The environment is another one, or has a shield itself.
        InfeasibleError: The learning arm cannot arrive behind the others.
    """

    def __init__(
        self, env: gymnasium.Env[Floats32, Floats32], tube_m: float = 0.0, action: ActionForm = "speed"
    ) -> None:
        below = getattr(env, "unwrapped", env)
        if not isinstance(below, YieldingEnv):
            raise InputError(f"{type(below).__name__} has no shield", remedy="give a YieldingEnv")
        self._size = _size(below, action)
        super().__init__(env)
        if self._size > 1:
            self.action_space = action_space(self._size)  # type: ignore[assignment]
        self._below: YieldingEnv = below
        self.shield = below.make_shield(tube_m)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """As the environment's."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.shield.reset()
        return observation, info

    def step(self, action: Floats32) -> tuple[Floats32, Any, bool, bool, dict[str, Any]]:
        """As the environment's, with the action that is let through."""
        i = self._below.learner
        commands = np.ones(self._below.simulation.arms)  # those of the others do not count
        priority = np.full(len(commands), np.nan)
        commands[i], priority[i] = read_command(action, self._size, self._below.cell.arms[i].name)
        self.shield.prefer(priority)
        admitted = self.shield.commands(commands)
        passed = _action(action, commands[i], admitted[i], self._size)
        observation, reward, terminated, truncated, info = self.env.step(passed)
        self.shield.look()
        self.shield.report(i, info, terminated or truncated)
        return observation, reward, terminated, truncated, info


@final
class ShieldParallelWrapper(_SavedShield, BaseParallelWrapper[str, Floats32, Floats32]):  # type: ignore[misc]  # untyped library
    """Lets through only actions of the arms of a ``CoordinationEnv`` that leave a way out.

    Args:
        env: A ``CoordinationEnv``, wrapped or not; wrappers below this one must not change actions.
        tube_m: How far arms may be off their references beyond what plans keep in reserve [m].
        action: ``speed``, or ``speed+priority``: what actions have here; the environment gets (1,).

    Raises:
        UnknownNameError: No such form of actions.
        InputError: The environment is another one, or has a shield itself.
        InfeasibleError: No passing order leads all arms to their ends.
    """

    def __init__(
        self, env: ParallelEnv[str, Floats32, Floats32], tube_m: float = 0.0, action: ActionForm = "speed"
    ) -> None:
        below = getattr(env, "unwrapped", env)
        if not isinstance(below, CoordinationEnv):
            raise InputError(f"{type(below).__name__} has no shield", remedy="give a CoordinationEnv")
        self._size = _size(below, action)
        super().__init__(env)
        self._below: CoordinationEnv = below
        self.shield = EpisodeShield(below.simulation, tube_m=tube_m)
        self._spaces = {agent: action_space(self._size) for agent in below.possible_agents}

    def action_space(self, agent: str) -> Box:
        """Box(-1, 1, (1,)) float32; (2,) with a priority."""
        return self._spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Floats32], dict[str, dict[str, Any]]]:
        """As the environment's."""
        observations, infos = self.env.reset(seed=seed, options=options)
        self.shield.reset()
        return observations, infos

    def step(self, actions: dict[str, Floats32]) -> tuple[Any, ...]:
        """As the environment's, with the actions that are let through."""
        given: object = actions  # whatever the annotation says
        if not isinstance(given, Mapping):
            self.env.step(actions)  # it complains
        names = self._below.possible_agents
        commands, priority = np.ones(len(names)), np.full(len(names), np.nan)  # who has arrived stays where it is
        for agent in self.env.agents:
            if agent in actions:  # the environment complains of those that are missing
                i = names.index(agent)
                commands[i], priority[i] = read_command(actions[agent], self._size, agent)
        self.shield.prefer(priority)
        admitted = self.shield.commands(commands)
        passed = {}
        for agent, action in actions.items():
            i = names.index(agent) if agent in names else -1
            passed[agent] = _action(action, commands[i], admitted[i], self._size) if i >= 0 else action
        results = self.env.step(passed)
        self.shield.look()
        for agent, info in results[4].items():
            self.shield.report(names.index(agent), info, results[2][agent] or results[3][agent])
        return cast("tuple[Any, ...]", results)
