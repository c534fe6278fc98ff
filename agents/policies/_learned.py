"""Policies that run agent files: the same thing to an evaluation as any baseline."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar, final, overload

import numpy as np

from armtempo.agents.policies._agent_file import Agent, find_agent
from armtempo.agents.policies._policy import Actions, Observations, action_size, to_action
from armtempo.arrays import Floats32
from armtempo.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@final
class LearnedPolicy:
    """An agent; of several arms it decides for the last one while the others run at full speed, or for all."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Forget the action that is held; actions are deterministic."""
        self._periods = 0
        self._held: Floats32 | None = None

    @overload
    def act(self, observation: Floats32, env: Any) -> Floats32: ...
    @overload
    def act(self, observation: Observations, env: Any) -> Actions: ...
    def act(self, observation: Floats32 | Observations, env: Any) -> Floats32 | Actions:
        """Its action, or one for every agent that is observed."""
        if self.agent.header.network == "graph":
            acted: Actions = self._act_on_graph(observation, env)
            return acted
        if not isinstance(observation, dict):
            return self.agent.act(observation)
        mine = set(observation) if self.agent.header.learners == "all" else {env.possible_agents[-1]}
        return {
            name: self.agent.act(row) if name in mine else to_action(1.0, action_size(env, name))
            for name, row in observation.items()
        }

    def _act_on_graph(self, observation: Any, env: Any) -> Any:
        """All arms see the same graph, each its own place in it; decided anew every ``decide_every`` periods."""
        seen = observation if "own" in observation else next(iter(observation.values()))
        actions = self._held
        if actions is None or self._periods >= self.agent.header.decide_every:
            self._held = actions = self.agent.act_on_graph(seen["nodes"], seen["edges"])
            self._periods = 0
        self._periods += 1
        if "own" in observation:
            return actions[int(np.argmax(seen["own"]))]
        return {name: actions[env.possible_agents.index(name)] for name in observation}


OWN_OPTIONS = {"action": "speed", "observation": "local", "orders": "asked"}
"""Options of episodes that are the agent's own affair, not what happens to it, and what they are unless it says."""

OptionsT = TypeVar("OptionsT", bound="DataclassInstance")


def options_of_agent(name: str, options: OptionsT) -> OptionsT:
    """The options of a coordination cell's episodes with those of the agent: how it sees, asks and is served.

    Raises:
        InputError: Its file cannot be used, or it needs a shield and there is none.
    """
    settings = find_agent(name).header.settings
    own = {key: settings.get(key, usual) for key, usual in OWN_OPTIONS.items()}
    if own != OWN_OPTIONS and not getattr(options, "shield", False):
        raise InputError(f"{name} acts under a shield", remedy="evaluate it with shield=True (--shield)")
    return replace(options, **own)


def learned_policy(name: str, env: Any, environment: str = "coordination") -> LearnedPolicy:
    """The policy of an agent's name (``ppo:FILE.npz``) in an environment.

    Args:
        name: Of the agent.
        env: Where it is to act.
        environment: What agent files call it.

    Raises:
        InputError: The file cannot be used, or the agent is for something else.
    """
    agent = find_agent(name)
    _check_kind(name, agent, environment)
    usual = {**OWN_OPTIONS, "mode": "speed"}
    for what in usual if environment == "coordination" else ():
        trained, here = agent.header.settings.get(what, usual[what]), getattr(env.options, what)
        if trained != here:
            raise InputError(
                f"{name} was trained with {what} {trained}, and this is {here}",
                remedy=f'evaluate it with {what}="{trained}"',
            )
    _check_fits(name, agent, env)
    return LearnedPolicy(agent)


def _check_kind(name: str, agent: Agent, environment: str) -> None:
    """Raise InputError unless an agent is one of this environment."""
    if agent.header.environment != environment:
        raise InputError(
            f"{name} is an agent of {agent.header.environment}, not of {environment}",
            remedy="evaluate it in a cell of its kind",
        )


def _check_fits(name: str, agent: Agent, env: Any) -> None:
    """Raise InputError unless an agent's observations and actions are the env's."""
    several = hasattr(env, "possible_agents")
    spaces = (
        (env.observation_space(env.possible_agents[0]), env.action_space(env.possible_agents[0]))
        if several
        else (env.observation_space, env.action_space)
    )
    if agent.header.network == "graph":  # of any number of arms; the settings fit
        return
    seen, actions = (space.shape[0] for space in spaces)
    if (len(agent.header.entries), agent.actions) != (seen, actions):
        raise InputError(
            f"{name} sees {len(agent.header.entries)} numbers and gives {agent.actions}; here there are {seen} to see "
            f"and {actions} to give",
            remedy="evaluate it on an arm with as many joints, or train it with this version of armtempo",
        )
