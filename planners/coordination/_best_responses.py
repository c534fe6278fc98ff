r"""Plans in which motions are shaped arm by arm: prioritised, and with every arm free to yield.

The optimum is sought from above by alternating best responses: with all motions but one fixed, that one is made as
early as it can be. What they end in depends on where they start, so they start from several plans: the best start
delays and offsets, one arm after the other in every order (as far as their number allows), and, with two arms, the
shortest path through the free cells of the chart redrawn in minimum times. Nobody can execute that path, for it has no
momentum, but one arm may be *taken* to move along it, a little slowed down, and the other then answers.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.coordination._event_graph import event_graph
from armtempo.planners.coordination._interval_search import ALL_STAGES, COARSE_STAGES, Stage
from armtempo.planners.coordination._makespan_bound import guide_path
from armtempo.planners.coordination._start_delays import delayed, offset, start_offset
from armtempo.planners.coordination._stop_and_go import stop_and_go
from armtempo.planners.coordination._time_windows import Occupancy, pair_is_free
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem, makespan
from armtempo.planners.topp import LIMIT_EXCESS_MAX, PhaseTrajectory

CLOSE_ENOUGH_SHARE = 0.002  # of what is attainable: a plan within it is not improved any more
LEAST_GAIN_SHARE = 1e-4  # of the makespan: what a round of best responses must gain
MOST_ROUNDS = 6  # of best responses
BETTER_SHARE = 1.0 - 1e-9  # of the makespan: ties keep the cell's order, whatever the rounding
GUIDE_STRETCHES = (1.0, 1.02, 1.05, 1.1, 1.2, 1.35)  # by which an arm on the relaxed path is slowed down
MOST_SHIFTED_ORDERS = 2000  # orders begun, when arms only shift their motions
MOST_SHAPED_ORDERS = 40  # orders begun, when motions are shaped


def prioritised(problem: TimingProblem, order: tuple[int, ...]) -> Motions:
    """Every arm as early as it can be among those that come before it in ``order``, which do not yield.

    Raises:
        InfeasibleError: Some arm finds no way among those before it.
    """
    planned: dict[int, PhaseTrajectory] = {order[0]: problem.fastest[order[0]]}
    for arm in order[1:]:
        planned[arm] = respond(problem, arm, planned, ALL_STAGES)
    return tuple(planned[arm] for arm in problem.arms)


def respond(
    problem: TimingProblem,
    arm: int,
    others: dict[int, PhaseTrajectory],
    stages: tuple[Stage, ...],
    horizon: float = np.inf,
) -> PhaseTrajectory:
    """An arm's best response; its own minimum-time motion, started in time, where that is earlier."""
    alone = problem.fastest[arm]
    try:
        shifted = alone.delayed(start_offset(problem, arm, others))
    except InfeasibleError:
        shifted = None
    if shifted is not None and shifted.duration <= (1.0 + LEAST_GAIN_SHARE) * alone.duration:
        return shifted
    try:
        shaped = problem.searches[arm].respond(others, stages=stages, horizon=min(horizon, _end(shifted)))
        if not all(pair_is_free(problem.chart_between(j, arm), other, shaped) for j, other in others.items()):
            raise InfeasibleError("the motion found grazes what is not certified free", reason="not certified")
        return _earlier(shaped, shifted)
    except InfeasibleError as error:
        if shifted is not None:
            return shifted
        names, rules = ", ".join(repr(problem.names[j]) for j in others), problem.rules_of([arm, *others])
        raise InfeasibleError(
            f"arm {problem.names[arm]!r} finds no way among {names}: {error.message}{rules and f' ({rules})'}",
            remedy="try another order, or 'optimal', in which all arms may yield",
            **error.data,
        ) from error


def _end(motion: PhaseTrajectory | None) -> float:
    return np.inf if motion is None else motion.duration


def _earlier(motion: PhaseTrajectory, other: PhaseTrajectory | None) -> PhaseTrajectory:
    return other if other is not None and other.duration <= motion.duration else motion


def improved(problem: TimingProblem, motions: Motions, stages: tuple[Stage, ...]) -> Motions:
    """Best responses in turn, the last to arrive first, until no round gains anything."""
    for _ in range(MOST_ROUNDS):
        before = makespan(motions)
        for arm in sorted(problem.arms, key=lambda k: -motions[k].duration):
            if motions[arm].duration <= problem.fastest[arm].duration * (1.0 + LEAST_GAIN_SHARE):
                continue
            others = {j: motion for j, motion in enumerate(motions) if j != arm}
            try:
                response = respond(problem, arm, others, stages, motions[arm].duration)
            except InfeasibleError:
                continue  # the lattice is too coarse for the motion it has
            if response.duration < motions[arm].duration:
                motions = (*motions[:arm], response, *motions[arm + 1 :])
        if makespan(motions) > (1.0 - LEAST_GAIN_SHARE) * before:
            break
    return motions


class Best:
    """The best plan so far."""

    def __init__(self, problem: TimingProblem) -> None:
        self.problem = problem
        self.enough = (1.0 + CLOSE_ENOUGH_SHARE) * problem.attainable
        self.motions: Motions | None = None
        self.order: tuple[int, ...] = ()

    @property
    def is_enough(self) -> bool:
        """Whether it is not worth improving any more."""
        return self.motions is not None and makespan(self.motions) <= self.enough

    def take(self, motions: Motions, order: tuple[int, ...] | None = None) -> None:
        """Take motions, in their order of priority or else of arrival, if they are better and keep clear."""
        if self.motions is not None and makespan(motions) >= BETTER_SHARE * makespan(self.motions):
            return
        if not self.problem.is_free(motions):
            return
        arrivals = sorted(self.problem.arms, key=lambda k: (motions[k].duration, k))
        self.motions, self.order = motions, tuple(arrivals) if order is None else order


def _guides(problem: TimingProblem) -> Iterator[tuple[int, Occupancy]]:
    """For two arms: one that is taken to move along the relaxed path, slowed down more and more; and which."""
    chart = problem.chart_between(0, 1)
    path = guide_path(problem.fastest[0], problem.fastest[1], chart)
    if path is None:
        return
    clock: Floats = np.arange(len(path), dtype=np.float64) * float(np.diff(path, axis=0).max(initial=0.0))
    for stretch in GUIDE_STRETCHES:
        for arm, swapped in ((0, chart), (1, chart.swapped)):
            yield arm, _virtual(problem.fastest[arm], path[:, arm], np.asarray(stretch * clock), swapped)


def _virtual(fastest: PhaseTrajectory, theta: Floats, clock: Floats, chart: CoordinationChart) -> Occupancy:
    """When an arm is in which column (arm: first index) if at ``clock`` it is where its fastest is at ``theta``."""
    border = fastest.time_at(np.minimum(chart.step_a * np.arange(chart.resolution + 1), fastest.lam[-1]))
    border = np.minimum(border, theta[-1])
    after = np.clip(np.searchsorted(theta, border, side="left"), 1, len(theta) - 1)
    rise = theta[after] - theta[after - 1]
    share = np.divide(border - theta[after - 1], rise, out=np.ones_like(rise), where=rise > 0.0)
    first = clock[after - 1] + share * (clock[after] - clock[after - 1])
    stays = np.searchsorted(theta, border, side="right") - 1  # the last row at a place where it waits
    last = np.maximum(first, np.where(theta[stays] == border, clock[stays], -np.inf))
    enter, leave = first[:-1].copy(), last[1:].copy()
    enter[0], leave[border[1:] >= theta[-1]] = -np.inf, np.inf
    return Occupancy(enter, leave)


def _answered(problem: TimingProblem, arm: int, virtual: Occupancy) -> Motions | None:
    """The other arm answers a virtual one, the arm itself answers that answer; None if either cannot."""
    other = 1 - arm
    try:
        answer = problem.searches[other].respond({arm: virtual}, stages=COARSE_STAGES[:1])
        own = respond(problem, arm, {other: answer}, COARSE_STAGES[:1])
    except InfeasibleError:
        return None
    return (own, answer) if arm == 0 else (answer, own)


def _orders(problem: TimingProblem, plan: Best) -> list[tuple[int, ...]]:
    """All orders of two arms; of more, what a search over orders with start offsets or, failing that, shapes finds."""
    if len(problem.arms) == 2:
        return [(0, 1), (1, 0)]
    latest = np.inf if plan.motions is None else makespan(plan.motions)
    found = _search_orders(problem, latest, shaped=False)
    if found is None and plan.motions is None:
        found = _search_orders(problem, latest, shaped=True)
    return [found] if found else []


def _search_orders(problem: TimingProblem, latest: float, *, shaped: bool) -> tuple[int, ...] | None:
    """Depth first over orders that share what they begin with, cut off at the best makespan so far, ``latest``."""
    best, best_order, nodes = latest, None, 0
    enough = (1.0 + CLOSE_ENOUGH_SHARE) * problem.attainable

    def begin(order: tuple[int, ...], planned: dict[int, PhaseTrajectory], so_far: float) -> None:
        nonlocal best, best_order, nodes
        if len(order) == len(problem.arms):
            best, best_order = so_far, order
            return
        children = []
        for arm in problem.arms:
            if arm in planned or nodes >= (MOST_SHAPED_ORDERS if shaped else MOST_SHIFTED_ORDERS):
                continue
            nodes += 1
            try:
                motion = (
                    respond(problem, arm, planned, COARSE_STAGES)
                    if shaped
                    else problem.fastest[arm].delayed(start_offset(problem, arm, planned))
                )
            except InfeasibleError:
                continue
            children.append((max(so_far, motion.duration), -problem.fastest[arm].duration, arm, motion))
        for reached, _, arm, motion in sorted(children, key=lambda child: child[:3]):
            if reached < best and best > enough:
                begin((*order, arm), {**planned, arm: motion}, reached)

    begin((), {}, 0.0)
    return best_order


def _shifted(problem: TimingProblem, orders: list[tuple[int, ...]]) -> Iterator[tuple[Motions, tuple[int, ...]]]:
    """Plans of start delays and offsets."""
    for order in orders:
        with suppress(InfeasibleError):
            yield delayed(problem, problem.fastest, order), order
    for order in orders:
        with suppress(InfeasibleError):
            yield offset(problem, order), order


def shift_only(best: Best) -> None:
    """Plans of start delays and offsets in the order of the cell and in that of the plan, if they are better."""
    for motions, order in _shifted(best.problem, [best.problem.arms, best.order]):
        best.take(motions, order)


def take_events(best: Best) -> None:
    """For paths with stops: waiting there alone, in the best passing order."""
    planes = best.problem.planes
    stops = any(plane.dynamics.path is not None and len(plane.dynamics.path.stops) for plane in planes)
    if stops and all(best.problem.holdable):
        motions = event_graph(best.problem)
        if motions is not None:
            best.take(motions)


def _take_prioritised(best: Best, orders: list[tuple[int, ...]]) -> None:
    for order in orders:
        if best.is_enough:
            return
        with suppress(InfeasibleError):
            best.take(prioritised(best.problem, order), order)


def _take_guided(best: Best) -> None:
    """For two arms: answers to an arm that is taken to move along the relaxed path, the best two improved."""
    if best.is_enough:
        return
    problem = best.problem
    candidates = [_answered(problem, arm, virtual) for arm, virtual in _guides(problem)]
    for motions in sorted((c for c in candidates if c is not None), key=makespan)[:2]:
        best.take(improved(problem, improved(problem, motions, COARSE_STAGES), ALL_STAGES))


def _take_stop_and_go(best: Best) -> None:
    """For two arms that can hold still, if nothing else is found: one at a time, and what improves it."""
    problem = best.problem
    if best.motions is not None or not all(problem.holdable):
        return
    slow = stop_and_go(problem.planes[0], problem.planes[1], problem.chart_between(0, 1))
    if slow is None:
        return
    # its parts are solved on grids of their own
    if max(motion.certificate.excess for motion in slow) <= LIMIT_EXCESS_MAX:
        best.take(slow)
    best.take(improved(problem, improved(problem, slow, COARSE_STAGES), ALL_STAGES))


def best_responses(problem: TimingProblem, best: Best | None = None) -> Best:
    """The best plan that answering arm by arm finds, if there is one that is better than ``best``, which is updated."""
    best = Best(problem) if best is None else best
    before = best.motions
    orders = _orders(problem, best)
    for motions, order in _shifted(problem, orders):
        best.take(motions, order)
    _take_prioritised(best, orders)
    if len(problem.arms) == 2:
        _take_guided(best)
        _take_stop_and_go(best)
    if best.motions is not None and best.motions is not before and not best.is_enough:
        best.take(improved(problem, best.motions, ALL_STAGES))
    return best
