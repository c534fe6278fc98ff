r"""Plans that only shift motions in time: start delays, start offsets, one arm after the other.

**Delay.** With ``tau(lambda)`` the time at which an arm releases another's place ``lambda`` for good and
``theta(lambda)`` the time at which the other's own motion is there, the start must wait for
``max over lambda of (tau - theta)``; for minimum-time motions that is the optimum of its order (coordination FACT 3).
With more arms the delays are a longest path over those of all pairs.

**Offset.** The smallest start at which the motion, as it is, meets no window of the others: it may pass before one
arm and behind another, and before and behind the same one.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

import numpy as np

from armtempo.errors import InfeasibleError
from armtempo.planners.coordination._pair_delay import pair_delay
from armtempo.planners.coordination._time_windows import Occupancy
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem
from armtempo.planners.topp import PhaseTrajectory


def delayed(problem: TimingProblem, motions: Motions, order: tuple[int, ...]) -> Motions:
    """The motions, each started as early as keeps it behind all that come before it in ``order``.

    Raises:
        InfeasibleError: Some arm cannot stay behind one that comes before it.
    """
    start: dict[int, float] = {}
    for arm in order:
        waits = (
            start[j]
            + pair_delay(
                problem.chart_between(j, arm), (problem.names[j], problem.names[arm]), motions[j], motions[arm]
            )
            for j in start
        )
        start[arm] = max([0.0, *waits])
    return tuple(motion.delayed(start[arm]) for arm, motion in enumerate(motions))


def start_offset(problem: TimingProblem, arm: int, others: Mapping[int, PhaseTrajectory]) -> float:
    """The smallest start of an arm's minimum-time motion that meets no window of the others [s].

    Raises:
        InfeasibleError: There is none.
    """
    motion = problem.fastest[arm]
    early, late = [], []
    for other, its_motion in others.items():
        runs = problem.runs(other, arm)
        own = Occupancy.of(motion, motion.lam[-1], len(runs.first) - 1)
        count = np.diff(runs.first)
        start, stop = runs.windows(its_motion)
        early.append(start - np.repeat(own.leave, count))
        late.append(stop - np.repeat(own.enter, count))
    shut_from, shut_to = np.concatenate([np.empty(0), *early]), np.concatenate([np.empty(0), *late])
    shut_from, shut_to = shut_from[shut_to > 0.0], shut_to[shut_to > 0.0]
    by_start = np.argsort(shut_from, kind="stable")
    shut_from, shut_to = shut_from[by_start], np.maximum.accumulate(shut_to[by_start])
    if not len(shut_from) or shut_from[0] >= 0.0:
        return 0.0
    open_at = np.flatnonzero(np.append(shut_from[1:], np.inf) >= shut_to)[0]
    wait = float(shut_to[open_at])
    if np.isinf(wait):
        names = ", ".join(repr(problem.names[j]) for j in others)
        raise InfeasibleError(
            f"no start of the minimum-time motion of arm {problem.names[arm]!r} keeps clear of {names}",
            remedy="try another order, or a method that shapes motions (interval, optimal)",
            reason="no offset",
        )
    return wait


def offset(problem: TimingProblem, order: tuple[int, ...]) -> Motions:
    """Minimum-time motions, each started as early as meets none of those that come before it in ``order``."""
    planned: dict[int, PhaseTrajectory] = {}
    for arm in order:
        planned[arm] = problem.fastest[arm].delayed(start_offset(problem, arm, planned))
    return tuple(planned[arm] for arm in problem.arms)


def one_by_one(problem: TimingProblem, order: tuple[int, ...]) -> tuple[Motions, tuple[int, ...]]:
    """Each arm in minimum time after the one before it has arrived; in ``order``, or the first that is safe.

    Raises:
        InfeasibleError: In every order some arm starts or ends in the way of another.
    """
    refusal: InfeasibleError | None = None
    for candidate in (order, order[::-1], *permutations(problem.arms)):
        try:
            delayed(problem, problem.fastest, candidate)  # all must be able to wait for all before them
        except InfeasibleError as error:
            refusal = refusal or error
            continue
        motions, start = list(problem.fastest), 0.0
        for arm in candidate:
            motions[arm] = problem.fastest[arm].delayed(start)
            start += problem.fastest[arm].duration
        return tuple(motions), candidate
    assert refusal is not None
    raise refusal
