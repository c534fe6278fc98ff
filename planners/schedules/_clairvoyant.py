"""What could have been: the best answer to motions that are known from start to end."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import permutations

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import ALL_STAGES, Motions, makespan, pair_is_free, respond
from armtempo.planners.topp import PhaseTrajectory

MOST_ORDERS = 6  # of the arms that answer


def clairvoyant(cell: CoordinationCell, given: Mapping[int, PhaseTrajectory]) -> Motions:
    """The earliest that the other arms can arrive around motions that are ``given``, disturbances and all.

    A policy sees a disturbance when it happens; this knows it beforehand, so the difference is its regret. The given
    arms do not yield: where they could, a policy may do better.

    Args:
        cell: Where.
        given: By arm, motions that stay as they are, free of collisions among themselves.

    Returns:
        One motion per arm. Of several arms that answer, one after the other in the best order that was tried.

    Raises:
        InputError: No such arm, or given motions that collide.
        InfeasibleError: An arm finds no way among those before it.
    """
    arms = range(len(cell.arms))
    for arm in given:
        if arm not in arms:
            raise InputError(f"cell {cell.name!r} has no arm {arm}; it has {len(arms)}")
    for i in given:
        for j in given:
            if i < j and not pair_is_free(cell.chart_between(i, j), given[i], given[j]):
                raise InputError(f"the given motions of arms {i} and {j} collide", remedy="let one of them answer")
    free = [arm for arm in arms if arm not in given]
    best: Motions | None = None
    refusal: InfeasibleError | None = None
    for order in list(permutations(free))[:MOST_ORDERS]:
        planned = dict(given)
        try:
            for arm in order:
                planned[arm] = respond(cell.timing, arm, planned, ALL_STAGES)
        except InfeasibleError as error:
            refusal = refusal or error
            continue
        motions = tuple(planned[arm] for arm in arms)
        if best is None or makespan(motions) < makespan(best):
            best = motions
    if best is None:
        assert refusal is not None
        raise refusal
    return best
