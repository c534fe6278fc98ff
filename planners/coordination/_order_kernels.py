"""Compiled: what an order of passing leads to, in the arms' own minimum-time clocks, and the best orders.

``to_go`` (A,) is what every arm still needs at full speed. Arm i, alone, is at a place at ``to_go[i] - g_i(place)``,
with ``g_i`` the time from there to its end at full speed; every delay moves all that comes after it. If arm j passes a
region first, arm i may pass its limit in a cell of j's when j has left the cell: j's delay there plus the ``lag``,

    to_go[j] - to_go[i] + max over the cells that j has yet to leave ( g_i(limit) - g_j(end of the cell) )

is the least delay that i has from there on. Whoever waits comes to rest and loses some of the time of starting again.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.charts.kernels import cell_at
from armtempo.planners.coordination._passing_orders import Orders
from armtempo.robots import njit

UNDECIDED = 2  # of an order
WAITING, LEADING, FIRST_CELL, CELLS, OFFSET, RESOLUTION, ORDER_COLUMNS = 0, 1, 2, 3, 4, 5, 6
SETTLED = 1e-9  # [s]: delays that change by less
MEAN_SHARE = 1e-3  # of the mean arrival in the cost of orders: of those with one makespan, the one that holds up less
NODES = 400  # of a search

PLACES = 256  # of a path, from which the time to go is known


class OrderTables(NamedTuple):
    """The regions of a cell in time. Of region r, in order o: 0, its arm a passes first; 1, its arm b does.

    Attributes:
        region: (R, 2, ORDER_COLUMNS) the arm that waits, the one that leads; along the path of the latter, the first
            cell of the region, how many it has, where they begin in ``limit`` and ``worst``, and cells of the path.
        limit: (B,) how far the waiting arm may go, over the cells.
        worst: (B,) the largest ``g_i(limit) - g_j(end of the cell)`` of this and all later cells [s].
        entry: (R, 2) where the waiting arm stands at the latest.
        leave: (R, 2) where the leading arm leaves the region.
        restart: (R, 2) half of what starting again at the entry costs [s].
        possible: (R, 2) whether there is such a place to stand, and the leading arm leaves the region at all.
        length: (A,) of the paths.
        go: (A, 2, PLACES) time to the end at full speed, from places evenly along each path [s]: on the minimum-time
            motion, and from rest.
        fastest: (A, PLACES) path speed of the minimum-time motion there.
    """

    region: Ints
    limit: Floats
    worst: Floats
    entry: Floats
    leave: Floats
    restart: Floats
    possible: Bools
    length: Floats
    go: Floats
    fastest: Floats


@njit
def time_to_go(tables: OrderTables, i: int, place: float, share: float) -> float:
    """What arm i needs from a place to its end [s]: with this share of full speed, 0 from rest."""
    at = min(max(place / tables.length[i], 0.0), 1.0) * (PLACES - 1)
    k = min(int(at), PLACES - 2)
    t = at - k
    fast = (1.0 - t) * tables.go[i, 0, k] + t * tables.go[i, 0, k + 1]
    rest = (1.0 - t) * tables.go[i, 1, k] + t * tables.go[i, 1, k + 1]
    return share * fast + (1.0 - share) * rest  # type: ignore[no-any-return]


@njit
def fill_times(tables: OrderTables, lam: Floats, mu: Floats, to_go: Floats) -> None:
    """Fill ``to_go`` (A,) [s] for arms at ``lam`` with ``mu`` (A,): between rest and full speed as their speed is."""
    for i in range(lam.shape[0]):
        at = min(max(lam[i] / tables.length[i], 0.0), 1.0) * (PLACES - 1)
        k = min(int(at), PLACES - 2)
        t = at - k
        most = (1.0 - t) * tables.fastest[i, k] + t * tables.fastest[i, k + 1]
        share = min(mu[i] / most, 1.0) if most > 0.0 else 0.0
        to_go[i] = time_to_go(tables, i, lam[i], share)


@njit
def lags(tables: OrderTables, lam: Floats, to_go: Floats, lag: Floats) -> None:
    """Fill ``lag`` (R, 2) [s] for arms at ``lam`` (A,): -inf: the region is behind an arm; inf: it cannot be so."""
    for r in range(lag.shape[0]):
        gone = False
        for order in range(2):
            row = tables.region[r, order]
            i, j = row[WAITING], row[LEADING]
            cell = cell_at(lam[j], row[RESOLUTION] / tables.length[j], row[RESOLUTION]) - row[FIRST_CELL]
            if cell >= row[CELLS]:
                gone = True
                continue
            at = row[OFFSET] + max(cell, 0)
            if tables.possible[r, order] and lam[i] <= tables.limit[at]:
                lag[r, order] = to_go[j] - to_go[i] + tables.worst[at]
            else:
                lag[r, order] = np.inf
        if gone:
            lag[r] = -np.inf


@njit
def fill_lags(tables: OrderTables, lam: Floats, mu: Floats, still: Floats, to_go: Floats, lag: Floats) -> None:
    """``fill_times`` of arms that stand on for ``still`` (A,) [s], added to ``to_go`` (A,) [s], then ``lags``."""
    fill_times(tables, lam, mu, to_go)
    for i in range(lam.shape[0]):
        to_go[i] += still[i]
    lags(tables, lam, to_go, lag)


@njit
def _delay(tables: OrderTables, lag: Floats, orders: Orders, delay: Floats, r: int, order: int) -> tuple[float, float]:
    """What arm i is late before region r, and what it has to be at least behind it, in this order."""
    i, j = tables.region[r, order, WAITING], tables.region[r, order, LEADING]
    entry, leave = tables.entry[r, order], tables.leave[r, order]
    own, other = 0.0, 0.0
    for q in range(orders.shape[0]):
        if q == r or orders[q] == UNDECIDED:
            continue
        who, there = tables.region[q, orders[q], WAITING], tables.entry[q, orders[q]]
        if who == i and there <= entry:
            own = max(own, delay[q])
        elif who == j and there < leave:
            other = max(other, delay[q])
    return own, other + lag[r, order]


@njit
def settle(tables: OrderTables, lag: Floats, orders: Orders, delay: Floats) -> bool:
    """Fill ``delay`` (R,) [s], of the waiting arm behind each decided region; False if arms wait for each other."""
    delay[:] = 0.0
    for _ in range(2 * orders.shape[0] + 2):
        changed = False
        for r in range(orders.shape[0]):
            order = orders[r]
            if order == UNDECIDED or lag[r, order] == -np.inf:
                continue
            own, least = _delay(tables, lag, orders, delay, r, order)
            if least == np.inf:
                return False
            wait, loss = least - own, tables.restart[r, order]
            late = own if wait <= 0.0 else least + loss * wait / (wait + loss)
            if late > delay[r] + SETTLED:
                delay[r], changed = late, True
        if not changed:
            return True
    return False


@njit
def arrivals(tables: OrderTables, to_go: Floats, orders: Orders, delay: Floats, arrival: Floats) -> None:
    """Fill ``arrival`` (A,), when every arm arrives [s from now]."""
    arrival[:] = to_go
    for r in range(orders.shape[0]):
        if orders[r] != UNDECIDED:
            i = tables.region[r, orders[r], WAITING]
            arrival[i] = max(arrival[i], to_go[i] + delay[r])


@njit
def cost(tables: OrderTables, to_go: Floats, orders: Orders, delay: Floats) -> float:
    """Makespan from now [s], and a little of the mean arrival."""
    arms, last, total = to_go.shape[0], 0.0, 0.0
    for i in range(arms):
        arrival = to_go[i]
        for r in range(orders.shape[0]):
            if orders[r] != UNDECIDED and tables.region[r, orders[r], WAITING] == i:
                arrival = max(arrival, to_go[i] + delay[r])
        last, total = max(last, arrival), total + arrival
    return last + MEAN_SHARE * total / arms  # type: ignore[no-any-return]


@njit
def force(lag: Floats, orders: Orders) -> bool:
    """Put right in ``orders`` (R,) what can be in one way only; False if some region can be in none."""
    for r in range(orders.shape[0]):
        if lag[r, 0] == -np.inf:
            orders[r] = 0
        elif lag[r, 0] == np.inf:
            orders[r] = 1
            if lag[r, 1] == np.inf:
                return False
        elif lag[r, 1] == np.inf:
            orders[r] = 0
    return True


@njit
def price(tables: OrderTables, lag: Floats, to_go: Floats, orders: Orders, forced: Orders, delay: Floats) -> float:
    """The ``cost`` of orders (R,) [s]; infinite where they do not lead on. ``forced`` (R,), ``delay`` (R,): scratch."""
    forced[:] = orders
    if not force(lag, forced):
        return np.inf
    for r in range(orders.shape[0]):
        if lag[r, 0] > -np.inf and forced[r] != orders[r]:
            return np.inf
    if not settle(tables, lag, forced, delay):
        return np.inf
    return cost(tables, to_go, forced, delay)


@njit
def _keep(best: Orders, costs: Floats, count: int, orders: Orders, price: float) -> int:
    """Insert among the best ones, cheapest first; how many there are now."""
    place = min(count, costs.shape[0] - 1)
    if count == costs.shape[0] and price >= costs[place]:
        return count
    while place > 0 and costs[place - 1] > price:
        best[place], costs[place] = best[place - 1], costs[place - 1]
        place -= 1
    best[place], costs[place] = orders, price
    return min(count + 1, costs.shape[0])  # type: ignore[no-any-return]


@njit
def search(
    tables: OrderTables, lag: Floats, to_go: Floats, nodes: Orders, delay: Floats, best: Orders, costs: Floats
) -> int:
    """Branch and bound, depth first: fill the ``best`` (K, R) orders and their ``costs`` (K,) [s]; returns how many.

    Orders of some regions alone bound from below what all of them cost. The region whose better order still means the
    longest wait is decided next; where none of the undecided ones means one, all are, each in the order without.

    Args:
        tables: Of the cell.
        lag: As of ``lags``.
        to_go: (A,) what every arm still needs at full speed, standing included [s].
        nodes: (NODES, R) scratch.
        delay: (R,) scratch.
        best: (K, R) out.
        costs: (K,) out.
    """
    R, count, used = nodes.shape[1], 0, 0
    nodes[0] = UNDECIDED
    depth = 1 if force(lag, nodes[0]) else 0
    while depth > 0 and used < NODES:
        depth -= 1
        used += 1
        orders = nodes[depth]
        if not settle(tables, lag, orders, delay):
            continue
        price = cost(tables, to_go, orders, delay)
        if count == costs.shape[0] and price >= costs[count - 1]:
            continue
        hardest, most, side = -1, 0.0, 0
        for r in range(R):
            if orders[r] == UNDECIDED:
                own_a, least_a = _delay(tables, lag, orders, delay, r, 0)
                own_b, least_b = _delay(tables, lag, orders, delay, r, 1)
                wait = min(least_a - own_a, least_b - own_b)
                if wait > most:
                    hardest, most, side = r, wait, int(least_b - own_b < least_a - own_a)
        if hardest < 0:
            for r in range(R):
                if orders[r] == UNDECIDED:
                    own, least = _delay(tables, lag, orders, delay, r, 0)
                    orders[r] = 0 if least <= own else 1
            if settle(tables, lag, orders, delay):
                count = _keep(best, costs, count, orders, cost(tables, to_go, orders, delay))
            continue
        if depth + 2 > nodes.shape[0]:
            continue
        nodes[depth + 1] = nodes[depth]
        nodes[depth, hardest], nodes[depth + 1, hardest] = 1 - side, side  # the last one is looked at first
        depth += 2
    return count
