"""A schedule: when every arm of a cell is where on its path, with a certified lower bound and a certificate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import Precedence, VciPlan
from armtempo.planners.schedules._certificate import ScheduleCertificate, certify
from armtempo.planners.topp import PhaseTrajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class Schedule:
    """One motion per arm, on a common clock.

    Attributes:
        method: The planner's name.
        cell: What was planned for.
        trajectories: One per arm, in the cell's order; each ends when its arm arrives.
        order: Arms by priority: in the order in which they pass, or, where each passes first somewhere, arrive.
        vci: What velocity control of the last arm in ``order`` did, where it was asked.
        fallback: The method that planned instead of the one asked for, where that found no way.
        fallback_reason: Why it did.
        unsmoothed: The plan without jerk limits whose passing order this one keeps, if it is one with.
    """

    method: str
    cell: CoordinationCell
    trajectories: tuple[PhaseTrajectory, ...]
    order: tuple[int, ...]
    vci: VciPlan | None = None
    fallback: str | None = None
    fallback_reason: str = ""
    unsmoothed: Schedule | None = None

    @property
    def makespan(self) -> float:
        """Time at which the last arm arrives [s]."""
        return max(trajectory.duration for trajectory in self.trajectories)

    @property
    def lower_bound(self) -> float:
        """Certified lower bound on the makespan of any timing of this cell [s]."""
        return self.cell.lower_bound

    @property
    def gap_percent(self) -> float:
        """(makespan - lower bound) / lower bound, in percent."""
        return 100.0 * (self.makespan / self.lower_bound - 1.0)

    @property
    def smoothing_price_percent(self) -> float:
        """How much longer it takes than without jerk limits, in percent; 0 if it has none."""
        return 0.0 if self.unsmoothed is None else 100.0 * (self.makespan / self.unsmoothed.makespan - 1.0)

    @property
    def planning_gap_percent(self) -> float:
        """The same above what any plan with the cell's clearance reserve must take, in percent."""
        return 100.0 * (self.makespan / self.cell.planned_bound - 1.0)

    @cached_property
    def precedence(self) -> Precedence:
        """What it decides about who passes first.

        Raises:
            InfeasibleError: It leads two arms through a cell of their chart that is not free.
        """
        pairs = combinations(range(len(self.trajectories)), 2)
        charts = {(i, j): self.cell.chart_between(i, j) for i, j in pairs}
        return Precedence.of_motions(self.trajectories, charts)

    @cached_property
    def certificate(self) -> ScheduleCertificate:
        """Worst ratios, smallest clearance and end error, computed apart from the planner."""
        return certify(self.cell, self.trajectories)
