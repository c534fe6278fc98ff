"""Trainings in IK cells: an arm that follows poses."""

from __future__ import annotations

from typing import final

from gymnasium.vector import AutoresetMode

from armtempo.agents.evaluation import CurveEvaluator, TrainingTask, beside
from armtempo.configs import IKCellConfig, IKTraining, TrainConfig, load_cell_config
from armtempo.envs import FeedbackIKEnv, FeedbackIKVectorEnv, ik_entries
from armtempo.planners import build_cell


@final
class IKTask(TrainingTask):
    """See ``IKTraining``."""

    environment = "feedback-ik"

    def __init__(self, config: TrainConfig, chosen: IKTraining) -> None:
        self.config, self._chosen = config, chosen
        self._cell = build_cell(load_cell_config(beside(config.source, chosen.cell), IKCellConfig))
        self.cells = (self._cell,)
        self.settings = {
            "physics": chosen.physics, "model_error": chosen.model_error, "action_mode": chosen.action_mode,
        }  # fmt: skip

    @property
    def entries(self) -> list[str]:
        """Names of the observation's entries."""
        return [entry.name for entry in ik_entries(self._cell.arm.dof)]

    @property
    def reward_scale(self) -> float:
        """Rewards may be too small to learn from."""
        return self._chosen.reward_scale

    def vector(self) -> FeedbackIKVectorEnv | None:
        """Without physics: targets drawn beforehand, actions held."""
        chosen = self._chosen
        if chosen.physics != "ideal":
            return None
        return FeedbackIKVectorEnv(
            self.config.num_envs, self._cell, action_mode=chosen.action_mode, family=chosen.families,
            targets=chosen.targets, target_seed=self.config.seed, hold_periods=chosen.hold_periods,
            autoreset_mode=AutoresetMode.SAME_STEP,
        )  # fmt: skip

    def single(self, turn: int) -> FeedbackIKEnv:
        """Environments take the families of targets in turn."""
        return self._made(turn, record=False)

    def evaluator(self) -> CurveEvaluator:
        """The reward, and targets that were followed within the cell's scales."""
        envs = [self._made(k, record=True) for k in range(len(self._chosen.families))]
        return CurveEvaluator(envs, self.config.evaluation)

    def _made(self, turn: int, *, record: bool) -> FeedbackIKEnv:
        families = self._chosen.families
        return FeedbackIKEnv(self._cell, record=record, family=families[turn % len(families)], **self.settings)
