r"""A certified lower bound on the makespan of all arms together, and who passes first where in the relaxed optimum.

Let ``theta_i(x)`` be when the minimum-time motion of arm i is at place x, and ``tau_i(x)`` when a given schedule first
is. No motion gains on the minimum-time one, so

    tau_i(y) >= tau_i(x) + theta_i(y) - theta_i(x)   for x < y,   tau_i(0) = 0.                                     (1)

*One cell.* Let ``[a, a'] x [b, b']`` be a cell of the chart of arms i and j that is blocked: closed, for the
certificate holds on its border too. At the first instant at which ``lam_i >= a`` and ``lam_j >= b`` one of the two is
an equality, say the second one. The schedule is not in the cell, so ``lam_i > a'`` then, and ``lam_j < b`` just before:
arm i has left before arm j comes. So with every cell that a schedule avoids either "i first" or "j first" holds,

    tau_i(a') < tau_j(b)   or   tau_j(b') < tau_i(a),                                                               (2)

and not both. Nobody leaves the end of a path or comes to its start: where a' is the end, or b the start, "i first"
cannot be.

*One region.* Cells that touch, at a corner at least, are passed on the same side: were the first passed with i first,
at an instant with ``lam_i > a'`` and ``lam_j < b``, and the second, [c, c'] x [d, d'], with j first, at one with
``lam_j > d'`` and ``lam_i < c``, then, as places never fall, ``a' < c`` if the former is earlier, or else ``d' < b``:
they would not touch. So a connected set of blocked cells, a collision region, is passed on one of two sides, and its
sides are all that is to decide.

*Many.* Decided sides make (1) and (2) a system of difference constraints; the least times that it allows are longest
paths, and if it has a cycle nothing does, for the inequalities (2) are strict: a deadlock. Those least times and their
makespan are below every schedule that passes on these sides; deciding one region more only adds constraints. Branch and
bound over the sides therefore ends in the least makespan of all timings that keep out of blocked cells and that (1)
holds for, and as long as it has not ended the least value of its open nodes is a bound. If no node is left, no schedule
exists: *certified infeasible*.

There is no grid in this: places are the borders of the charts' cells, whatever their number, and nothing is taken off
for it. What the motions' own grid may overestimate is taken off each arm's clock, ``(1 - share) theta`` in place of
``theta``, as for pairs; a share of 1e-9 of the bound is left to rounding. The same search over all cells that are not
certified free bounds the plans that keep to free cells; the sides of its optimum are the best guess of who passes first
where.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.coordination._joint_bound_kernels import (
    LEAF,
    UNDECIDED_SIDE,
    Events,
    Open,
    earliest,
    expand,
    push,
)
from armtempo.planners.coordination._passing_corners import can_be, staircase
from armtempo.planners.coordination._passing_orders import Orders, PassingRegion
from armtempo.planners.topp import PhaseTrajectory

MOST_NODES = 100_000  # expanded, unless another number is asked for
NODES_PER_LOOK = 256  # expanded between two looks at the clock
ROUNDING_SHARE = 1e-9  # of the bound

Report = Callable[[float, int], object]
"""Called with the bound so far [s] and the number of open nodes."""


@dataclass(frozen=True, kw_only=True, eq=False)
class JointBound:
    """What the relaxed search says of all arms together.

    Attributes:
        time: Lower bound on their makespan [s]; infinite if no timing avoids the regions.
        complete: Whether the search came to its end; else it stopped at a limit with the bound reached so far.
        nodes: Nodes of the search that were expanded.
        sides: (R,) who passes which region first in the relaxed optimum, as orders of ``PassingOrders``: 0 arm a, 1 arm
            b; None if there is none or it was not reached.
        earliest: Per arm, places (K,) [lambda] and when the relaxed optimum is there at the earliest (K,) [s]; where it
            takes longer from one to the next than the minimum-time motion, the arm waits. None where ``sides`` is.
    """

    time: float
    complete: bool
    nodes: int
    sides: Orders | None = None
    earliest: tuple[tuple[Floats, Floats], ...] | None = None

    def __post_init__(self) -> None:
        if self.sides is not None:
            self.sides.setflags(write=False)
        for lam, tau in self.earliest or ():
            lam.setflags(write=False)
            tau.setflags(write=False)


class _Demands(NamedTuple):
    """Of one side of a region: arm ``second`` may come to each of its places after ``first`` has come to its own."""

    region: int
    side: int
    first: int
    second: int
    left: Floats  # (K,) shares of the first arm's path
    enter: Floats  # (K,) shares of the second arm's path


def _demands(regions: Sequence[PassingRegion]) -> tuple[list[_Demands], Bools]:
    """What each side of each region asks for, and (R, 2) whether it can be passed on that side at all."""
    demands, possible = [], np.ones((len(regions), 2), dtype=np.bool_)
    for r, (a, b, region) in enumerate(regions):
        for side, (first, second) in enumerate(((a, b), (b, a))):
            left, enter = staircase(region, side)
            possible[r, side] = can_be(region, left, enter)
            if possible[r, side]:
                demands.append(_Demands(r, side, first, second, left / region.resolution, enter / region.resolution))
    return demands, possible


def _places(arms: int, demands: Sequence[_Demands]) -> list[Floats]:
    """Per arm its start, its end and where anything is asked of it or about it, as shares of its path."""
    asked: list[list[Floats]] = [[np.array([0.0, 1.0])] for _ in range(arms)]
    for demand in demands:
        asked[demand.first].append(demand.left)
        asked[demand.second].append(demand.enter)
    return [np.unique(np.concatenate(own)) for own in asked]


def _events(places: Sequence[Floats], theta: Sequence[Floats], demands: Sequence[_Demands], regions: int) -> Events:
    first = np.cumsum([0, *(len(own) for own in places)])

    def place(arm: int, shares: Floats) -> Ints:
        return np.asarray(first[arm] + np.searchsorted(places[arm], shares), dtype=np.int64)

    none = np.zeros(0, dtype=np.int64)
    entered = np.concatenate([none, *(place(one.second, one.enter) for one in demands)])
    left = np.concatenate([none, *(place(one.first, one.left) for one in demands)])
    many = [len(one.left) for one in demands]
    region = np.repeat(np.array([one.region for one in demands], dtype=np.int64), many)
    side = np.repeat(np.array([one.side for one in demands], dtype=np.int8), many)
    order = np.argsort(entered, kind="stable")
    entered, left, region, side = entered[order], left[order], region[order], side[order]
    return Events(
        first=first,
        theta=np.concatenate(theta),
        begin=np.searchsorted(entered, np.arange(first[-1] + 1)),
        region=region,
        side=side,
        left=left,
        of_region=np.searchsorted(np.sort(region), np.arange(regions + 1)),
        listed=np.argsort(region, kind="stable"),
        entered=entered,
        arm_of=np.repeat(np.arange(len(places)), np.diff(first)),
    )


def _theta(fastest: PhaseTrajectory, slow: float, places: Floats) -> Floats:
    """When the minimum-time motion is at places (K,), less the share by which it may be too slow."""
    at = np.minimum(fastest.time_at(np.minimum(places * fastest.lam[-1], fastest.lam[-1])), fastest.duration)
    return np.asarray((1.0 - slow) * at, dtype=np.float64)


def _room(nodes: Open | None, regions: int, room: int) -> Open:
    """Room for so many open nodes, those of an old heap in it."""
    if nodes is None:
        none = np.zeros(0, dtype=np.int64)
        nodes = Open(none, np.zeros(0), none, none, np.zeros((0, regions), dtype=np.int8))
    more = room - len(nodes.slot)
    return Open(
        slot=np.append(nodes.slot, np.arange(len(nodes.slot), room)),
        value=np.append(nodes.value, np.zeros(more)),
        depth=np.append(nodes.depth, np.zeros(more, dtype=np.int64)),
        branch=np.append(nodes.branch, np.zeros(more, dtype=np.int64)),
        sides=np.concatenate([nodes.sides, np.zeros((more, regions), dtype=np.int8)]),
    )


def _search(
    events: Events, sides: Orders, most_nodes: int, time_limit_s: float, report: Report | None
) -> tuple[Open, int, int]:
    """Expand the best nodes until the best is a leaf, none is left or a limit is reached.

    Returns the heap, how many nodes of it are open and how many were expanded.
    """
    nodes = _room(None, len(sides), 2 * NODES_PER_LOOK)
    size = push(events, nodes, 0, sides, 0.0, np.empty(len(events.theta)), np.empty_like(events.first[1:]))
    expanded, stop = 0, time.perf_counter() + time_limit_s
    while size and nodes.branch[nodes.slot[0]] != LEAF and expanded < most_nodes:
        if expanded and time.perf_counter() >= stop:
            break
        most = min(NODES_PER_LOOK, most_nodes - expanded)
        if size + most > len(nodes.slot):
            nodes = _room(nodes, len(sides), 2 * len(nodes.slot))
        size, more = expand(events, nodes, size, most)
        expanded += more
        if report is not None and size:
            report(float(nodes.value[nodes.slot[0]]), size)
    return nodes, size, expanded


def joint_bound(
    fastest: Sequence[PhaseTrajectory],
    regions: Sequence[PassingRegion],
    *,
    shares: Sequence[float] | None = None,
    most_nodes: int = MOST_NODES,
    time_limit_s: float = math.inf,
    report: Report | None = None,
) -> JointBound:
    """The least makespan of all timings that pass every region on one of its sides, momentum ignored.

    Args:
        fastest: Minimum-time motion of every arm.
        regions: Collision regions of all pairs: of blocked cells for a bound on every timing, of cells that are not
            free for one on plans that keep to free cells.
        shares: By what share of itself each motion may be too slow; None: by none.
        most_nodes: Expanded at most: a limit that gives the same answer on every machine.
        time_limit_s: A limit in time [s], looked at every few hundred nodes.
        report: Called with the bound reached and the number of open nodes now and then.
    """
    demands, possible = _demands(regions)
    if not possible.any(axis=1).all():
        return JointBound(time=math.inf, complete=True, nodes=0)
    slow = [0.0] * len(fastest) if shares is None else shares
    places = _places(len(fastest), demands)
    theta = [_theta(motion, share, own) for motion, share, own in zip(fastest, slow, places, strict=True)]
    events = _events(places, theta, demands, len(regions))
    sides = np.where(possible.all(axis=1), UNDECIDED_SIDE, possible[:, 1]).astype(np.int8)
    nodes, size, expanded = _search(events, sides, most_nodes, time_limit_s, report)
    if size == 0:
        return JointBound(time=math.inf, complete=True, nodes=expanded)
    best = nodes.slot[0]
    bound = (1.0 - ROUNDING_SHARE) * float(nodes.value[best])
    if nodes.branch[best] != LEAF:
        return JointBound(time=bound, complete=False, nodes=expanded)
    tau = np.empty(len(events.theta))
    found = nodes.sides[best].copy()
    earliest(events, found, tau, np.empty_like(events.first[1:]))
    lam = [own * motion.lam[-1] for own, motion in zip(places, fastest, strict=True)]
    return JointBound(
        time=bound,
        complete=True,
        nodes=expanded,
        sides=found,
        earliest=tuple(zip(lam, np.split(tau, events.first[1:-1]), strict=True)),
    )


@final
class RelaxedTimes:
    """What sides cost without momentum: the makespan of the earliest times that they allow.

    Args:
        fastest: Minimum-time motion of every arm.
        regions: Collision regions of all pairs.
    """

    def __init__(self, fastest: Sequence[PhaseTrajectory], regions: Sequence[PassingRegion]) -> None:
        demands, self._possible = _demands(regions)
        places = _places(len(fastest), demands)
        theta = [_theta(motion, 0.0, own) for motion, own in zip(fastest, places, strict=True)]
        self._events = _events(places, theta, demands, len(regions))

    def makespan(self, sides: Orders) -> float:
        """Of sides (R,) [s]; infinite in a deadlock, or where one of them is impossible."""
        if not self._possible[np.arange(len(sides)), sides].all():
            return math.inf
        events = self._events
        return earliest(events, sides, np.empty(len(events.theta)), np.empty_like(events.first[1:]))
