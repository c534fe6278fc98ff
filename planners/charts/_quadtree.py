r"""The quadtree that certifies a coordination chart (research/coordination.md 2.1), compiled, level by level.

The distance of two convex bodies changes by at most the sum of their displacements, so with ``delta`` the farthest
that any point of a link moves from its place at the centre,

    d(centre) - delta_a - delta_b >= d_min   for all pairs of links: the cell is *free*
    d(centre) + delta_a + delta_b <  d_min   for one pair:            the cell is *blocked*

between samples and for every timing; else it is split. A pair that is free in a cell is not asked again below it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.charts._arm_sweep import ArmSweep
from armtempo.robots import Bodies, kernels, njit, pack_bodies, separation

States = NDArray[np.uint8]

FREE, UNDECIDED, BLOCKED = 0, 1, 2
ASK_SHAPES, HOPELESS = 3, 4  # of a pair: the real shapes decide; of a cell: no part of it will be free by its capsules
DISTANCE_ROUNDING = 1e-9  # [m]


class _Side(NamedTuple):
    """What the kernel needs of one arm."""

    axes: Floats
    poses: Floats
    base: Floats
    radius: Floats
    exact: Bools
    bodies: Bodies


class _Cells(NamedTuple):
    """Cells of one level: their places, and for each the open pairs ``pairs[first[c] : first[c + 1]]``."""

    a: Ints
    b: Ints
    first: Ints
    pairs: Ints


class Certified(NamedTuple):
    """What the quadtree found: states (R, R), and how many distances of pairs it asked for."""

    states: States
    capsule_queries: int
    shape_queries: int


def certify(sweep_a: ArmSweep, sweep_b: ArmSweep, d_min: float, *, real: bool) -> Certified:
    """States of all cells; without ``real`` shapes only capsules that are the shapes themselves can block."""
    sides = [
        _Side(s.axes, s.poses, s.base, s.arm.capsules.radius, s.arm.capsules.exact, pack_bodies(s.arm.shapes))
        for s in (sweep_a, sweep_b)
    ]
    resolution = sweep_a.finest
    states = np.zeros((resolution, resolution), dtype=np.uint8)
    pairs = np.arange(len(sweep_a.arm.shapes) * len(sweep_b.arm.shapes), dtype=np.int64)
    origin = np.zeros(1, dtype=np.int64)
    cells = _Cells(origin, origin, np.array([0, len(pairs)], dtype=np.int64), pairs)
    moves = [(s.capsule_moves, s.shape_moves if real else s.capsule_moves) for s in (sweep_a, sweep_b)]
    by_capsules = by_shapes = 0
    size = resolution
    while len(cells.a):
        level = resolution // size
        cell_state = np.empty(len(cells.a), dtype=np.uint8)
        pair_state = np.zeros(len(cells.pairs), dtype=np.uint8)
        asked = _classify(
            cells, 2 * size, sides[0], sides[1], moves[0][0][level], moves[1][0][level], moves[0][1][level],
            moves[1][1][level], d_min, real, cell_state, pair_state,
        )  # fmt: skip
        by_capsules += asked[0]
        by_shapes += asked[1]
        _paint(states, cells, cell_state, size)
        if size == 1:
            break
        cells = _split(cells, cell_state, pair_state)
        size //= 2
    return Certified(states, by_capsules, by_shapes)


@njit
def _classify(
    cells: _Cells,
    per: int,
    side_a: _Side,
    side_b: _Side,
    capsule_moves_a: Floats,
    capsule_moves_b: Floats,
    shape_moves_a: Floats,
    shape_moves_b: Floats,
    d_min: float,
    real: bool,
    cell_state: States,
    pair_state: States,
) -> tuple[int, int]:
    """Decide the open pairs of every cell: by capsules, then the real shapes of those too near, nearest first.

    ``per``: places of ``axes`` per cell. Returns the number of capsule distances and of distances of real shapes.
    """
    shapes_b = side_b.radius.shape[0]
    samples = (side_a.poses.shape[0] - 1) // (side_a.axes.shape[0] - 1)
    distance = np.empty(side_a.radius.shape[0] * shapes_b)
    W = np.empty((4, 3))
    shortest = np.zeros((len(distance), 3))  # of every pair, where it was asked last: cells lie side by side
    by_capsules, by_shapes = 0, 0
    for c in range(cells.a.shape[0]):
        place_a, place_b = cells.a[c] * per + per // 2, cells.b[c] * per + per // 2
        start, stop = cells.first[c], cells.first[c + 1]
        state = FREE
        for e in range(start, stop):
            ka, kb = cells.pairs[e] // shapes_b, cells.pairs[e] % shapes_b
            axis_a, axis_b = side_a.axes[place_a, ka], side_b.axes[place_b, kb]
            d = kernels.segment_distance(axis_a[0], axis_a[1], axis_b[0], axis_b[1])
            d -= side_a.radius[ka] + side_b.radius[kb]
            by_capsules += 1
            moved = capsule_moves_a[cells.a[c], ka] + capsule_moves_b[cells.b[c], kb] + DISTANCE_ROUNDING
            if d - moved >= d_min:
                continue
            distance[e - start] = d
            near = d + moved < d_min
            if side_a.exact[ka] and side_b.exact[kb]:
                pair_state[e] = BLOCKED if near else UNDECIDED
            else:
                pair_state[e] = ASK_SHAPES
                if near and not real:
                    state = HOPELESS
            if pair_state[e] == BLOCKED:
                state = BLOCKED
                break
            state = max(state, UNDECIDED)
        while real and state == UNDECIDED:
            nearest, e = math.inf, -1
            for other in range(start, stop):
                if pair_state[other] == ASK_SHAPES and distance[other - start] < nearest:
                    nearest, e = distance[other - start], other
            if e < 0:
                state = FREE
                for other in range(start, stop):
                    state = max(state, pair_state[other])
                break
            ka, kb = cells.pairs[e] // shapes_b, cells.pairs[e] % shapes_b
            link_a, link_b = side_a.bodies.link[ka], side_b.bodies.link[kb]
            # The tolerance keeps the answer true of FCL's distances, by which plans are judged.
            moved = shape_moves_a[cells.a[c], ka] + shape_moves_b[cells.b[c], kb] + DISTANCE_ROUNDING
            moved += max(side_a.bodies.tolerance[ka], side_b.bodies.tolerance[kb])
            low, high = separation(
                side_a.bodies, ka, side_a.base if link_a < 0 else side_a.poses[place_a * samples, link_a],
                side_b.bodies, kb, side_b.base if link_b < 0 else side_b.poses[place_b * samples, link_b],
                d_min + moved, d_min - moved, shortest[cells.pairs[e]], W,
            )  # fmt: skip
            by_shapes += 1
            pair_state[e] = UNDECIDED
            if low >= d_min + moved:
                pair_state[e] = FREE
            elif high < d_min - moved:
                pair_state[e] = BLOCKED
                state = BLOCKED
        cell_state[c] = state
    return by_capsules, by_shapes


@njit
def _paint(states: States, cells: _Cells, cell_state: States, size: int) -> None:
    for c in range(cells.a.shape[0]):
        state = UNDECIDED if cell_state[c] == HOPELESS else cell_state[c]
        if cell_state[c] == UNDECIDED and size > 1:
            continue
        for i in range(cells.a[c] * size, (cells.a[c] + 1) * size):
            for j in range(cells.b[c] * size, (cells.b[c] + 1) * size):
                states[i, j] = state


@njit
def _split(cells: _Cells, cell_state: States, pair_state: States) -> _Cells:
    """The four children of every undecided cell, with the pairs that are not yet free."""
    many, entries = 0, 0
    for c in range(cells.a.shape[0]):
        if cell_state[c] == UNDECIDED:
            many += 1
            for e in range(cells.first[c], cells.first[c + 1]):
                if pair_state[e] != FREE:
                    entries += 1
    a, b = np.empty(4 * many, np.int64), np.empty(4 * many, np.int64)
    first, pairs = np.empty(4 * many + 1, np.int64), np.empty(4 * entries, np.int64)
    k, m = 0, 0
    for c in range(cells.a.shape[0]):
        if cell_state[c] == UNDECIDED:
            for child in range(4):
                a[k], b[k], first[k] = 2 * cells.a[c] + child // 2, 2 * cells.b[c] + child % 2, m
                for e in range(cells.first[c], cells.first[c + 1]):
                    if pair_state[e] != FREE:
                        pairs[m] = cells.pairs[e]
                        m += 1
                k += 1
    first[k] = m
    return _Cells(a, b, first, pairs)
