r"""The best plan with all arms free to yield: best responses, then joint refinement in one passing class after another.

Who passes which region first makes a class. Refined are those of the relaxed optimum, of what the caller asks for, and
of the best plan so far; beside every class are those in which one region that its makespan hangs on is passed the other
way. Of all that are known the one is next that costs least without momentum. One that costs as much as the best plan
takes is left out: nothing in it is better.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property

import numpy as np

from armtempo.errors import InfeasibleError, InputError, brief
from armtempo.planners.coordination._best_responses import (
    Best,
    best_responses,
    improved,
    respond,
    shift_only,
    take_events,
)
from armtempo.planners.coordination._interval_search import ALL_STAGES
from armtempo.planners.coordination._joint_bound import RelaxedTimes
from armtempo.planners.coordination._joint_refinement import refine
from armtempo.planners.coordination._passing_orders import Orders
from armtempo.planners.coordination._precedence import Precedence
from armtempo.planners.coordination._time_windows import pair_is_free
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem, makespan
from armtempo.planners.geometry import number
from armtempo.planners.topp import LIMIT_EXCESS_MAX

GAP = 0.005  # proven: a plan that is nearer to the bound is not refined jointly
CLASSES_MAX = 40  # refined
CRITICAL_LEAST = 1e-2  # [s/s] what the makespan hangs on
RESERVE_TRIALS = 3


def optimal(
    problem: TimingProblem, *, gap: float = GAP, time_limit_s: float | None = None, starts: Sequence[Orders] = ()
) -> tuple[Motions, tuple[int, ...]]:
    """The best plan that is found with all arms free to yield, and its order: of priority, else of arrival.

    With two arms a plan is found wherever the outer chart has a monotone path of free cells and both can hold still.
    Without a time limit the search ends after so many classes: the same input gives the same plan, bit by bit.

    Args:
        problem: What to time.
        gap: Stop when the plan is proven to be within this share of the best there can be.
        time_limit_s: Refine no further after so long [s], once there is a plan. Looked at between steps of the joint
            refinement; bounds and best responses are not cut short.
        starts: Orders (R,) of ``problem.passing_orders`` to refine first.

    Raises:
        InputError: ``gap`` is negative or ``time_limit_s`` not positive, or one is no number.
        InfeasibleError: ``reason`` is ``certified infeasible``, ``undecided`` (only the chart's undecided cells are in
            the way) or ``not holdable`` (an arm that cannot stand still would have to).
    """
    limit = math.inf if time_limit_s is None else number(time_limit_s, "time_limit_s")
    if not number(gap, "gap") >= 0.0 or not limit > 0.0:
        raise InputError(
            f"gap {brief(gap)} and time_limit_s {brief(time_limit_s)}: the one must be >= 0, the other > 0",
            remedy="give a share like 0.005, and seconds",
        )
    if np.isinf(problem.lower_bound):
        rules = problem.rules_of(problem.arms)
        raise InfeasibleError(
            f"no timing at all keeps the arms apart{rules and f' and to their rules: {rules}'} (certified)",
            remedy=f"{'take a rule back, ' if rules else ''}lower d_min_m, or move a path or a base",
            reason="certified infeasible",
        )
    if len(problem.arms) == 1:
        return problem.fastest, (0,)
    if np.isinf(problem.attainable):
        raise _no_plan(problem)
    best = Best(problem)
    take_events(best)
    classes = _Classes(problem, best, (1.0 + gap) * problem.lower_bound, time.perf_counter() + limit)
    if len(problem.arms) > 2:  # orders are many: they are tried once there is a plan to beat
        classes.refine_first(starts)
    if not classes.has_enough:
        best_responses(problem, best)
    classes.refine_first(starts)
    classes.refine_beside()
    if best.motions is not None and len(problem.arms) > 2:
        shift_only(best)  # the simple plan, where a refined one misses it by rounding
    if best.motions is None:
        raise _no_plan(problem)
    return best.motions, best.order


class _Classes:
    """Passing classes to be refined, and those that were."""

    def __init__(self, problem: TimingProblem, best: Best, enough: float, deadline: float) -> None:
        self.problem, self.best, self.enough, self.deadline = problem, best, enough, deadline
        self.seen: set[bytes] = set()
        self.refined = 0
        self.open: list[tuple[float, int, Orders]] = []  # makespan without momentum, number, orders

    @cached_property
    def _relaxed(self) -> RelaxedTimes:
        return RelaxedTimes(self.problem.fastest, self.problem.passing_orders.regions)

    @property
    def has_enough(self) -> bool:
        """Whether the best plan needs no refinement; nothing is refined where arms cannot hold still."""
        best = self.best
        return best.motions is not None and (best.is_enough or makespan(best.motions) <= self.enough)

    @property
    def is_done(self) -> bool:
        """Whether the best plan is enough, or the time is up."""
        return self.has_enough or time.perf_counter() > self.deadline

    def refine_first(self, starts: Sequence[Orders]) -> None:
        """Refine the classes of ``starts``, of the relaxed optimum and of the best plan so far."""
        first = list(starts) if self.problem.relaxed.sides is None else [*starts, self.problem.relaxed.sides]
        for orders in [*first, *self._of_best()]:
            if not self.is_done:
                self._put(orders)
                self._refine_next()

    def refine_beside(self) -> None:
        """Refine classes beside them, until none is left that could be better."""
        while self.open and self.refined < CLASSES_MAX and not self.is_done:
            self._refine_next()

    def _refine_next(self) -> None:
        if self.open:
            value, _, orders = self.open.pop(self.open.index(min(self.open, key=lambda one: one[:2])))
            if value < self._latest:
                self.refined += 1
                self._refine(orders)

    @property
    def _latest(self) -> float:
        return math.inf if self.best.motions is None else makespan(self.best.motions)

    def _of_best(self) -> list[Orders]:
        if self.best.motions is None:
            return []
        passing = self.problem.passing_orders
        charts = {(a, b): self.problem.chart_between(a, b) for a, b, _ in passing.regions}
        try:
            return [passing.of_precedence(Precedence.of_motions(self.best.motions, charts))]
        except InfeasibleError:  # by rounding
            return []

    def _put(self, orders: Orders) -> None:
        orders = np.array(orders, dtype=np.int8)
        if orders.tobytes() not in self.seen:
            self.seen.add(orders.tobytes())
            value = self._relaxed.makespan(orders)
            if value < self._latest:
                self.open.append((value, len(self.seen), orders))

    def _refine(self, orders: Orders) -> None:
        """Refine a class, take what keeps clear, and put the classes beside it."""
        reserve = 0.0
        for _ in range(RESERVE_TRIALS):
            found = refine(self.problem, orders, reserve=reserve, beat=self._latest, deadline=self.deadline)
            if found is None:
                return
            if makespan(found.motions) >= self._latest:
                break
            excess = max(motion.certificate.excess for motion in found.motions)
            if excess <= LIMIT_EXCESS_MAX:
                break
            reserve = 1.0 - (1.0 - reserve) * (1.0 - 1.5 * excess)
        else:
            return
        if self.problem.is_free(found.motions):
            self.best.take(found.motions)
        elif makespan(found.motions) < self._latest:
            with suppress(InfeasibleError):
                self.best.take(improved(self.problem, _apart(self.problem, found.motions), ALL_STAGES))
        for region in np.flatnonzero(found.critical > CRITICAL_LEAST):
            beside = orders.copy()
            beside[region] = 1 - beside[region]
            self._put(beside)


def _apart(problem: TimingProblem, motions: Motions) -> Motions:
    """The same with arms that do not keep clear answering the others, the one with most conflicts first.

    Raises:
        InfeasibleError: One of them finds no way.
    """
    for _ in problem.arms:
        conflicts = [
            sum(
                not pair_is_free(problem.chart_between(arm, j), motions[arm], motions[j])
                for j in problem.arms
                if j != arm
            )
            for arm in problem.arms
        ]
        if not any(conflicts):
            break
        arm = int(np.argmax(conflicts))
        others = {j: motion for j, motion in enumerate(motions) if j != arm}
        motions = (*motions[:arm], respond(problem, arm, others, ALL_STAGES), *motions[arm + 1 :])
    return motions


def _no_plan(problem: TimingProblem) -> InfeasibleError:
    still = [name for name, holds in zip(problem.names, problem.holdable, strict=True) if not holds]
    if still:
        return InfeasibleError(
            f"no timing was found, and arm {still[0]!r} cannot hold still everywhere on its path to wait for one",
            remedy="raise limits.torque_nm, or move a path or a base",
            reason="not holdable",
        )
    return InfeasibleError(
        "no timing through cells that are certified free was found, and none is ruled out: undecided",
        remedy="lower chart_tolerance_m or d_min_m, or move a start, an end or a base",
        reason="undecided",
    )
