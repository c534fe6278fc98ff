"""Train an agent as a training file says: the door to stable-baselines3 and sb3-contrib."""

from __future__ import annotations

import csv
import json
import shlex
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import torch
from stable_baselines3.common.callbacks import BaseCallback

from armtempo import __version__
from armtempo.agents.evaluation import CurveEvaluator, Row, TrainingTask
from armtempo.agents.policies import Agent, AgentHeader, load_agent, save_agent
from armtempo.agents.training._checkpoint import checkpoint_for, restore, save_checkpoint
from armtempo.agents.training._export import agent_of
from armtempo.agents.training._imitation import imitate
from armtempo.agents.training._logs import open_logs
from armtempo.agents.training._model import training_model
from armtempo.agents.training._signals import HeldSignals
from armtempo.agents.training._tasks import training_env, training_task
from armtempo.configs import TrainConfig, bundled_trainings, load_train_config
from armtempo.errors import InputError
from armtempo.files import check_output_folder, locked, whole_file

CHECKPOINT, CURVE, AGENT, BEST, LOCK = "checkpoint.pt", "curve.csv", "agent.npz", "best.npz", "lock"
SAVE_EVERY_S = 30.0  # besides what the configuration says: no more than this is lost
SAVE_SPARSENESS = 20.0  # times what saving takes: a large replay buffer is saved less often


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
    """Train an agent, or go on with a training that was interrupted or is to be longer.

    In ``folder``: ``checkpoint.pt``, ``curve.csv``, logs for TensorBoard, and at the end ``agent.npz``. A training that
    was interrupted and resumed ends with the same weights as one that was not, and one that was resumed with more
    ``steps`` with those of one that had so many from the start, with two exceptions. What depends on the share of the
    training that is left (``learning_rate_end``, ``undisturbed_until``) was other until then. And environments without
    a state that can be saved (``bullet``, targets drawn for each episode) begin their episodes anew where a training
    goes on elsewhere than at a multiple of ``checkpoint_every_steps``.

    Besides those, there is a checkpoint every half minute, which changes nothing. Ctrl-C and SIGTERM end a training
    once its rollout is done and saved (in the main thread; a second one at once), with what they would have done
    without it: KeyboardInterrupt, the end of the process.

    Args:
        config: A training, its bundled name, or its file.
        folder: Where its files go.
        seed: Instead of the file's.
        steps: Agent steps in all, instead of the file's.
        resume: Go on from the checkpoint in ``folder``; the configuration must be the same but for its steps.
        on_progress: Called with steps done and steps in all.
        on_row: Called with each new row of the learning curve.

    Raises:
        ArmtempoError: A configuration, cell or checkpoint that cannot be used.
        InputError: ``folder`` cannot be written, another process trains in it, or it holds a training already and
            ``resume`` was not asked for.
    """
    torch.set_num_threads(1)
    given = config if isinstance(config, TrainConfig) else load_train_config(config)
    chosen = given.changed(seed=seed, total_steps=steps)
    folder = Path(folder)
    check_output_folder(folder)
    if resume:
        checkpoint_for(folder / CHECKPOINT, _said(chosen))  # before a folder is made, or cells are built
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder / LOCK) as alone:
        if not alone:
            raise InputError(
                f"{folder}: another process trains there", remedy="wait for it, or give another folder (--output)"
            )
        if not resume and any((folder / name).exists() for name in (CHECKPOINT, AGENT)):
            raise InputError(f"{folder}: holds a training already", remedy="resume it, or give another folder")
        return _train(chosen, folder, resume, on_progress, on_row)


def _train(
    config: TrainConfig,
    folder: Path,
    resume: bool,
    on_progress: Callable[[int, int], None] | None,
    on_row: Callable[[Row], None] | None,
) -> Training:
    """The training of whoever holds the folder's lock."""
    content = checkpoint_for(folder / CHECKPOINT, _said(config)) if resume else {}
    task = training_task(config)
    env = training_env(task)
    evaluator = task.evaluator()
    try:
        _leave_undisturbed(env, task, 0)
        model = training_model(config, env)
        with open_logs(folder, content.get("logs", {})) as logger, HeldSignals() as signals:
            model.set_logger(logger)
            curve = restore(folder / CHECKPOINT, content, model, _said(config)) if resume else []
            if config.imitation is not None and not resume:
                imitate(model, task.demonstrations(), config.imitation, config.seed)
            callback = EvaluationCallback(task, evaluator, folder, curve, signals, on_progress, on_row)
            left = config.total_steps - model.num_timesteps
            if left > 0:
                model.learn(left, callback=callback, log_interval=1, reset_num_timesteps=not resume)
            agent = callback.finish(model)
    finally:
        evaluator.close()
        env.close()
    return Training(config=config, agent=agent, curve=curve, folder=folder)


def _leave_undisturbed(env: Any, task: TrainingTask, steps: int) -> None:
    """Which episodes that begin from now on are undisturbed."""
    share = task.undisturbed_share(steps)
    if share is not None:
        env.env_method("leave_undisturbed", share)


def _said(config: TrainConfig) -> str:
    """A configuration as text, whatever the layout of its file."""
    return json.dumps(config.model_dump(mode="json"), sort_keys=True)


def _header(task: TrainingTask, steps: int, curve: list[Row]) -> AgentHeader:
    config = task.config
    line = ["armtempo", "train", _called(config), "--seed", str(config.seed)]
    return AgentHeader(
        name=config.name,
        algorithm=config.algorithm,
        activation=config.network.activation,
        environment=task.environment,
        settings=task.settings,
        learners=task.learners,
        entries=task.entries,
        cells=[cell.name for cell in task.cells],
        steps=steps,
        seed=config.seed,
        command=shlex.join([*line, "--steps", str(config.total_steps)]),
        config=config.text,
        curve=[dict(row) for row in curve],
        armtempo=__version__,
        network=config.network.kind,
        decide_every=task.decide_every,
    )


def _called(config: TrainConfig) -> str:
    """What to type after ``armtempo train``: a bundled training's name, or the file's."""
    stem = config.source.stem
    bundled = stem in bundled_trainings() and load_train_config(stem).text == config.text
    return stem if bundled else config.source.name or config.name


@final
class EvaluationCallback(BaseCallback):
    """Between two rollouts: evaluates the agent, writes the curve and the checkpoint where they are due, and ends."""

    def __init__(
        self,
        task: TrainingTask,
        evaluator: CurveEvaluator,
        folder: Path,
        curve: list[Row],
        signals: HeldSignals,
        on_progress: Callable[[int, int], None] | None,
        on_row: Callable[[Row], None] | None,
    ) -> None:
        super().__init__()
        self._task, self._evaluator, self._folder, self._signals = task, evaluator, folder, signals
        self._curve, self._on_progress, self._on_row = curve, on_progress, on_row
        self._began = time.perf_counter() - (curve[-1]["seconds"] if curve else 0.0)
        if curve:
            self._write_curve()  # rows behind the checkpoint come again

    def _on_training_start(self) -> None:
        config = self._task.config
        self._evaluated = self._curve[-1]["steps"] // config.evaluation.every_steps if self._curve else -1
        self._saved = self.model.num_timesteps // config.checkpoint_every_steps
        self._next_save = time.perf_counter() + SAVE_EVERY_S

    def _on_rollout_start(self) -> None:
        config, steps = self._task.config, self.model.num_timesteps
        if self._on_progress is not None:
            self._on_progress(steps, config.total_steps)
        _leave_undisturbed(self.training_env, self._task, steps)
        if steps // config.evaluation.every_steps > self._evaluated:
            self._evaluated = steps // config.evaluation.every_steps
            self._evaluate(self.model)
        due = steps // config.checkpoint_every_steps > self._saved
        if due or self._signals.received is not None or time.perf_counter() > self._next_save:
            self._saved = steps // config.checkpoint_every_steps
            self._save(self.model, cut=due)
        if self._signals.received is not None:
            self._signals.pass_on(self._how_to_go_on(steps))

    def _on_step(self) -> bool:
        return True

    def finish(self, model: Any) -> Agent:
        """The last evaluation and checkpoint, and the agent's file."""
        steps = int(model.num_timesteps)
        if not self._curve or self._curve[-1]["steps"] != steps:
            self._evaluate(model)
        self._save(model, cut=False)
        agent = agent_of(model, _header(self._task, steps, self._curve))
        if self._task.config.evaluation.select == "best" and (self._folder / BEST).exists():
            best = load_agent(self._folder / BEST)
            agent = replace(best, header=replace(agent.header, steps=best.header.steps))
        save_agent(self._folder / AGENT, agent)
        if self._signals.received is not None:
            self._signals.pass_on(f"{self._folder / AGENT} is complete")
        return agent

    def _evaluate(self, model: Any) -> None:
        steps = int(model.num_timesteps)
        agent = agent_of(model, _header(self._task, steps, []))
        result = self._evaluator.row(agent)
        self._keep_best(agent, result)
        row = {"steps": steps, "seconds": round(time.perf_counter() - self._began, 1), **result}
        self._curve.append(row)
        self._write_curve()
        for name, value in result.items():
            if value is not None:
                model.logger.record(f"evaluation/{name}", value)
        model.logger.dump(steps)
        if self._on_row is not None:
            self._on_row(row)

    def _keep_best(self, agent: Agent, result: Row) -> None:
        """Write the agent where it is better than all before."""
        if self._task.config.evaluation.select == "last":
            return
        score, before = self._evaluator.score(result), [self._evaluator.score(row) for row in self._curve]
        if score is not None and all(score < one for one in before if one is not None):
            save_agent(self._folder / BEST, agent)

    def _write_curve(self) -> None:
        with whole_file(self._folder / CURVE) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(self._curve[-1]), restval="")
            writer.writeheader()
            writer.writerows(self._curve)

    def _save(self, model: Any, *, cut: bool) -> None:
        began = time.perf_counter()
        save_checkpoint(self._folder / CHECKPOINT, model, _said(self._task.config), self._curve, cut=cut)
        now = time.perf_counter()
        self._next_save = now + max(SAVE_EVERY_S, SAVE_SPARSENESS * (now - began))

    def _how_to_go_on(self, steps: int) -> str:
        total = self._task.config.total_steps
        return f"saved at {steps} of {total} steps in {self._folder}; --resume (in Python resume=True) goes on"
