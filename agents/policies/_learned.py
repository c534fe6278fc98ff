"""Policies that run agent files: the same thing to an evaluation as any baseline."""

from __future__ import annotations

from typing import Any, final

from armtempo.agents.policies._agent_file import Agent, find_agent
from armtempo.agents.policies._policy import Actions, Observations, to_action
from armtempo.arrays import Floats32
from armtempo.envs import BlendTrackingEnv, CoordinationEnv, FeedbackIKEnv
from armtempo.errors import InputError


@final
class LearnedPolicy:
    """An agent of cells of several arms: decides for the last arm while the others run at full speed, or for all."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget: its actions are deterministic."""

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """One action for every agent that is observed."""
        mine = set(observations) if self.agent.header.learners == "all" else {env.possible_agents[-1]}
        return {agent: self.agent.act(row) if agent in mine else to_action(1.0) for agent, row in observations.items()}


@final
class LearnedOneArmPolicy:
    """An agent of an environment with one arm."""

    def __init__(self, agent: Agent) -> None:
        self.agent = agent

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget: its actions are deterministic."""

    def act(self, observation: Floats32, env: BlendTrackingEnv | FeedbackIKEnv) -> Floats32:
        """Its action."""
        return self.agent.act(observation)


def learned_policy(name: str, env: CoordinationEnv) -> LearnedPolicy:
    """The policy of an agent's name (``ppo:...``) in an environment.

    Raises:
        UnknownNameError: No such agent comes with armtempo.
        InputError: The file cannot be used, or the agent is for something else.
    """
    agent = find_agent(name)
    check_fits(name, agent, env, "coordination")
    if agent.header.settings.get("mode", "speed") != env.options.mode:
        raise InputError(
            f"{name} was trained in mode {agent.header.settings['mode']}, and this is {env.options.mode}",
            remedy=f"evaluate it in mode {agent.header.settings['mode']}",
        )
    return LearnedPolicy(agent)


def check_fits(
    name: str, agent: Agent, env: CoordinationEnv | BlendTrackingEnv | FeedbackIKEnv, environment: str
) -> None:
    """Raise InputError unless an agent is one of this environment, and its observations and actions are the env's."""
    if agent.header.environment != environment:
        raise InputError(
            f"{name} is an agent of {agent.header.environment}, not of {environment}",
            remedy="evaluate it in a cell of its kind",
        )
    spaces: Any = (
        (env.observation_spaces["arm_0"], env.action_spaces["arm_0"])
        if isinstance(env, CoordinationEnv)
        else (env.observation_space, env.action_space)
    )
    seen, actions = (space.shape[0] for space in spaces)
    if (len(agent.header.entries), agent.actions) != (seen, actions):
        raise InputError(
            f"{name} sees {len(agent.header.entries)} numbers and gives {agent.actions}; here there are {seen} to see "
            f"and {actions} to give",
            remedy="evaluate it on an arm with as many joints, or train it with this version of armtempo",
        )
