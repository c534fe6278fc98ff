r"""Compiled branch and bound over who passes first in every collision region; see ``_joint_bound`` for what it means.

A node of the search decides some of the regions. Its value is the makespan of the earliest times that its difference
constraints allow: a longest path, worked out by letting every arm go on as far as the others' times are known. What
remains when nobody can go on waits in a circle.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats, Ints
from armtempo.robots import njit

Sides = NDArray[np.int8]

UNDECIDED_SIDE = np.int8(-1)
LEAF = -1  # in place of the region to decide next


class Events(NamedTuple):
    """Places of all arms at which something is asked, arm after arm, and what is asked there."""

    first: Ints
    """(A+1,) the first place of each arm; each has its start and its end."""
    theta: Floats
    """(P,) the arm's own clock there [s]."""
    begin: Ints
    """(P+1,) demands ``begin[p] : begin[p + 1]`` are made at place p: of the arm that enters something there."""
    region: Ints
    """(D,) of which region,"""
    side: Sides
    """(D,) if it is passed on which side, and"""
    left: Ints
    """(D,) which place the other arm must have reached before."""
    of_region: Ints
    """(R+1,) demands of region r are ``listed[of_region[r] : of_region[r + 1]]``."""
    listed: Ints
    """(D,)"""
    entered: Ints
    """(D,) the place at which a demand is made."""
    arm_of: Ints
    """(P,) whose place it is."""


class Open(NamedTuple):
    """Open nodes: a heap of slots, the first ``size`` of them; the other slots are free."""

    slot: Ints
    """(C,) the heap."""
    value: Floats
    """(C,) of the node in each slot [s]."""
    depth: Ints
    """(C,) how many regions it decides."""
    branch: Ints
    """(C,) the region to decide next, or LEAF."""
    sides: Sides
    """(C, R)"""


@njit
def earliest(events: Events, sides: Sides, tau: Floats, at: Ints) -> float:
    """Fill the earliest times ``tau`` (P,) that the decided sides allow; returns the makespan, infinite in a deadlock.

    ``at`` (A,): scratch, the next place of each arm.
    """
    arms = at.shape[0]
    at[:] = events.first[:-1]
    moved = True
    while moved:
        moved = False
        for i in range(arms):
            while at[i] < events.first[i + 1]:
                p = at[i]
                time = 0.0
                if p > events.first[i]:
                    time = tau[p - 1] + (events.theta[p] - events.theta[p - 1])
                waits = False
                for d in range(events.begin[p], events.begin[p + 1]):
                    if sides[events.region[d]] == events.side[d]:
                        other = events.left[d]
                        if at[events.arm_of[other]] <= other:
                            waits = True
                            break
                        time = max(time, tau[other])
                if waits:
                    break
                tau[p] = time
                at[i] = p + 1
                moved = True
    makespan = 0.0
    for i in range(arms):
        if at[i] < events.first[i + 1]:
            return np.inf
        makespan = max(makespan, tau[events.first[i + 1] - 1])
    return float(makespan)


@njit
def settle(events: Events, tau: Floats, sides: Sides, kept: Sides) -> int:
    """The undecided region that times violate most, or LEAF: then ``kept`` (R,) has the sides on which all are passed.

    What violates a region is the lesser of what its two sides would ask for.
    """
    worst, branch = 0.0, LEAF
    late = np.empty(2)
    for r in range(sides.shape[0]):
        kept[r] = sides[r]
        if sides[r] != UNDECIDED_SIDE:
            continue
        late[:] = -np.inf
        for k in range(events.of_region[r], events.of_region[r + 1]):
            d = events.listed[k]
            late[events.side[d]] = max(late[events.side[d]], tau[events.left[d]] - tau[events.entered[d]])
        kept[r] = 0 if late[0] <= late[1] else 1
        if late[kept[r]] > worst:
            worst, branch = late[kept[r]], r
    return branch


@njit
def _before(nodes: Open, m: int, n: int) -> bool:
    """Whether heap entry m goes before n: the lower value, of equals the one that decides more."""
    a, b = nodes.slot[m], nodes.slot[n]
    if nodes.value[a] != nodes.value[b]:
        return bool(nodes.value[a] < nodes.value[b])
    return bool(nodes.depth[a] > nodes.depth[b])


@njit
def _rise(nodes: Open, m: int) -> None:
    while m > 0 and _before(nodes, m, (m - 1) // 2):
        parent = (m - 1) // 2
        nodes.slot[m], nodes.slot[parent] = nodes.slot[parent], nodes.slot[m]
        m = parent


@njit
def _sink(nodes: Open, size: int) -> None:
    m = 0
    while True:
        best = m
        for child in (2 * m + 1, 2 * m + 2):
            if child < size and _before(nodes, child, best):
                best = child
        if best == m:
            return
        nodes.slot[m], nodes.slot[best] = nodes.slot[best], nodes.slot[m]
        m = best


@njit
def push(events: Events, nodes: Open, size: int, sides: Sides, least: float, tau: Floats, at: Ints) -> int:
    """Work out a node and keep it open unless it is a deadlock; ``least``: its parent's value. Returns the new size."""
    value = earliest(events, sides, tau, at)
    if value == np.inf:
        return size
    kept = np.empty_like(sides)
    branch = settle(events, tau, sides, kept)
    if branch == LEAF and earliest(events, kept, tau, at) == np.inf:
        # Sides that hold with equality only may wait in a circle: decide one after the other.
        for r in range(sides.shape[0]):
            if sides[r] == UNDECIDED_SIDE:
                branch = r
                break
    slot = nodes.slot[size]
    nodes.sides[slot] = kept if branch == LEAF else sides
    nodes.value[slot] = max(value, least)
    nodes.depth[slot] = np.sum(sides != UNDECIDED_SIDE)
    nodes.branch[slot] = branch
    _rise(nodes, size)
    return size + 1


@njit
def expand(events: Events, nodes: Open, size: int, most: int) -> tuple[int, int]:
    """Expand the best nodes, ``most`` at most, until the best is a leaf; returns the new size and how many were.

    ``nodes`` must have room for ``size + most``.
    """
    tau = np.empty(events.theta.shape[0])
    at = np.empty(events.first.shape[0] - 1, dtype=np.int64)
    sides = np.empty(nodes.sides.shape[1], dtype=np.int8)
    done = 0
    while done < most and size > 0 and nodes.branch[nodes.slot[0]] != LEAF:
        best = nodes.slot[0]
        branch, value = nodes.branch[best], float(nodes.value[best])
        sides[:] = nodes.sides[best]
        size -= 1
        nodes.slot[0], nodes.slot[size] = nodes.slot[size], nodes.slot[0]
        _sink(nodes, size)
        for side in range(2):
            sides[branch] = side
            size = push(events, nodes, size, sides, value, tau, at)
        done += 1
    return size, done
