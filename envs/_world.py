"""A cell as one flat buffer: what compiled loops of the environments need, at little cost per call.

Handing sixty arrays to a compiled function costs more than a control period of two arms; a buffer and its offsets cost
little, and the functions below cut the arrays out again.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.planners import Cell, ClearanceTable, Mode, PathTable, phase_kernels
from armtempo.robots import ArmModel, njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Fields of the buffer, per arm: eleven of the phase plane, the time to go, five of the path table, twelve of the arm.
BLOCK = 64
_ROWS, _EDGES, _TO_GO, _TABLE, _MODEL, _FIELDS = 0, 7, 11, 12, 17, 29


class World(NamedTuple):
    """What does not change during an episode; A arms, n joints at most."""

    buffer: Array
    offset: Ints  # (A, 29) where each field of an arm begins
    size: Ints  # (A, 4) stations, joints, stations of the path table, rows of limits
    prismatic: NDArray[np.bool_]  # (A, n)
    torque_max: Array  # (A, n) true limits; plans may keep a reserve
    coulomb: Array  # (A, n) dry friction
    scale: Array  # (A, 2) minimum time [s], acceleration that counts as 1
    region: Ints  # (A, A, 3) [i, j]: R rows along arm i's path, where ``last_occupied`` and ``last_in_block`` begin
    clearance: Ints  # (P, 3) arms i, j and where their clearance table begins, for worlds without physics
    nodes: int
    by_speed: bool
    tick: float


class State(NamedTuple):
    """What does: one entry per arm."""

    lam: Array
    mu: Array
    arrival: Array  # instant at which the reference arrived [s], nan before


def pack(cell: Cell, mode: Mode, clearances: Sequence[tuple[int, int, ClearanceTable]] = ()) -> World:
    """Pack a cell; ``clearances``: (i, j, table) per pair of arms."""
    parts: list[Array] = []
    length = 0
    arms, width = len(cell.arms), max(arm.dof for arm in cell.arms)
    offset, size = np.zeros((arms, _FIELDS), dtype=np.int64), np.zeros((arms, 4), dtype=np.int64)
    prismatic = np.zeros((arms, width), dtype=np.bool_)
    torque_max, coulomb = np.zeros((arms, width)), np.zeros((arms, width))

    def put(array: Array) -> int:
        nonlocal length
        parts.append(np.ascontiguousarray(array, dtype=np.float64).ravel())
        length += parts[-1].size
        return length - parts[-1].size

    # The functions below cut the fields out again by their places.
    assert phase_kernels.Rows._fields == ("station", "a", "b", "r", "low", "high", "x_cap")
    assert phase_kernels.Edges._fields == ("low", "high", "low_next", "high_next")
    assert PathTable._fields == ("station", "q", "dq", "ddq", "ddq_before")
    assert len(ArmModel._fields) == 1 + _FIELDS - _MODEL
    assert ArmModel._fields[3] == "prismatic"
    for i, (arm, plane, path, motion) in enumerate(zip(cell.arms, cell.planes, cell.paths, cell.fastest, strict=True)):
        table = path.table()
        model = [field for name, field in arm.model._asdict().items() if name != "prismatic"]
        to_go = motion.duration - motion.time_at(plane.rows.station)
        for k, field in enumerate([*plane.rows, *plane.edges, to_go, *table, *model]):
            offset[i, k] = put(field)
        size[i] = len(plane.rows.station), arm.dof, len(table.station), plane.rows.a.shape[1]
        prismatic[i, : arm.dof], torque_max[i, : arm.dof] = arm.model.prismatic, arm.torque_max
        coulomb[i, : arm.dof] = arm.coulomb
    places = [(i, j, put(table.distance)) for i, j, table in clearances]
    minimum = np.array([motion.duration for motion in cell.fastest])
    lengths = np.array([path.length for path in cell.paths])
    region = np.zeros((arms, arms, 3), dtype=np.int64)
    for i, j in permutations(range(arms), 2):
        chart = cell.chart_between(j, i)
        border = (chart.last_column + 1) * chart.step_a * (1.0 - 1e-12)
        last = np.where(chart.last_column >= 0, border, -1.0)
        blocks = np.maximum.reduceat(last, np.arange(0, len(last), BLOCK))
        region[i, j] = len(last), put(last), put(blocks)
    return World(
        buffer=np.concatenate(parts),
        offset=offset,
        size=size,
        prismatic=prismatic,
        torque_max=torque_max,
        coulomb=coulomb,
        scale=np.stack([minimum, 8.0 * lengths / minimum**2], axis=1),
        region=region,
        clearance=np.array(places, dtype=np.int64).reshape(-1, 3),
        nodes=len(clearances[0][2].distance) if clearances else 0,
        by_speed=mode == "speed",
        tick=cell.physics_tick,
    )


@njit
def rows_of(world: World, i: int) -> phase_kernels.Rows:
    """The limits along arm i's path."""
    N, m, o, b = world.size[i, 0], world.size[i, 3], world.offset[i], world.buffer
    return phase_kernels.Rows(
        b[o[0] : o[0] + N],
        b[o[1] : o[1] + N * m].reshape(N, m),
        b[o[2] : o[2] + N * m].reshape(N, m),
        b[o[3] : o[3] + N * m].reshape(N, m),
        b[o[4] : o[4] + N * m].reshape(N, m),
        b[o[5] : o[5] + N * m].reshape(N, m),
        b[o[6] : o[6] + N],
    )


@njit
def length_of(world: World, i: int) -> float:
    """The length of arm i's path."""
    return world.buffer[world.offset[i, _ROWS] + world.size[i, 0] - 1]  # type: ignore[no-any-return]


@njit
def edges_of(world: World, i: int) -> phase_kernels.Edges:
    """The controllable set of arm i."""
    N, o, b = world.size[i, 0], world.offset[i], world.buffer
    e = _EDGES
    return phase_kernels.Edges(
        b[o[e] : o[e] + N],
        b[o[e + 1] : o[e + 1] + N],
        b[o[e + 2] : o[e + 2] + N - 1],
        b[o[e + 3] : o[e + 3] + N - 1],
    )


@njit
def to_go_of(world: World, i: int) -> Array:
    """Minimum time from each station of arm i to its end [s]."""
    o = world.offset[i, _TO_GO]
    return world.buffer[o : o + world.size[i, 0]]


@njit
def table_of(world: World, i: int) -> PathTable:
    """The joint path of arm i."""
    n, K, o, b = world.size[i, 1], world.size[i, 2], world.offset[i], world.buffer
    f = _TABLE
    return PathTable(
        b[o[f] : o[f] + K],
        b[o[f + 1] : o[f + 1] + K * n].reshape(K, n),
        b[o[f + 2] : o[f + 2] + K * n].reshape(K, n),
        b[o[f + 3] : o[f + 3] + K * n].reshape(K, n),
        b[o[f + 4] : o[f + 4] + K * n].reshape(K, n),
    )


@njit
def model_of(world: World, i: int) -> ArmModel:
    """The rigid bodies of arm i."""
    n, o, b = world.size[i, 1], world.offset[i], world.buffer
    f = _MODEL
    return ArmModel(
        b[o[f] : o[f] + 9 * n].reshape(n, 3, 3),
        b[o[f + 1] : o[f + 1] + 3 * n].reshape(n, 3),
        b[o[f + 2] : o[f + 2] + 3 * n].reshape(n, 3),
        world.prismatic[i][:n],
        b[o[f + 3] : o[f + 3] + n],
        b[o[f + 4] : o[f + 4] + 3 * n].reshape(n, 3),
        b[o[f + 5] : o[f + 5] + 9 * n].reshape(n, 3, 3),
        b[o[f + 6] : o[f + 6] + n],
        b[o[f + 7] : o[f + 7] + 3],
        b[o[f + 8] : o[f + 8] + 9].reshape(3, 3),
        b[o[f + 9] : o[f + 9] + 3],
        b[o[f + 10] : o[f + 10] + 9].reshape(3, 3),
        b[o[f + 11] : o[f + 11] + 3],
    )


@njit
def last_occupied(world: World, i: int, j: int) -> Array:
    """(R,) per row along arm i's path: how far arm j goes before the row is free for good; < 0: it is."""
    return world.buffer[world.region[i, j, 1] : world.region[i, j, 1] + world.region[i, j, 0]]


@njit
def last_in_block(world: World, i: int, j: int) -> Array:
    """(R / BLOCK,) the largest of BLOCK rows of it."""
    o = world.region[i, j, 2]
    return world.buffer[o : o + (world.region[i, j, 0] + BLOCK - 1) // BLOCK]


@njit
def clearance_of(world: World, p: int) -> ClearanceTable:
    """The clearance table of pair p."""
    i, j, o = world.clearance[p, 0], world.clearance[p, 1], world.clearance[p, 2]
    K = world.nodes
    return ClearanceTable(world.buffer[o : o + K * K].reshape(K, K), length_of(world, i), length_of(world, j))
