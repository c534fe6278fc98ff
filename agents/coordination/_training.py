"""Trainings in coordination cells: arms on given paths that learn when to go."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, final

import numpy as np

from armtempo.agents.coordination._baselines import ExecutionPolicy
from armtempo.agents.coordination._result import safe_makespan
from armtempo.agents.coordination._teaching import Demonstrations
from armtempo.agents.coordination._team_training import TeamEvaluator, demonstrations, team_simulations
from armtempo.agents.evaluation import CurveEvaluator, Row, TrainingTask, beside, run_episode
from armtempo.agents.policies import GRAPH_NAMES, Actions, Agent, LearnedPolicy, Observations, Policy
from armtempo.configs import BenchmarkFilter, CoordinationTraining, SharedSpaceConfig, TrainConfig, load_cell_config
from armtempo.envs import (
    COORDINATION_ENTRIES,
    BatchSimulation,
    CoordinationEnv,
    CoordinationVectorEnv,
    Disturbance,
    YieldingEnv,
)
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, benchmark_instances, build_cell, execution_of, schedule

ARMS_WITH_QUICK_OPTIMUM = 2  # at most, for the optimum to be found quickly


@final
class CoordinationTask(TrainingTask):
    """See ``CoordinationTraining``."""

    environment = "coordination"

    def __init__(self, config: TrainConfig, chosen: CoordinationTraining) -> None:
        self.config, self._chosen = config, chosen
        self._cells = _cells_of(chosen, config.source)
        self.cells = self._cells
        self.learners = chosen.learners
        self.settings = {"physics": chosen.physics, "mode": chosen.mode}
        if chosen.shield:
            self.settings["shield"] = True
        if chosen.action != "speed":  # files of before say nothing
            self.settings["action"] = chosen.action
        if chosen.observation == "graph":
            self.settings |= {"observation": "graph", "orders": chosen.orders}
        self._drawn = _drawn_options(chosen)

    @property
    def entries(self) -> list[str]:
        """Names of the observation's entries."""
        return GRAPH_NAMES if self._graphs else [entry.name for entry in COORDINATION_ENTRIES]

    @property
    def _graphs(self) -> bool:
        return self._chosen.observation == "graph"

    @property
    def _team_options(self) -> dict[str, Any]:
        """Of simulations of all arms of a cell."""
        options = {**self.settings, **self._drawn, "reward": "team"}
        del options["physics"]
        return options

    @property
    def decide_every(self) -> int:
        """``hold_periods``."""
        return self._chosen.hold_periods

    def team(self) -> list[BatchSimulation] | None:
        """Graphs of all cells."""
        return team_simulations(self._cells, self.config.num_envs, self._team_options) if self._graphs else None

    def demonstrations(self) -> Demonstrations | None:
        """Decisions of the teacher, in the cells of the training."""
        wanted, chosen = self.config.imitation, self._chosen
        if wanted is None:
            return None
        return demonstrations(
            self._cells, wanted.decisions, self._team_options, hold_periods=chosen.hold_periods,
            undisturbed_share=chosen.undisturbed_share, seed=self.config.seed,
        )  # fmt: skip

    @property
    def cut_penalty(self) -> float:
        """What the shield cuts may cost."""
        return self._chosen.cut_penalty

    def undisturbed_share(self, steps: int) -> float | None:
        """All of them until ``undisturbed_until``, then ``undisturbed_share``."""
        chosen = self._chosen
        if chosen.physics != "ideal":
            return None
        return 1.0 if steps < chosen.undisturbed_until * self.config.total_steps else chosen.undisturbed_share

    def vector(self) -> CoordinationVectorEnv | None:
        """Rows of learners, without physics."""
        if self._chosen.physics != "ideal":
            return None
        arms = len(self._cells[0].arms)
        learners = (arms - 1,) if self._chosen.learners == "last" else tuple(range(arms))
        options = {**self.settings, **self._drawn, "reward": self._chosen.reward, "learners": learners}
        del options["physics"]
        return CoordinationVectorEnv(self._cells, self.config.num_envs, **options)

    def single(self, turn: int) -> YieldingEnv:
        """The last arm learns, the others go at full speed; cells in turn."""
        return YieldingEnv(self._cell(turn), others="phase-plane", **self.settings, **self._drawn)

    def parallel(self, turn: int) -> CoordinationEnv | None:
        """All arms learn; cells in turn."""
        if self._chosen.learners == "last":
            return None
        return CoordinationEnv(self._cell(turn), **self.settings, **self._drawn)

    def evaluator(self) -> CurveEvaluator:
        """Makespans, undisturbed ones against bound and optimum; of graphs both against full speed."""
        if self._graphs:
            watched = self._cells
            if self._chosen.validation is not None:
                watched = tuple(build_cell(one.config) for one in _instances(self._chosen.validation))
            return TeamEvaluator(
                watched[: self.config.evaluation.cells], self._team_options, self.config.evaluation,
                self._chosen.hold_periods,
            )  # fmt: skip
        cells = self._cells[: self.config.evaluation.cells]
        return CoordinationEvaluator(
            [CoordinationEnv(cell, record=True, **self.settings, **self._drawn) for cell in cells],
            [CoordinationEnv(cell, record=True, **self.settings) for cell in cells],
            self.config,
        )

    def _cell(self, turn: int) -> CoordinationCell:
        return self._cells[turn % len(self._cells)]


@final
class CoordinationEvaluator(CurveEvaluator):
    """Evaluates agents for several arms.

    A row has ``gap_percent``, how far undisturbed makespans are above the certified bounds, and ``optimum_percent``,
    above the optimum run in the same environment, means over cells; None where a cell was not finished. ``reward``,
    ``makespan_s``, ``finished`` out of ``episodes`` and ``violations`` (episodes) are of episodes as in training.
    """

    def __init__(
        self, envs: Sequence[CoordinationEnv], undisturbed: Sequence[CoordinationEnv], config: TrainConfig
    ) -> None:
        super().__init__(envs, config.evaluation)
        self._undisturbed = tuple(undisturbed)
        self._optimum: list[float | None] | None = None

    def row(self, agent: Agent) -> Row:
        """Evaluate an agent; the same agent gives the same row."""
        policy, seed = LearnedPolicy(agent), self.config.seed
        if self._optimum is None:
            self._optimum = [self._optimal(env) for env in self._undisturbed]
        gaps, above = [], []
        for env, optimum in zip(self._undisturbed, self._optimum, strict=True):
            makespan = _makespan(env, policy, seed)[0]
            gaps.append(None if makespan is None else 100.0 * (makespan / env.cell.lower_bound - 1.0))
            above.append(None if makespan is None or optimum is None else 100.0 * (makespan / optimum - 1.0))
        makespans, rewards, violations = [], [], 0
        for k in range(self.config.episodes):
            makespan, reward, violated = _makespan(self.envs[k % len(self.envs)], policy, seed + k)
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
        return _makespan(env, ExecutionPolicy(partial(execution_of, plan)), self.config.seed)[0]

    def close(self) -> None:
        """Close the environments."""
        super().close()
        for env in self._undisturbed:
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


def _cells_of(chosen: CoordinationTraining, source: Path) -> tuple[CoordinationCell, ...]:
    if chosen.benchmark is not None:
        configs = [instance.config for instance in _instances(chosen.benchmark)]
    else:
        configs = [load_cell_config(beside(source, name), SharedSpaceConfig) for name in chosen.cells or ()]
    if chosen.control_period_s is not None:
        configs = [config.model_copy(update={"control_period_s": chosen.control_period_s}) for config in configs]
    return tuple(build_cell(config) for config in configs)


def _instances(wanted: BenchmarkFilter) -> Sequence[Any]:
    found = [
        instance
        for instance in benchmark_instances(wanted.split, family=wanted.family, arms=wanted.arms)
        if instance.labels.status == "feasible" and wanted.priority_class in (None, instance.labels.priority_class)
    ]
    if not found:
        raise InputError("coordination.benchmark: no cell of the set is so", remedy="ask for less")
    return found[: wanted.most]


def _drawn_options(chosen: CoordinationTraining) -> dict[str, Any]:
    """Options that differ from episode to episode."""
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
