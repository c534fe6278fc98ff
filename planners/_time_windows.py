"""When another arm forbids which part of a path: from its motion and the chart of both to windows of time.

While arm a is in column c of the chart, arm b must keep out of the rows that are not free there. A *slot* is a piece
of b's path between two borders; the runs of columns that are not free beside it are found once per chart, and every
motion of a turns each run into one window: from its entering the first column to its leaving the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.planners._coordination_chart import FREE, CoordinationChart
from armtempo.planners._phase_trajectory import PhaseTrajectory
from armtempo.robots import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MARGIN = 1e-5  # [s] by which windows are widened, so that motions pass beside the corners of cells
SHIFT = 1e-6  # [s] one arm is early or late by this when a motion is checked


class Occupancy(NamedTuple):
    """When an arm is in which column of its side of a chart, (R,) each; infinite where it stands for ever."""

    enter: Array
    leave: Array

    @classmethod
    def of(cls, motion: PhaseTrajectory, length: float, columns: int) -> Occupancy:
        """Of a motion along a path of ``length`` cut into equal columns."""
        border = np.minimum(length / columns * np.arange(columns + 1), motion.lam[-1])
        enter, leave = motion.time_at(border[:-1]), _last_time_at(motion, border[1:])
        enter[border[:-1] <= motion.lam[0]] = -np.inf
        leave[border[1:] < motion.lam[0]] = -np.inf
        leave[border[1:] >= motion.lam[-1]] = np.inf
        return cls(enter, leave)


class Runs(NamedTuple):
    """Per slot the runs of columns that are not free beside it: slot s has ``first[s]`` to ``first[s + 1] - 1``."""

    first: Ints
    low: Ints
    high: Ints  # last column of the run


def _last_time_at(motion: PhaseTrajectory, lam: Array) -> Array:
    """The last instant at which ``lam`` is reached; ``time_at`` gives the first."""
    i = np.clip(np.searchsorted(motion.lam, lam, side="right") - 1, 0, len(motion.lam) - 2)
    way = np.clip(lam - motion.lam[i], 0.0, None)
    pace = motion.mu[i] + np.sqrt(np.maximum(motion.mu[i] ** 2 + 2.0 * motion.mu_dot[i] * way, 0.0))
    step = np.divide(2.0 * way, pace, out=np.zeros_like(way), where=pace > 0.0)
    return np.minimum(motion.time[i] + step, motion.time[i + 1])


@njit
def _runs(
    states: NDArray[np.uint8], low: Ints, high: Ints, first: Ints, run_low: Ints, run_high: Ints, fill: bool
) -> None:
    """Count (``first[s + 1]``) or fill the runs of columns in which any of the rows ``low[s]`` to ``high[s]`` is shut."""
    slots = low.shape[0]
    inside = np.zeros(slots, np.bool_)
    seen = np.zeros(slots, np.int64)
    for column in range(states.shape[0]):
        for s in range(slots):
            shut = False
            for row in range(low[s], high[s] + 1):
                if states[column, row] != FREE:
                    shut = True
                    break
            if shut and not inside[s]:
                if fill:
                    run_low[first[s] + seen[s]] = column
                else:
                    first[s + 1] += 1
                seen[s] += 1
            if shut and fill:
                run_high[first[s] + seen[s] - 1] = column
            inside[s] = shut


def blocked_runs(chart: CoordinationChart, border: Array) -> Runs:
    """Runs of columns of a chart (first index: the other arm) beside the slots between ``border`` (S+1,)."""
    low = np.floor(border[:-1] / chart.step_b + 1e-9).astype(np.int64)
    high = np.ceil(border[1:] / chart.step_b - 1e-9).astype(np.int64) - 1
    low, high = np.clip(low, 0, chart.resolution - 1), np.clip(high, 0, chart.resolution - 1)
    first = np.zeros(len(low) + 1, dtype=np.int64)
    none = np.empty(0, dtype=np.int64)
    _runs(chart.states, low, high, first, none, none, False)
    np.cumsum(first, out=first)
    run_low, run_high = np.empty(first[-1], dtype=np.int64), np.empty(first[-1], dtype=np.int64)
    _runs(chart.states, low, high, first, run_low, run_high, True)
    return Runs(first, run_low, run_high)


@njit
def _merge(first: Ints, start: Array, stop: Array, out_first: Ints) -> int:
    """Sort the windows of every slot and join those that overlap, in place; returns how many are left."""
    total = 0
    for s in range(first.shape[0] - 1):
        a, b = first[s], first[s + 1]
        order = np.argsort(start[a:b])
        begin, end = start[a:b][order], stop[a:b][order]
        out_first[s] = total
        for k in range(b - a):
            if end[k] <= begin[k]:
                continue
            if total > out_first[s] and begin[k] <= stop[total - 1]:
                stop[total - 1] = max(stop[total - 1], end[k])
            else:
                start[total], stop[total] = begin[k], end[k]
                total += 1
    out_first[first.shape[0] - 1] = total
    return total


def forbidden_windows(runs: Sequence[Runs], others: Sequence[Occupancy]) -> tuple[Ints, Array, Array]:
    """Windows per slot (CSR: first, start, stop) in which any of the other arms shuts it, each sorted and disjoint."""
    slots = len(runs[0].first) - 1
    slot = np.concatenate([np.repeat(np.arange(slots), np.diff(run.first)) for run in runs])
    start = np.concatenate([other.enter[run.low] for run, other in zip(runs, others, strict=True)]) - MARGIN
    stop = np.concatenate([other.leave[run.high] for run, other in zip(runs, others, strict=True)]) + MARGIN
    order = np.argsort(slot, kind="stable")
    start, stop = start[order], stop[order]
    first = np.concatenate([[0], np.cumsum(np.bincount(slot, minlength=slots))]).astype(np.int64)
    merged = np.empty_like(first)
    total = _merge(first, start, stop, merged)
    return merged, start[:total].copy(), stop[:total].copy()


def pair_is_free(chart: CoordinationChart, motion_a: PhaseTrajectory, motion_b: PhaseTrajectory) -> bool:
    """Whether two motions stay in free cells of their chart at all times, and either a little early or late."""
    border_a = chart.step_a * np.arange(1, chart.resolution)
    border_b = chart.step_b * np.arange(1, chart.resolution)
    crossed_a = np.concatenate([motion_a.time_at(border_a), _last_time_at(motion_a, border_a), motion_a.time])
    crossed_b = np.concatenate([motion_b.time_at(border_b), _last_time_at(motion_b, border_b), motion_b.time])
    end = max(motion_a.duration, motion_b.duration)
    for shift in (-SHIFT, 0.0, SHIFT):
        instants = np.unique(np.concatenate([crossed_a, crossed_b + shift]))
        instants = instants[(instants >= 0.0) & (instants <= end)]
        middle = np.concatenate([[0.0], 0.5 * (instants[1:] + instants[:-1]), [end]])
        low, high = [], []
        for motion, step, late in ((motion_a, chart.step_a, 0.0), (motion_b, chart.step_b, shift)):
            place = motion.at(np.clip(middle - late, 0.0, motion.duration))[0] / step
            low.append(np.clip(np.ceil(place - 1e-12).astype(np.int64) - 1, 0, chart.resolution - 1))
            high.append(np.clip(np.floor(place + 1e-12).astype(np.int64), 0, chart.resolution - 1))
        for a in (low[0], high[0]):
            for b in (low[1], high[1]):
                if (chart.states[a, b] != FREE).any():
                    return False
    return True
