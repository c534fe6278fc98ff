"""Agents that see graphs in training: episodes of many cells at once, demonstrations, and the curve's figures."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from armtempo.agents.coordination._teaching import Demonstrations, demonstrate
from armtempo.agents.evaluation import CurveEvaluator, Row
from armtempo.agents.policies import Agent
from armtempo.arrays import Floats
from armtempo.configs import EvaluationConfig
from armtempo.envs import BatchSimulation
from armtempo.planners import CoordinationCell

EPISODES_AT_ONCE = 2  # of a cell, in one go of demonstrations


def team_simulations(
    cells: Sequence[CoordinationCell], episodes: int, options: dict[str, Any]
) -> list[BatchSimulation]:
    """As many episodes as there are, shared out evenly among cells; of more cells than episodes the first ones."""
    counts = np.diff(np.linspace(0, episodes, min(len(cells), episodes) + 1).astype(int)).tolist()
    return [BatchSimulation(cell, count, **options) for cell, count in zip(cells, counts, strict=False)]


def demonstrations(
    cells: Sequence[CoordinationCell],
    decisions: int,
    options: dict[str, Any],
    *,
    hold_periods: int,
    undisturbed_share: float,
    seed: int,
) -> Demonstrations:
    """At least so many decisions of the teacher, from all cells alike; as many cells at once as there are cores."""
    each = -(-decisions // len(cells))

    def of_cell(k: int) -> list[Demonstrations]:
        parts: list[Demonstrations] = []
        simulation = BatchSimulation(cells[k], EPISODES_AT_ONCE, **options)
        try:
            while sum(len(part.rows) for part in parts) < each:
                before = EPISODES_AT_ONCE * (k + len(cells) * len(parts))
                places = before + np.arange(EPISODES_AT_ONCE + 1)
                simulation.undisturbed[:] = np.diff(np.floor(undisturbed_share * places)) > 0
                parts.append(demonstrate(simulation, seed + before, hold_periods))
        finally:
            simulation.close()
        return parts

    with ThreadPoolExecutor(os.cpu_count()) as pool:  # the simulations run without Python's lock
        return Demonstrations.joined([part for parts in pool.map(of_cell, range(len(cells))) for part in parts])


class TeamEvaluator(CurveEvaluator):
    """Evaluates agents for all arms of cells, against full speed in the same orders and the same episodes.

    A row has ``undisturbed_ratio`` and ``disturbed_ratio``, makespans over those of full speed, means over episodes;
    ``mixed_ratio``, the mean of both, by which the best agent is told; ``reward`` and ``finished`` out of ``episodes``.
    An episode that was not finished counts as its time limit.

    Args:
        cells: Where it is evaluated.
        options: Of the episodes.
        config: How many disturbed episodes, and from which seed on.
        hold_periods: Control periods between decisions.
    """

    def __init__(
        self, cells: Sequence[CoordinationCell], options: dict[str, Any], config: EvaluationConfig, hold_periods: int
    ) -> None:
        super().__init__((), config)
        self._hold = hold_periods
        each = max(1, config.episodes // len(cells))
        self._simulations = [BatchSimulation(cell, 1 + each, **options) for cell in cells]
        self._full_speed: list[Floats] | None = None

    def row(self, agent: Agent) -> Row:
        """Evaluate an agent; the same agent gives the same row."""
        if self._full_speed is None:
            self._full_speed = [self._run(one, None)[0] for one in self._simulations]
        undisturbed, disturbed, rewards, finished = [], [], [], 0
        for one, full in zip(self._simulations, self._full_speed, strict=True):
            times, earned, there = self._run(one, agent)
            ratios = times / full
            undisturbed.append(ratios[0])
            disturbed += ratios[1:].tolist()
            rewards += earned.tolist()
            finished += there
        still, late = float(np.mean(undisturbed)), float(np.mean(disturbed))
        return {
            "reward": float(np.mean(rewards)),
            "finished": finished,
            "episodes": len(rewards),
            "undisturbed_ratio": still,
            "disturbed_ratio": late,
            "mixed_ratio": 0.5 * (still + late),
        }

    def score(self, row: Row) -> float:
        """The ``mixed_ratio``."""
        score: float = row["mixed_ratio"]
        return score

    def _run(self, one: BatchSimulation, agent: Agent | None) -> tuple[Floats, Floats, int]:
        """Makespans (E,) [s] and rewards (E,) of an agent, or of full speed; how many episodes were finished."""
        one.undisturbed[:] = np.arange(one.episodes) == 0
        one.seed(self.config.seed)
        one.reset()
        commands, rewards = np.ones(one.lam.shape), np.zeros(one.episodes)
        active = np.ones(one.episodes, dtype=np.bool_)
        assert one.graph is not None
        period = 0
        while active.any():
            if agent is not None and period % self._hold == 0:
                for e in np.flatnonzero(active).tolist():
                    actions = agent.act_on_graph(one.graph.graphs.nodes[e], one.graph.graphs.edges[e])
                    commands[e] = 0.5 * (actions[:, 0].astype(np.float64) + 1.0)
            one.step(commands, active)
            period += 1
            rewards[active] += one.rewards[active, 0]
            active = active & ~(one.terminated | one.truncated).all(axis=1)
        makespans = one.arrival.max(axis=1)
        good = ~np.isnan(makespans) & ~one.violated
        return np.where(good, makespans, one.time_limit), rewards, int(good.sum())

    def close(self) -> None:
        """End the simulations' threads."""
        for one in self._simulations:
            one.close()
