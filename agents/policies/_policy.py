"""What an agent is: something that turns observations into actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeVar, final, overload

import numpy as np

from armtempo.agents.policies._agent_file import find_agent, is_agent_name
from armtempo.arrays import Floats32
from armtempo.errors import InputError, UnknownNameError, brief

Observations = dict[str, Floats32]
Actions = dict[str, Floats32]
ObservationT_contra = TypeVar("ObservationT_contra", contravariant=True)
ActionT_co = TypeVar("ActionT_co", covariant=True)


class Policy(Protocol[ObservationT_contra, ActionT_co]):
    """Decides in an environment; baselines and learned agents alike.

    In PettingZoo ``Policy[Observations, Actions]``: a row for every agent that is observed, and one action (1,) float32
    in [-1, 1] for each. In Gymnasium ``Policy[Floats32, Floats32]``: one row, and one action of the space.
    """

    def reset(self, seed: int | None = None) -> None:
        """Forget the last episode; all randomness comes from ``seed``."""
        ...

    def act(self, observation: ObservationT_contra, env: Any, /) -> ActionT_co:
        """What to do about an observation of ``env``."""
        ...


@final
class RandomPolicy:
    """Uniform actions."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Start the random numbers again."""
        self._random = np.random.default_rng(seed)

    @overload
    def act(self, observation: Floats32, env: Any) -> Floats32: ...
    @overload
    def act(self, observation: Observations, env: Any) -> Actions: ...
    def act(self, observation: Floats32 | Observations, env: Any) -> Floats32 | Actions:
        """Draw an action, or one for every agent."""
        if isinstance(observation, dict):
            return {agent: self._draw(env.action_space(agent).shape) for agent in observation}
        return self._draw(env.action_space.shape)

    def _draw(self, shape: tuple[int, ...]) -> Floats32:
        return self._random.uniform(-1.0, 1.0, shape).astype(np.float32)


def to_action(command: float, size: int = 1) -> Floats32:
    """A command in [0, 1] as an action (size,); a priority, if it has one, is 0."""
    action = np.zeros(size, dtype=np.float32)
    action[0] = 2.0 * command - 1.0
    return action


def action_size(env: Any, agent: str) -> int:
    """How many numbers an action of an agent has."""
    return int(env.action_space(agent).shape[0])


def chosen_policies(policies: Sequence[str] | str | None, known: Sequence[str], episodes: int) -> tuple[str, ...]:
    """The policies that an evaluation is asked for, ``known`` ones or learned agents; None: all that are ``known``.

    Raises:
        UnknownNameError: A policy or agent that does not exist.
        InputError: Less than one episode, or an agent's file that cannot be used.
    """
    chosen = known if policies is None else (policies,) if isinstance(policies, str) else policies
    if not isinstance(chosen, Sequence):
        raise InputError(f"policies are names, got {brief(policies)}", remedy=f"known: {', '.join(known)}")
    for name in chosen:
        if isinstance(name, str) and is_agent_name(name):
            find_agent(name)  # before anything runs
        elif not isinstance(name, str) or name not in known:
            raise UnknownNameError("policy", name, known)
    if isinstance(episodes, bool) or not isinstance(episodes, int | np.integer):
        raise InputError(f"episodes must be a whole number, got {brief(episodes)}", remedy="give 1 or more")
    if episodes < 1:
        raise InputError(f"episodes must be at least 1, got {brief(episodes)}")
    return tuple(chosen)
