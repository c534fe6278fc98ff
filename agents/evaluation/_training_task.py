"""What a kind of cell brings to a training: where agents learn, and how good they are meanwhile."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv

from armtempo.agents.evaluation._evaluate import play
from armtempo.agents.policies import Agent, LearnedPolicy
from armtempo.configs import EvaluationConfig, TrainConfig
from armtempo.planners.cells import CellBase
from armtempo.reading import user_path

Row = dict[str, Any]
"""A row of a learning curve: ``reward``, ``finished`` out of ``episodes``, and what else a kind measures."""


class CurveEvaluator:
    """Evaluates agents in environments of its own: the reward and the successes of episodes as in training.

    Args:
        envs: Environments that episodes take in turn.
        config: How many episodes, from which seed on.
    """

    def __init__(self, envs: Sequence[Any], config: EvaluationConfig) -> None:
        self.envs, self.config = tuple(envs), config

    def row(self, agent: Agent) -> Row:
        """Evaluate an agent; the same agent gives the same row."""
        rewards, finished = [], 0
        for k in range(self.config.episodes):
            reward, info = play(self.envs[k % len(self.envs)], LearnedPolicy(agent), self.config.seed + k)
            rewards.append(reward)
            finished += bool(info.get("is_success"))
        return {
            "reward": float(np.mean(rewards)) if rewards else None,
            "finished": finished,
            "episodes": len(rewards),
        }

    def score(self, row: Row) -> float | None:
        """By what the best row is told, less is better; None: nothing."""
        return None if row["reward"] is None else -float(row["reward"])

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()


class TrainingTask(ABC):
    """Where a training happens; ``TASKS`` lists the kinds by what a training file says of them.

    Attributes:
        environment: Name of the environment in agents' files.
        config: The training.
        cells: Where agents learn.
        settings: What the environments are made with, by name, but for the cell and what is drawn.
        learners: Of several arms: ``last`` or ``all``; else None.
    """

    environment: ClassVar[str]
    config: TrainConfig
    cells: tuple[CellBase[Any], ...]
    settings: dict[str, Any]
    learners: Literal["last", "all"] | None = None

    @property
    @abstractmethod
    def entries(self) -> list[str]:
        """Names of the observation's entries."""

    @abstractmethod
    def vector(self) -> VectorEnv[Any, Any, Any] | None:
        """Many environments at once, episodes beginning anew in the same step; None: there is no such form of them."""

    @abstractmethod
    def single(self, turn: int) -> gymnasium.Env[Any, Any]:
        """Environment number ``turn`` of those that run one after another."""

    @property
    def decide_every(self) -> int:
        """Control periods for which an agent's action is held."""
        return 1

    def team(self) -> Sequence[Any] | None:
        """Simulations in which one row decides for all arms, for ``decide_every`` control periods; None: not here."""
        return None

    def demonstrations(self) -> Any | None:
        """What agents are shown first: ``rows``, ``actions`` and ``returns``; None: nothing."""
        return None

    def parallel(self, turn: int) -> Any | None:
        """The same of PettingZoo, where all agents of it learn; None: one agent learns."""
        return None

    @property
    def reward_scale(self) -> float:
        """Multiplies what the algorithm is told."""
        return 1.0

    @property
    def cut_penalty(self) -> float:
        """What asking for more than a shield lets through costs per step, times what it cuts."""
        return 0.0

    def undisturbed_share(self, steps: int) -> float | None:
        """Share of the environments whose next episodes draw nothing, after so many steps; None: as they are made."""
        return None

    @abstractmethod
    def evaluator(self) -> CurveEvaluator:
        """What measures an agent of this training."""


def beside(source: Path, name: str) -> str | Path:
    """A cell file beside the training's, or a bundled name."""
    path = source.parent / user_path(name)
    return path if path.suffix in (".yaml", ".yml") and path.is_file() else name
