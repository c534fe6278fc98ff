"""Many episodes of a pose that moves at once, without physics: targets, references and errors in arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.common import (
    Batch,
    Chunks,
    DrawnCells,
    Generators,
    Seeds,
    Slots,
    count_of,
    sums_of,
    with_masks,
)
from armtempo.envs.ik._env import REWARD_WEIGHTS
from armtempo.envs.ik._observation import PERIODS_AHEAD, IKView, observe_ik
from armtempo.envs.ik._options import IKOptions
from armtempo.envs.ik._periods import IKEpisodes, look_ahead, make_drive, run_ik_periods
from armtempo.planners import IKCell
from armtempo.planners.cells import draw_target
from armtempo.planners.ik.kernels import Targets as IKTargets
from armtempo.state import State

PER_THREAD = 4  # episodes that are worth a thread
TICKS_UNLIMITED = 1e9  # ticks
TARGET_ARRAYS = ("position", "rotation", "velocity", "angular_velocity")


@final
class IKBatch(Batch):
    """E episodes of a cell, as ``FeedbackIKEnv`` with ``physics="ideal"`` runs them, to the last bit.

    Args:
        cell: The cell.
        episodes: E.
        options: Of the episodes; their family is the first.
        families: Of the targets.
        targets: How many are drawn beforehand, and the seed of that; None: one for every episode.
        hold_periods: Control periods that are one step.
        threads: How many share the episodes; None: one per core, if there are episodes enough.
    """

    changing = ("_drawn", "_episodes", "_ahead", "_stepped", "_generators")

    def __init__(
        self,
        cell: IKCell,
        episodes: int,
        *,
        options: IKOptions,
        families: Sequence[str],
        targets: tuple[int | None, int],
        hold_periods: int,
        threads: int | None,
    ) -> None:
        self.cell, self._options = cell, options
        self._hold = count_of(hold_periods, "hold_periods")
        longest = (
            TICKS_UNLIMITED if options.max_episode_s is None else (options.max_episode_s - 1e-9) / cell.physics_tick
        )
        self._limit = math.ceil(min(max(longest, 1.0), TICKS_UNLIMITED))
        self._drawn = DrawnCells(cell, families, draw_target, self._put, episodes, *targets, "targets")
        slots, E, n = self._drawn.slots, episodes, cell.arm.dof
        self._targets = Slots(slots)
        self._starts, self._lasts = np.zeros((slots, n)), np.zeros(slots, dtype=np.int64)
        self._drawn.draw_beforehand()
        self._drive = make_drive(cell, by_gains=options.action_mode == "gains")
        self._episodes = IKEpisodes(
            np.zeros(E, dtype=np.int64), np.zeros(E, dtype=np.int64), np.zeros((E, 3, n)), np.zeros((E, n)), np.ones(E),
            np.zeros((E, 6)), np.zeros((E, n)), np.zeros((E, 2)), np.zeros((E, 4)),
        )  # fmt: skip
        self._ahead: Floats = np.zeros((E, len(PERIODS_AHEAD), 6))
        self._stepped: Bools = np.zeros(E, dtype=np.bool_)
        self._generators, self._chunks = Generators(E), Chunks(E, threads, PER_THREAD)

    def _put(self, slot: int, cell: IKCell) -> None:
        """The target and the start of ``cell``, at the physics ticks."""
        self._targets.put(slot, {name: getattr(cell.target, name)[::2] for name in TARGET_ARRAYS})
        self._starts[slot], self._lasts[slot] = cell.start, cell.ticks

    @property
    def name(self) -> str:
        """The cell's."""
        return self.cell.name

    def _kernel_targets(self) -> IKTargets:
        """As the kernels read them: a row per tick."""
        position, rotation, velocity, turning = (self._targets[name] for name in TARGET_ARRAYS)
        return IKTargets(position, rotation, velocity, turning, 1, self.cell.physics_tick)

    def reset(self, mask: Bools, seeds: Seeds | None, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin new episodes of these (E,); how long they last."""
        del options
        episodes = self._episodes
        self._generators.seed(seeds, mask)
        for e in np.flatnonzero(mask).tolist():
            slot = self._drawn.slot_for(e, self._generators.each[e])
            episodes.slot[e], episodes.tick[e] = slot, 0
            episodes.reference[e], episodes.hardness[e] = self._starts[slot], 1.0
            for array in (episodes.speeds, episodes.demand, episodes.squares, episodes.shares):
                array[e] = 0.0
        self._stepped[mask] = False
        now = episodes.tick[:, None]
        look_ahead(
            self.cell.arm.model, self._kernel_targets(), episodes.slot, self._joints(), now, mask,
            episodes.error[:, None],
        )  # fmt: skip
        self._look(mask)
        return with_masks({"duration_s": np.where(mask, self._durations(), 0.0)}, mask)

    def _joints(self) -> Floats:
        return np.ascontiguousarray(self._episodes.reference[:, 2])

    def _durations(self) -> Floats:
        return np.asarray(self._lasts[self._episodes.slot] * self.cell.physics_tick)

    def _look(self, changed: Bools) -> None:
        """What is ahead of these episodes."""
        episodes, cell = self._episodes, self.cell
        rows = episodes.tick[:, None] + cell.ticks_per_period * np.array(PERIODS_AHEAD)
        rows = np.minimum(rows, self._lasts[episodes.slot][:, None])
        look_ahead(cell.arm.model, self._kernel_targets(), episodes.slot, self._joints(), rows, changed, self._ahead)

    def step(self, actions: Floats, active: Bools) -> None:
        """Run ``hold_periods`` of these (E,), less at their end."""

        def part(_: int, first: int, last: int) -> None:
            run_ik_periods(
                self._drive, self._kernel_targets(), self._lasts, self._episodes, first, last, active, actions,
                self.cell.ticks_per_period, self._hold, self._limit,
            )  # fmt: skip

        self._chunks.run(part)
        self._stepped = active.copy()
        self._look(active)

    @property
    def observations(self) -> Floats32:
        """(E, size) now."""
        episodes, cell = self._episodes, self.cell
        slot, tick, q = episodes.slot, episodes.tick, self._joints()
        velocity, turning = self._targets["velocity"][slot, tick], self._targets["angular_velocity"][slot, tick]
        return observe_ik(cell, IKView(
            q, (q - episodes.reference[:, 1]) / cell.physics_tick, q, episodes.error, velocity, turning, self._ahead,
            cell.singular_value(q), episodes.demand, tick / self._lasts[slot],
        ))  # fmt: skip

    @property
    def rewards(self) -> Floats:
        """(E,) of the last step."""
        duration, weights = self._durations(), np.array(list(REWARD_WEIGHTS.values()))
        terms = weights[:, None] * (-self._episodes.shares.T * self.cell.control_period / duration)
        return np.where(self._stepped, sums_of(terms), 0.0)

    @property
    def terminated(self) -> Bools:
        """(E,) at their target's end."""
        return self._stepped & (self._episodes.tick >= self._lasts[self._episodes.slot])

    @property
    def truncated(self) -> Bools:
        """(E,) at the time limit."""
        return self._stepped & ~self.terminated & (self._episodes.tick >= self._limit)

    def figures(self, over: Bools) -> dict[str, Any]:
        """How near to their targets episodes were that have ended."""
        position_scale, orientation_scale = self.cell.error_scales
        position, orientation = np.sqrt(self._episodes.squares / np.maximum(self._episodes.tick, 1)[:, None]).T
        close = (position < position_scale) & (orientation < orientation_scale)
        figures = {
            "is_success": self.terminated & close,
            "position_error_rms_m": np.where(over, position, np.nan),
            "position_error_rms_mm": np.where(over, 1e3 * position, np.nan),
            "orientation_error_rms_rad": np.where(over, orientation, np.nan),
        }
        return with_masks(figures, over)

    @property
    def made_of(self) -> State:
        """The options, and where targets come from."""
        return {"options": self._options, "hold_periods": self._hold, **self._drawn.made_of}

    def close(self) -> None:
        """End the threads; may be called twice."""
        self._chunks.close()
