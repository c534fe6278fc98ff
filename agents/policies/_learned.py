"""Policies that run agent files: the same thing to an evaluation as any baseline."""

from __future__ import annotations

from typing import Any, final, overload

from armtempo.agents.policies._agent_file import Agent, find_agent
from armtempo.agents.policies._policy import Actions, Observations, action_size, to_action
from armtempo.arrays import Floats32
from armtempo.errors import InputError


@final
class LearnedPolicy:
    """An agent; of several arms it decides for the last one while the others run at full speed, or for all."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget: its actions are deterministic."""

    @overload
    def act(self, observation: Floats32, env: Any) -> Floats32: ...
    @overload
    def act(self, observation: Observations, env: Any) -> Actions: ...
    def act(self, observation: Floats32 | Observations, env: Any) -> Floats32 | Actions:
        """Its action, or one for every agent that is observed."""
        if not isinstance(observation, dict):
            return self.agent.act(observation)
        mine = set(observation) if self.agent.header.learners == "all" else {env.possible_agents[-1]}
        return {
            name: self.agent.act(row) if name in mine else to_action(1.0, action_size(env, name))
            for name, row in observation.items()
        }


def learned_policy(name: str, env: Any, environment: str = "coordination") -> LearnedPolicy:
    """The policy of an agent's name (``ppo:...``) in an environment.

    Args:
        name: Of the agent.
        env: Where it is to act.
        environment: What agent files call it.

    Raises:
        UnknownNameError: No such agent comes with armtempo.
        InputError: The file cannot be used, or the agent is for something else.
    """
    agent = find_agent(name)
    _check_kind(name, agent, environment)
    for what in ("action", "mode") if environment == "coordination" else ():
        trained, here = agent.header.settings.get(what, "speed"), getattr(env.options, what)
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
    seen, actions = (space.shape[0] for space in spaces)
    if (len(agent.header.entries), agent.actions) != (seen, actions):
        raise InputError(
            f"{name} sees {len(agent.header.entries)} numbers and gives {agent.actions}; here there are {seen} to see "
            f"and {actions} to give",
            remedy="evaluate it on an arm with as many joints, or train it with this version of armtempo",
        )
