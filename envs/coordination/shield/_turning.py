"""The shield's compiled part: which orders of passing hold, and how they are turned.

Orders that are to be turned together are looked for breadth first. Where orders do not lead on, arms wait for each
other in a circle; arms that pass every region of the circle in the same order end up waiting there, too: the first of
them to go farther would have to be let through by another one that has. So one region of the circle has to be turned,
and only these are tried, each without those tried before it: no set of turns is met twice, and the first that leads on
is a smallest one. (An arm that ends in another one's way is a circle of one region.)

To turn an order, every arm that waits then must stop behind its limit if it brakes now, and from where all arms stop
that way all must arrive. Limits open only, so then all arrive from wherever obeying arms get instead.
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._kernels import (
    LEADING_ARM,
    LIMIT_MARGIN_SHARE,
    NOBODY_WAITS,
    PARTS_PER_TICK,
    UNTIL_REST,
    WAITING_ARM,
    Orders,
    ShieldTables,
    ShieldWork,
    feasible,
    fits,
    foresee,
    limit_now,
    row_of,
)
from armtempo.envs.coordination.world import World, length_of, steps_of
from armtempo.robots import uncounted

NODES = 48  # sets of turns that a search looks at, at most
NOT_YET = 2  # whether an order can be turned: beside 0 and 1, not looked at yet
HERE, FARTHEST, STOPS, NO_COMMANDS = range(4)  # rows of ``ShieldWork.lam``


@uncounted
def put(source: Floats | Orders | Bools, target: Floats | Orders | Bools) -> None:
    """``target[:] = source``, one-dimensional; numba would make an array for the case that they overlap."""
    for k in range(target.shape[0]):
        target[k] = source[k]


@uncounted
def begin(lam: Floats, mu: Floats, work: ShieldWork) -> None:
    """Nothing is foreseen yet of arms that are at ``lam`` with ``mu`` (A,)."""
    for row in range(2):
        for i in range(lam.shape[0]):
            work.places[row, i, 0], work.speed[row, i, 0], work.length[row, i] = lam[i], mu[i], 0


@uncounted
def _behind(world: World, tables: ShieldTables, r: int, order: int, lam: Floats) -> bool:
    """Whether the arm that would wait in region r is behind its limit where it is."""
    i = tables.region[r, order, WAITING_ARM]
    return lam[i] <= limit_now(world, tables, r, order, lam) - LIMIT_MARGIN_SHARE * length_of(world, i)  # type: ignore[no-any-return]


@uncounted
def _can_turn(
    world: World, tables: ShieldTables, r: int, order: int, orders: Orders, lam: Floats, mu: Floats, commands: Floats,
    scripted: Bools, unsure: Bools, parts: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Whether region r can be turned to ``order``: nobody is scripted, and the arm that waits then can stop in time."""
    i, j = tables.region[r, order, WAITING_ARM], tables.region[r, order, LEADING_ARM]
    if scripted[i] or scripted[j] or not _behind(world, tables, r, order, lam):
        return False
    return fits(world, tables, r, order, orders, lam, mu, commands, unsure, parts, work)


@uncounted
def _stops(world: World, tables: ShieldTables, mu: Floats, unsure: Bools, parts: int, work: ShieldWork) -> None:
    """Fill where all arms come to rest if they brake from now on."""
    for i in range(mu.shape[0]):
        row = row_of(True)
        stop = foresee(
            steps_of(world, i), world.by_speed, tables.holdable[i], world.tick, work.lam[NO_COMMANDS, i], parts,
            UNTIL_REST, row, i, work.places[row, i], work.speed[row, i], work.length, work.rest, work.speeds,
        )  # fmt: skip
        stop = 0 if unsure[i] and mu[i] <= 0.0 else min(stop, work.places.shape[2] - parts - 1)
        work.lam[STOPS, i] = work.places[row, i, stop]


@uncounted
def _circle(world: World, tables: ShieldTables, orders: Orders, work: ShieldWork) -> int:
    """Fill ``work.circle`` with regions whose arms wait for each other where they have got (``HERE``); how many."""
    here, holds, seen = work.lam[HERE], work.arms, work.circle
    at = -1
    for i in range(here.shape[0]):
        holds[i], work.lam[FARTHEST, i] = -1, np.inf
        if at < 0 and here[i] < length_of(world, i):
            at = i
    for r in range(orders.shape[0]):
        if orders[r] < NOBODY_WAITS:
            i, limit = tables.region[r, orders[r], WAITING_ARM], limit_now(world, tables, r, orders[r], here)
            if limit < work.lam[FARTHEST, i]:
                work.lam[FARTHEST, i], holds[i] = limit, r
    count = 0
    while True:  # from who waits to whom it waits for, until one comes again, or one that has arrived
        r = holds[at]
        for k in range(count):
            if seen[k] == r:
                for m in range(k, count):
                    seen[m - k] = seen[m]
                return count - k
        seen[count] = r
        count += 1
        at = tables.region[r, orders[r], LEADING_ARM]
        if here[at] >= length_of(world, at):
            seen[0] = r
            return 1


@uncounted
def _search(
    world: World, tables: ShieldTables, orders: Orders, lam: Floats, mu: Floats, commands: Floats, scripted: Bools,
    unsure: Bools, parts: int, most: int, work: ShieldWork,
) -> int:  # fmt: skip
    """The node of the fewest turns, up to ``most``, that leads on; -1: there is none, -2: none was found among so many.

    Node 0 is where it begins, ``settled[0]`` what must not be turned; back to ``orders``, which hold, anything can be.
    """
    nodes, settled, turns = work.nodes, work.settled, work.turns
    count, at = 1, 0
    turns[0] = 0
    while at < count:
        put(work.lam[STOPS], work.lam[HERE])
        if feasible(world, tables, nodes[at], work.lam[HERE], work.lam[FARTHEST]):
            return at
        found = _circle(world, tables, nodes[at], work) if turns[at] < most else 0
        for k in range(found):
            r = work.circle[k]
            if settled[at, r]:
                continue
            other = 1 - nodes[at, r]
            if work.turnable[r] == NOT_YET:
                can = other == orders[r] or _can_turn(
                    world, tables, r, other, orders, lam, mu, commands, scripted, unsure, parts, work
                )
                work.turnable[r] = 1 if can else 0
            settled[at, r] = True
            if work.turnable[r] == 1:
                if count == nodes.shape[0]:
                    return -2
                put(nodes[at], nodes[count])
                put(settled[at], settled[count])
                turns[count] = turns[at] + 1
                nodes[count, r] = other
                count += 1
        at += 1
    return -1


@uncounted
def set_wanted(tables: ShieldTables, asked: Orders, priority: Floats, wanted: Orders) -> None:
    """Fill ``wanted`` (R,): the arm with the higher number first; where they are equal as ``asked`` (2: either)."""
    for r in range(wanted.shape[0]):
        b, a = tables.region[r, 0, WAITING_ARM], tables.region[r, 0, LEADING_ARM]
        wanted[r] = asked[r]
        if priority[a] != priority[b]:
            wanted[r] = 0 if priority[a] > priority[b] else 1


@uncounted
def _begin_search(tables: ShieldTables, orders: Orders, scripted: Bools, work: ShieldWork) -> None:
    for r in range(orders.shape[0]):
        work.nodes[0, r], work.turnable[r] = orders[r], NOT_YET
        work.settled[0, r] = orders[r] == NOBODY_WAITS


@uncounted
def take(
    world: World, tables: ShieldTables, orders: Orders, wanted: Orders, lam: Floats, mu: Floats, scripted: Bools,
    uncertain: Bools, ticks: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Turn the orders (R,) to those ``wanted`` (R,; 2: either), or as near to them as leads on; True if one is turned.

    Nearest are those with the fewest turns from what is wanted, of regions where either will do, too. They change only
    for ones that are nearer than those in force, so they do not go to and fro while the same is wanted.
    """
    unsure, parts, none = work.unsure, PARTS_PER_TICK * ticks, work.lam[NO_COMMANDS]
    for i in range(lam.shape[0]):
        unsure[i] = scripted[i] or uncertain[i]
    begin(lam, mu, work)
    _begin_search(tables, orders, scripted, work)
    start, asked = work.nodes[0], 0
    for r in range(orders.shape[0]):
        if wanted[r] < NOBODY_WAITS and orders[r] < NOBODY_WAITS and wanted[r] != orders[r]:
            if _can_turn(world, tables, r, wanted[r], orders, lam, mu, none, scripted, unsure, parts, work):
                start[r] = wanted[r]
                asked += 1
            else:
                work.settled[0, r] = True
    if asked == 0:
        return False
    _stops(world, tables, mu, unsure, parts, work)
    found = _search(world, tables, orders, lam, mu, none, scripted, unsure, parts, asked - 1, work)
    if found >= 0:
        put(work.nodes[found], orders)
    turned = found >= 0
    for r in range(orders.shape[0] if found == -2 else 0):  # too many: one after the other, as far as that leads on
        if wanted[r] < NOBODY_WAITS and orders[r] < NOBODY_WAITS and wanted[r] != orders[r]:
            if not _can_turn(world, tables, r, wanted[r], orders, lam, mu, none, scripted, unsure, parts, work):
                continue
            put(orders, work.nodes[1])
            work.nodes[1, r] = wanted[r]
            put(work.lam[STOPS], work.lam[HERE])
            if feasible(world, tables, work.nodes[1], work.lam[HERE], work.lam[FARTHEST]):
                orders[r], turned = wanted[r], True
    return turned


@uncounted
def keep_orders(
    world: World, tables: ShieldTables, orders: Orders, wanted: Orders, lam: Floats, mu: Floats, scripted: Bools,
    uncertain: Bools, ticks: int, asked: Orders, work: ShieldWork,
) -> None:  # fmt: skip
    """``take``, and fill ``asked`` (R,) with the orders that hold then, where something was wanted."""
    take(world, tables, orders, wanted, lam, mu, scripted, uncertain, ticks, work)
    for r in range(orders.shape[0]):
        asked[r] = orders[r] if wanted[r] < NOBODY_WAITS else NOBODY_WAITS


@uncounted
def first_orders(
    world: World, tables: ShieldTables, lam: Floats, scripted: Bools, orders: Orders, work: ShieldWork
) -> bool:
    """Fill ``orders`` with the first candidate that leads on from arms at rest at ``lam``; False if none does.

    Where an arm is already past the limit of a candidate the order is the other one. If none leads on, then what is
    nearest to the first.
    """
    for c in range(tables.candidates.shape[0]):
        if _at_rest(world, tables, lam, scripted, tables.candidates[c], orders):
            put(lam, work.lam[HERE])
            if feasible(world, tables, orders, work.lam[HERE], work.lam[FARTHEST]):
                return True
    if tables.candidates.shape[0] == 0 or not _at_rest(world, tables, lam, scripted, tables.candidates[0], orders):
        return False
    still, parts = work.lam[NO_COMMANDS], work.speeds.shape[0]
    begin(lam, still, work)
    _begin_search(tables, orders, scripted, work)
    for r in range(orders.shape[0]):
        if orders[r] < NOBODY_WAITS:
            i, j = tables.region[r, orders[r], WAITING_ARM], tables.region[r, orders[r], LEADING_ARM]
            free = not scripted[i] and not scripted[j]
            work.turnable[r] = 1 if free and _behind(world, tables, r, 1 - orders[r], lam) else 0
    put(lam, work.lam[STOPS])
    found = _search(world, tables, orders, lam, still, still, scripted, scripted, parts, orders.shape[0], work)
    if found >= 0:
        put(work.nodes[found], orders)
    return found >= 0


@uncounted
def _at_rest(
    world: World, tables: ShieldTables, lam: Floats, scripted: Bools, candidate: Orders, orders: Orders
) -> bool:
    """Fill ``orders`` with a candidate, the other order where arms at ``lam`` do not obey it; False: nor that."""
    for r in range(orders.shape[0]):
        orders[r] = candidate[r]
        if orders[r] == NOBODY_WAITS or _behind(world, tables, r, orders[r], lam):
            continue
        i, j = tables.region[r, orders[r], WAITING_ARM], tables.region[r, orders[r], LEADING_ARM]
        orders[r] = 1 - orders[r]
        if scripted[i] or scripted[j] or not _behind(world, tables, r, orders[r], lam):
            return False
    return True


@uncounted
def turn_for(
    world: World, tables: ShieldTables, orders: Orders, wanted: Orders, lam: Floats, mu: Floats, commands: Floats,
    scripted: Bools, unsure: Bools, parts: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Turn orders that the commands as they are contradict, if that leads on; True if one is turned.

    For all arms that are held back at once; if that does not lead on, for one arm after the other. What is as
    ``wanted`` is not turned, nor what a scripted arm leads: an arm that is held back there has to wait.
    """
    held, arms = work.arms, lam.shape[0]  # regions in which an arm is held back; -1: one of them stays as it is
    wrong = work.wrong
    held[:] = 0
    for r in range(orders.shape[0]):
        wrong[r] = False
        i = tables.region[r, min(orders[r], 1), WAITING_ARM]
        if orders[r] == NOBODY_WAITS or scripted[i]:
            continue
        if not fits(world, tables, r, orders[r], orders, lam, mu, commands, unsure, parts, work):
            wrong[r] = True
            stays = wanted[r] == orders[r] or not _can_turn(
                world, tables, r, 1 - orders[r], orders, lam, mu, commands, scripted, unsure, parts, work
            )
            held[i] = -1 if stays or held[i] < 0 else held[i] + 1
    freed = 0
    for i in range(arms):
        freed += held[i] > 0
    if freed == 0:
        return False
    for i in range(arms):
        work.hindered[i] = work.freed[i] = held[i] > 0
    _stops(world, tables, mu, unsure, parts, work)
    turned = _free(world, tables, orders, wanted, lam, mu, commands, scripted, unsure, parts, work)
    for i in range(0 if turned or freed < 2 else arms):
        if work.hindered[i]:
            work.freed[:] = False
            work.freed[i] = True
            turned |= _free(world, tables, orders, wanted, lam, mu, commands, scripted, unsure, parts, work)
    return turned


@uncounted
def _free(
    world: World, tables: ShieldTables, orders: Orders, wanted: Orders, lam: Floats, mu: Floats, commands: Floats,
    scripted: Bools, unsure: Bools, parts: int, work: ShieldWork,
) -> bool:  # fmt: skip
    """Turn what holds the arms of ``work.freed`` back; True if that leads on."""
    _begin_search(tables, orders, scripted, work)
    for r in range(orders.shape[0]):
        if orders[r] == NOBODY_WAITS:
            continue
        i = tables.region[r, orders[r], WAITING_ARM]
        if work.wrong[r] and work.freed[i]:
            work.nodes[0, r], work.settled[0, r] = 1 - orders[r], True
        elif work.wrong[r] or wanted[r] == orders[r]:
            work.settled[0, r] = True
    most = orders.shape[0]
    found = _search(world, tables, orders, lam, mu, commands, scripted, unsure, parts, most, work)
    for r in range(orders.shape[0] if found >= 0 else 0):
        work.wrong[r] &= orders[r] == work.nodes[found, r]
        orders[r] = work.nodes[found, r]
    return found >= 0
