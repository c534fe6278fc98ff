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

from armtempo.envs._world import World, edges_of, length_of, rows_of, steps_of
from armtempo.planners import phase_kernels
from armtempo.robots import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Orders = NDArray[np.int8]

MARGIN = 1e-7  # of a path: how far behind a limit an arm is kept
HERE = 1e-9  # of a cell: an arm on the border of two cells counts as in the earlier one
STEPS = 1024  # commands that are cut are whole parts of this: exact in float32, and as actions
PARTS = 16  # of a tick, in which limits are asked
UNKNOWN, STARTED = -2, -1  # how much of an arm is foreseen; else the ticks until rest
SWEEPS = 8  # after which arms that still do not fit brake


class ShieldTables(NamedTuple):
    """What does not change during an episode; R regions, A arms."""

    buffer: Array  # limits, one after the other
    region: Ints  # (R, 2, 5) [r, who passes first: 0 is a, 1 is b]: second arm, first arm, and its limit: its first
    #               cell on the first arm's path, number of cells, where it begins in the buffer
    cells: Ints  # (A, A) resolution of the pair's chart
    candidates: Orders  # (C, R) orders to begin with, the preferred first
    holdable: Bools  # (A,) whether the arm can stand wherever it is
    spacing: Array  # (A, 2) of the nodes of ``stop``: place, speed
    stop: Array  # (A, N, M) where arm i stops if it brakes at a node, a little more


class ShieldWork(NamedTuple):
    """Scratch of one thread; K + 1 places: now, and at the end of every tick."""

    places: Array  # (2, A, K + 1) under the command for one period, then braking; braking from now on
    length: Ints  # (2, A) ticks until the arm is at rest, or UNKNOWN or STARTED
    after: Array  # (2, A, 3) place and speed after that period, and a bound on where it stops
    orders: Orders  # (2, R)
    lam: Array  # (2, A)
    speeds: Array  # (ticks of a period,)


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
    for i in range(lam.shape[0]):  # noqa: SIM110 (numba has no all() of a generator)
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
def stop_table(world: World, i: int, ticks: int, spacing: Array, out: Array) -> None:
    """Fill ``out`` (N, M) with where arm i stops if it brakes at a node, and what it covers in two ticks."""
    rows, edges = rows_of(world, i), edges_of(world, i)
    steps, end, scratch, speeds = steps_of(world, i), length_of(world, i), np.empty(ticks), np.empty(ticks)
    for node in range(out.shape[0]):
        for level in range(out.shape[1]):
            place, speed = min(node * spacing[0], end), level * spacing[1]
            edge = phase_kernels.edge_speed(rows, edges, place)
            if level > 0 and (level - 1) * spacing[1] >= edge:
                out[node, level] = out[node, level - 1]  # no arm is that fast there
                continue
            slack = 2.0 * speed * world.tick
            speed = min(speed, edge)
            for _ in range(100000):
                before = place
                place, speed, _ = phase_kernels.run(
                    steps, place, speed, 0.0, world.by_speed, world.tick, ticks, scratch, speeds
                )
                if speed <= 0.0 or place >= end or place == before:
                    break
            out[node, level] = min(place + slack, end)


@njit
def stop_bound(tables: ShieldTables, i: int, lam: float, mu: float) -> float:
    """A place behind which arm i certainly comes to rest if it brakes now: the next node of its table, both ways.

    Braking motions do not cross, and a braking arm is not faster later: from a node farther on and a higher speed it
    stops farther. Infinite for arms that cannot hold still everywhere, which may be pulled on.
    """
    if not tables.holdable[i]:
        return np.inf
    if mu <= 0.0:
        return lam
    node, level = int(np.ceil(lam / tables.spacing[i, 0])), int(np.ceil(mu / tables.spacing[i, 1]))
    stop = tables.stop[i]
    return max(lam, float(stop[min(node, stop.shape[0] - 1), min(level, stop.shape[1] - 1)]))


@njit
def _row(braking: bool) -> int:
    """Of ``work``: 0 under the command, 1 braking; a number written in a call would compile a copy of what it calls."""
    return 1 if braking else 0


@njit
def _start(
    world: World, tables: ShieldTables, row: int, i: int, lam: float, mu: float, command: float, ticks: int,
    work: ShieldWork,
) -> None:  # fmt: skip
    """Foresee arm i for one period under a command."""
    out = work.places[row, i]
    out[0] = lam
    after, speed, _ = phase_kernels.run(
        steps_of(world, i), lam, mu, command, world.by_speed, world.tick, ticks, out[1 : ticks + 1], work.speeds
    )
    work.after[row, i, 0], work.after[row, i, 1] = after, speed
    work.after[row, i, 2] = stop_bound(tables, i, after, speed)
    work.length[row, i] = STARTED


@njit
def _foresee(
    world: World, tables: ShieldTables, row: int, i: int, lam: Array, mu: Array, commands: Array, ticks: int,
    work: ShieldWork,
) -> int:  # fmt: skip
    """Foresee arm i under its command (row 0) or braking (row 1) for one period, then braking; ticks until rest.

    An arm that does not come to rest in time counts as going on to the end of its path.
    """
    if work.length[row, i] >= 0:
        return work.length[row, i]  # type: ignore[no-any-return]
    if work.length[row, i] == UNKNOWN:
        _start(world, tables, row, i, lam[i], mu[i], commands[i] if row == 0 else 0.0, ticks, work)
    out, k = work.places[row, i], ticks
    last = out.shape[0] - 1
    steps, end = steps_of(world, i), length_of(world, i)
    place, speed = work.after[row, i, 0], work.after[row, i, 1]
    while k + ticks < last:
        if place >= end or (speed <= 0.0 and tables.holdable[i]):
            break
        before = place
        place, speed, _ = phase_kernels.run(
            steps, place, speed, 0.0, world.by_speed, world.tick, ticks, out[k + 1 : k + 1 + ticks], work.speeds
        )
        if place == before:
            break
        k += ticks
    else:
        out[k + 1 :] = end
        k += 1
    work.length[row, i] = k
    return k


@njit
def _bend(places: Array, k: int, last: int) -> float:
    """The larger of the second differences at both ends of the tick before ``k``; ``last``: at rest from there on."""
    step = places[min(k, last)] - places[min(k - 1, last)]
    bend = float(abs(places[min(k + 1, last)] - places[min(k, last)] - step))
    if k > 1:
        bend = max(bend, abs(step - (places[min(k - 1, last)] - places[min(k - 2, last)])))
    return bend


@njit
def _behind(
    tables: ShieldTables, r: int, order: int, length: float, margin: float, far: Array, far_last: int, near: Array,
    near_last: int, k: int,
) -> bool:  # fmt: skip
    """Whether the second arm stays behind its limit during the tick before place ``k``.

    Limits never fall, so in every part of the tick it is enough that the one is behind at its end the limit from where
    the other is at its begin. Inside a tick places differ from the chord by an eighth of the second difference if the
    acceleration is constant; four times that is allowed for.
    """
    begin, end = near[min(k - 1, near_last)], near[min(k, near_last)]
    if far[k] <= limit_at(tables, r, order, begin, length) - margin:
        return True
    if far[k] > limit_at(tables, r, order, end, length) - margin:
        return False
    far_bend, near_bend = 0.5 * _bend(far, k, far_last), 0.5 * _bend(near, k, near_last)
    for part in range(PARTS):
        low = max(begin + part / PARTS * (end - begin) - near_bend, begin)
        high = min(far[k - 1] + (part + 1) / PARTS * (far[k] - far[k - 1]) + far_bend, far[k])
        if high > limit_at(tables, r, order, low, length) - margin:
            return False
    return True


@njit
def _fits(
    world: World, tables: ShieldTables, r: int, order: int, orders: Orders, lam: Array, mu: Array, commands: Array,
    unsure: Bools, ticks: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Whether the second arm of a region stays behind its limit or, where ``order`` is in force already, is braking."""
    i, j = tables.region[r, order, 0], tables.region[r, order, 1]
    length = length_of(world, j)
    limit = limit_at(tables, r, order, lam[j], length)
    if limit == np.inf:
        return True
    margin = MARGIN * length_of(world, i)
    if work.length[0, i] == UNKNOWN:
        _start(world, tables, _row(False), i, lam[i], mu[i], commands[i], ticks, work)
    if work.after[0, i, 2] <= limit - margin:
        return True
    last, far = _foresee(world, tables, _row(False), i, lam, mu, commands, ticks, work), work.places[0, i]
    if far[last] <= limit - margin:
        return True
    row = _row(unsure[j])
    stop, near = _foresee(world, tables, row, j, lam, mu, commands, ticks, work), work.places[row, j]
    stop = min(stop, work.places.shape[2] - ticks - 1)  # what is not foreseen of an arm ahead does not count
    for k in range(1, last + 1):
        if far[k] > limit - margin:
            if not _behind(tables, r, order, length, margin, far, last, near, stop, k):
                if order != orders[r]:
                    return False
                own = _foresee(world, tables, _row(True), i, lam, mu, commands, ticks, work)
                if far[k] > work.places[1, i, min(k, own)]:
                    return False
            limit = limit_at(tables, r, order, near[min(k, stop)], length)
            if limit == np.inf:
                return True
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
        commands[i], work.length[0, i] = middle / STEPS, UNKNOWN
        fits = True
        for r in range(orders.shape[0]):
            mine = orders[r] < 2 and tables.region[r, orders[r], 0] == i
            if mine and not _fits(world, tables, r, orders[r], orders, lam, mu, commands, unsure, ticks, work):
                fits = False
                break
        if fits:
            low = middle
        else:
            high = middle
    commands[i], work.length[0, i] = low / STEPS, UNKNOWN


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
        free = orders[r] < 2 and not scripted[tables.region[r, orders[r], 0]]
        if free and not _fits(world, tables, r, orders[r], orders, lam, mu, commands, unsure, ticks, work):
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
            free = trial[r] < 2 and not scripted[tables.region[r, trial[r], 0]]
            if free and not _fits(world, tables, r, trial[r], orders, lam, mu, commands, unsure, ticks, work):
                fits = False
                break
        if not fits:
            continue
        for i in range(lam.shape[0]):  # an arm that stops earlier than it can is farther, so it leads on from there too
            row = _row(unsure[i])
            stop = _foresee(world, tables, row, i, lam, mu, commands, ticks, work)
            work.lam[0, i] = work.places[row, i, min(stop, work.places.shape[2] - ticks - 1)]
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
    work.length[:] = UNKNOWN
    unsure = scripted | uncertain
    fits, tried, changed = False, False, False
    sweep = 0
    while not fits:
        fits = True
        for r in range(orders.shape[0]):
            if orders[r] == 2 or scripted[tables.region[r, orders[r], 0]]:
                continue
            if not _fits(world, tables, r, orders[r], orders, lam, mu, admitted, unsure, ticks, work):
                fits = False
                if not tried:
                    tried = True
                    if _other_orders(world, tables, orders, lam, mu, admitted, scripted, unsure, ticks, work):
                        return False
                i = tables.region[r, orders[r], 0]
                if sweep < SWEEPS:
                    _cut(world, tables, orders, i, lam, mu, admitted, unsure, ticks, work)
                else:
                    admitted[i], work.length[0, i] = 0.0, UNKNOWN
                changed = True
        sweep += 1
    return changed
