"""Which arm passes first in every region, decided while they move: the best orders from where the arms are now."""

from __future__ import annotations

from collections.abc import Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats
from armtempo.planners.coordination._arm_orders import arm_orders
from armtempo.planners.coordination._order_kernels import (
    NODES,
    ORDER_COLUMNS,
    PLACES,
    SETTLED,
    OrderTables,
    fill_times,
    force,
    lags,
    price,
    search,
)
from armtempo.planners.coordination._passing_orders import Orders, PassingOrders
from armtempo.planners.topp import PhasePlane
from armtempo.planners.topp.kernels import advance

RANKS_ALL_TRIED = 6  # arms, of which all orders of arms are tried
ANY_TIME = 1e6  # [s]: more than an arm needs
RESTART_SHARE = 0.5  # of what starting again costs, that a wait costs at most


@final
class OrderSearch:
    """Orders of passing of several arms, priced in their own minimum-time clocks.

    The price is the time until the last arm arrives if all run at full speed and wait only where the order says so; it
    is an estimate (arms that wait are taken to lose half of a start from rest), exact where nobody waits. It is not a
    bound. Whether arms can still stop where they would have to is not asked: the shield knows.

    Args:
        regions: Where two arms can meet.
        planes: One per arm.
        kept: How many of the best orders are kept.
    """

    def __init__(self, regions: PassingOrders, planes: Sequence[PhasePlane], *, kept: int = 8) -> None:
        self.regions = regions
        self._tables = order_tables(regions, planes)
        R = len(regions.regions)
        self._lag, self._delay, self._forced = np.zeros((R, 2)), np.zeros(R), np.zeros(R, dtype=np.int8)
        self._nodes = np.zeros((NODES, R), dtype=np.int8)
        self._best, self._costs = np.zeros((kept, R), dtype=np.int8), np.zeros(kept)

    def times_to_go(self, lam: Floats, mu: Floats) -> Floats:
        """(A,) what every arm needs to its end at full speed from places and path speeds (A,) [s]."""
        to_go = np.zeros(len(lam))
        fill_times(self._tables, lam, mu, to_go)
        return to_go

    def price(self, lam: Floats, to_go: Floats, orders: Orders) -> float:
        """What ``orders`` (R,) cost from ``lam`` (A,) on [s]; infinite where they do not lead on."""
        lags(self._tables, lam, to_go, self._lag)
        return self._price(to_go, np.asarray(orders, dtype=np.int8))

    def _price(self, to_go: Floats, orders: Orders) -> float:
        return float(price(self._tables, self._lag, to_go, orders, self._forced, self._delay))

    def best(self, lam: Floats, to_go: Floats) -> tuple[NDArray[np.int8], Floats]:
        """The best orders (K, R) from ``lam`` (A,) on and their prices (K,) [s], the cheapest first; K may be 0."""
        lags(self._tables, lam, to_go, self._lag)
        count = search(self._tables, self._lag, to_go, self._nodes, self._delay, self._best, self._costs)
        return self._best[:count].copy(), self._costs[:count].copy()

    def best_ranks(self, lam: Floats, to_go: Floats) -> tuple[NDArray[np.int8], Floats]:
        """As ``best``, of the orders in which one arm is before another wherever it can be."""
        lags(self._tables, lam, to_go, self._lag)
        found: dict[bytes, tuple[float, Orders]] = {}
        for rank in arm_orders(to_go.tolist(), RANKS_ALL_TRIED):
            orders = self.regions.of_ranks(rank)
            if not force(self._lag, orders):
                break
            if orders.tobytes() not in found:
                found[orders.tobytes()] = (self._price(to_go, orders), orders)
        good = sorted((one for one in found.values() if np.isfinite(one[0])), key=lambda one: one[0])
        good = good[: len(self._best)]
        shape = (len(good), len(self.regions.regions))
        return np.array([orders for _, orders in good], dtype=np.int8).reshape(shape), np.array([p for p, _ in good])

    def turned(self, lam: Floats, to_go: Floats, starts: Sequence[Orders]) -> tuple[NDArray[np.int8], Floats]:
        """As ``best``: the cheapest of ``starts`` (R,), then with one region after the other turned while that pays."""
        lags(self._tables, lam, to_go, self._lag)
        found = [min(((self._price(to_go, row), row) for row in starts), key=lambda one: one[0])]
        while True:
            tried = []
            for r in np.flatnonzero(np.isfinite(self._lag).all(axis=1)):
                turned = found[-1][1].copy()
                turned[r] = 1 - turned[r]
                tried.append((self._price(to_go, turned), turned))
            best = min(tried, key=lambda one: one[0], default=found[-1])
            if not best[0] < found[-1][0]:
                break
            found.append(best)
        found.reverse()
        return np.array([row for _, row in found], dtype=np.int8), np.array([price for price, _ in found])


def order_tables(regions: PassingOrders, planes: Sequence[PhasePlane]) -> OrderTables:
    """What compiled loops need of a cell's regions to price orders."""
    lengths, fastest = np.array(regions.lengths), [plane.fastest() for plane in planes]
    go, speed = np.zeros((len(planes), 2, PLACES)), np.zeros((len(planes), PLACES))
    for i, (plane, motion) in enumerate(zip(planes, fastest, strict=True)):
        places = np.linspace(0.0, lengths[i], PLACES)
        times = motion.time_at(places)
        go[i, 0], speed[i] = motion.duration - times, motion.at(times)[1]
        go[i, 1] = [_from_rest(plane, float(place)) for place in places]
    R = len(regions.regions)
    region = np.zeros((R, 2, ORDER_COLUMNS), dtype=np.int64)
    entry, leave, restart = np.zeros((R, 2)), np.zeros((R, 2)), np.zeros((R, 2))
    possible = np.zeros((R, 2), dtype=np.bool_)
    limits, worst, offset = [np.zeros(0)], [np.zeros(0)], 0
    for r, (a, b, own) in enumerate(regions.regions):
        for order, (i, j, first, limit) in enumerate(
            ((b, a, own.begin_a, own.limit_b), (a, b, own.begin_b, own.limit_a))
        ):
            count = len(limit)
            region[r, order] = i, j, first, count, offset, own.resolution
            ends = (first + 1 + np.arange(count)) * (lengths[j] / own.resolution)
            to_limit = fastest[i].duration - fastest[i].time_at(limit)
            late = to_limit - fastest[j].duration + fastest[j].time_at(np.minimum(ends, lengths[j]))
            limits.append(limit)
            worst.append(np.maximum.accumulate(late[::-1])[::-1])
            offset += count
            entry[r, order], leave[r, order] = limit[0], ends[-1]
            loss = _from_rest(planes[i], float(limit[0])) - float(to_limit[0])
            restart[r, order] = RESTART_SHARE * max(loss, SETTLED)
            possible[r, order] = limit[0] > 0.0 and first + count < own.resolution
    return OrderTables(
        region=region,
        limit=np.concatenate(limits),
        worst=np.concatenate(worst),
        entry=entry,
        leave=leave,
        restart=restart,
        possible=possible,
        length=lengths,
        go=go,
        fastest=speed,
    )


def _from_rest(plane: PhasePlane, lam: float) -> float:
    """What an arm needs to its end at full speed from rest at ``lam`` [s]."""
    none = np.empty(0)
    return float(advance(plane.edges.steps, lam, 0.0, 1.0, True, ANY_TIME, 1, none, none, 1.0)[2])
