r"""Execution by precedence: who passes first wherever two arms can meet, whatever the clock says.

A plan decides for every cell of every chart that is not free which of the two arms passes it first. What remains of
the plan's clock is, for every ordered pair (i, j), a *limit*: while arm j is in cell c of its path, arm i must not be
past

    limit_ij(c) = min over cells c' >= c of arm j, over cells a of arm i with (a, c') not free and j first: begin of a

Limits never fall as arm j goes on, so with arms that never go back they only ever open.

**Safe.** Arms that obey all limits never are in a cell that is not free: the arm that passes it second is kept at its
border until the other has left it, by the limit of the cells from there on.

**Free of deadlock.** Take any state that obeys the limits and the instant at which the plan is at each arm's place;
let m be the arm whose instant t is the earliest. Every other arm is where the plan has it at t or farther, limits
never fall, and the plan goes on past t: so m's limits are beyond its place and it may go on. Some arm always may, until
all have arrived. Limits that do not come from one timed plan have no such instant; ``check_deadlock_free`` decides it
exactly: it lets every arm go as far as the others' places allow, over and over. Limits never fall in anybody's place,
so where that ends is the farthest that any execution gets; short of the ends, each arm left waits for another one that
waits, and following them finds a cycle in the graph of "may not enter before the other has left". That run visits the
events of the graph in their order, as a topological sort does: it ends early if and only if there is a cycle.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.arrays import Floats, Ints
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.charts import FREE, CoordinationChart, limit_at
from armtempo.planners.topp import PhaseTrajectory
from armtempo.robots import njit

SAME_INSTANT_SHARE = 1e-9  # of the makespan: passes nearer in time than this are in time (rounding of a tight plan)


@njit
def _decide(
    states: NDArray[np.uint8], b_first_from: Ints, a_first_until: Ints, limit_a: Floats, limit_b: Floats, step: Floats
) -> tuple[int, int]:
    """Fill both limits of a pair; returns a cell that neither passes first, or (-1, -1).

    In column b of the chart arm a passes its cells up to ``a_first_until[b]`` first, b those from ``b_first_from[b]``.
    """
    cells = states.shape[0]
    for b in range(cells - 1, -1, -1):
        if b + 1 < cells:
            limit_a[b] = min(limit_a[b], limit_a[b + 1])
        for a in range(cells):
            if states[a, b] != FREE:
                if a >= b_first_from[b]:
                    limit_a[b] = min(limit_a[b], a * step[0])
                elif a <= a_first_until[b]:
                    limit_b[a] = min(limit_b[a], b * step[1])
                else:
                    return a, b
    for a in range(cells - 2, -1, -1):
        limit_b[a] = min(limit_b[a], limit_b[a + 1])
    return -1, -1


def _passes(motion: PhaseTrajectory, length: float, cells: int) -> tuple[Floats, Floats]:
    """(cells,) the last instant before the motion is inside each cell, and the first after: a border is outside."""
    border = np.arange(1, cells) * (length / cells)
    reached = motion.time_at(border)
    # A dwell on the border has not entered the next cell: the last of the rows there counts.
    row = np.searchsorted(motion.lam, border, side="right") - 1
    waits = motion.lam[row] == border
    entered = np.where(waits, motion.time[row], reached)
    return np.concatenate([[-np.inf], entered]), np.concatenate([reached, [np.inf]])


@dataclass(frozen=True, kw_only=True, eq=False)
@final
class Precedence:
    """How far every arm may go while another one is where it is.

    Attributes:
        lengths: (A,) lengths of the paths.
        limits: By ordered pair (i, j): over the cells of arm j's path, the farthest place of arm i [lambda]; infinite
            where it may go anywhere. Never falls along arm j's path.
    """

    lengths: tuple[float, ...]
    limits: Mapping[tuple[int, int], Floats]

    def __post_init__(self) -> None:
        for (i, j), limit in self.limits.items():
            if i == j or not (0 <= i < len(self.lengths) and 0 <= j < len(self.lengths)):
                raise InputError(f"there is no pair of arms {(i, j)}: {len(self.lengths)} lengths are given")
            if np.isnan(limit).any() or (limit[1:] < limit[:-1]).any():
                raise InputError(f"the limit of arm {i} falls as arm {j} goes on", remedy="take the least of all later")
            limit.setflags(write=False)

    @classmethod
    def of_motions(
        cls, motions: Sequence[PhaseTrajectory], charts: Mapping[tuple[int, int], CoordinationChart]
    ) -> Precedence:
        """What timed motions decide.

        Args:
            motions: One per arm.
            charts: By pair i < j, first index along arm i's path; pairs that are left out never meet.

        Raises:
            InfeasibleError: The motions meet in a cell that is not free; the message names the arms and the places.
        """
        lengths = tuple(float(motion.dynamics.length) for motion in motions)
        slack = SAME_INSTANT_SHARE * max(motion.duration for motion in motions)
        limits = {}
        for (i, j), chart in charts.items():
            cells = chart.resolution
            (enter_i, leave_i), (enter_j, leave_j) = (_passes(motions[k], lengths[k], cells) for k in (i, j))
            # Passed by i first: i has left when j enters. Both are sorted, so in each column it is the first cells.
            i_until = np.searchsorted(leave_i, enter_j + slack, side="right") - 1
            j_from = np.searchsorted(enter_i, leave_j - slack, side="left")
            limit_i, limit_j = np.full(cells, np.inf), np.full(cells, np.inf)
            steps = np.array([chart.step_a, chart.step_b])
            a, b = _decide(chart.states, j_from, i_until, limit_i, limit_j, steps)
            if a >= 0:
                raise InfeasibleError(
                    f"{_name(motions, i)} at {a * chart.step_a:.4g} m and {_name(motions, j)} at "
                    f"{b * chart.step_b:.4g} m are in a collision region at once in this plan",
                    remedy="plan on the same charts that are executed",
                    arms=(i, j),
                )
            limits[i, j], limits[j, i] = limit_i, limit_j
        return cls(lengths=lengths, limits=limits)

    @classmethod
    def of_order(
        cls, lengths: Sequence[float], order: Sequence[int], charts: Mapping[tuple[int, int], CoordinationChart]
    ) -> Precedence:
        """The earlier arm in ``order`` passes first everywhere; ``charts`` as for ``of_motions``."""
        rank = {arm: place for place, arm in enumerate(order)}
        limits = {}
        for (i, j), chart in charts.items():
            first, second = (i, j) if rank[i] < rank[j] else (j, i)
            limits[second, first] = (chart if first == i else chart.swapped).closure[:-1].copy()
        return cls(lengths=tuple(lengths), limits=limits)

    def together(self, other: Precedence) -> Precedence:
        """What arms may do that obey both; of the same paths, with any resolutions."""
        limits = dict(self.limits)
        for pair, theirs in other.limits.items():
            own = limits.get(pair, theirs)
            cells = math.lcm(len(own), len(theirs))
            limits[pair] = np.minimum(np.repeat(own, cells // len(own)), np.repeat(theirs, cells // len(theirs)))
        return Precedence(lengths=self.lengths, limits=limits)

    def limit(self, i: int, j: int) -> Floats:
        """Over the cells of arm j's path: the farthest place of arm i; one infinite entry where they never meet."""
        return self.limits.get((i, j), np.array([np.inf]))

    def farthest(self, i: int, j: int, lam_j: ArrayLike) -> Floats:
        """The farthest place of arm i while arm j is at ``lam_j`` (any shape)."""
        return limit_at(self.limit(i, j), self.lengths[j], np.asarray(lam_j, dtype=np.float64))

    def waits_for(self, i: int, places: Sequence[float] | Floats) -> tuple[int, ...]:
        """The arms that still have to leave something before arm i may go to its end."""
        return tuple(
            j
            for j in range(len(self.lengths))
            if j != i and (i, j) in self.limits and float(self.farthest(i, j, places[j])) < self.lengths[i]
        )

    def check_deadlock_free(self, places: Sequence[float] | Floats | None = None) -> None:
        """Check that arms that go as far as they may all arrive, from ``places`` (their starts by default).

        Raises:
            InfeasibleError: They do not; the message names arms that wait for each other.
        """
        lam = np.zeros(len(self.lengths)) if places is None else np.array(places, dtype=np.float64)
        lengths = np.array(self.lengths)
        moved = True
        while moved:
            moved = False
            for i in range(len(lam)):
                reach = min(
                    [lengths[i], *(float(self.farthest(i, j, lam[j])) for k, j in self.limits if k == i)],
                )
                if reach > lam[i]:
                    lam[i], moved = reach, True
        stuck = [i for i in range(len(lam)) if lam[i] < lengths[i]]
        if not stuck:
            return
        chain = [stuck[0]]
        while True:  # every arm that is stuck is held by one that is stuck: follow them until one comes again
            i = chain[-1]
            j = min((k for m, k in self.limits if m == i), key=lambda k: float(self.farthest(i, k, lam[k])))
            if j in chain:
                cycle = [*chain[chain.index(j) :], j]
                break
            chain.append(j)
            if lam[j] >= lengths[j]:  # it is at its end, in the way
                raise InfeasibleError(
                    f"arm {i} waits for ever at {lam[i]:.4g} m: arm {j} ends in its way",
                    remedy="let it pass before that one arrives",
                    cycle=(i, j),
                )
        waits = ", ".join(f"arm {i} at {lam[i]:.4g} m" for i in cycle[:-1])
        raise InfeasibleError(
            f"the arms wait for each other for ever: {' for '.join(f'arm {i}' for i in cycle)} ({waits})",
            remedy="choose another passing order",
            cycle=tuple(cycle),
        )


def _name(motions: Sequence[PhaseTrajectory], i: int) -> str:
    arm = motions[i].dynamics.arm
    return f"arm {i}" if arm is None else f"arm {arm.name!r}"
