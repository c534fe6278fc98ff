r"""Compiled loops of the joint refinement: all arms' ``x = mu^2`` at their stations, one arm after the other.

Between two stations ``x`` is linear, so an interval of length D takes ``2 D / (sqrt(x) + sqrt(x'))``: convex. Limits
are rows ``low <= a (x' - x) + b x + r sqrt(x) <= high`` at either end. Every row couples two neighbours: the Newton
matrix of an arm is tridiagonal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.robots import inlined, njit

A, B, R, LOW, HIGH = range(5)  # columns of the rows of a chain


class Chain(NamedTuple):
    """All arms' stations, one arm after the other.

    ``rows`` (S, 2, J, 5): of the interval that begins at a station, the limits at either end, ``a`` over twice the
    length; all over half their width. ``first`` (A+1,): where each arm begins. The first and the last of an arm are
    fixed, and ``x`` at stops and in dwells.
    """

    station: Floats  # (S,)
    first: Ints
    rows: Floats
    cap: Floats  # (S,) of x
    fixed: Bools  # (S,)


class Places(NamedTuple):
    """Places at which the clock of an arm is read, rising along each arm: (P,) station before, way from there."""

    first: Ints  # (A+1,) where each arm's places begin
    station: Ints
    way: Floats


@inlined
def _value(row: Floats, x: float, x_next: float, here: float) -> float:
    value = row[A] * (x_next - x) + row[B] * here
    return float(value + row[R] * np.sqrt(here) if row[R] != 0.0 else value)


@njit
def room(chain: Chain, x: Floats, slack: Floats, bounds: Floats) -> float:
    """Fill what every row has left, ``slack`` (S, 2, J, 2) and ``bounds`` (S, 2); returns the least of all."""
    least = np.inf
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        for s in range(begin, last):
            for e in range(2):
                for j in range(chain.rows.shape[2]):
                    row = chain.rows[s, e, j]
                    value = _value(row, x[s], x[s + 1], x[s + e])
                    slack[s, e, j, 0], slack[s, e, j, 1] = value - row[LOW], row[HIGH] - value
                    least = min(least, slack[s, e, j, 0], slack[s, e, j, 1])
            if not chain.fixed[s]:
                bounds[s, 0], bounds[s, 1] = x[s], chain.cap[s] - x[s]
                least = min(least, bounds[s, 0], bounds[s, 1])
    return least


@njit
def read_clocks(chain: Chain, places: Places, x: Floats, time: Floats) -> None:
    """Fill the time (P,) at which each place is passed, if its arm starts at 0."""
    for arm in range(chain.first.shape[0] - 1):
        s, clock = chain.first[arm], 0.0
        for p in range(places.first[arm], places.first[arm + 1]):
            while s < places.station[p]:
                clock += 2.0 * (chain.station[s + 1] - chain.station[s]) / (np.sqrt(x[s]) + np.sqrt(x[s + 1]))
                s += 1
            way = places.way[p]
            share = way / (chain.station[s + 1] - chain.station[s])  # of the last interval exactly 1
            there = max(x[s] + share * (x[s + 1] - x[s]), 0.0)
            time[p] = clock + 2.0 * way / (np.sqrt(x[s]) + np.sqrt(there)) if way > 0.0 else clock


@inlined
def _slopes(way: float, share: float, x: float, x_next: float) -> tuple[float, float]:
    """How the time over the first ``way`` of an interval, that ``share`` of it, changes with x at its ends."""
    there = max(x + share * (x_next - x), 0.0)
    root, far = np.sqrt(x), np.sqrt(there)
    pace = (root + far) ** 2
    near = way / (pace * root) if root > 0.0 else 0.0  # where it is 0 it is fixed
    beyond = way / (pace * far) if far > 0.0 else 0.0
    return -near - (1.0 - share) * beyond, -share * beyond


@njit
def slopes(chain: Chain, places: Places, x: Floats, slope: Floats, ends: Floats) -> None:
    """Fill how times change with ``x`` at each station (S, 2): of the interval that ends there, that begins there.

    ``ends`` (P, 2): of the part of an interval up to a place, with x at both ends of the interval.
    """
    slope[:] = 0.0
    for arm in range(chain.first.shape[0] - 1):
        for s in range(chain.first[arm], chain.first[arm + 1] - 1):
            length = chain.station[s + 1] - chain.station[s]
            slope[s, 1], slope[s + 1, 0] = _slopes(length, 1.0, float(x[s]), float(x[s + 1]))
        for s in range(chain.first[arm], chain.first[arm + 1]):
            if chain.fixed[s]:
                slope[s] = 0.0
        for p in range(places.first[arm], places.first[arm + 1]):
            s, way = places.station[p], places.way[p]
            share = way / (chain.station[s + 1] - chain.station[s])
            ends[p, 0], ends[p, 1] = _slopes(way, share, float(x[s]), float(x[s + 1]))
            if chain.fixed[s]:
                ends[p, 0] = 0.0
            if chain.fixed[s + 1]:
                ends[p, 1] = 0.0


@njit
def assemble(
    chain: Chain,
    places: Places,
    x: Floats,
    slack: Floats,
    bounds: Floats,
    z: Floats,
    z_bounds: Floats,
    mu: float,
    weight: Floats,
    prudence: float,
    diagonal: Floats,
    beside: Floats,
    gradient: Floats,
) -> None:
    """Fill the tridiagonal Newton matrix and the gradient (S,) of the rows' barrier.

    ``weight`` (P,): what the Lagrangian gains with the time at each place; intervals before it that weigh less than
    nothing (they should take longer) have no curvature here, which keeps the matrix positive. ``prudence`` is the
    price of relative changes of ``x``.
    """  # fmt: skip
    diagonal[:], beside[:], gradient[:] = 0.0, 0.0, 0.0
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        p, weighs = places.first[arm + 1] - 1, 0.0
        for s in range(last - 1, begin - 1, -1):
            length = chain.station[s + 1] - chain.station[s]
            while p >= places.first[arm] and places.station[p] > s:
                weighs += weight[p]
                p -= 1
            here = weighs
            q = p
            while q >= places.first[arm] and places.station[q] == s:
                here += weight[q] * places.way[q] / length
                q -= 1
            if here > 0.0:
                root, after = np.sqrt(x[s]), np.sqrt(x[s + 1])
                pace = root + after
                w = here * length / (pace * pace)
                if root > 0.0:
                    diagonal[s] += w * (1.0 / (pace * x[s]) + 0.5 / (x[s] * root))
                if after > 0.0:
                    diagonal[s + 1] += w * (1.0 / (pace * x[s + 1]) + 0.5 / (x[s + 1] * after))
                if root > 0.0 and after > 0.0:
                    beside[s] += w / (pace * root * after)
            for e in range(2):
                for j in range(chain.rows.shape[2]):
                    row = chain.rows[s, e, j]
                    low, high = slack[s, e, j, 0], slack[s, e, j, 1]
                    stiff = z[s, e, j, 0] / low + z[s, e, j, 1] / high
                    force = mu / high - mu / low
                    own = row[B]
                    if row[R] != 0.0 and x[s + e] > 0.0:
                        own += 0.5 * row[R] / np.sqrt(x[s + e])
                    g, g_next = -row[A], row[A]
                    if e == 0:
                        g += own
                    else:
                        g_next += own
                    diagonal[s] += stiff * g * g
                    diagonal[s + 1] += stiff * g_next * g_next
                    beside[s] += stiff * g * g_next
                    gradient[s] += force * g
                    gradient[s + 1] += force * g_next
            if not chain.fixed[s]:
                diagonal[s] += z_bounds[s, 0] / bounds[s, 0] + z_bounds[s, 1] / bounds[s, 1] + prudence / (x[s] * x[s])
                gradient[s] += mu / bounds[s, 1] - mu / bounds[s, 0]
        for s in range(begin, last + 1):
            if chain.fixed[s]:
                diagonal[s], gradient[s] = 1.0, 0.0
                beside[s] = 0.0
                beside[max(s - 1, begin)] = 0.0


@njit
def factor(chain: Chain, diagonal: Floats, beside: Floats) -> None:
    """Turn tridiagonal matrices into their factors L D L' in place: D in ``diagonal``, L in ``beside``."""
    for arm in range(chain.first.shape[0] - 1):
        for s in range(chain.first[arm], chain.first[arm + 1] - 1):
            lower = beside[s] / diagonal[s]
            diagonal[s + 1] -= lower * beside[s]
            beside[s] = lower


@njit
def _solve(begin: int, last: int, diagonal: Floats, beside: Floats, value: Floats) -> None:
    for s in range(begin, last):
        value[s + 1] -= beside[s] * value[s]
    for s in range(begin, last + 1):
        value[s] /= diagonal[s]
    for s in range(last - 1, begin - 1, -1):
        value[s] -= beside[s] * value[s + 1]


@njit
def condense(
    chain: Chain,
    places: Places,
    diagonal: Floats,
    beside: Floats,
    slope: Floats,
    ends: Floats,
    value: Floats,
    compliance: Floats,
) -> None:
    """Fill how the time at place p answers a unit of force at place q, ``compliance`` (P+1, P+1).

    Its last column: how it answers ``value`` (S,).
    """  # fmt: skip
    total = places.station.shape[0]
    answer = np.empty(chain.station.shape[0])
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        for q in range(places.first[arm], places.first[arm + 1] + 1):
            column = q
            if q == places.first[arm + 1]:
                answer[begin : last + 1] = value[begin : last + 1]
                column = total
            else:
                answer[begin : last + 1] = 0.0
                at = places.station[q]
                for s in range(begin, at):
                    answer[s] = slope[s, 0] + slope[s, 1]
                answer[at] = slope[at, 0] + ends[q, 0]
                answer[at + 1] = ends[q, 1]
            _solve(begin, last, diagonal, beside, answer)
            s, done = begin, 0.0
            for p in range(places.first[arm], places.first[arm + 1]):
                at = places.station[p]
                while s < at:
                    done += (slope[s, 0] + slope[s, 1]) * answer[s]
                    s += 1
                compliance[p, column] = done + (slope[at, 0] + ends[p, 0]) * answer[at] + ends[p, 1] * answer[at + 1]


@njit
def back_substitute(
    chain: Chain,
    places: Places,
    diagonal: Floats,
    beside: Floats,
    slope: Floats,
    ends: Floats,
    force: Floats,
    value: Floats,
) -> None:
    """Turn ``value`` (S,) into the step: minus the solution for it and the forces (P,) at all places."""  # fmt: skip
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        p, pull = places.first[arm + 1] - 1, 0.0
        for s in range(last, begin - 1, -1):
            while p >= places.first[arm] and places.station[p] == s:
                value[s] += force[p] * (slope[s, 0] + ends[p, 0])
                value[s + 1] += force[p] * ends[p, 1]
                pull += force[p]
                p -= 1
            # places from here on are behind the station: the intervals on both sides count
            early = pull
            q = p + 1
            while q < places.first[arm + 1] and places.station[q] == s:
                early -= force[q]
                q += 1
            value[s] += early * (slope[s, 0] + slope[s, 1])
        _solve(begin, last, diagonal, beside, value)
        for s in range(begin, last + 1):
            value[s] = -value[s]


@njit
def step_rows(
    chain: Chain,
    x: Floats,
    dx: Floats,
    slack: Floats,
    bounds: Floats,
    z: Floats,
    z_bounds: Floats,
    mu: float,
    dz: Floats,
    dz_bounds: Floats,
) -> tuple[float, float]:
    """Fill the steps of the rows' multipliers; returns the longest of ``x`` and of those that keep all above 0."""
    shrink, shrink_z = 0.0, 0.0  # the fastest relative fall
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        for s in range(begin, last):
            for e in range(2):
                for j in range(chain.rows.shape[2]):
                    row = chain.rows[s, e, j]
                    change = row[A] * (dx[s + 1] - dx[s]) + row[B] * dx[s + e]
                    if row[R] != 0.0 and x[s + e] > 0.0:
                        change += 0.5 * row[R] / np.sqrt(x[s + e]) * dx[s + e]
                    for side in range(2):
                        left = slack[s, e, j, side]
                        if left < np.inf:
                            fall = (change if side == 1 else -change) / left
                            own = z[s, e, j, side]
                            dz[s, e, j, side] = mu / left - own + own * fall
                            shrink = max(shrink, fall)
                            shrink_z = max(shrink_z, -dz[s, e, j, side] / own)
            if not chain.fixed[s]:
                for side in range(2):
                    left = bounds[s, side]
                    if left < np.inf:
                        fall = (dx[s] if side == 1 else -dx[s]) / left
                        own = z_bounds[s, side]
                        dz_bounds[s, side] = mu / left - own + own * fall
                        shrink = max(shrink, fall)
                        shrink_z = max(shrink_z, -dz_bounds[s, side] / own)
    return 1.0 / shrink if shrink > 0.0 else np.inf, 1.0 / shrink_z if shrink_z > 0.0 else np.inf


@njit
def log_sum(chain: Chain, slack: Floats, bounds: Floats) -> float:
    """The sum of logarithms of all that is bounded."""
    total = 0.0
    for arm in range(chain.first.shape[0] - 1):
        begin, last = chain.first[arm], chain.first[arm + 1] - 1
        for s in range(begin, last):
            product = 1.0
            for e in range(2):
                for j in range(chain.rows.shape[2]):
                    for side in range(2):
                        if slack[s, e, j, side] < np.inf:
                            product *= slack[s, e, j, side]
                total += np.log(product)
                product = 1.0
            if not chain.fixed[s]:
                total += np.log(bounds[s, 0])
                if bounds[s, 1] < np.inf:
                    total += np.log(bounds[s, 1])
    return total


@njit
def complementarity(room: Floats, bounds: Floats, z: Floats, z_bounds: Floats) -> tuple[float, int]:
    """The sum of what is left of rows and ``x`` times its multiplier, and how many there are."""
    total, count = 0.0, 0
    for s in range(bounds.shape[0]):
        for e in range(2):
            for j in range(room.shape[2]):
                for side in range(2):
                    if room[s, e, j, side] < np.inf:
                        total += room[s, e, j, side] * z[s, e, j, side]
                        count += 1
        for side in range(2):
            if bounds[s, side] < np.inf:
                total += bounds[s, side] * z_bounds[s, side]
                count += 1
    return total, count
