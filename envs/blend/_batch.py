"""Many episodes on blended paths at once, without physics: paths, profiles and references in arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, final

import numpy as np

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.blend._kernels import measure_tip
from armtempo.envs.blend._observation import BLEND_ENTRIES, scales_of
from armtempo.envs.blend._options import BlendOptions
from armtempo.envs.blend._periods import (
    LENGTH,
    ROW_FIXED,
    BlendEpisodes,
    BlendPaths,
    follow_periods,
    observe_episodes,
    plan_periods,
)
from armtempo.envs.bodies import CONTROLLER_GAIN
from armtempo.envs.common import (
    TIME_LIMIT,
    Batch,
    Chunks,
    DrawnCells,
    Generators,
    Seeds,
    Slots,
    as_commands,
    sums_of,
    with_masks,
)
from armtempo.planners import BlendCell, FeedOverride, PredictorCorrector
from armtempo.planners.blends.kernels import PackedPath
from armtempo.planners.cells import draw_path
from armtempo.planners.line_speed.kernels import start_warp
from armtempo.state import State

PER_THREAD = 16  # episodes that are worth a thread


@final
class BlendBatch(Batch):
    """E episodes of a cell, as ``BlendTrackingEnv`` with ``physics="ideal"`` runs them, to the last bit.

    Args:
        cell: The cell.
        episodes: E.
        options: Of the episodes; their family is the first.
        families: Of the paths.
        paths: How many are drawn beforehand, and the seed of that; None: one for every episode.
        threads: How many share the episodes; None: one per core, if there are episodes enough.
    """

    changing = ("_drawn", "_episodes", "_charged", "_passed", "_stepped", "_rewards", "_seen", "_generators")

    def __init__(
        self,
        cell: BlendCell,
        episodes: int,
        *,
        options: BlendOptions,
        families: Sequence[str],
        paths: tuple[int | None, int],
        threads: int | None,
    ) -> None:
        self.cell, self._options = cell, options
        self._drawn = DrawnCells(cell, families, draw_path, self._put, episodes, *paths, "paths")
        slots, E, n, K = self._drawn.slots, episodes, cell.arm.dof, cell.ticks_per_period
        self._arrays = Slots(slots)
        self._counts, self._shortest = np.zeros((slots, 4), dtype=np.int64), np.zeros(slots)
        self._lengths, self._durations = np.zeros(slots), np.zeros(slots)
        self._start_joints, self._start_tips = np.zeros((slots, n)), np.zeros((slots, 3))
        self._start_places = np.zeros((slots, 2))  # station and distance from the path [m]
        self._drawn.draw_beforehand()
        mapping = PredictorCorrector(cell.blended)
        self._paper, self._corrections = options.mapping == "paper", (mapping.iterations, mapping.compensate)
        self._keeps_normal = 1 if options.profile == "limit-aware" else None
        self._scales = scales_of(cell)
        self._coulomb, self._torque_max = cell.arm.coulomb.copy(), cell.arm.torque_max.copy()
        self._speed_max = cell.arm.speed_max.copy()
        self._episodes = BlendEpisodes(
            np.zeros(E, dtype=np.int64), np.zeros(E, dtype=np.int64), np.zeros((E, 10)), np.zeros((E, 7)),
            np.zeros((E, 2)), np.zeros((E, 3)), np.zeros((E, 3, n)), np.zeros((E, n)), np.zeros((E, n)),
            np.zeros((E, 3)), *np.zeros((4, E)), *np.full((2, E), np.nan),
        )  # fmt: skip
        self._charged, self._passed = np.zeros(E), np.zeros(E)  # until when time, and length, are paid for
        self._stepped: Bools = np.zeros(E, dtype=np.bool_)
        self._rewards = np.zeros(E)
        self._seen: Floats32 = np.zeros((E, len(BLEND_ENTRIES)), dtype=np.float32)
        self._motion, self._full, self._points = np.zeros((E, K, 8)), np.zeros((E, K)), np.zeros((E, K, 3))
        self._joints, self._rows = np.zeros((E, K, n)), np.zeros((E, K, ROW_FIXED + 3 * n))
        self._ran = np.zeros(E, dtype=np.int64)
        self._generators, self._chunks = Generators(E), Chunks(E, threads, PER_THREAD)

    def _put(self, slot: int, cell: BlendCell) -> None:
        """The path of ``cell`` with its profile and its start."""
        path, profile = cell.blended.packed, cell.profile(self._options.profile)
        along = cell.blended if self._options.profile == "limit-aware" else None
        feed = FeedOverride(profile, profile.limits, path=along).packed
        self._arrays.put(slot, path._asdict())
        self._arrays.put(slot, {name: getattr(feed, name) for name in ("knots", "coefficients", "marks", "limits")})
        pieces = len(feed.coefficients), len(feed.marks), len(path.kind), len(path.panel_start)
        self._counts[slot], self._shortest[slot] = pieces, feed.shortest
        self._lengths[slot], self._durations[slot] = cell.blended.length, profile.duration
        start = cell.path.evaluate(0.0)[0]
        self._start_joints[slot] = start
        self._start_places[slot] = measure_tip(cell.arm.model, path, start, 0.0, self._start_tips[slot])

    @property
    def name(self) -> str:
        """The cell's."""
        return self.cell.name

    def _kernel_paths(self) -> BlendPaths:
        own = self._arrays
        return BlendPaths(
            self._counts, PackedPath(*(own[name] for name in PackedPath._fields)), own["knots"], own["coefficients"],
            own["marks"], own["limits"], self._shortest,
        )  # fmt: skip

    def reset(self, mask: Bools, seeds: Seeds | None, options: Mapping[str, Any]) -> dict[str, Any]:
        """Begin new episodes of these (E,); what they are about."""
        del options
        episodes = self._episodes
        self._generators.seed(seeds, mask)
        for e in np.flatnonzero(mask).tolist():
            episodes.slot[e] = self._drawn.slot_for(e, self._generators.each[e])
        slot = episodes.slot[mask]
        zeros = (
            episodes.ticks, episodes.mapping, episodes.motion, episodes.joint_speeds, episodes.demand,
            episodes.tip_speed, episodes.arc_speed, self._charged, self._passed, self._rewards,
        )  # fmt: skip
        for array in zeros:
            array[mask] = 0.0
        episodes.warp[mask], episodes.feed[mask] = start_warp(), (0.0, 1.0)
        episodes.reference[mask], episodes.tip[mask] = self._start_joints[slot][:, None], self._start_tips[slot]
        episodes.station[mask], episodes.contour_error[mask] = self._start_places[slot].T
        episodes.end[mask] = episodes.arrival[mask] = np.nan
        self._stepped[mask] = False
        self._observe(mask)
        corners = np.array([len(self._drawn.cells[one].segments) - 1 for one in episodes.slot])
        told = {"length_m": self._lengths[episodes.slot], "duration_s": self._durations[episodes.slot]}
        return with_masks({name: np.where(mask, x, 0) for name, x in {**told, "corners": corners}.items()}, mask)

    def _observe(self, changed: Bools) -> None:
        def part(_: int, first: int, last: int) -> None:
            observe_episodes(
                self._kernel_paths(), self._episodes, first, last, changed, self._scales, self._torque_max,
                self._speed_max, self._seen,
            )  # fmt: skip

        self._chunks.run(part)

    def step(self, actions: Floats, active: Bools) -> None:
        """Run one control period of these (E,)."""
        cell, tick, overrides = self.cell, self.cell.physics_tick, as_commands(actions[:, 0])
        paths, episodes = self._kernel_paths(), self._episodes

        def plan(_: int, first: int, last: int) -> None:
            plan_periods(
                paths, self._keeps_normal, self._paper, self._corrections, episodes, first, last, active, overrides,
                tick, self._motion, self._full, self._points,
            )  # fmt: skip

        def follow(_: int, first: int, last: int) -> None:
            follow_periods(
                cell.arm.model, paths, episodes, first, last, active, self._motion, self._joints, self._coulomb,
                self._torque_max, CONTROLLER_GAIN / tick, tick, cell.contour_error_max, self._rows, self._ran,
            )  # fmt: skip

        self._chunks.run(plan)
        for slot in np.flatnonzero(np.bincount(episodes.slot[active])).tolist():
            own = np.flatnonzero(active & (episodes.slot == slot))
            self._joints[own] = self._drawn.cells[slot].path.inverse(self._points[own], self._motion[own, :, LENGTH])
        self._chunks.run(follow)
        self._stepped = active.copy()
        self._earn(active)
        self._observe(active)

    def _earn(self, active: Bools) -> None:
        """Rewards of a period, term by term as ``BlendTrackingEnv`` has them."""
        episodes, limits = self._episodes, self.cell.limits
        deviation = np.abs(self._rows[:, :, 2] - self._full).mean(axis=1)
        error = self._rows[:, :, 1].mean(axis=1)
        for e in np.flatnonzero(active & (self._ran < self.cell.ticks_per_period)).tolist():  # out of the tube
            ran = self._ran[e]
            deviation[e] = np.abs(self._rows[e, :ran, 2] - self._full[e, :ran]).mean()
            error[e] = self._rows[e, :ran, 1].mean()
        reference, length = self._durations[episodes.slot], self._lengths[episodes.slot]
        until = np.where(np.isnan(episodes.arrival), self._time(), episodes.arrival)
        elapsed, longest = until - self._charged, self._limits() + self.cell.control_period
        terms = [
            (episodes.motion[:, LENGTH] - self._passed) / length,
            -elapsed / reference,
            -np.minimum(deviation / limits.speed, 1.0) * elapsed / reference,
            -np.minimum(error / self.cell.contour_error_max, 1.0) * elapsed / reference,
            np.where(self._left(), -(1.0 + 3.0 * longest / reference), 0.0),
        ]
        self._rewards = np.where(active, sums_of(np.array(terms)), 0.0)
        self._charged[active], self._passed[active] = until[active], episodes.motion[active, LENGTH]

    def _time(self) -> Floats:
        return np.asarray(self._episodes.ticks * self.cell.physics_tick)

    def _limits(self) -> Floats:
        """(E,) time limits [s]."""
        given = self._options.max_episode_s
        durations = self._durations[self._episodes.slot]
        return np.asarray(TIME_LIMIT * durations if given is None else np.full_like(durations, given))

    def _left(self) -> Bools:
        return np.asarray(~(self._episodes.contour_error <= self.cell.contour_error_max))

    @property
    def observations(self) -> Floats32:
        """(E, 15) now."""
        return self._seen.copy()

    @property
    def rewards(self) -> Floats:
        """(E,) of the last step."""
        return self._rewards.copy()

    @property
    def terminated(self) -> Bools:
        """(E,) arrived, or out of the tube."""
        return self._stepped & (~np.isnan(self._episodes.arrival) | self._left())

    @property
    def truncated(self) -> Bools:
        """(E,) at the time limit."""
        return self._stepped & ~self.terminated & (self._time() >= self._limits() - 1e-9)

    def figures(self, over: Bools) -> dict[str, Any]:
        """How the episodes ended."""
        arrival, left = self._episodes.arrival, over & self._left()
        figures = {
            "is_success": over & ~np.isnan(arrival) & ~left,
            "left": left,
            "arrival_s": np.where(over, arrival, np.nan),
        }
        return with_masks(figures, over)

    @property
    def made_of(self) -> State:
        """The options, and where paths come from."""
        return {"options": self._options, **self._drawn.made_of}

    def close(self) -> None:
        """End the threads; may be called twice."""
        self._chunks.close()
