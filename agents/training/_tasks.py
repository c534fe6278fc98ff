"""The kinds of trainings by what their files say, and the environments that a training steps."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from typing import Any

from armtempo.agents.blend import BlendTask
from armtempo.agents.coordination import CoordinationTask
from armtempo.agents.evaluation import TrainingTask
from armtempo.agents.ik import IKTask
from armtempo.configs import BlendTraining, CoordinationTraining, IKTraining, TrainConfig

TASKS: dict[type, Callable[[TrainConfig, Any], TrainingTask]] = {
    CoordinationTraining: CoordinationTask,
    BlendTraining: BlendTask,
    IKTraining: IKTask,
}
"""By the schema of what a training file says of its environment."""


def training_task(config: TrainConfig) -> TrainingTask:
    """Build the cells of a training.

    Raises:
        ArmtempoError: A cell that cannot be used, or none is left by the filter.
    """
    return TASKS[type(config.environment)](config, config.environment)


def training_env(task: TrainingTask) -> Any:
    """The ``VecEnv`` that a training steps: many at once where there is such a form, else one after another."""
    from gymnasium.wrappers import TransformReward
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    from armtempo.agents.training.vec_envs import ParallelVecEnv, TeamVecEnv, VectorVecEnv

    team = task.team()
    if team is not None:
        return TeamVecEnv(team, hold_periods=task.decide_every, threads=os.cpu_count() or 1)
    vector: Any = task.vector()
    if vector is not None:
        return VectorVecEnv(vector, task.reward_scale, cut_penalty=task.cut_penalty)
    turns, count = itertools.count(), task.config.num_envs
    first = task.parallel(next(turns))
    if first is not None:
        made = itertools.chain([first], (task.parallel(turn) for turn in turns))
        return ParallelVecEnv(lambda: next(made), count)
    turns = itertools.count()

    def one() -> Any:
        env = Monitor(task.single(next(turns)))
        return env if task.reward_scale == 1.0 else TransformReward(env, lambda r: task.reward_scale * float(r))

    return DummyVecEnv([one] * count)
