"""The environments of a training, made from its configuration."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from armtempo.configs import (
    BenchmarkFilter,
    BlendCellConfig,
    BlendTraining,
    CellConfig,
    CoordinationTraining,
    IKCellConfig,
    IKTraining,
    TrainConfig,
    load_cell_config,
)
from armtempo.envs import (
    BLEND_ENTRIES,
    COORDINATION_ENTRIES,
    BlendTrackingEnv,
    BlendTrackingVectorEnv,
    CoordinationEnv,
    CoordinationVectorEnv,
    Disturbance,
    FeedbackIKEnv,
    FeedbackIKVectorEnv,
    YieldingEnv,
    ik_entries,
)
from armtempo.errors import InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell, benchmark_instances, build_cell

AnyCell = CoordinationCell | BlendCell | IKCell


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingTask:
    """Where a training happens.

    Attributes:
        cells: The cells.
        environment: Name of the environment.
        settings: What it is made with, but for the cell and what disturbs an episode.
        disturbed: Options of coordination that differ from episode to episode.
        variants: Options that differ from environment to environment; they are taken in turn.
    """

    config: TrainConfig
    cells: tuple[AnyCell, ...]
    environment: str
    settings: dict[str, Any]
    disturbed: dict[str, Any]
    variants: tuple[dict[str, Any], ...] = ({},)

    @property
    def entries(self) -> list[str]:
        """Names of the observation's entries."""
        if self.environment == "coordination":
            return [entry.name for entry in COORDINATION_ENTRIES]
        if self.environment == "blend-tracking":
            return [entry.name for entry in BLEND_ENTRIES]
        cell = self.cells[0]
        assert isinstance(cell, IKCell)
        return [entry.name for entry in ik_entries(cell.arm.dof)]

    def single(self, cell: AnyCell, *, disturbed: bool = True, variant: int = 0) -> Any:
        """One environment in a cell, as evaluations run it."""
        options = self.settings | (self.disturbed if disturbed else {}) | self.variants[variant]
        make: Any = {
            "coordination": CoordinationEnv,
            "blend-tracking": BlendTrackingEnv,
            "feedback-ik": FeedbackIKEnv,
        }[self.environment]
        return make(cell, record=True, **options)


def training_task(config: TrainConfig) -> TrainingTask:
    """Build the cells of a training.

    Raises:
        ArmtempoError: A cell that cannot be used, or none is left by the filter.
    """
    chosen = config.environment
    settings: dict[str, Any]
    if isinstance(chosen, CoordinationTraining):
        settings = {"physics": chosen.physics, "mode": chosen.mode}
        if chosen.shield:
            settings["shield"] = True
        return TrainingTask(
            config=config,
            cells=_coordination_cells(chosen, config.source),
            environment="coordination",
            settings=settings,
            disturbed=_disturbed(chosen),
        )
    settings = {"physics": chosen.physics, "model_error": chosen.model_error}
    variants: tuple[dict[str, Any], ...]
    source = _beside(config.source, chosen.cell)
    cell: AnyCell
    if isinstance(chosen, BlendTraining):
        cell = build_cell(load_cell_config(source, BlendCellConfig))
        settings |= {"profile": chosen.profile, "mapping": chosen.mapping}
        variants, environment = ({"family": chosen.family},), "blend-tracking"
    else:
        cell = build_cell(load_cell_config(source, IKCellConfig))
        settings |= {"action_mode": chosen.action_mode}
        variants, environment = tuple({"family": family} for family in chosen.families), "feedback-ik"
    return TrainingTask(
        config=config, cells=(cell,), environment=environment, settings=settings, disturbed={}, variants=variants
    )


def _beside(source: Path, name: str) -> str | Path:
    """A cell file beside the training's, or a bundled name."""
    path = source.parent / Path(name).expanduser()
    return path if path.suffix in (".yaml", ".yml") and path.is_file() else name


def _coordination_cells(chosen: CoordinationTraining, source: Path) -> tuple[CoordinationCell, ...]:
    if chosen.benchmark is not None:
        configs = [instance.config for instance in _instances(chosen.benchmark)]
    else:
        configs = [load_cell_config(_beside(source, name), CellConfig) for name in chosen.cells or ()]
    if chosen.control_period_s is not None:
        configs = [config.model_copy(update={"control_period_s": chosen.control_period_s}) for config in configs]
    return tuple(build_cell(config) for config in configs)


def _instances(wanted: BenchmarkFilter) -> Sequence[Any]:
    found = [
        instance
        for instance in benchmark_instances(wanted.split, family=wanted.family)
        if instance.labels.status == "feasible" and wanted.priority_class in (None, instance.labels.priority_class)
    ]
    if not found:
        raise InputError("coordination.benchmark: no cell of the set is so", remedy="ask for less")
    return found[: wanted.most]


def _disturbed(chosen: CoordinationTraining) -> dict[str, Any]:
    options: dict[str, Any] = {}
    if chosen.disturbance is not None:
        options["disturbance"] = chosen.disturbance
    if chosen.custom_disturbance is not None:
        options["disturbance"] = Disturbance(**chosen.custom_disturbance.model_dump())
    if chosen.observation_noise:
        options["observation_noise"] = chosen.observation_noise
    if any(chosen.start_phase):
        options["start_phase"] = chosen.start_phase
    return options


def training_env(task: TrainingTask) -> Any:
    """The ``VecEnv`` that a training steps: batched where the physics are ideal, else one environment after another."""
    from gymnasium.vector import AutoresetMode
    from gymnasium.wrappers import TransformReward
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    from armtempo.agents.training.vec_envs import ParallelVecEnv, VectorVecEnv

    options: dict[str, Any]
    config, chosen, cells = task.config, task.config.environment, task.cells
    if isinstance(chosen, CoordinationTraining) and chosen.physics == "ideal":
        several = [cell for cell in cells if isinstance(cell, CoordinationCell)]
        arms = len(several[0].arms)
        learners = (arms - 1,) if chosen.learners == "last" else tuple(range(arms))
        options = task.settings | task.disturbed | {"reward": chosen.reward, "learners": learners}
        del options["physics"]
        batch = CoordinationVectorEnv(several, config.num_envs, **options)
        return VectorVecEnv(batch, cut_penalty=chosen.cut_penalty)
    if isinstance(chosen, IKTraining) and chosen.physics == "ideal":
        assert isinstance(cells[0], IKCell)
        vector = FeedbackIKVectorEnv(
            config.num_envs, cells[0], action_mode=chosen.action_mode, family=chosen.families, targets=chosen.targets,
            target_seed=config.seed, hold_periods=chosen.hold_periods, autoreset_mode=AutoresetMode.SAME_STEP,
        )  # fmt: skip
        return VectorVecEnv(vector, chosen.reward_scale)
    if isinstance(chosen, BlendTraining) and chosen.physics == "ideal":
        assert isinstance(cells[0], BlendCell)
        return VectorVecEnv(
            BlendTrackingVectorEnv(
                config.num_envs, cells[0], profile=chosen.profile, mapping=chosen.mapping, family=chosen.family,
                autoreset_mode=AutoresetMode.SAME_STEP,
            )
        )  # fmt: skip
    options = task.settings | task.disturbed
    turn, variants = itertools.cycle(cells), itertools.cycle(task.variants)
    if isinstance(chosen, CoordinationTraining) and chosen.learners == "all":
        return ParallelVecEnv(lambda: CoordinationEnv(next(turn), **options), config.num_envs)  # type: ignore[arg-type]

    def one() -> Any:
        cell: Any = next(turn)
        own: Any = options | next(variants)
        if isinstance(chosen, CoordinationTraining):
            return Monitor(YieldingEnv(cell, others="phase-plane", **own))
        if isinstance(chosen, BlendTraining):
            return Monitor(BlendTrackingEnv(cell, **own))
        return TransformReward(Monitor(FeedbackIKEnv(cell, **own)), lambda r: chosen.reward_scale * float(r))

    return DummyVecEnv([one] * config.num_envs)
