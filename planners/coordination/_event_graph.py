r"""Plans in which arms wait at their stops alone, and go from stop to stop in minimum time: a graph of events.

An *event* is the begin of a run, from one stop of a path (or its start) to the next. With who passes which region first
given, every corner of a region ("arm i may come to p once arm j is past q") asks that one run begins later than another
by some time, and a run begins once the one before it has ended. The longest paths through these times are the earliest
begins; a circle that is longer than nothing is a deadlock. Orders are found by branch and bound: the earliest begins
under the orders so far are a bound, and the first region that they do not pass on either side is the next to decide.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.coordination._passing_corners import can_be, staircase
from armtempo.planners.coordination._time_windows import WINDOW_MARGIN
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem
from armtempo.planners.topp import PhaseTrajectory

MOST_NODES = 4000  # orders begun
KEPT_SHARE = 1e-9  # of the makespan: rounding of begins


class _Runs(NamedTuple):
    """The runs of all arms, one arm after the other."""

    first: Ints  # (A+1,) where each arm's begin
    border: tuple[Floats, ...]  # per arm (K+1,) where they begin, and the end [lambda]
    begin: tuple[Floats, ...]  # per arm (K+1,) when they do in minimum time [s]

    @classmethod
    def of(cls, motions: Motions) -> _Runs:
        borders, begins = [], []
        for motion in motions:
            path = motion.dynamics.path
            stops = np.empty(0) if path is None else path.stops
            borders.append(np.concatenate([[motion.lam[0]], stops, [motion.lam[-1]]]))
            begins.append(motion.time_at(borders[-1]))
        first = np.cumsum([0, *(len(border) - 1 for border in borders)])
        return cls(first, tuple(borders), tuple(begins))


class _Later(NamedTuple):
    """Run ``run`` begins at least ``by`` [s] after run ``than`` does; (E,) each."""

    than: Ints
    run: Ints
    by: Floats


def event_graph(problem: TimingProblem) -> Motions | None:
    """The best plan of its kind that is found; None: there is none, or not within so many orders.

    Motions are not checked: that they keep clear is for the caller to see.
    """
    runs = _Runs.of(problem.fastest)
    passing = problem.passing_orders
    sides = [_sides(problem, runs, r) for r in range(len(passing.regions))]
    own = _own(runs)
    best, best_begins, nodes = np.inf, None, 0
    forced = tuple((r, 0 if side[0] is not None else 1) for r, side in enumerate(sides) if None in side)
    open_nodes: list[tuple[tuple[int, int], ...]] = [forced]
    while open_nodes and nodes < MOST_NODES:
        decided = open_nodes.pop()
        nodes += 1
        chosen = [sides[r][order] for r, order in decided]
        if any(side is None for side in chosen):
            continue
        begins = _earliest(runs, [own, *(side for side in chosen if side is not None)])
        if begins is None or _end(runs, begins) >= best * (1.0 - KEPT_SHARE):
            continue
        taken = {r for r, _ in decided}
        open_region = next(
            (r for r in range(len(sides)) if r not in taken and not any(_kept(side, begins) for side in sides[r])), None
        )
        if open_region is None:
            best, best_begins = _end(runs, begins), begins
            continue
        children = [(*decided, (open_region, order)) for order in (0, 1)]
        ends = [_end_of(runs, [own, *(s for r, o in child if (s := sides[r][o]) is not None)]) for child in children]
        open_nodes += [child for _, child in sorted(zip(ends, children, strict=True), key=lambda one: -one[0])]
    return None if best_begins is None else tuple(_motions(problem, runs, best_begins))


def _sides(problem: TimingProblem, runs: _Runs, r: int) -> tuple[_Later | None, _Later | None]:
    """What region r asks for if its arm a, or b, passes first; None: somebody's start or end is in the way."""
    a, b, region = problem.passing_orders.regions[r]
    found: list[_Later | None] = []
    for order in (0, 1):
        first, second = (b, a) if order else (a, b)
        left, entered = staircase(region, order)
        if not can_be(region, left, entered):
            found.append(None)
            continue
        lengths = problem.passing_orders.lengths
        leaves, enters = left * (lengths[first] / region.resolution), entered * (lengths[second] / region.resolution)
        of_first = np.clip(np.searchsorted(runs.border[first], leaves, side="left") - 1, 0, None)
        of_second = np.clip(np.searchsorted(runs.border[second], enters, side="right") - 1, 0, None)
        # a place is left when it is passed for good; an arm that waits there has not entered what is behind it
        past = problem.fastest[first].time_at(leaves) - runs.begin[first][of_first]
        comes = problem.fastest[second].last_time_at(enters) - runs.begin[second][of_second]
        comes = np.where(runs.border[second][of_second] == enters, 0.0, comes)
        found.append(_strongest(runs.first[first] + of_first, runs.first[second] + of_second, past - comes))
    return found[0], found[1]


def _strongest(than: Ints, run: Ints, by: Floats) -> _Later:
    """Of what is asked of the same two runs, the most."""
    pairs, which = np.unique(np.stack([than, run]), axis=1, return_inverse=True)
    most = np.full(pairs.shape[1], -np.inf)
    np.maximum.at(most, which.reshape(-1), by + 2.0 * WINDOW_MARGIN)
    return _Later(pairs[0], pairs[1], most)


def _own(runs: _Runs) -> _Later:
    """A run begins once the one before it has ended."""
    than = np.concatenate([np.arange(a, b - 1) for a, b in zip(runs.first[:-1], runs.first[1:], strict=True)])
    by = np.concatenate([np.diff(begin)[:-1] for begin in runs.begin])
    return _Later(than.astype(np.int64), than.astype(np.int64) + 1, by)


def _earliest(runs: _Runs, asked: list[_Later]) -> Floats | None:
    """(K,) when runs begin at the earliest; None: they wait for each other."""
    than, run, by = (np.concatenate(column) for column in zip(*asked, strict=True))
    begins = np.zeros(int(runs.first[-1]))
    for _ in range(len(begins) + 1):
        later = begins.copy()
        np.maximum.at(later, run, begins[than] + by)
        if (later <= begins + KEPT_SHARE).all():
            return later
        begins = later
    return None


def _end(runs: _Runs, begins: Floats) -> float:
    """When the last arm arrives."""
    last = runs.first[1:] - 1
    return max(float(begins[k] + begin[-1] - begin[-2]) for k, begin in zip(last, runs.begin, strict=True))


def _end_of(runs: _Runs, asked: list[_Later]) -> float:
    begins = _earliest(runs, asked)
    return np.inf if begins is None else _end(runs, begins)


def _kept(side: _Later | None, begins: Floats) -> bool:
    """Whether begins pass a region on that side."""
    return side is not None and bool((begins[side.run] >= begins[side.than] + side.by - KEPT_SHARE).all())


def _motions(problem: TimingProblem, runs: _Runs, begins: Floats) -> Iterator[PhaseTrajectory]:
    """The fastest motions, standing at every stop until the next run begins."""
    for arm, motion in enumerate(problem.fastest):
        own = begins[runs.first[arm] : runs.first[arm + 1]]
        early = runs.begin[arm][:-1]
        late = own - early  # by how much each run is later than in minimum time: rises
        waits = np.diff(late, prepend=0.0)
        for border, wait in zip(runs.border[arm], waits, strict=False):
            if wait > 0.0:
                motion = motion.waiting(int(np.searchsorted(motion.lam, border)), float(wait))
        yield motion
