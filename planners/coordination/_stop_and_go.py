r"""The plan that always exists: one arm moves at a time, from rest to rest, along a path of free cells of the chart.

Where the outer chart has a monotone path of cells (neighbours share a side) and both arms can hold still everywhere,
moving one arm at a time between the centres of its corners is a plan. It is slow, and a start for better ones.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats
from armtempo.planners.charts import FREE, CoordinationChart
from armtempo.planners.topp import PhasePlane, PhaseTrajectory
from armtempo.robots import njit

CELLS_TRIED_FIRST = 512  # cells along each side, tried first
UNREACHED = np.int16(32000)
INTERVALS_OF_A_MOVE = 100  # at least


@njit
def _turns(shut: Bools, turns: NDArray[np.int16]) -> None:
    """Fewest turns to every cell, arriving along a (``[..., 0]``) or along b (``[..., 1]``)."""
    for i in range(shut.shape[0]):
        for j in range(shut.shape[1]):
            turns[i, j, 0] = turns[i, j, 1] = UNREACHED
            if shut[i, j]:
                continue
            if i == 0 and j == 0:
                turns[i, j, 0] = turns[i, j, 1] = 0
                continue
            if i > 0:
                turns[i, j, 0] = min(turns[i - 1, j, 0], turns[i - 1, j, 1] + 1)
            if j > 0:
                turns[i, j, 1] = min(turns[i, j - 1, 1], turns[i, j - 1, 0] + 1)
            turns[i, j, 0] = min(turns[i, j, 0], UNREACHED)
            turns[i, j, 1] = min(turns[i, j, 1], UNREACHED)


def _corners(shut: Bools) -> list[tuple[int, int]] | None:
    """Cells where a monotone path with the fewest turns begins, turns and ends; None if there is no path."""
    turns = np.empty((*shut.shape, 2), dtype=np.int16)
    _turns(shut, turns)
    i, j = len(shut) - 1, shut.shape[1] - 1
    if turns[i, j].min() >= UNREACHED:
        return None
    along = int(turns[i, j].argmin())
    corners = [(i, j)]
    while (i, j) != (0, 0):
        before = (i - 1, j) if along == 0 else (i, j - 1)
        here = turns[i, j, along]
        i, j = before
        if (i, j) != (0, 0) and turns[i, j, along] != here:
            corners.append((i, j))
            along = 1 - along
    return [(0, 0), *corners[::-1]]


def _moves(chart: CoordinationChart) -> list[tuple[float, float]] | None:
    """Places (lambda_a, lambda_b) between which one arm moves at a time; None if no path of free cells exists."""
    shut = chart.states != FREE
    coarse, share = shut, 1
    while len(coarse) > CELLS_TRIED_FIRST and len(coarse) % 2 == 0:
        coarse = coarse[0::2] | coarse[1::2]
        coarse = coarse[:, 0::2] | coarse[:, 1::2]
        share *= 2
    corners = _corners(coarse)
    if corners is None and share > 1:
        corners, share = _corners(shut), 1
    if corners is None:
        return None
    count = chart.resolution // share

    def place(cell: int, length: float) -> float:
        return 0.0 if cell == 0 else length if cell == count - 1 else (cell + 0.5) * length / count

    return [(place(i, chart.length_a), place(j, chart.length_b)) for i, j in corners]


def rest_to_rest(plane: PhasePlane, start: float, stop: float) -> PhaseTrajectory:
    """The fastest motion from rest at one place of the path to rest at another."""
    return PhasePlane(plane.dynamics.between(start, stop, intervals=INTERVALS_OF_A_MOVE)).fastest()


def stop_and_go(
    plane_a: PhasePlane, plane_b: PhasePlane, chart: CoordinationChart
) -> tuple[PhaseTrajectory, PhaseTrajectory] | None:
    """One arm at a time from rest to rest through free cells; None if the chart has no such path.

    Both arms must be able to hold still everywhere.
    """
    places = _moves(chart)
    if places is None:
        return None
    planes = (plane_a, plane_b)
    columns: list[list[list[Floats]]] = [[[np.zeros(1)] for _ in range(3)] for _ in planes]  # lam, mu, time
    clock = 0.0
    for here, there in pairwise(places):
        for plane, (lam, mu, time), start, stop in zip(planes, columns, here, there, strict=True):
            if stop > start:
                move = rest_to_rest(plane, start, stop)
                if clock > time[-1][-1]:  # it has waited for the other
                    for column, value in zip((lam, mu, time), (start, 0.0, clock), strict=True):
                        column.append(np.array([value]))
                lam.append(move.lam[1:])
                mu.append(move.mu[1:])
                time.append(clock + move.time[1:])
        clock = max(float(time[-1][-1]) for _, _, time in columns)
    first, second = (
        PhaseTrajectory(
            lam=np.concatenate(lam), mu=np.concatenate(mu), time=np.concatenate(time), dynamics=plane.dynamics
        )
        for plane, (lam, mu, time) in zip(planes, columns, strict=True)
    )
    return first, second
