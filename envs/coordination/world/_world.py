"""A cell as one flat buffer: what compiled loops of the environments need, at little cost per call.

Handing sixty arrays to a compiled function costs more than a control period of two arms; a buffer and its offsets cost
little, and the functions below cut the arrays out again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations, permutations
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, PhaseTrajectory
from armtempo.planners.charts import ClearanceTable, clearance_table
from armtempo.planners.joint_paths.kernels import PathTable
from armtempo.planners.topp import Mode
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import ArmModel, inlined, uncounted

# Fields of the buffer, per arm: twelve of the phase plane, the time to go, five of the path table, twelve of the arm.
FCL_BELOW = 0.05  # [m] above d_min: nearer than this the clearance tables ask FCL, not capsules
CELLS_PER_BLOCK = 64
RULE_ROUNDING = 1e-9  # of a path, at the ends of the parts of a rule
_ROWS, _EDGES, _TO_GO, _TABLE, _MODEL, _FIELDS = 0, 7, 12, 13, 18, 30


class World(NamedTuple):
    """What does not change during an episode; A arms, n joints at most."""

    buffer: Floats
    offset: Ints  # (A, 30) where each field of an arm begins
    size: Ints  # (A, 4) stations, joints, stations of the path table, rows of limits
    prismatic: Bools  # (A, n)
    torque_max: Floats  # (A, n) true limits; plans may keep a reserve
    coulomb: Floats  # (A, n) dry friction
    scale: Floats  # (A, 2) minimum time [s], acceleration that counts as 1
    region: Ints  # (A, A, 4) [i, j]: rows along arm i's path, where last_occupied, last_in_block, waits begin
    clearance: Ints  # (P, 3) arms i, j and where their clearance table begins, for worlds without physics
    rules: Floats  # (X, 6) arms i and j are not to be in (a0, a1) and (b0, b1) of their paths at once
    nodes: int
    by_speed: bool
    tick: float


class Episodes(NamedTuple):
    """What does: E episodes at once, A arms, at most S stops. Simulations of one episode have E = 1."""

    lam: Floats  # (E, A)
    mu: Floats  # (E, A)
    arrival: Floats  # (E, A) instant at which the reference arrived [s], nan before
    ticks: Ints  # (E,) since the start
    steps: Ints  # (E,) control periods since the start
    violated: Bools  # (E,)
    smallest: Floats  # (E,) clearance so far [m]
    key: NDArray[np.uint64]  # (E,) of the random numbers
    number: Ints  # (E,) which episode of its environment it is
    late: Floats  # (E, A) how long the arm stands before it obeys [s]
    speed: Floats  # (E, A) share of its commands that it obeys
    stops: Floats  # (E, A, S, 2) when it brakes instead [s]: from, until
    rewarded: Floats  # (E, A) place at the last reward
    charged: Floats  # (E, A) instant at the last reward [s]
    clock: Floats  # (E,) how fast the time of the references goes, at most; 1 but where torques do not follow


def make_episodes(count: int, arms: int, stops: int) -> Episodes:
    """Episodes of so many arms that stand at their starts, undisturbed."""

    def each(value: float = 0.0) -> Floats:
        return np.full((count, arms), value)

    return Episodes(
        lam=each(), mu=each(), arrival=each(np.nan),
        ticks=np.zeros(count, dtype=np.int64), steps=np.zeros(count, dtype=np.int64),
        violated=np.zeros(count, dtype=np.bool_), smallest=np.full(count, np.inf),
        key=np.zeros(count, dtype=np.uint64), number=np.full(count, -1, dtype=np.int64),
        late=each(), speed=each(1.0), stops=np.zeros((count, arms, stops, 2)), rewarded=each(), charged=each(),
        clock=np.ones(count),
    )  # fmt: skip


def check_places(state: Mapping[str, Any], lengths: Floats) -> None:
    """Raise InputError for a state with ``episodes`` off the paths: compiled loops would read what is not theirs."""
    lam, mu = state["episodes.lam"], state["episodes.mu"]
    if not (((lam >= 0.0) & (lam <= lengths)).all() and ((mu >= 0.0) & (mu < np.inf)).all()):
        raise InputError("the state's arms are not on their paths", remedy="give what get_state returned")


def pack(cell: CoordinationCell, mode: Mode, clearances: Sequence[tuple[int, int, ClearanceTable]] = ()) -> World:
    """Pack a cell; ``clearances``: (i, j, table) per pair of arms."""
    parts: list[Floats] = []
    length = 0
    arms, width = len(cell.arms), max(arm.dof for arm in cell.arms)
    offset, size = np.zeros((arms, _FIELDS), dtype=np.int64), np.zeros((arms, 4), dtype=np.int64)
    prismatic = np.zeros((arms, width), dtype=np.bool_)
    torque_max, coulomb = np.zeros((arms, width)), np.zeros((arms, width))

    def put(array: Floats) -> int:
        nonlocal length
        parts.append(np.ascontiguousarray(array, dtype=np.float64).ravel())
        length += parts[-1].size
        return length - parts[-1].size

    # The functions below cut the fields out again by their places.
    assert phase_kernels.Rows._fields == ("station", "a", "b", "r", "low", "high", "x_cap")
    assert phase_kernels.Edges._fields == ("low", "high", "low_next", "high_next", "steps")
    assert PathTable._fields == ("station", "q", "dq", "ddq", "ddq_before")
    assert len(ArmModel._fields) == 1 + _FIELDS - _MODEL
    assert ArmModel._fields[3] == "prismatic"
    for i, (arm, plane, path, motion) in enumerate(zip(cell.arms, cell.planes, cell.paths, cell.fastest, strict=True)):
        table = path.table()
        model = [field for name, field in arm.model._asdict().items() if name != "prismatic"]
        fields = [*plane.rows, *plane.edges, _to_go(motion, plane.rows.station), *table, *model]
        for k, field in enumerate(fields):
            offset[i, k] = put(field)
        size[i] = len(plane.rows.station), arm.dof, len(table.station), plane.rows.a.shape[1]
        prismatic[i, : arm.dof], torque_max[i, : arm.dof] = arm.model.prismatic, arm.torque_max
        coulomb[i, : arm.dof] = arm.coulomb
    places = [(i, j, put(table.distance)) for i, j, table in clearances]
    minimum = np.array([motion.duration for motion in cell.fastest])
    lengths = np.array([path.length for path in cell.paths])
    region = np.zeros((arms, arms, 4), dtype=np.int64)
    to_go = [_to_go(motion, plane.rows.station) for motion, plane in zip(cell.fastest, cell.planes, strict=True)]
    for i, j in permutations(range(arms), 2):
        chart = cell.chart_behind(j, i)
        border = (chart.last_column + 1) * chart.step_a * (1.0 - 1e-12)
        last = np.where(chart.last_column >= 0, border, -1.0)
        blocks = np.maximum.reduceat(last, np.arange(0, len(last), CELLS_PER_BLOCK))
        waits = _waits(to_go[i], to_go[j], last, *(cell.planes[k].rows.station for k in (i, j)))
        region[i, j] = len(last), put(last), put(blocks), put(waits)
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
        rules=_rules_of(cell, lengths),
        nodes=len(clearances[0][2].distance) if clearances else 0,
        by_speed=mode == "speed",
        tick=cell.physics_tick,
    )


def _rules_of(cell: CoordinationCell, lengths: Floats) -> Floats:
    """(X, 6) the cell's rules that are certain, a little narrower for rounding."""
    rows = []
    for rule in cell.exclusions:
        if rule.certain:
            parts = zip(rule.arms, (rule.part_a, rule.part_b), strict=True)
            ends = [
                (low + slack if low > 0.0 else -slack, high - slack if high < lengths[arm] else high + slack)
                for arm, (low, high) in parts
                for slack in (RULE_ROUNDING * lengths[arm],)
            ]
            rows.append([*rule.arms, *ends[0], *ends[1]])
    return np.array(rows, dtype=np.float64).reshape(-1, 6)


@uncounted
def breaks_rule(world: World, places: Floats) -> bool:
    """Whether arms at ``places`` (A,) are where a rule does not let both be."""
    for x in range(world.rules.shape[0]):
        rule = world.rules[x]
        a, b = places[int(rule[0])], places[int(rule[1])]
        if rule[2] < a < rule[3] and rule[4] < b < rule[5]:
            return True
    return False


_WORLDS: WeakKeyDictionary[CoordinationCell, dict[Mode, World]] = WeakKeyDictionary()


def ideal_world(cell: CoordinationCell, mode: Mode) -> World:
    """A cell packed with the clearance table of every pair of arms: one for all who ask, as nobody writes to it."""
    known = _WORLDS.setdefault(cell, {})
    if mode not in known:
        known[mode] = _ideal_world(cell, mode)
    return known[mode]


def _ideal_world(cell: CoordinationCell, mode: Mode) -> World:
    below = cell.d_min + FCL_BELOW
    pairs = combinations(range(len(cell.arms)), 2)
    return pack(cell, mode, [(i, j, clearance_table(i, j, cell.arms, cell.paths, below)) for i, j in pairs])


def _to_go(motion: PhaseTrajectory, station: Floats) -> Floats:
    """(N,) what a minimum-time motion still takes from each station [s]."""
    out: Floats = motion.duration - motion.time_at(station)
    return out


def _waits(own: Floats, other: Floats, last: Floats, own_station: Floats, other_station: Floats) -> Floats:
    """(R + 1, 2) per row: the other's time to go when it leaves the row for good, and what that asks of the own arm.

    With times to go ``g_i`` and ``g_j`` (linear between stations), arm i at ``lam_i`` gets to row s (beginning at
    ``b_s``) in ``g_i(lam_i) - g_i(b_s)``, and arm j leaves it in ``g_j(lam_j) - g_j(last_s)``. So i has to wait

        g_j(lam_j) - g_i(lam_i) + max over the rows s from where it is of (g_i(b_s) - g_j(last_s))

    to pass behind j. Column 0: ``g_j(last_s)`` (inf: never occupied); column 1: the maximum over s and all later rows.
    """
    count = len(last)
    begins = np.arange(count) * (own_station[-1] / count)
    leaves = np.where(last >= 0.0, np.interp(last, other_station, other), np.inf)
    asked = np.interp(begins, own_station, own) - leaves
    out = np.full((count + 1, 2), np.inf)
    out[:-1, 0] = leaves
    out[:-1, 1] = np.maximum.accumulate(asked[::-1])[::-1]
    out[-1, 1] = -np.inf
    return out


@uncounted
def length_of(world: World, i: int) -> float:
    """The length of arm i's path."""
    return world.buffer[world.offset[i, _ROWS] + world.size[i, 0] - 1]  # type: ignore[no-any-return]


@inlined
def steps_of(world: World, i: int) -> Floats:
    """``edges_of(world, i).steps``, what ``phase_kernels.advance`` needs."""
    N, o = world.size[i, 0], world.offset[i, _EDGES + 4]
    K = phase_kernels.STEP_HEADER_COLUMNS + phase_kernels.COLUMNS_PER_ROW * world.size[i, 3]
    return world.buffer[o : o + N * K].reshape(N, K)


@inlined
def to_go_of(world: World, i: int) -> Floats:
    """Minimum time from each station of arm i to its end [s]."""
    o = world.offset[i, _TO_GO]
    return world.buffer[o : o + world.size[i, 0]]


@inlined
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


@inlined
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


@inlined
def last_occupied(world: World, i: int, j: int) -> Floats:
    """(R,) per row along arm i's path: how far arm j goes before the row is free for good; < 0: it is."""
    return world.buffer[world.region[i, j, 1] : world.region[i, j, 1] + world.region[i, j, 0]]


@inlined
def last_in_block(world: World, i: int, j: int) -> Floats:
    """(R / CELLS_PER_BLOCK,) the largest of so many rows of it."""
    o = world.region[i, j, 2]
    return world.buffer[o : o + (world.region[i, j, 0] + CELLS_PER_BLOCK - 1) // CELLS_PER_BLOCK]


@inlined
def waits_of(world: World, i: int, j: int) -> Floats:
    """(R + 1, 2) per row along arm i's path what it has to wait for arm j there and from there on; see ``_waits``."""
    o, R = world.region[i, j, 3], world.region[i, j, 0]
    return world.buffer[o : o + 2 * R + 2].reshape(R + 1, 2)


@inlined
def clearance_of(world: World, p: int) -> ClearanceTable:
    """The clearance table of pair p."""
    i, j, o = world.clearance[p, 0], world.clearance[p, 1], world.clearance[p, 2]
    K = world.nodes
    return ClearanceTable(world.buffer[o : o + K * K].reshape(K, K), length_of(world, i), length_of(world, j))
