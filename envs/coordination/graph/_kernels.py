"""Compiled: the graphs of many episodes, in the order of ``NODE_ENTRIES`` and ``EDGE_ENTRIES``."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats32
from armtempo.envs.coordination.graph._entries import EDGE_ENTRIES, LONGEST, NODE_ENTRIES
from armtempo.envs.coordination.shield import NOBODY_WAITS, Orders, OrderWork, StopsSeen, still_standing
from armtempo.envs.coordination.world import Episodes, World, length_of, steps_of
from armtempo.planners.coordination.kernels import (
    WAITING,
    OrderTables,
    arrivals,
    fill_lags,
    settle,
    time_to_go,
)
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit, unlocked

(
    PRESENT, ARRIVED, PROGRESS, SPEED, AT_REST, MINIMUM_TIME, ELAPSED, TIME_TO_GO, DELAY, SLACK, NEXT_DELAY, NEXT_WAIT,
    RESTART, STANDS, UNCHANGED, EXPECTED_REST, STOPS, RESTED, OBEYED,
) = range(len(NODE_ENTRIES))  # fmt: skip
AHEAD, REGIONS, FIRST, OPEN, WAIT, LEAD, ENTRY, EXIT, TAIL, LATE = range(len(EDGE_ENTRIES))
STOPS_TOLD, REGIONS_TOLD = 4.0, 8.0  # of which there are told as many at most
WAITS = 1e-6  # [s]: what is less is none


@njit
def _told(time: float, unit: float) -> float:
    """A time in units, as far as it is told."""
    return min(max(time / unit, -LONGEST), LONGEST)


@njit
def _fill_nodes(
    world: World, prices: OrderTables, seen: StopsSeen, episodes: Episodes, e: int, orders: Orders, unit: float,
    own: OrderWork, nodes: Floats32,
) -> None:  # fmt: skip
    """The arms of episode e; ``own`` as ``fill_graphs`` has filled it."""
    now, arrival = episodes.ticks[e] * world.tick, own.arrival[0]
    last = arrival.max()
    for i in range(arrival.shape[0]):
        steps, node = steps_of(world, i), nodes[i]
        lam, mu, end = episodes.lam[e, i], episodes.mu[e, i], length_of(world, i)
        k = phase_kernels.interval_at(steps, lam)
        begin, stop = steps[k, phase_kernels.STATION], steps[k + 1, phase_kernels.STATION]
        edge = np.sqrt(max(phase_kernels.upper_edge(steps, k, (lam - begin) / (stop - begin)), 0.0))
        loss = time_to_go(prices, i, lam, 0.0) - time_to_go(prices, i, lam, 1.0)
        node[PRESENT], node[ARRIVED], node[PROGRESS] = 1.0, 1.0 if lam >= end else 0.0, min(lam / end, 1.0)
        node[SPEED], node[AT_REST] = min(mu / edge, 1.0) if edge > 0.0 else 0.0, 1.0 if mu <= 0.0 else 0.0
        node[MINIMUM_TIME], node[ELAPSED] = world.scale[i, 0] / unit, _told(now, unit)
        node[TIME_TO_GO] = _told(own.to_go[i], unit)
        node[DELAY], node[SLACK] = _told(arrival[i] - own.to_go[i], unit), _told(last - arrival[i], unit)
        node[RESTART] = _told(max(loss, 0.0), unit)
        node[STANDS], node[UNCHANGED] = 1.0 if seen.stands[e, i] else 0.0, _told(now - seen.since[e, i], unit)
        node[EXPECTED_REST], node[RESTED] = _told(own.still[i], unit), _told(seen.rested[e, i], unit)
        node[STOPS], node[OBEYED] = min(seen.stops[e, i] / STOPS_TOLD, 1.0), seen.obeyed[e, i]
        nearest, late = np.inf, 0.0
        for r in range(orders.shape[0]):
            if orders[r] == NOBODY_WAITS or own.lag[r, orders[r]] == -np.inf or own.delay[r] <= WAITS:
                continue
            if prices.region[r, orders[r], WAITING] == i and prices.entry[r, orders[r]] < nearest:
                nearest, late = prices.entry[r, orders[r]], own.delay[r]
        node[NEXT_DELAY], node[NEXT_WAIT] = _told(late, unit), LONGEST
        if nearest < np.inf:
            node[NEXT_WAIT] = _told(max(own.to_go[i] - time_to_go(prices, i, nearest, 1.0), 0.0), unit)


@njit
def _fill_edges(prices: OrderTables, orders: Orders, unit: float, own: OrderWork, edges: Floats32) -> None:
    """The pairs; ``own`` as ``fill_graphs`` has filled it."""
    for r in range(orders.shape[0]):
        if own.lag[r, 0] == -np.inf:  # behind them
            continue
        for order in range(2):
            i, j = prices.region[r, order, WAITING], prices.region[r, 1 - order, WAITING]
            edge, entry, leave = edges[i, j], prices.entry[r, order], prices.leave[r, 1 - order]
            edge[REGIONS] = min(edge[REGIONS] + 1.0 / REGIONS_TOLD, 1.0)
            until = _told(own.to_go[i] - time_to_go(prices, i, entry, 1.0), unit)
            if edge[AHEAD] > 0.0 and edge[ENTRY] <= until:
                continue
            waits, leads = own.lag[r, order], own.lag[r, 1 - order]
            tail = time_to_go(prices, i, leave, 1.0)
            edge[AHEAD], edge[ENTRY] = 1.0, until
            edge[EXIT], edge[TAIL] = _told(own.to_go[i] - tail, unit), _told(tail, unit)
            edge[FIRST] = 0.0 if orders[r] == NOBODY_WAITS else -1.0 if orders[r] == order else 1.0
            edge[OPEN] = 1.0 if waits < np.inf and leads < np.inf else 0.0
            edge[WAIT], edge[LEAD], edge[LATE] = _told(waits, unit), _told(leads, unit), _told(own.delay[r], unit)


@unlocked
def fill_graphs(
    world: World, prices: OrderTables, seen: StopsSeen, episodes: Episodes, first: int, last: int, active: Bools,
    orders: Orders, expected: float, unit: float, period: float, own: OrderWork, nodes: Floats32, edges: Floats32,
) -> None:  # fmt: skip
    """Write the graphs of the active ones of episodes first..last - 1.

    Args:
        world: The cell.
        prices: Its regions in time.
        seen: Who stands.
        episodes: E, A arms.
        first: Of the episodes.
        last: Behind them.
        active: (E,).
        orders: (E, R) that hold.
        expected: How long a stop lasts before one was seen [s].
        unit: Of times [s].
        period: Control period [s].
        own: Scratch.
        nodes: (E, GRAPH_ARMS, N) out.
        edges: (E, GRAPH_ARMS, GRAPH_ARMS, K) out: of arm i, the pair (i, j).
    """
    for e in range(first, last):
        if not active[e]:
            continue
        still_standing(seen, e, episodes.ticks[e] * world.tick, expected, period, own.still)
        fill_lags(prices, episodes.lam[e], episodes.mu[e], own.still, own.to_go, own.lag)
        if not settle(prices, own.lag, orders[e], own.delay):
            own.delay[:] = 0.0
        arrivals(prices, own.to_go, orders[e], own.delay, own.arrival[0])
        nodes[e], edges[e] = 0.0, 0.0
        _fill_nodes(world, prices, seen, episodes, e, orders[e], unit, own, nodes[e])
        _fill_edges(prices, orders[e], unit, own, edges[e])
