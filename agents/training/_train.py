"""Train an agent as a training file says: the door to stable-baselines3 and sb3-contrib."""

from __future__ import annotations

import csv
import json
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from armtempo import __version__
from armtempo.agents.policies import Agent, AgentHeader, save_agent
from armtempo.agents.training._checkpoint import read_checkpoint, restore, save_checkpoint
from armtempo.agents.training._environments import TrainingTask, training_env, training_task
from armtempo.agents.training._evaluation import COLUMNS, TrainEvaluation
from armtempo.agents.training._export import agent_of
from armtempo.agents.training._model import training_model
from armtempo.agents.training.vec_envs import VectorVecEnv
from armtempo.configs import CoordinationTraining, TrainConfig, bundled_trainings, load_train_config
from armtempo.errors import InputError
from armtempo.files import whole_file

CHECKPOINT, CURVE, AGENT = "checkpoint.pt", "curve.csv", "agent.npz"
Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Training:
    """What a training came to.

    Attributes:
        config: What it was made from.
        agent: The trained agent, which is also in ``folder``.
        curve: One row per evaluation.
        folder: Where its files are.
    """

    config: TrainConfig
    agent: Agent
    curve: list[Row]
    folder: Path


def train(
    config: TrainConfig | str | Path,
    folder: str | Path,
    *,
    seed: int | None = None,
    steps: int | None = None,
    resume: bool = False,
    on_progress: Callable[[int, int], None] | None = None,
    on_row: Callable[[Row], None] | None = None,
) -> Training:
    """Train an agent, or go on with a training that was interrupted.

    In ``folder``: ``checkpoint.pt``, ``curve.csv``, logs for TensorBoard, and at the end ``agent.npz``. A training that
    was interrupted and resumed ends with the same weights as one that was not.

    Args:
        config: A training, its bundled name, or its file.
        folder: Where its files go.
        seed: Instead of the file's.
        steps: Agent steps, instead of the file's.
        resume: Go on from the checkpoint in ``folder``; the configuration must be the same.
        on_progress: Called with steps done and steps in all.
        on_row: Called with each new row of the learning curve.

    Raises:
        ArmtempoError: A configuration, cell or checkpoint that cannot be used.
        InputError: ``folder`` holds a training already and ``resume`` was not asked for.
    """
    torch.set_num_threads(1)
    given = config if isinstance(config, TrainConfig) else load_train_config(config)
    chosen = given.changed(seed=seed, total_steps=steps)
    folder = Path(folder)
    checkpoint = folder / CHECKPOINT
    if checkpoint.exists() and not resume:
        raise InputError(f"{folder}: holds a training already", remedy="resume it, or give another folder")
    content = read_checkpoint(checkpoint) if resume else None
    task = training_task(chosen)
    env = training_env(task)
    evaluation = TrainEvaluation(task)
    try:
        _leave_undisturbed(env, chosen, 0)
        model = training_model(chosen, env)
        said = _said(chosen)
        curve = [] if content is None else restore(checkpoint, content, model, said)
        folder.mkdir(parents=True, exist_ok=True)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        callback = EvaluationCallback(task, evaluation, folder, said, curve, on_progress, on_row)
        left = chosen.total_steps - model.num_timesteps
        if left > 0:
            model.learn(left, callback=callback, log_interval=1, reset_num_timesteps=content is None)
        callback.finish(model)
        agent = agent_of(model, _header(task, int(model.num_timesteps), curve))
        save_agent(folder / AGENT, agent)
    finally:
        evaluation.close()
        env.close()
    return Training(config=chosen, agent=agent, curve=curve, folder=folder)


def _leave_undisturbed(env: Any, config: TrainConfig, steps: int) -> None:
    """Which episodes that begin from now on are undisturbed."""
    if isinstance(env, VectorVecEnv) and config.coordination is not None:
        chosen = config.coordination
        all_of_them = steps < chosen.undisturbed_until * config.total_steps
        env.env_method("leave_undisturbed", 1.0 if all_of_them else chosen.undisturbed_share)


def _said(config: TrainConfig) -> str:
    """A configuration as text, whatever the layout of its file."""
    return json.dumps(config.model_dump(mode="json"), sort_keys=True)


def _header(task: TrainingTask, steps: int, curve: list[Row]) -> AgentHeader:
    config, chosen = task.config, task.config.environment
    line = ["armtempo", "train", _called(config), "--seed", str(config.seed)]
    return AgentHeader(
        name=config.name,
        algorithm=config.algorithm,
        activation=config.network.activation,
        environment=task.environment,  # type: ignore[arg-type]
        settings=task.settings,
        learners=chosen.learners if isinstance(chosen, CoordinationTraining) else None,
        entries=task.entries,
        cells=[cell.name for cell in task.cells],
        steps=steps,
        seed=config.seed,
        command=shlex.join([*line, "--steps", str(config.total_steps)]),
        config=config.text,
        curve=[dict(row) for row in curve],
        armtempo=__version__,
    )


def _called(config: TrainConfig) -> str:
    """What to type after ``armtempo train``: a bundled training's name, or the file's."""
    stem = config.source.stem
    bundled = stem in bundled_trainings() and load_train_config(stem).text == config.text
    return stem if bundled else config.source.name or config.name


@final
class EvaluationCallback(BaseCallback):
    """Between two rollouts: evaluates the agent, writes the curve and the checkpoint where they are due."""

    def __init__(
        self,
        task: TrainingTask,
        evaluation: TrainEvaluation,
        folder: Path,
        said: str,
        curve: list[Row],
        on_progress: Callable[[int, int], None] | None,
        on_row: Callable[[Row], None] | None,
    ) -> None:
        super().__init__()
        self._task, self._evaluation, self._folder, self._said = task, evaluation, folder, said
        self._curve, self._on_progress, self._on_row = curve, on_progress, on_row
        self._began = time.perf_counter() - (curve[-1]["seconds"] if curve else 0.0)

    def _on_training_start(self) -> None:
        config = self._task.config
        resumed = self.model.num_timesteps > 0
        self._evaluated = self.model.num_timesteps // config.evaluation.every_steps if resumed else -1
        self._saved = self.model.num_timesteps // config.checkpoint_every_steps

    def _on_rollout_start(self) -> None:
        config, steps = self._task.config, self.model.num_timesteps
        if self._on_progress is not None:
            self._on_progress(steps, config.total_steps)
        _leave_undisturbed(self.training_env, config, steps)
        if steps // config.evaluation.every_steps > self._evaluated:
            self._evaluated = steps // config.evaluation.every_steps
            self._evaluate(self.model)
        if steps // config.checkpoint_every_steps > self._saved:
            self._saved = steps // config.checkpoint_every_steps
            self._save(self.model)

    def _on_step(self) -> bool:
        return True

    def finish(self, model: Any) -> None:
        """The last evaluation and checkpoint."""
        if not self._curve or self._curve[-1]["steps"] != model.num_timesteps:
            self._evaluate(model)
        self._save(model)
        model.logger.close()

    def _evaluate(self, model: Any) -> None:
        steps = int(model.num_timesteps)
        result = self._evaluation.row(agent_of(model, _header(self._task, steps, [])))
        row = {"steps": steps, "seconds": round(time.perf_counter() - self._began, 1), **result}
        self._curve.append(row)
        with whole_file(self._folder / CURVE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS, restval="")
            writer.writeheader()
            writer.writerows(self._curve)
        for name, value in result.items():
            if value is not None:
                model.logger.record(f"evaluation/{name}", value)
        model.logger.dump(steps)
        if self._on_row is not None:
            self._on_row(row)

    def _save(self, model: Any) -> None:
        save_checkpoint(self._folder / CHECKPOINT, model, self._said, self._curve)
