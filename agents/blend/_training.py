"""Trainings in blend cells: an arm that overrides the feed rate."""

from __future__ import annotations

from typing import final

from gymnasium.vector import AutoresetMode

from armtempo.agents.evaluation import CurveEvaluator, TrainingTask, beside
from armtempo.configs import BlendCellConfig, BlendTraining, TrainConfig, load_cell_config
from armtempo.envs import BLEND_ENTRIES, BlendTrackingEnv, BlendTrackingVectorEnv
from armtempo.planners import build_cell


@final
class BlendTask(TrainingTask):
    """See ``BlendTraining``."""

    environment = "blend-tracking"

    def __init__(self, config: TrainConfig, chosen: BlendTraining) -> None:
        self.config, self._chosen = config, chosen
        self._cell = build_cell(load_cell_config(beside(config.source, chosen.cell), BlendCellConfig))
        self.cells = (self._cell,)
        self.settings = {
            "physics": chosen.physics, "model_error": chosen.model_error, "profile": chosen.profile,
            "mapping": chosen.mapping,
        }  # fmt: skip

    @property
    def entries(self) -> list[str]:
        """Names of the observation's entries."""
        return [entry.name for entry in BLEND_ENTRIES]

    def vector(self) -> BlendTrackingVectorEnv | None:
        """Without physics."""
        if self._chosen.physics != "ideal":
            return None
        return BlendTrackingVectorEnv(
            self.config.num_envs, self._cell, profile=self._chosen.profile, mapping=self._chosen.mapping,
            family=self._chosen.family, autoreset_mode=AutoresetMode.SAME_STEP,
        )  # fmt: skip

    def single(self, turn: int) -> BlendTrackingEnv:
        """All are alike."""
        return self._made(record=False)

    def evaluator(self) -> CurveEvaluator:
        """The reward, and the arrivals."""
        return CurveEvaluator([self._made(record=True)], self.config.evaluation)

    def _made(self, *, record: bool) -> BlendTrackingEnv:
        return BlendTrackingEnv(self._cell, record=record, family=self._chosen.family, **self.settings)
