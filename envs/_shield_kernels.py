"""The shield's compiled part: commands for one control period that leave every arm a way to stop, and all a way on.

A command is foreseen exactly as the environment will run it: for one period, then maximum braking period by period
until the arm is at rest. Orders (R,) say of every collision region who passes first (see ``PassingOrders``): 0 its arm
a, 1 its arm b, 2 nobody waits. Arms that obey the limits of feasible orders neither meet nor wait for each other for
ever; both are kept: limits are asked at every tick for all arms at once, and orders change only to feasible ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.envs._kernels import run_arm
from armtempo.envs._world import World, edges_of, length_of, rows_of
from armtempo.robots import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Orders = NDArray[np.int8]

MARGIN = 1e-7  # of a path: how far behind a limit an arm is kept
HERE = 1e-9  # of a cell: an arm on the border of two cells counts as in the earlier one
STEPS = 1024  # commands that are cut are whole parts of this: exact in float32, and as actions
SWEEPS = 8  # after which arms that still do not fit brake


class ShieldTables(NamedTuple):
    """What does not change during an episode; R regions, A arms."""

    buffer: Array  # limits, one after the other
    region: Ints  # (R, 2, 5) [r, who passes first: 0 is a, 1 is b]: second arm, first arm, and its limit: its first
    #               cell on the first arm's path, number of cells, where it begins in the buffer
    cells: Ints  # (A, A) resolution of the pair's chart
    candidates: Orders  # (C, R) orders to begin with, the preferred first
    holdable: Bools  # (A,) whether the arm can stand wherever it is


class ShieldWork(NamedTuple):
    """Scratch of one thread; K + 1 places: now, and at the end of every tick."""

    places: Array  # (2, A, K + 1) under the command for one period, then braking; braking from now on
    length: Ints  # (2, A) ticks until the arm is at rest; -1: not foreseen yet
    orders: Orders  # (2, R)
    lam: Array  # (2, A)


@njit
def limit_at(tables: ShieldTables, r: int, order: int, place: float, length: float) -> float:
    """How far the second arm of a region may go while the first is at ``place`` of its path of ``length``."""
    region = tables.region[r, order]
    cells = tables.cells[region[0], region[1]]
    cell = min(max(int(place * (cells / length) - HERE), 0), cells - 1) - region[2]
    if cell >= region[3]:
        return np.inf
    return tables.buffer[region[4] + max(cell, 0)]  # type: ignore[no-any-return]


@njit
def feasible(world: World, tables: ShieldTables, orders: Orders, lam: Array, reach: Array) -> bool:
    """Whether arms that go as far as the others' places allow, over and over, all arrive; ``lam`` (A,) is where."""
    moved = True
    while moved:
        for i in range(lam.shape[0]):
            reach[i] = length_of(world, i)
        for r in range(orders.shape[0]):
            if orders[r] < 2:
                i, j = tables.region[r, orders[r], 0], tables.region[r, orders[r], 1]
                limit = limit_at(tables, r, orders[r], lam[j], length_of(world, j))
                reach[i] = min(reach[i], limit - MARGIN * length_of(world, i))
        moved = False
        for i in range(lam.shape[0]):
            if reach[i] > lam[i]:
                lam[i], moved = reach[i], True
    for i in range(lam.shape[0]):
        if lam[i] < length_of(world, i):
            return False
    return True


@njit
def first_orders(
    world: World, tables: ShieldTables, lam: Array, scripted: Bools, orders: Orders, work: ShieldWork
) -> bool:
    """Fill ``orders`` with the first candidate that leads on from arms at rest at ``lam``; False if none does.

    Where an arm is already past the limit of a candidate the order is the other one.
    """
    for c in range(tables.candidates.shape[0]):
        obeyed = True
        for r in range(orders.shape[0]):
            orders[r] = tables.candidates[c, r]
            for _ in range(2):
                if orders[r] == 2:
                    break
                i, j = tables.region[r, orders[r], 0], tables.region[r, orders[r], 1]
                if lam[i] <= limit_at(tables, r, orders[r], lam[j], length_of(world, j)) - MARGIN * length_of(world, i):
                    break
                if orders[r] != tables.candidates[c, r] or scripted[i] or scripted[j]:
                    obeyed = False
                    break
                orders[r] = 1 - orders[r]
        work.lam[0][:] = lam
        if obeyed and feasible(world, tables, orders, work.lam[0], work.lam[1]):
            return True
    return False


@njit
def _foresee(
    world: World, tables: ShieldTables, i: int, lam: float, mu: float, command: float, ticks: int, out: Array
) -> int:
    """Fill ``out`` (K + 1,) with the places of arm i under a command for one period, then braking; ticks until rest.

    An arm that does not come to rest in time counts as going on to the end of its path.
    """
    rows, edges = rows_of(world, i), edges_of(world, i)
    out[0] = lam
    last = out.shape[0] - 1
    end = rows.station[rows.station.shape[0] - 1]
    k = 0
    while k + ticks < last:
        if lam >= end or (command == 0.0 and mu <= 0.0 and tables.holdable[i]):
            return k
        before = lam
        lam, mu, _ = run_arm(rows, edges, lam, mu, command, world.by_speed, world.tick, ticks, out[k + 1 : k + 1 + ticks])
        if command == 0.0 and lam == before:
            return k
        k += ticks
        command = 0.0
    out[k + 1 :] = end
    return k + 1


@njit
def _fits(
    world: World, tables: ShieldTables, r: int, order: int, lam: Array, mu: Array, commands: Array, unsure: Bools,
    ticks: int, strict: bool, work: ShieldWork,
) -> bool:  # fmt: skip
    """Whether the second arm of a region stays behind its limit; not ``strict``: or is just braking."""
    i, j = tables.region[r, order, 0], tables.region[r, order, 1]
    length = length_of(world, j)
    limit = limit_at(tables, r, order, lam[j], length)
    if limit == np.inf:
        return True
    margin = MARGIN * length_of(world, i)
    if work.length[0, i] < 0:
        work.length[0, i] = _foresee(world, tables, i, lam[i], mu[i], commands[i], ticks, work.places[0, i])
    last = work.length[0, i]
    far = work.places[0, i]
    if far[last] <= limit - margin:
        return True
    row = 1 if unsure[j] else 0
    if work.length[row, j] < 0:
        command = 0.0 if unsure[j] else commands[j]
        work.length[row, j] = _foresee(world, tables, j, lam[j], mu[j], command, ticks, work.places[row, j])
    stop, near = min(work.length[row, j], work.places.shape[2] - ticks - 1), work.places[row, j]
    for k in range(1, last + 1):
        if far[k] > limit - margin:
            limit = limit_at(tables, r, order, near[min(k - 1, stop)], length)
            if limit == np.inf:
                return True
            if far[k] > limit - margin:
                if strict:
                    return False
                if work.length[1, i] < 0:
                    work.length[1, i] = _foresee(world, tables, i, lam[i], mu[i], 0.0, ticks, work.places[1, i])
                if far[k] > work.places[1, i, min(k, work.length[1, i])]:
                    return False
    return True


@njit
def _cut(
    world: World, tables: ShieldTables, orders: Orders, i: int, lam: Array, mu: Array, commands: Array, unsure: Bools,
    ticks: int, work: ShieldWork,
) -> None:  # fmt: skip
    """Lower the command of arm i, by bisection, until it stays behind all its limits."""
    low, high = 0, int(np.ceil(commands[i] * STEPS))
    while high - low > 1:
        middle = (low + high) // 2
        commands[i], work.length[0, i] = middle / STEPS, -1
        fits = True
        for r in range(orders.shape[0]):
            if orders[r] < 2 and tables.region[r, orders[r], 0] == i:
                if not _fits(world, tables, r, orders[r], lam, mu, commands, unsure, ticks, False, work):
                    fits = False
                    break
        if fits:
            low = middle
        else:
            high = middle
    commands[i], work.length[0, i] = low / STEPS, -1


@njit
def _other_orders(
    world: World, tables: ShieldTables, orders: Orders, lam: Array, mu: Array, commands: Array, scripted: Bools,
    unsure: Bools, ticks: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Change who passes first where the commands as they are contradict it, if that leads on; False if it does not.

    First only in these regions, then in all of the pair where the same arm waits.
    """
    R = orders.shape[0]
    wrong, trial = work.orders[0], work.orders[1]
    for r in range(R):
        wrong[r] = 0
        if orders[r] < 2 and not scripted[tables.region[r, orders[r], 0]]:
            if not _fits(world, tables, r, orders[r], lam, mu, commands, unsure, ticks, False, work):
                if scripted[tables.region[r, orders[r], 1]]:
                    return False
                wrong[r] = 1
    for attempt in range(2):
        changed = attempt == 0
        for r in range(R):
            trial[r] = orders[r]
            if wrong[r] == 1:
                trial[r] = 1 - orders[r]
            elif attempt == 1 and orders[r] < 2:
                for s in range(R):
                    if (
                        wrong[s] == 1
                        and tables.region[r, orders[r], 0] == tables.region[s, orders[s], 0]
                        and tables.region[r, orders[r], 1] == tables.region[s, orders[s], 1]
                        and limit_at(
                            tables, r, orders[r], lam[tables.region[r, orders[r], 1]],
                            length_of(world, tables.region[r, orders[r], 1]),
                        ) < np.inf
                    ):  # fmt: skip
                        trial[r], changed = 1 - orders[r], True
        if not changed:
            return False
        fits = True
        for r in range(R):
            if trial[r] < 2 and not scripted[tables.region[r, trial[r], 0]]:
                strict = trial[r] != orders[r]
                if not _fits(world, tables, r, trial[r], lam, mu, commands, unsure, ticks, strict, work):
                    fits = False
                    break
        if not fits:
            continue
        for i in range(lam.shape[0]):  # an arm that stops earlier than it can is farther, so it leads on from there too
            row = 1 if unsure[i] else 0
            if work.length[row, i] < 0:
                command = 0.0 if unsure[i] else commands[i]
                work.length[row, i] = _foresee(world, tables, i, lam[i], mu[i], command, ticks, work.places[row, i])
            work.lam[0, i] = work.places[row, i, min(work.length[row, i], work.places.shape[2] - ticks - 1)]
        if feasible(world, tables, trial, work.lam[0], work.lam[1]):
            orders[:] = trial
            return True
    return False


@njit
def admit(
    world: World,
    tables: ShieldTables,
    orders: Orders,
    lam: Array,
    mu: Array,
    commands: Array,
    scripted: Bools,
    uncertain: Bools,
    ticks: int,
    admitted: Array,
    work: ShieldWork,
) -> bool:
    """Fill ``admitted`` (A,) with the commands for one period of ``ticks`` that are let through; True if one is cut.

    Args:
        world: The cell.
        tables: Its regions.
        orders: (R,) who passes first; changed where the commands ask for it and it leads on.
        lam: (A,) places.
        mu: (A,) path speeds.
        commands: (A,) as asked for, in [0, 1].
        scripted: (A,) arms whose command is not changed: they brake or not, as they please.
        uncertain: (A,) arms that may do less than they are told: anything from maximum braking to their command.
        ticks: Ticks of a control period.
        admitted: (A,) out. Given the orders it is the largest, arm by arm, up to the steps of a cut.
        work: Scratch.

    Arms are held back only by arms ahead of them: the limits of an arm rise with the commands of all others, so there
    is a largest set of commands, and lowering arm by arm whoever does not fit finds it. To brake is always let through:
    it is what was checked the last time.
    """
    admitted[:] = commands
    work.length[:] = -1
    unsure = scripted | uncertain
    fits, tried, changed = False, False, False
    sweep = 0
    while not fits:
        fits = True
        for r in range(orders.shape[0]):
            if orders[r] == 2 or scripted[tables.region[r, orders[r], 0]]:
                continue
            if not _fits(world, tables, r, orders[r], lam, mu, admitted, unsure, ticks, False, work):
                fits = False
                if not tried:
                    tried = True
                    if _other_orders(world, tables, orders, lam, mu, admitted, scripted, unsure, ticks, work):
                        return False
                i = tables.region[r, orders[r], 0]
                if sweep < SWEEPS:
                    _cut(world, tables, orders, i, lam, mu, admitted, unsure, ticks, work)
                else:
                    admitted[i], work.length[0, i] = 0.0, -1
                changed = True
        sweep += 1
    return changed
