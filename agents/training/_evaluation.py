"""How good the agent is while it learns: a row of its learning curve."""

from __future__ import annotations

from functools import partial
from typing import Any, final

import numpy as np

from armtempo.agents.coordination import ExecutionPolicy, safe_makespan
from armtempo.agents.evaluation import play, run_episode
from armtempo.agents.policies import Actions, Agent, LearnedPolicy, Observations, Policy
from armtempo.agents.training._environments import TrainingTask
from armtempo.envs import CoordinationEnv
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, execution_of, schedule

ARMS_WITH_QUICK_OPTIMUM = 2  # at most, for the optimum to be found quickly

COLUMNS = (
    "steps", "seconds", "reward", "finished", "episodes", "violations", "makespan_s", "gap_percent",
    "optimum_percent",
)  # fmt: skip


@final
class TrainEvaluation:
    """Evaluates agents of a training, in environments of its own.

    Of several arms, a row has ``gap_percent``, how far undisturbed makespans are above the certified bounds, and
    ``optimum_percent``, above the optimum run in the same environment, means over cells; None where a cell was not
    finished. ``reward``, ``makespan_s``, ``finished`` out of ``episodes`` and ``violations`` (episodes) are of episodes
    as the training has them. Of one arm, the reward and successes alone.
    """

    def __init__(self, task: TrainingTask) -> None:
        self._task, self._config = task, task.config.evaluation
        self._cells = task.cells[: self._config.cells]
        variants = range(len(task.variants))
        self._disturbed = [task.single(cell, variant=k) for cell in self._cells for k in variants]
        self._undisturbed = [task.single(cell, disturbed=False) for cell in self._cells]
        self._optimum: list[float | None] | None = None

    def row(self, agent: Agent) -> dict[str, Any]:
        """Evaluate an agent; the same agent gives the same row."""
        if self._task.environment == "coordination":
            return self._of_several(agent)
        rewards, finished = [], 0
        for k in range(self._config.episodes):
            env = self._disturbed[k % len(self._disturbed)]
            reward, info = play(env, LearnedPolicy(agent), self._config.seed + k)
            rewards.append(reward)
            finished += bool(info.get("is_success"))
        return {
            "reward": float(np.mean(rewards)) if rewards else None,
            "finished": finished,
            "episodes": len(rewards),
        }

    def _of_several(self, agent: Agent) -> dict[str, Any]:
        policy, seed = LearnedPolicy(agent), self._config.seed
        if self._optimum is None:
            self._optimum = [self._optimal(env) for env in self._undisturbed]
        gaps, above = [], []
        for env, cell, optimum in zip(self._undisturbed, self._cells, self._optimum, strict=True):
            assert isinstance(cell, CoordinationCell)
            makespan = _makespan(env, policy, seed)[0]
            gaps.append(None if makespan is None else 100.0 * (makespan / cell.lower_bound - 1.0))
            above.append(None if makespan is None or optimum is None else 100.0 * (makespan / optimum - 1.0))
        makespans, rewards, violations = [], [], 0
        for k in range(self._config.episodes):
            env = self._disturbed[k % len(self._disturbed)]
            makespan, reward, violated = _makespan(env, policy, seed + k)
            violations += violated
            rewards.append(reward)
            if makespan is not None:
                makespans.append(makespan)
        return {
            "reward": float(np.mean(rewards)) if rewards else None,
            "finished": len(makespans),
            "episodes": len(rewards),
            "violations": violations,
            "makespan_s": float(np.mean(makespans)) if makespans else None,
            "gap_percent": _mean(gaps),
            "optimum_percent": _mean(above),
        }

    def _optimal(self, env: CoordinationEnv) -> float | None:
        """Makespan of the optimal plan, run in the same environment."""
        if len(env.cell.arms) > ARMS_WITH_QUICK_OPTIMUM:
            return None
        try:
            plan = schedule(env.cell, "optimal")
        except InfeasibleError:
            return None
        return _makespan(env, ExecutionPolicy(partial(execution_of, plan)), self._config.seed)[0]

    def close(self) -> None:
        """Close the environments."""
        for env in (*self._disturbed, *self._undisturbed):
            env.close()


def _makespan(
    env: CoordinationEnv, policy: Policy[Observations, Actions], seed: int
) -> tuple[float | None, float, bool]:
    """Makespan, or None if an arm did not arrive or two came too close; reward; whether they did."""
    trace, reward = run_episode(env, policy, seed)
    return safe_makespan(trace), reward, trace.violations > 0


def _mean(values: list[float | None]) -> float | None:
    numbers = [value for value in values if value is not None]
    return float(np.mean(numbers)) if numbers and len(numbers) == len(values) else None
