"""Compiled: the best order of passing, searched and decided anew while the arms move; and who holds back at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._foresight import run_ahead
from armtempo.envs.coordination.shield._kernels import Orders, ShieldTables, ShieldWork
from armtempo.envs.coordination.shield._stops_seen import UNDECIDED_YET, StopsSeen, look, still_standing
from armtempo.envs.coordination.shield._turning import keep_orders
from armtempo.envs.coordination.world import Episodes, World, length_of
from armtempo.planners import CoordinationCell
from armtempo.planners.coordination.kernels import NODES, OrderTables, fill_lags, fill_times, price, search
from armtempo.robots import njit, unlocked

DECIDE_EVERY = 10  # control periods, unless an arm comes to stand or goes again
BETTER_SHARE = 0.02  # of the time that is left: another order must be better by so much
ORDERS_KEPT = 8  # of a search
SAME_PRICE = 1e-9  # [s]
HOLD_SHARES = (0.9, 0.6, 0.3)  # of the time that arms at rest will lose on their way, for which they hold back instead


class OrderWork(NamedTuple):
    """Scratch of one thread."""

    lag: Floats  # (R, 2)
    delay: Floats  # (R,)
    forced: Orders  # (R,)
    nodes: Orders  # (NODES, R)
    best: Orders  # (ORDERS_KEPT, R)
    costs: Floats  # (ORDERS_KEPT,)
    held: Orders  # (2, R) the order that holds, and one that is run ahead
    to_go: Floats  # (A,)
    still: Floats  # (A,)
    arrival: Floats  # (2, A)
    places: Floats  # (2, A) places and speeds of arms that are run ahead
    holds: Floats  # (2, A)


def order_work(cell: CoordinationCell, regions: int) -> OrderWork:
    """Scratch for one thread."""
    arms = len(cell.arms)
    return OrderWork(
        lag=np.zeros((regions, 2)), delay=np.zeros(regions), forced=np.zeros(regions, dtype=np.int8),
        nodes=np.zeros((NODES, regions), dtype=np.int8), best=np.zeros((ORDERS_KEPT, regions), dtype=np.int8),
        costs=np.zeros(ORDERS_KEPT), held=np.zeros((2, regions), dtype=np.int8), to_go=np.zeros(arms),
        still=np.zeros(arms), arrival=np.zeros((2, arms)), places=np.zeros((2, arms)), holds=np.zeros((2, arms)),
    )  # fmt: skip


@njit
def best_order(
    world: World, tables: ShieldTables, prices: OrderTables, lam: Floats, mu: Floats, still: Floats, first: bool,
    scripted: Bools, uncertain: Bools, ticks: int, orders: Orders, asked: Orders, own: OrderWork, work: ShieldWork,
) -> None:  # fmt: skip
    """Keep to the cheapest order (see ``OrderSearch``) that leads on and can be had, where it is enough cheaper.

    Args:
        world: The cell.
        tables: Its regions.
        prices: The same, in time.
        lam: (A,) places.
        mu: (A,) path speeds.
        still: (A,) for how long each arm stands on [s].
        first: Any cheaper order will do.
        scripted: (A,) as for ``keep_orders``.
        uncertain: (A,) as for ``keep_orders``.
        ticks: Ticks of a control period.
        orders: (R,) that hold, in place.
        asked: (R,) what is asked for, in place.
        own: Scratch.
        work: Scratch.
    """
    fill_lags(prices, lam, mu, still, own.to_go, own.lag)
    enough = price(prices, own.lag, own.to_go, orders, own.forced, own.delay)
    if not first:
        enough *= 1.0 - BETTER_SHARE
    count = search(prices, own.lag, own.to_go, own.nodes, own.delay, own.best, own.costs)
    own.held[0] = orders
    for k in range(count):
        if own.costs[k] >= enough:
            return
        keep_orders(world, tables, orders, own.best[k], lam, mu, scripted, uncertain, ticks, asked, work)
        if price(prices, own.lag, own.to_go, orders, own.forced, own.delay) <= own.costs[k] + SAME_PRICE:
            return
        keep_orders(world, tables, orders, own.held[0], lam, mu, scripted, uncertain, ticks, asked, work)


@njit
def redecide(
    world: World, tables: ShieldTables, prices: OrderTables, seen: StopsSeen, episodes: Episodes, e: int,
    changed: bool, expected: float, scripted: Bools, uncertain: Bools, ticks: int, orders: Orders, asked: Orders,
    own: OrderWork, work: ShieldWork,
) -> None:  # fmt: skip
    """``best_order`` of episode e when it begins, when ``changed``, and every ``DECIDE_EVERY`` control periods.

    ``expected``: how long a stop lasts before one was seen [s]; 0: arms that stand are taken to go on at once.
    """
    waited = seen.waited[e]
    if waited != UNDECIDED_YET:
        seen.waited[e] += 1
    if not (changed or waited == UNDECIDED_YET or seen.waited[e] >= DECIDE_EVERY):
        return
    own.still[:] = 0.0
    if expected > 0.0:
        still_standing(seen, e, episodes.ticks[e] * world.tick, expected, ticks * world.tick, own.still)
    best_order(
        world, tables, prices, episodes.lam[e], episodes.mu[e], own.still, waited == UNDECIDED_YET, scripted,
        uncertain, ticks, orders, asked, own, work,
    )  # fmt: skip
    seen.waited[e] = 0


@unlocked
def look_all(
    world: World, tables: ShieldTables, prices: OrderTables, seen: StopsSeen, episodes: Episodes, first: int,
    last: int, active: Bools, decides: bool, expected: float, scripted: Bools, uncertain: Bools, ticks: int,
    orders: Orders, asked: Orders, own: OrderWork, work: ShieldWork,
) -> bool:  # fmt: skip
    """See what can be seen of the active ones of episodes first..last - 1 after a control period; decide their orders.

    Returns whether an arm of the last one came to stand or went again.
    """
    changed = False
    for e in range(first, last):
        if active[e]:
            changed = look(world, seen, episodes, e, ticks)
            if decides:
                redecide(
                    world, tables, prices, seen, episodes, e, changed, expected, scripted, uncertain[e], ticks,
                    orders[e], asked[e], own, work,
                )  # fmt: skip
    return changed


@njit
def hold_back(
    world: World, tables: ShieldTables, prices: OrderTables, lam: Floats, mu: Floats, still: Floats, orders: Orders,
    scripted: Bools, uncertain: Bools, ticks: int, longest: float, holds: Floats, own: OrderWork, work: ShieldWork,
) -> None:  # fmt: skip
    """Fill ``holds`` (A,): for how long arms at rest wait where they are, instead of on their way [s].

    As much of the time that they will lose behind others as is quickest when all is run ahead under the shield,
    ``longest`` [s] at most; none of it where that is. One at least of the arms on their way does not wait.
    """
    arms, period = lam.shape[0], ticks * world.tick
    holds[:] = 0.0
    fill_times(prices, lam, mu, own.to_go)
    best = _makespan(world, tables, orders, lam, mu, still, scripted, uncertain, ticks, longest, own, work)
    late, most, least = own.arrival[1], 0.0, np.inf
    for i in range(arms):
        at_rest = mu[i] == 0.0 and still[i] == 0.0
        late[i] = max(own.arrival[0, i] - own.to_go[i], 0.0) if at_rest and own.arrival[0, i] < np.inf else 0.0
        if lam[i] < length_of(world, i):
            least = min(least, late[i])
        else:
            late[i] = 0.0
    for i in range(arms):  # where nobody moves, what all wait is lost
        late[i] = max(late[i] - least, 0.0)
        most = max(most, late[i])
    if most <= period:
        return
    for share in HOLD_SHARES:
        for i in range(arms):
            own.holds[1, i] = max(share * late[i], still[i])
        makespan = _makespan(world, tables, orders, lam, mu, own.holds[1], scripted, uncertain, ticks, best, own, work)
        if makespan < best:
            best = makespan
            for i in range(arms):
                holds[i] = share * late[i]


@njit
def _makespan(
    world: World, tables: ShieldTables, orders: Orders, lam: Floats, mu: Floats, stands: Floats, scripted: Bools,
    uncertain: Bools, ticks: int, horizon: float, own: OrderWork, work: ShieldWork,
) -> float:  # fmt: skip
    """Makespan of arms that stand first and then go at full speed [s]; inf beyond the horizon."""
    own.held[1], own.places[0], own.places[1] = orders, lam, mu
    run_ahead(
        world, tables, own.held[1], own.places[0], own.places[1], stands, scripted, uncertain, ticks, horizon,
        own.arrival[0], work,
    )  # fmt: skip
    return own.arrival[0].max()  # type: ignore[no-any-return]


@unlocked
def hold_back_all(
    world: World, tables: ShieldTables, prices: OrderTables, seen: StopsSeen, episodes: Episodes, first: int,
    last: int, active: Bools, expected: float, scripted: Bools, uncertain: Bools, ticks: int, orders: Orders,
    longest: float, holds: Floats, own: OrderWork, work: ShieldWork,
) -> None:  # fmt: skip
    """``hold_back`` for the active ones of episodes first..last - 1: ``holds`` (E, A)."""
    for e in range(first, last):
        if active[e]:
            still_standing(seen, e, episodes.ticks[e] * world.tick, expected, ticks * world.tick, own.still)
            hold_back(
                world, tables, prices, episodes.lam[e], episodes.mu[e], own.still, orders[e], scripted, uncertain[e],
                ticks, longest, holds[e], own, work,
            )  # fmt: skip
