"""What an agent is: something that turns observations into actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, TypeVar, final

import numpy as np

from armtempo.agents.policies._agent_file import find_agent, is_agent_name
from armtempo.arrays import Floats32
from armtempo.envs import BlendTrackingEnv, CoordinationEnv, FeedbackIKEnv
from armtempo.errors import InputError, UnknownNameError

Observations = dict[str, Floats32]
Actions = dict[str, Floats32]
Env = TypeVar("Env", BlendTrackingEnv, FeedbackIKEnv)
Met_contra = TypeVar("Met_contra", BlendTrackingEnv, FeedbackIKEnv, contravariant=True)


class Policy(Protocol):
    """Decides for all arms of an environment; baselines and learned agents alike."""

    def reset(self, seed: int | None = None) -> None:
        """Forget the last episode; all randomness comes from ``seed``."""
        ...

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """One action (1,) float32 in [-1, 1] for every agent that is observed."""
        ...


class SingleArmPolicy(Protocol[Met_contra]):
    """Decides for the arm of an environment with one."""

    def reset(self, seed: int | None = None) -> None:
        """Forget the last episode; all randomness comes from ``seed``."""
        ...

    def act(self, observation: Floats32, env: Met_contra) -> Floats32:
        """One action of the environment's space."""
        ...


@final
class RandomActions:
    """Uniform actions."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Start the random numbers again."""
        self._random = np.random.default_rng(seed)

    def act(self, observation: Floats32, env: BlendTrackingEnv | FeedbackIKEnv) -> Floats32:
        """Draw an action."""
        return self._random.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)


def run_to_end(
    env: Env, policy: SingleArmPolicy[Env], seed: int | None = None, options: dict[str, Any] | None = None
) -> tuple[float, dict[str, Any]]:
    """One episode of one arm; returns the sum of its rewards and its last info."""
    observation, info = env.reset(seed=seed, options=options)
    policy.reset(seed)
    total, over = 0.0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy.act(observation, env))
        total += reward
        over = terminated or truncated
    return total, info


def to_action(command: float) -> Floats32:
    """A command in [0, 1] as an action."""
    return np.array([2.0 * command - 1.0], dtype=np.float32)


def chosen_policies(policies: Sequence[str] | str | None, known: Sequence[str], episodes: int) -> tuple[str, ...]:
    """The policies that an evaluation is asked for, ``known`` ones or learned agents; None: all that are ``known``.

    Raises:
        UnknownNameError: A policy or agent that does not exist.
        InputError: Less than one episode, or an agent's file that cannot be used.
    """
    chosen = known if policies is None else (policies,) if isinstance(policies, str) else policies
    for name in chosen:
        if is_agent_name(name):
            find_agent(name)  # before anything runs
        elif name not in known:
            raise UnknownNameError("policy", name, known)
    if episodes < 1:
        raise InputError(f"episodes must be at least 1, got {episodes}")
    return tuple(chosen)
