"""What coordination plans with: a phase plane per arm and a chart per pair, whatever they were made from."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import final

import numpy as np

from armtempo.errors import InfeasibleError
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.coordination._interval_search import IntervalSearch
from armtempo.planners.coordination._joint_bound import MOST_NODES, JointBound, Report, joint_bound
from armtempo.planners.coordination._makespan_bound import (
    MakespanBound,
    PairBound,
    PriorityClass,
    pair_bound,
)
from armtempo.planners.coordination._pair_delay import pair_delay
from armtempo.planners.coordination._passing_orders import PassingOrders, PassingRegion
from armtempo.planners.coordination._time_windows import Runs, blocked_runs, pair_is_free
from armtempo.planners.topp import PhasePlane, PhaseTrajectory

Charts = Callable[[int, int], CoordinationChart]
Motions = tuple[PhaseTrajectory, ...]
NATURAL_DELAY_SHARE = 0.03  # of the bound, by which a start delay may miss it and still be the natural plan


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class TimingProblem:
    """Arms on given paths, to be timed.

    Attributes:
        names: One per arm.
        planes: One per arm.
        chart_between: Planning chart of arms (i, j), first index along path i; plans stay in its free cells.
        bound_chart_between: Likewise the chart of bounds, where only certified-blocked cells count.
        bound_motions: Minimum-time motions for bounds, and by what share they may be too slow; None: the planes' own.
    """

    names: tuple[str, ...]
    planes: tuple[PhasePlane, ...]
    chart_between: Charts
    bound_chart_between: Charts
    bound_motions: Callable[[], tuple[tuple[PhaseTrajectory, float], ...]] | None = None

    @cached_property
    def arms(self) -> tuple[int, ...]:
        """Their indices."""
        return tuple(range(len(self.planes)))

    @cached_property
    def fastest(self) -> Motions:
        """The minimum-time motion of every arm."""
        return tuple(plane.fastest() for plane in self.planes)

    @cached_property
    def holdable(self) -> tuple[bool, ...]:
        """Per arm whether it can hold still wherever it is on its path; in a dwell it does not wait."""
        return tuple(bool((plane.holdable | plane.dwelling).all()) for plane in self.planes)

    @cached_property
    def _runs(self) -> dict[tuple[int, int], Runs]:
        return {}

    def runs(self, other: int, arm: int) -> Runs:
        """Where ``other`` shuts the path of ``arm``, found once."""
        if (other, arm) not in self._runs:
            self._runs[other, arm] = blocked_runs(self.chart_between(other, arm))
        return self._runs[other, arm]

    def rules_of(self, arms: Collection[int]) -> str:
        """The rules among some arms, in words, for messages; empty without any."""
        rules = (rule.rule for i, j in combinations(sorted(arms), 2) for rule in self.chart_between(i, j).exclusions)
        return "; ".join(dict.fromkeys(rules))

    @cached_property
    def searches(self) -> tuple[IntervalSearch, ...]:
        """The interval search of every arm."""

        def search(arm: int) -> IntervalSearch:
            return IntervalSearch(plane=self.planes[arm], runs_with=lambda other: self.runs(other, arm))

        return tuple(search(arm) for arm in self.arms)

    @cached_property
    def _bound_motions(self) -> tuple[tuple[PhaseTrajectory, float], ...]:
        return tuple((m, 0.0) for m in self.fastest) if self.bound_motions is None else self.bound_motions()

    @cached_property
    def passing_orders(self) -> PassingOrders:
        """The collision regions of all pairs in the planning charts."""
        charts = {pair: self.chart_between(*pair) for pair in combinations(self.arms, 2)}
        return PassingOrders.of_charts([plane.length for plane in self.planes], charts)

    def bounded(
        self, *, most_nodes: int = MOST_NODES, time_limit_s: float = np.inf, report: Report | None = None
    ) -> JointBound:
        """Lower bound on the makespan of any timing, all arms together; ``joint`` is it by the default limits.

        Args:
            most_nodes: Expanded at most; see ``joint_bound``.
            time_limit_s: Stop after so long [s].
            report: Called with the bound reached [s] and the number of open nodes now and then.
        """
        motions, shares = zip(*self._bound_motions, strict=True)
        regions = [
            PassingRegion(i, j, region)
            for i, j in combinations(self.arms, 2)
            for region in self.bound_chart_between(i, j).cores
        ]
        return joint_bound(
            motions, regions, shares=shares, most_nodes=most_nodes, time_limit_s=time_limit_s, report=report
        )

    @cached_property
    def relaxed(self) -> JointBound:
        """The same of plans in free cells of the planning charts; its ``sides`` are orders of ``passing_orders``."""
        return joint_bound(self.fastest, self.passing_orders.regions)

    @cached_property
    def joint(self) -> JointBound:
        """``bounded`` by its usual limits."""
        return self.bounded()

    def find_joint(self, report: Report) -> JointBound:
        """``joint``; where it is not known yet, ``report`` is told how far its search has come, see ``bounded``."""
        if "joint" not in self.__dict__:  # where cached properties are kept
            self.__dict__["joint"] = self.bounded(report=report)
        return self.joint

    @cached_property
    def lower_bound(self) -> float:
        """Lower bound on the makespan of any timing, all arms together [s]; infinite if there is none."""
        time = max([self.joint.time, *((1.0 - share) * motion.duration for motion, share in self._bound_motions)])
        if self.joint.complete:
            return float(time)
        shares = [share for _, share in self._bound_motions]
        pairs = (pair.time * (1.0 - max(shares[i], shares[j])) for (i, j), pair in self._pairs.items())
        return float(max([time, *pairs]))

    @cached_property
    def _pairs(self) -> dict[tuple[int, int], PairBound]:
        motions = [motion for motion, _ in self._bound_motions]
        return {
            (i, j): pair_bound(motions[i], motions[j], self.bound_chart_between(i, j))
            for i, j in combinations(self.arms, 2)
        }

    @cached_property
    def bound(self) -> MakespanBound:
        """The lower bound, and the class of every pair."""
        classes: dict[tuple[int, int], PriorityClass] = {}
        natural: dict[tuple[int, int], tuple[bool, bool]] = {}
        for (i, j), pair in self._pairs.items():
            if np.isinf(pair.time):
                classes[i, j] = "infeasible"
            elif pair_is_free(self.chart_between(i, j), self.fastest[i], self.fastest[j]):
                classes[i, j] = "free"
            else:
                natural[i, j] = self._natural(i, j, pair)
                classes[i, j] = "uniform" if any(natural[i, j]) else "mixed"
        return MakespanBound(
            time=self.lower_bound, joint=self.joint, pairs=self._pairs, classes=classes, natural=natural
        )

    def _natural(self, i: int, j: int, pair: PairBound) -> tuple[bool, bool]:
        """Whether i, or j, may go first everywhere at no cost, and a start delay shows it on the planning chart too."""
        found = []
        for free, (a, b) in zip(pair.natural, ((i, j), (j, i)), strict=True):
            first, second = self.fastest[a], self.fastest[b]
            try:
                wait = pair_delay(self.chart_between(a, b), (self.names[a], self.names[b]), first, second)
            except InfeasibleError:  # in that order nobody could wait
                wait = np.inf
            found.append(
                free and max(first.duration, second.duration + wait) <= (1.0 + NATURAL_DELAY_SHARE) * pair.time
            )
        return found[0], found[1]

    @cached_property
    def attainable(self) -> float:
        """What no plan in free cells of the planning charts can beat, momentum ignored [s]; or infinite."""
        return max(makespan(self.fastest), self.relaxed.time)

    def is_free(self, motions: Motions) -> bool:
        """Whether all motions stay in free cells of all planning charts."""
        return all(
            pair_is_free(self.chart_between(i, j), motions[i], motions[j]) for i, j in combinations(self.arms, 2)
        )


def makespan(motions: Motions) -> float:
    """Time at which the last arm arrives [s]."""
    return max(motion.duration for motion in motions)
