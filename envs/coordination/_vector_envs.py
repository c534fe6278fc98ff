"""Many environments at once without physics: Gymnasium's vector form of yielding, and arrays for all arms of cells."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.bodies import Physics
from armtempo.envs.common import (
    action_space,
    autoreset_of,
    check_ideal,
    check_late,
    count_of,
    observation_space,
    read_commands,
    spread,
)
from armtempo.envs.coordination._batch import BatchSimulation
from armtempo.envs.coordination._yielding_env import learner_of, others_of
from armtempo.envs.coordination.shield import plan_of
from armtempo.envs.coordination.world import COORDINATION_ENTRIES, Disturbance, Range
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, Execution
from armtempo.planners.cells import CellBase, as_cell
from armtempo.planners.topp import Mode

PER_THREAD = {False: 256, True: 32}  # episodes that are worth a thread: without the shield, and with it


def _threads(count: int, threads: int | None, shield: bool) -> int:
    return max(1, min(os.cpu_count() or 1, count // PER_THREAD[shield])) if threads is None else threads


@final
class YieldingVectorEnv(VectorEnv[Floats32, Floats32, NDArray[Any]]):
    """E ``YieldingEnv`` at once (``gymnasium.make_vec("armtempo/Yielding-v0", num_envs=E)``), without physics.

    Environment k of seed s has the bits of a single one with ``physics="ideal"`` and seed s + k. Infos hold, at the
    end of an episode, ``is_success``, ``violation`` and ``arrival_s`` (nan: none), after a reset ``master_late_s``;
    arrays (E,) with a mask each (``_is_success``...), as Gymnasium has it. In ``SAME_STEP`` those of the end are in
    ``final_info``, the last observations (E, 21) in ``final_obs``.

    Args:
        num_envs: E.
        cell: As in ``YieldingEnv``.
        learner: As in ``YieldingEnv``.
        others: As in ``YieldingEnv``, by name. What is executed by precedence or by ``vci`` runs in Python, episode by
            episode: right, but slow.
        physics: ``ideal``.
        mode: As in ``YieldingEnv``; so are those below that are not told here.
        master_late_s: Time or range [s].
        max_episode_s: Time limit [s].
        disturbance: What goes wrong with arms.
        observation_noise: Standard deviation.
        start_phase: Share of the path, or a range.
        shield: Let through only what can neither collide nor end in a deadlock; what it cut is told at the end.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP`` of Gymnasium's ``AutoresetMode``, or its value.
        threads: How many share the episodes; None: one per core, if there are episodes enough.

    Raises:
        InputError: Physics is ``bullet``: make that with ``vectorization_mode="sync"``.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        learner: str | None = None,
        others: str | Execution | None = None,
        physics: Physics = "ideal",
        mode: Mode = "speed",
        render_mode: str | None = None,
        master_late_s: float | Range = 0.0,
        max_episode_s: float | None = None,
        disturbance: str | Disturbance | None = None,
        observation_noise: float = 0.0,
        start_phase: float | Range = 0.0,
        shield: bool = False,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        threads: int | None = None,
    ) -> None:
        check_ideal(physics, render_mode)
        self.autoreset_mode = autoreset_of(autoreset_mode)
        self.num_envs = count_of(num_envs)
        self.cell = as_cell(cell, CoordinationCell)
        self._own, self._shielded = learner_of(self.cell, learner), shield
        if others is not None and not isinstance(others, str):
            raise InputError("one Execution cannot run many episodes", remedy="name a planning method instead")
        self._others = others_of(self.cell, others, mode, self.num_envs)
        self.simulation = BatchSimulation(
            self.cell, self.num_envs, mode=mode, disturbance=disturbance, observation_noise=observation_noise,
            start_phase=start_phase, master_late_s=master_late_s, max_episode_s=max_episode_s, shield=shield,
            scripted=[i for i in range(len(self.cell.arms)) if i != self._own],
            plan=plan_of(self.cell, self._others[0]) if shield and self._others else None,
            threads=_threads(self.num_envs, threads, shield),
        )  # fmt: skip
        self.metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": self.autoreset_mode}
        self.render_mode = None
        self.single_observation_space: Box = observation_space(COORDINATION_ENTRIES)
        self.single_action_space: Box = action_space()
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._commands = np.ones((self.num_envs, len(self.cell.arms)))

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: Environment k gets ``seed + k``, or a sequence of seeds.
            options: May give ``reset_mask`` (E,), which environments, and ``master_late_s`` [s] for these episodes.
        """
        mask = (options or {}).get("reset_mask")
        late = (options or {}).get("master_late_s")
        if late is not None:
            check_late(late)
        if mask is not None and not (isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,) and mask.any()):
            raise InputError("reset_mask must be an array of truth values, one per environment, not all False")
        if seed is not None:
            if isinstance(seed, int | np.integer):
                self._np_random, self._np_random_seed = seeding.np_random(int(seed))
            self.simulation.seed(seed, mask)
        begun = np.ones(self.num_envs, dtype=np.bool_) if mask is None else mask.astype(np.bool_)
        self._begin(begun, late)
        return self._observed(), self._begun(begun)

    def _begin(self, begun: Bools, late: float | None = None) -> None:
        self.simulation.reset(begun, late)
        self._over[begun] = False
        for e in np.flatnonzero(begun) if self._others else ():
            self._others[e].reset()

    def _observed(self) -> Floats32:
        return self.simulation.observations[:, self._own].copy()

    def _begun(self, begun: Bools) -> dict[str, Any]:
        return {"master_late_s": np.where(begun, self.simulation.drawn["late_s"][:, 0], 0.0), "_master_late_s": begun}

    def step(self, actions: ArrayLike) -> tuple[Floats32, Floats, Bools, Bools, dict[str, Any]]:
        """Run one control period; environments whose episode was over begin anew instead (``NEXT_STEP``).

        Raises:
            ActionError: The actions are not (E, 1) finite numbers.
        """
        commands, simulation = self._commands, self.simulation
        again = self._over.copy()
        commands[:, self._own] = read_commands(actions, (self.num_envs, 1))[:, 0]
        for e, execution in enumerate(self._others):
            if not again[e]:
                own = commands[e, self._own]
                commands[e] = execution.commands(simulation.lam[e].copy(), simulation.mu[e].copy())
                commands[e, self._own] = own
        infos: dict[str, Any] = {}
        simulation.step(commands, ~again)
        if again.any():
            self._begin(again)
            infos |= self._begun(again)
        rewards = simulation.rewards[:, self._own].copy()
        terminated, truncated = simulation.terminated[:, self._own].copy(), simulation.truncated[:, self._own].copy()
        self._over = terminated | truncated
        if self._over.any():
            ended = self._figures()
            if self.autoreset_mode == AutoresetMode.SAME_STEP:
                over = self._over.copy()
                infos |= {"final_obs": self._observed(), "_final_obs": over, "final_info": ended, "_final_info": over}
                self._begin(over)
                infos |= self._begun(over)
            else:
                infos |= ended
        return self._observed(), rewards, terminated, truncated, infos

    def _figures(self) -> dict[str, Any]:
        over, arrival = self._over.copy(), self.simulation.arrival[:, self._own]
        figures = {
            "is_success": over & ~np.isnan(arrival) & ~self.simulation.violated,
            "violation": over & self.simulation.violated,
            "arrival_s": np.where(over, arrival, np.nan),
        }
        if self._shielded:
            figures["shield_steps"] = np.where(over, self.simulation.steps, 0)
            figures["shield_changed"] = np.where(over, self.simulation.shield_changed[:, self._own], 0)
            figures["shield_change"] = np.where(over, self.simulation.shield_change[:, self._own], 0.0)
        return figures | {f"_{name}": over for name in figures}

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All that changes, as arrays; ``set_state`` goes on from there with the same bits.

        Raises:
            InputError: Other arms are executed in Python, which has a state of its own.
        """
        if self._others:
            raise InputError("executions of other arms cannot be saved", remedy='use others="phase-plane"')
        return {**self.simulation.get_state(), "over": self._over.copy()}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from ``get_state``.

        Raises:
            InputError: It is the state of other environments.
        """
        self.simulation.set_state(state)
        self._over = np.asarray(state["over"], dtype=np.bool_).copy()

    def close_extras(self, **_: Any) -> None:
        """End the threads."""
        self.simulation.close()


@final
class CoordinationVectorEnv:
    """E episodes at once of one or several cells with A arms each, for all arms, without physics.

    Observations (E, A, 21), actions (E, A, 1), rewards (E, A): arrays, no names. An episode is over when two arms
    came too close, all have arrived, or time is up; it begins anew in the same step. Then infos hold ``final_obs``
    (E, A, 21) and ``final_info``: ``arrival_s`` (E, A), ``makespan_s``, ``violation``, ``is_success`` (E,), both with a
    mask (``_final_obs``, ``_final_info``). An arm that has arrived gets reward 0 and is terminated until then.

    Episode k of seed s has the bits of a ``CoordinationEnv`` with ``physics="ideal"`` and seed s + k.

    Args:
        cell: One, or several with equally many arms; each gets an equal share of the episodes, in their order.
        num_envs: E.
        mode: As in ``CoordinationEnv``; so are those below that are not told here.
        learners: The arms that obey actions, by number; the others ask for full speed, whatever their actions.
            None: all.
        reward: ``own`` or ``team``, see ``BatchSimulation``.
        master_late_s: Time or range [s].
        max_episode_s: Time limit [s].
        disturbance: What goes wrong with arms.
        observation_noise: Standard deviation.
        start_phase: Share of the path, or a range.
        shield: Let through only what can neither collide nor end in a deadlock; what it cut is told at the end.
        threads: How many share the episodes, or the cells if there are several; None: one per core, if there are
            episodes enough.
    """

    metadata: ClassVar[dict[str, Any]] = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        cell: CoordinationCell | str | Path | Sequence[CoordinationCell | str | Path] = "lee1991",
        num_envs: int = 1,
        *,
        mode: Mode = "speed",
        learners: Sequence[int] | None = None,
        reward: str = "own",
        master_late_s: float | Range = 0.0,
        max_episode_s: float | None = None,
        disturbance: str | Disturbance | None = None,
        observation_noise: float = 0.0,
        start_phase: float | Range = 0.0,
        shield: bool = False,
        threads: int | None = None,
    ) -> None:
        self.num_envs = count_of(num_envs)
        given = [cell] if isinstance(cell, CellBase | str | Path) else list(cell)
        self.cells = tuple(as_cell(one, CoordinationCell) for one in given)
        counts = {len(one.arms) for one in self.cells}
        if len(counts) != 1 or len(self.cells) > self.num_envs:
            raise InputError(
                f"{len(self.cells)} cells with {sorted(counts)} arms for {self.num_envs} episodes",
                remedy="give cells with equally many arms, and an episode for each at least",
            )
        self.arms = counts.pop()
        self.learners = tuple(range(self.arms)) if learners is None else tuple(int(i) for i in learners)
        if not self.learners or not set(self.learners) <= set(range(self.arms)):
            raise InputError(f"learners is {learners!r}, the cells have {self.arms} arms", remedy="give their numbers")
        bounds = np.linspace(0, self.num_envs, len(self.cells) + 1).astype(int).tolist()
        self._spans = [slice(first, last) for first, last in pairwise(bounds)]
        together = _threads(self.num_envs, threads, shield)
        self._pool = ThreadPoolExecutor(together) if together > 1 and len(self.cells) > 1 else None
        self.simulations = tuple(
            BatchSimulation(
                one, span.stop - span.start, mode=mode, reward=reward, disturbance=disturbance,
                observation_noise=observation_noise, start_phase=start_phase, master_late_s=master_late_s,
                max_episode_s=max_episode_s, shield=shield,
                threads=together if self._pool is None else 1,
            )
            for one, span in zip(self.cells, self._spans, strict=True)
        )  # fmt: skip
        self._shielded = shield
        self.observation_space: Box = observation_space(COORDINATION_ENTRIES)
        self.action_space: Box = action_space()
        self._full = np.ones((self.num_envs, self.arms))

    def leave_undisturbed(self, share: float) -> None:
        """From their next reset on this share of every cell's episodes is neither disturbed nor late nor elsewhere.

        Raises:
            InputError: It is not between 0 and 1.
        """
        if not 0.0 <= share <= 1.0:
            raise InputError(f"the share of undisturbed episodes must be between 0 and 1, got {share!r}")
        for one in self.simulations:
            one.undisturbed[:] = np.arange(one.episodes) < round(share * one.episodes)

    def _gathered(self, name: str) -> NDArray[Any]:
        return np.concatenate([getattr(one, name) for one in self.simulations])

    def reset(
        self, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin all episodes anew; ``options`` may give ``master_late_s`` [s] for these."""
        late = (options or {}).get("master_late_s")
        if late is not None:
            check_late(late)
        seeds = spread(seed, self.num_envs)
        for one, span in zip(self.simulations, self._spans, strict=True):
            if seed is not None:
                one.seed(seeds[span])
            one.reset(None, late)
        drawn = [one.drawn for one in self.simulations]
        return self._gathered("observations"), {
            "disturbance": {name: np.concatenate([part[name] for part in drawn]) for name in ("late_s", "speed")}
        }

    def step(self, actions: ArrayLike) -> tuple[Floats32, Floats, Bools, Bools, dict[str, Any]]:
        """Run one control period.

        Raises:
            ActionError: The actions are not (E, A, 1) finite numbers.
        """
        given = read_commands(actions, (self.num_envs, self.arms, 1))[:, :, 0]
        commands = self._full.copy()
        commands[:, self.learners] = given[:, self.learners]
        parts = [commands[span] for span in self._spans]
        each = map if self._pool is None else self._pool.map
        list(each(BatchSimulation.step, self.simulations, parts))
        rewards, observations = self._gathered("rewards"), self._gathered("observations")
        terminated, truncated = self._gathered("terminated"), self._gathered("truncated")
        over = (terminated | truncated).all(axis=1)
        infos: dict[str, Any] = {}
        if over.any():
            arrival, violation = self._gathered("arrival"), self._gathered("violated")
            makespan = arrival.max(axis=1)  # nan if one did not arrive
            infos = {
                "final_obs": observations.copy(),
                "_final_obs": over,
                "final_info": {
                    "arrival_s": arrival,
                    "makespan_s": makespan,
                    "violation": violation,
                    "is_success": ~np.isnan(makespan) & ~violation,
                },
                "_final_info": over.copy(),
            }
            if self._shielded:
                for name in ("shield_changed", "shield_change"):
                    infos["final_info"][name] = self._gathered(name)
                infos["final_info"]["shield_steps"] = self._gathered("steps")
            for one, span in zip(self.simulations, self._spans, strict=True):
                if over[span].any():
                    one.reset(over[span])
                    observations[span] = one.observations
        return observations, rewards, terminated, truncated, infos

    def get_state(self) -> dict[str, NDArray[Any]]:
        """All that changes, as arrays; ``set_state`` goes on from there with the same bits."""
        return {f"{k}.{name}": a for k, one in enumerate(self.simulations) for name, a in one.get_state().items()}

    def set_state(self, state: dict[str, NDArray[Any]]) -> None:
        """Go on from ``get_state``.

        Raises:
            InputError: It is the state of other environments.
        """
        for k, one in enumerate(self.simulations):
            start = f"{k}."
            one.set_state({name[len(start) :]: array for name, array in state.items() if name.startswith(start)})

    def close(self) -> None:
        """End the threads; may be called twice."""
        if self._pool is not None:
            self._pool.shutdown()
        for one in self.simulations:
            one.close()
