"""Many environments at once without physics: Gymnasium's vector form of yielding, and arrays for all arms of cells."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Unpack, final

import numpy as np
from gymnasium.spaces import Space
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.common import (
    Batch,
    Chunks,
    Seeds,
    VectorBase,
    action_space,
    as_commands,
    check_late,
    count_of,
    ideal_options,
    is_number,
    observation_space,
    with_masks,
)
from armtempo.envs.coordination._batch import BatchSimulation
from armtempo.envs.coordination._episode import times_of
from armtempo.envs.coordination._yielding_env import learner_of, others_of
from armtempo.envs.coordination.graph import Graphs, graph_space, seen_by_all
from armtempo.envs.coordination.shield import plan_of
from armtempo.envs.coordination.world import COORDINATION_ENTRIES, CoordinationKeywords, CoordinationOptions
from armtempo.errors import InputError, brief
from armtempo.planners import CoordinationCell, Execution
from armtempo.planners.cells import as_cell
from armtempo.state import State

PER_THREAD = {False: 256, True: 32}  # episodes that are worth a thread: without the shield, and with it


def _threads(count: int, threads: int | None, shield: bool) -> int:
    if threads is not None:
        return count_of(threads, "threads")
    return max(1, min(os.cpu_count() or 1, count // PER_THREAD[shield]))


def _begin(simulation: BatchSimulation, mask: Bools, seeds: Seeds | None, late: float | None) -> None:
    """New episodes of these (E,); those with a seed are seeded."""
    if not mask.any():
        return
    seeded = mask & np.array([one is not None for one in seeds or [None] * len(mask)])
    if seeded.any():
        simulation.seed(seeds, seeded)
    simulation.reset(mask, late)


def _seen(options: CoordinationOptions) -> Space[Any]:
    """Of what one arm sees."""
    return graph_space() if options.observation == "graph" else observation_space(COORDINATION_ENTRIES)


def _late(options: Mapping[str, Any]) -> float | None:
    """``master_late_s`` of a reset."""
    if "master_late_s" not in options:
        return None
    late: float = options["master_late_s"]
    check_late(late)
    return late


@final
class YieldingBatch(Batch):
    """Episodes of a cell in which one arm learns, as ``VectorBase`` steps them.

    Args:
        simulation: All arms.
        own: Number of the learning arm.
        others: What the other arms do in each episode; none: full speed.
        shielded: Whether the simulation has a shield.
        made_of: What tells it apart from others.
    """

    changing = ("simulation", "_others")

    def __init__(
        self, simulation: BatchSimulation, own: int, others: Sequence[Execution], shielded: bool, made_of: State
    ) -> None:
        self.simulation, self._own, self._shielded, self._made_of = simulation, own, shielded, made_of
        self._others = tuple(others)
        self._commands = np.ones((simulation.episodes, simulation.arms))

    @property
    def name(self) -> str:
        """The cell's."""
        return self.simulation.cell.name

    @property
    def observations(self) -> Any:
        """(E, 21) now, or a graph with (E, ...)."""
        if self.simulation.graph is None:
            return self.simulation.observations[:, self._own].copy()
        return self.simulation.graph.seen_by_all([self._own])

    @property
    def rewards(self) -> Floats:
        """(E,) of the last step."""
        return self.simulation.rewards[:, self._own].copy()

    @property
    def terminated(self) -> Bools:
        """(E,)."""
        return self.simulation.terminated[:, self._own].copy()

    @property
    def truncated(self) -> Bools:
        """(E,)."""
        return self.simulation.truncated[:, self._own].copy()

    def reset(self, mask: Bools, seeds: Seeds | None, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin new episodes of these (E,); how late their first arms are."""
        _begin(self.simulation, mask, seeds, _late(options))
        for e in np.flatnonzero(mask).tolist() if self._others else ():
            self._others[e].reset()
        late = np.where(mask, self.simulation.drawn["late_s"][:, 0], 0.0)
        return with_masks({"master_late_s": late}, mask)

    def step(self, actions: Floats, active: Bools) -> None:
        """Run one control period of these (E,)."""
        commands, simulation = self._commands, self.simulation
        commands[:, self._own] = as_commands(actions[:, 0])
        for e, execution in enumerate(self._others):
            if active[e]:
                own = commands[e, self._own]
                commands[e] = execution.commands(simulation.lam[e].copy(), simulation.mu[e].copy())
                commands[e, self._own] = own
        simulation.step(commands, active)

    def figures(self, over: Bools) -> dict[str, Any]:
        """How the episodes ended, and what the shield did in them."""
        simulation, arrival = self.simulation, self.simulation.arrival[:, self._own]
        figures = {
            "is_success": over & ~np.isnan(arrival) & ~simulation.violated,
            "violation": over & simulation.violated,
            "arrival_s": np.where(over, arrival, np.nan),
        }
        if self._shielded:
            figures["shield_steps"] = np.where(over, simulation.steps, 0)
            figures["shield_changed"] = np.where(over, simulation.shield_changed[:, self._own], 0)
            figures["shield_change"] = np.where(over, simulation.shield_change[:, self._own], 0.0)
        return with_masks(figures, over)

    @property
    def made_of(self) -> State:
        """The options, the number of the learning arm, and what the others do."""
        return self._made_of

    def close(self) -> None:
        """End the threads."""
        self.simulation.close()


@final
class YieldingVectorEnv(VectorBase[YieldingBatch]):
    """E ``YieldingEnv`` at once (``gymnasium.make_vec("armtempo/Yielding-v0", num_envs=E)``), without physics.

    Environment k of seed s has the bits of a single one with ``physics="ideal"`` and seed s + k. Infos hold, at the
    end of an episode, ``is_success``, ``violation`` and ``arrival_s`` (nan: none), after a reset ``master_late_s``;
    arrays (E,) with a mask each (``_is_success``...), as Gymnasium has it. In ``SAME_STEP`` those of the end are in
    ``final_info``, the last observations (E, 21) in ``final_obs``. A reset may be given ``master_late_s`` [s].

    Args:
        num_envs: E.
        cell: As in ``YieldingEnv``.
        learner: As in ``YieldingEnv``.
        others: As in ``YieldingEnv``, by name. What is executed by precedence or by ``vci`` runs in Python, episode by
            episode: right, but slow.
        render_mode: None: there are no pictures.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
        threads: How many share the episodes; None: one per core, if there are episodes enough.
        **options: As ``CoordinationOptions`` has them; ``physics`` is ``ideal``.

    Raises:
        InputError: Physics is ``bullet``: make that with ``vectorization_mode="sync"``.
    """

    reset_options = ("master_late_s",)

    def __init__(
        self,
        num_envs: int = 1,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        learner: str | None = None,
        others: str | Execution | None = None,
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
        **options: Unpack[CoordinationKeywords],
    ) -> None:
        chosen = ideal_options(CoordinationOptions, options, YieldingVectorEnv, render_mode)
        count = count_of(num_envs)
        self.cell = as_cell(cell, CoordinationCell)
        own = learner_of(self.cell, learner)
        if others is not None and not isinstance(others, str):
            raise InputError("one Execution cannot run many episodes", remedy="name a planning method instead")
        each = others_of(self.cell, others, chosen.mode, count)
        self.simulation = BatchSimulation(
            self.cell, count,
            scripted=[i for i in range(len(self.cell.arms)) if i != own],
            plan=plan_of(each[0]) if chosen.shield and each else None,
            threads=_threads(count, threads, chosen.shield), **options,
        )  # fmt: skip
        made_of = {"options": chosen, "learner": own, "others": others, **times_of(self.cell)}
        batch = YieldingBatch(self.simulation, own, each, chosen.shield, made_of)
        super().__init__(
            batch, count, seen=_seen(chosen), actions=action_space(chosen.action_size), autoreset_mode=autoreset_mode
        )


@final
class CellsBatch(Batch):
    """Episodes of one or several cells with A arms each, as ``VectorBase`` steps them: arrays (E, A, ...).

    Args:
        simulations: One for each cell; their episodes in turn.
        learners: The arms that obey actions; the others ask for full speed.
        shielded: Whether the simulations have a shield.
        threads: How many simulations run at the same time.
        made_of: What tells them apart from others.
    """

    changing = ("simulations",)

    def __init__(
        self,
        simulations: Sequence[BatchSimulation],
        learners: Sequence[int],
        shielded: bool,
        threads: int,
        made_of: State,
    ) -> None:
        self.simulations, self._shielded, self._made_of = tuple(simulations), shielded, made_of
        every = list(learners) == list(range(simulations[0].arms))
        self._learners = slice(None) if every else list(learners)  # a slice is quicker
        ends = np.cumsum([0, *(one.episodes for one in simulations)]).tolist()
        self.spans = [slice(first, last) for first, last in pairwise(ends)]
        self._full = np.ones((ends[-1], simulations[0].arms))
        self._chunks = Chunks(len(self.simulations), threads)

    @property
    def name(self) -> str:
        """The cells'."""
        return ", ".join(one.cell.name for one in self.simulations)

    def gathered(self, name: str) -> NDArray[Any]:
        """An attribute of all simulations, a new array."""
        return np.concatenate([getattr(one, name) for one in self.simulations])

    @property
    def observations(self) -> Any:
        """(E, A, 21) now; or the graphs of all arms, (E, ...)."""
        views = [one.graph for one in self.simulations if one.graph is not None]
        if not views:
            return self.gathered("observations")
        return {name: np.concatenate([getattr(view.graphs, name) for view in views]) for name in Graphs._fields}

    @property
    def rewards(self) -> Floats:
        """(E, A) of the last step."""
        return self.gathered("rewards")

    @property
    def terminated(self) -> Bools:
        """(E, A)."""
        return self.gathered("terminated")

    @property
    def truncated(self) -> Bools:
        """(E, A)."""
        return self.gathered("truncated")

    def reset(self, mask: Bools, seeds: Seeds | None, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin new episodes of these (E,)."""
        late = _late(options)
        for one, span in zip(self.simulations, self.spans, strict=True):
            _begin(one, mask[span], None if seeds is None else seeds[span], late)
        return {}

    def step(self, actions: Floats, active: Bools) -> None:
        """Run one control period of these (E,)."""
        commands = self._full.copy()
        commands[:, self._learners] = as_commands(actions[:, self._learners, 0])
        priority = None
        if actions.shape[2] > 1:
            priority = np.full(commands.shape, np.nan)
            priority[:, self._learners] = actions[:, self._learners, 1]

        def part(_: int, first: int, last: int) -> None:
            for one, span in zip(self.simulations[first:last], self.spans[first:last], strict=True):
                one.step(commands[span], active[span], None if priority is None else priority[span])

        self._chunks.run(part)

    def figures(self, over: Bools) -> dict[str, Any]:
        """How the episodes ended, and what the shield did in them; of those that have not, what is so now."""
        del over
        arrival, violation = self.gathered("arrival"), self.gathered("violated")
        makespan = arrival.max(axis=1)  # nan if one did not arrive
        figures = {
            "arrival_s": arrival,
            "makespan_s": makespan,
            "violation": violation,
            "is_success": ~np.isnan(makespan) & ~violation,
        }
        if self._shielded:
            figures |= {name: self.gathered(name) for name in ("shield_changed", "shield_change")}
            figures["shield_steps"] = self.gathered("steps")
        return figures

    @property
    def made_of(self) -> State:
        """The options, and which arms learn."""
        return self._made_of

    def close(self) -> None:
        """End the threads."""
        self._chunks.close()
        for one in self.simulations:
            one.close()


@final
class CoordinationVectorEnv(VectorBase[CellsBatch]):
    """E episodes at once of one or several cells with A arms each, for all arms, without physics.

    Observations (E, A, 21), or of graphs, which all arms share, ``nodes`` and ``edges`` (E, ...); actions (E, A, 1) or,
    with priorities, (E, A, 2); rewards (E, A): arrays, no names. An episode is over when two arms came too close, all
    have arrived, or time is up; it begins anew in the same step. Then infos hold ``final_obs``, as observations are,
    and ``final_info``: ``arrival_s`` (E, A), ``makespan_s``, ``violation``, ``is_success`` (E,), both with a mask
    (``_final_obs``, ``_final_info``). An arm that has arrived gets reward 0 and is terminated until then. A reset may
    be given ``master_late_s`` [s].

    Episode k of seed s has the bits of a ``CoordinationEnv`` with ``physics="ideal"`` and seed s + k. A row (see
    ``VectorBase``) is a learner: row ``e L + k`` is learner k of L in episode e.

    Args:
        cell: One, or several with equally many arms; each gets an equal share of the episodes, in their order.
        num_envs: E.
        learners: The arms that obey actions, by number; the others ask for full speed, whatever their actions.
            None: all.
        reward: ``own`` or ``team``, see ``BatchSimulation``.
        threads: How many share the episodes, or the cells if there are several; None: one per core, if there are
            episodes enough.
        **options: As ``CoordinationOptions`` has them; ``physics`` is ``ideal``.
    """

    reset_options = ("master_late_s",)

    def __init__(
        self,
        cell: CoordinationCell | str | Path | Sequence[CoordinationCell | str | Path] = "lee1991",
        num_envs: int = 1,
        *,
        learners: Sequence[int] | None = None,
        reward: str = "own",
        threads: int | None = None,
        **options: Unpack[CoordinationKeywords],
    ) -> None:
        chosen = ideal_options(CoordinationOptions, options, CoordinationVectorEnv)
        count = count_of(num_envs)
        given = list(cell) if isinstance(cell, Sequence) and not isinstance(cell, str) else [cell]
        self.cells = tuple(as_cell(one, CoordinationCell) for one in given)
        counts = {len(one.arms) for one in self.cells}
        if len(counts) != 1 or len(self.cells) > count:
            raise InputError(
                f"{len(self.cells)} cells with {sorted(counts)} arms for {count} episodes",
                remedy="give cells with equally many arms, and an episode for each at least",
            )
        self.arms = counts.pop()
        every = range(self.arms)
        chosen_arms = every if learners is None else learners if isinstance(learners, Collection) else ()
        self.learners = tuple(int(i) for i in chosen_arms if is_number(i) and i in every)
        if not self.learners or len(self.learners) < len(chosen_arms):
            raise InputError(
                f"learners is {brief(learners)}, the cells have {self.arms} arms", remedy="give their numbers"
            )
        together = _threads(count, threads, chosen.shield)
        bounds = np.linspace(0, count, len(self.cells) + 1).astype(int).tolist()
        simulations = [
            BatchSimulation(
                one, last - first, reward=reward, threads=together if len(self.cells) == 1 else 1, **options
            )
            for one, (first, last) in zip(self.cells, pairwise(bounds), strict=True)
        ]
        times = [times_of(one) for one in self.cells]
        made_of = {"options": chosen, "learners": self.learners, "reward": reward, "cells": times}
        batch = CellsBatch(simulations, self.learners, chosen.shield, together, made_of)
        self.arm_observation_space, self.arm_action_space = _seen(chosen), action_space(chosen.action_size)
        graphs = chosen.observation == "graph"
        super().__init__(
            batch, count,
            seen=graph_space(own=False) if graphs else batch_space(self.arm_observation_space, self.arms),
            actions=batch_space(self.arm_action_space, self.arms),
            autoreset_mode=AutoresetMode.SAME_STEP,
        )  # fmt: skip

    @property
    def simulations(self) -> tuple[BatchSimulation, ...]:
        """One for each cell."""
        return self.batch.simulations

    def reset(
        self, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin new episodes; infos tell what goes wrong in them. Otherwise as ``VectorBase.reset``."""
        observations, infos = super().reset(seed=seed, options=options)
        drawn = [one.drawn for one in self.simulations]
        wrong = {name: np.concatenate([part[name] for part in drawn]) for name in ("late_s", "speed")}
        return observations, infos | {"disturbance": wrong}

    def leave_undisturbed(self, share: float) -> None:
        """From their next reset on this share of every cell's episodes is neither disturbed nor late nor elsewhere.

        Raises:
            InputError: It is not between 0 and 1.
        """
        if not (is_number(share) and 0.0 <= share <= 1.0):
            raise InputError(f"the share of undisturbed episodes must be between 0 and 1, got {brief(share)}")
        for one in self.simulations:
            one.undisturbed[:] = np.arange(one.episodes) < round(share * one.episodes)

    @property
    def shield_cut(self) -> Floats:
        """(E, A) by how much the shield cut the commands of the last step."""
        return self.batch.gathered("shield_cut")

    @property
    def row_spaces(self) -> tuple[Space[Any], Space[Any]]:
        """Of what one arm sees, and of its actions."""
        return self.arm_observation_space, self.arm_action_space

    @property
    def rows_per_env(self) -> int:
        """L."""
        return len(self.learners)

    def to_rows(self, values: Any) -> Any:
        """(E, A, ...) to (E L, ...); graphs (E, ...) to what every learner sees."""
        if isinstance(values, dict):
            return seen_by_all(values, self.learners)
        mine = values[:, self.learners]
        return np.ascontiguousarray(mine.reshape(-1, *mine.shape[2:]))

    def from_rows(self, actions: NDArray[Any]) -> NDArray[Any]:
        """Actions (E L, n) as (E, A, n)."""
        size = actions.shape[-1]
        given = np.ones((self.num_envs, self.arms, size), dtype=actions.dtype)
        given[:, self.learners] = actions.reshape(self.num_envs, -1, size)
        return given
