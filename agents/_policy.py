"""What an agent is: something that turns observations into actions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armtempo.envs import CoordinationEnv
from armtempo.errors import InputError, UnknownNameError

Observations = dict[str, NDArray[np.float32]]
Actions = dict[str, NDArray[np.float32]]


class Policy(Protocol):
    """Decides for all arms of an environment; baselines and learned agents alike."""

    def reset(self, seed: int | None = None) -> None:
        """Forget the last episode; all randomness comes from ``seed``."""
        ...

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """One action (1,) float32 in [-1, 1] for every agent that is observed."""
        ...


def to_action(command: float) -> NDArray[np.float32]:
    """A command in [0, 1] as an action."""
    return np.array([2.0 * command - 1.0], dtype=np.float32)


def chosen_policies(policies: Sequence[str] | str | None, known: Sequence[str], episodes: int) -> tuple[str, ...]:
    """The policies that an evaluation is asked for; None: all that are ``known``.

    Raises:
        UnknownNameError: A policy that does not exist.
        InputError: Less than one episode.
    """
    chosen = known if policies is None else (policies,) if isinstance(policies, str) else policies
    for name in chosen:
        if name not in known:
            raise UnknownNameError("policy", name, known)
    if episodes < 1:
        raise InputError(f"episodes must be at least 1, got {episodes}")
    return tuple(chosen)
