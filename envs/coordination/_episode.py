"""What the environments of several arms share: commands from actions, rewards, ends and infos of an episode."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.random import Generator

from armtempo.arrays import Floats
from armtempo.envs.common import TIME_LIMIT, check_late, collision_reward, key_from, progress_reward, time_reward
from armtempo.envs.coordination.shield import EpisodeShield
from armtempo.envs.coordination.world import CoordinationOptions, CoordinationSimulation
from armtempo.planners import CoordinationCell
from armtempo.state import Stateful


def time_limit(cell: CoordinationCell, max_episode_s: float | None) -> tuple[float, float]:
    """The reference time of rewards, and after how long an episode is truncated [s]."""
    reference = cell.sequential_makespan
    return reference, TIME_LIMIT * reference if max_episode_s is None else float(max_episode_s)


def times_of(cell: CoordinationCell) -> dict[str, tuple[float, ...]]:
    """What tells cells of one name apart, for states."""
    return {"minimum_times_s": tuple(motion.duration for motion in cell.fastest)}


@final
class Episode(Stateful):
    """The state of an episode of one cell, above the simulation."""

    changing = ("simulation", "_charged", "_before", "timed_out", "_key", "_number")

    def __init__(self, cell: CoordinationCell, options: CoordinationOptions, *, record: bool) -> None:
        self.cell = cell
        self.reference_time, self.time_limit = time_limit(cell, options.max_episode_s)
        self.simulation = CoordinationSimulation(cell, options, record=record)
        self.lengths = [path.length for path in cell.paths]
        self._key: int | None = None
        self._number = -1
        self._start()

    def _start(self) -> None:
        self._charged = [0.0] * len(self.lengths)
        self._before: list[float] = self.simulation.lam.tolist()
        self.timed_out = False

    def reset(
        self, generator: Generator, seeded: bool, options: Mapping[str, Any], shield: EpisodeShield | None = None
    ) -> dict[str, Any]:
        """Start again; returns what was drawn.

        Args:
            generator: Gives the key of the random numbers, when ``seeded`` or the first time.
            seeded: Begin to count episodes anew.
            options: May give ``master_late_s`` for this episode [s].
            shield: Begins with it; places from which it finds no way on are drawn again.

        Raises:
            InputError: That is no time.
            InfeasibleError: The shield finds no way on from the starts of the paths either.
        """
        late = None
        if "master_late_s" in options:
            check_late(options["master_late_s"])
            late = np.zeros(len(self.lengths))
            late[0] = options["master_late_s"]
        if seeded or self._key is None:
            self._key, self._number = key_from(generator), -1
        self._number += 1
        accepts = None if shield is None else shield.leads_on
        self.simulation.reset(late, key=self._key, number=self._number, accepts=accepts)
        if shield is not None:
            shield.reset()
        self._start()
        return self.simulation.drawn

    def step(self, commands: Floats) -> None:
        """Run one control period."""
        self.simulation.step(commands)
        self.timed_out = self.simulation.time >= self.time_limit - 1e-9

    def outcome(self, i: int) -> tuple[float, bool, bool, dict[str, Any]]:
        """Reward, terminated, truncated and info of a running arm after a step."""
        simulation, length = self.simulation, self.lengths[i]
        position = float(simulation.lam[i])
        arrival = float(simulation.arrival[i])
        arrived = arrival == arrival  # not nan
        until = arrival if arrived else simulation.time
        terms = {
            "progress": progress_reward(position - self._before[i], length),
            "time": time_reward(until - self._charged[i], self.reference_time),
            "collision": collision_reward(position, length) if simulation.violated else 0.0,
        }
        self._before[i], self._charged[i] = position, until
        terminated = arrived or simulation.violated
        truncated = self.timed_out and not terminated
        info: dict[str, Any] = {
            "lam": position,
            "mu": float(simulation.mu[i]),
            "time_s": simulation.time,
            "min_clearance_m": simulation.min_clearance,
            "reward_terms": terms,
        }
        if terminated or truncated:
            info["is_success"] = arrived and not simulation.violated
            info["violation"] = simulation.violated
            if arrived:
                info["arrival_s"] = arrival
        return float(terms["progress"] + terms["time"] + terms["collision"]), terminated, truncated, info


def agent_names(arms: Sequence[object]) -> list[str]:
    """``arm_0``, ``arm_1``, ... in priority order."""
    return [f"arm_{i}" for i in range(len(arms))]


RESET_OPTIONS = ("master_late_s",)
"""What a reset may be given for one episode: how long the first arm stands before it obeys [s]."""
