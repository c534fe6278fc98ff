"""When another arm forbids which part of a path: from its motion and the chart of both to windows of time.

While arm a is in column c of the chart, arm b must keep out of the rows that are not free there. The
runs of columns that are not free beside each row are found once per chart; every motion of a turns a run into one
window: from its entering the first column to its leaving the last. A *slot* is a piece of b's path between two
borders: it has the windows of all rows that it touches, and of all other arms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats, Ints
from armtempo.planners.charts import FREE, CoordinationChart
from armtempo.planners.topp import PhaseTrajectory
from armtempo.robots import njit

WINDOW_MARGIN = 1e-5  # [s] by which windows are widened, so that motions pass beside the corners of cells
CHECKED_SHIFT = 1e-6  # [s] one arm is early or late by this when a motion is checked


class Occupancy(NamedTuple):
    """When an arm is in which column of its side of a chart, (R,) each; infinite where it stands for ever."""

    enter: Floats
    leave: Floats

    @classmethod
    def of(cls, motion: PhaseTrajectory, length: float, columns: int) -> Occupancy:
        """Of a motion along a path of ``length`` cut into equal columns."""
        border = np.minimum(length / columns * np.arange(columns + 1), motion.lam[-1])
        enter, leave = motion.time_at(border[:-1]), motion.last_time_at(border[1:])
        enter[border[:-1] <= motion.lam[0]] = -np.inf
        leave[border[1:] < motion.lam[0]] = -np.inf
        leave[border[1:] >= motion.lam[-1]] = np.inf
        return cls(enter, leave)


class Runs(NamedTuple):
    """Per row of a chart the runs of columns that are not free: row r has ``first[r]`` to ``first[r + 1] - 1``."""

    first: Ints  # (R+1,)
    low: Ints  # first column of the run
    high: Ints  # last column of it
    length_a: float
    step_b: float

    def windows(self, other: PhaseTrajectory | Occupancy) -> tuple[Floats, Floats]:
        """For every run from when to when the other arm is in it, widened by the margin [s]."""
        if not isinstance(other, Occupancy):
            other = Occupancy.of(other, self.length_a, len(self.first) - 1)
        return other.enter[self.low] - WINDOW_MARGIN, other.leave[self.high] + WINDOW_MARGIN


@njit
def _count_runs(states: NDArray[np.uint8], first: Ints) -> None:
    for column in range(states.shape[0]):
        for row in range(states.shape[1]):
            shut = states[column, row] != FREE
            first[row + 1] += shut and (column == 0 or states[column - 1, row] == FREE)


@njit
def _fill_runs(states: NDArray[np.uint8], first: Ints, low: Ints, high: Ints) -> None:
    seen = first[:-1].copy()
    for column in range(states.shape[0]):
        for row in range(states.shape[1]):
            if states[column, row] != FREE:
                if column == 0 or states[column - 1, row] == FREE:
                    low[seen[row]] = column
                    seen[row] += 1
                high[seen[row] - 1] = column


def blocked_runs(chart: CoordinationChart) -> Runs:
    """The runs of a chart whose first index is along the other arm's path."""
    first = np.zeros(chart.resolution + 1, dtype=np.int64)
    _count_runs(chart.states, first)
    np.cumsum(first, out=first)
    low, high = np.empty(first[-1], dtype=np.int64), np.empty(first[-1], dtype=np.int64)
    _fill_runs(chart.states, first, low, high)
    return Runs(first, low, high, chart.length_a, chart.step_b)


@njit
def _merge(first: Ints, start: Floats, stop: Floats, out_first: Ints) -> int:
    """Join the windows of every slot that overlap, in place, sorted as they are; returns how many are left.

    (No sorting in here: numba links ``sort`` and ``argsort`` of two cached functions to one another.)
    """
    total = 0
    for s in range(first.shape[0] - 1):
        out_first[s] = total
        for k in range(first[s], first[s + 1]):
            begin, end = start[k], stop[k]
            if end <= begin:
                continue
            if total > out_first[s] and begin <= stop[total - 1]:
                stop[total - 1] = max(stop[total - 1], end)
            else:
                start[total], stop[total] = begin, end
                total += 1
    out_first[first.shape[0] - 1] = total
    return total


def forbidden_windows(
    border: Floats, others: Sequence[tuple[Runs, PhaseTrajectory | Occupancy]]
) -> tuple[Ints, Floats, Floats]:
    """Windows per slot between ``border`` (S+1,) in which any other arm shuts it: CSR first, start, stop; disjoint."""
    slots, starts, stops = [], [], []
    for runs, other in others:
        rows = len(runs.first) - 1
        row_low = np.clip(np.floor(border[:-1] / runs.step_b + 1e-9).astype(np.int64), 0, rows - 1)
        row_high = np.clip(np.ceil(border[1:] / runs.step_b - 1e-9).astype(np.int64) - 1, row_low, rows - 1)
        begin, end = runs.first[row_low], runs.first[row_high + 1]  # the runs of neighbouring rows stand side by side
        count = end - begin
        which = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count - begin, count)
        start, stop = runs.windows(other)
        slots.append(np.repeat(np.arange(len(begin)), count))
        starts.append(start[which])
        stops.append(stop[which])
    slot = np.concatenate([np.empty(0, dtype=np.int64), *slots])
    start, stop = np.concatenate([np.empty(0), *starts]), np.concatenate([np.empty(0), *stops])
    order = np.lexsort((start, slot))
    start, stop = start[order], stop[order]
    first = np.concatenate([[0], np.cumsum(np.bincount(slot, minlength=len(border) - 1))]).astype(np.int64)
    merged = np.empty_like(first)
    total = _merge(first, start, stop, merged)
    return merged, start[:total].copy(), stop[:total].copy()


def pair_is_free(chart: CoordinationChart, motion_a: PhaseTrajectory, motion_b: PhaseTrajectory) -> bool:
    """Whether two motions stay in free cells of their chart at all times, and either a little early or late."""
    border_a: Floats = chart.step_a * np.arange(1, chart.resolution, dtype=np.float64)
    border_b: Floats = chart.step_b * np.arange(1, chart.resolution, dtype=np.float64)
    crossed_a = np.concatenate([motion_a.time_at(border_a), motion_a.last_time_at(border_a), motion_a.time])
    crossed_b = np.concatenate([motion_b.time_at(border_b), motion_b.last_time_at(border_b), motion_b.time])
    end = max(motion_a.duration, motion_b.duration)
    for shift in (-CHECKED_SHIFT, 0.0, CHECKED_SHIFT):
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
