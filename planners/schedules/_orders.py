"""Which arm has priority over which: orders of the arms, tried until the best plan of a method is found."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from armtempo.errors import InfeasibleError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import arm_orders, delayed, makespan
from armtempo.planners.schedules._schedule import Schedule

ARMS_ALL_TRIED = 5  # see ``arm_orders``
SHAPED_TRIED = 6  # orders in which motions are shaped: those with which start delays do best
BETTER_SHARE = 1e-6  # of a makespan: by less no order is better than the cell's own

Order = tuple[int, ...]


def all_orders(cell: CoordinationCell) -> list[Order]:
    """Orders to try, that of the cell first."""
    return arm_orders([motion.duration for motion in cell.fastest], ARMS_ALL_TRIED)


def promising_orders(cell: CoordinationCell) -> list[Order]:
    """The cell's own, and those in which start delays are shortest."""
    times: dict[Order, float] = {}
    for order in all_orders(cell):
        try:
            times[order] = makespan(delayed(cell.timing, cell.fastest, order))
        except InfeasibleError:
            times[order] = float("inf")
    own = tuple(range(len(cell.arms)))
    best = sorted(times, key=times.__getitem__)[:SHAPED_TRIED]
    return [own, *(order for order in best if order != own)]


def best_of(plan: Callable[[Order], Schedule], orders: Iterable[Order]) -> Schedule:
    """The shortest plan, the earlier order where two are as short.

    Raises:
        InfeasibleError: There is none, as the first order says.
    """
    best: Schedule | None = None
    first: InfeasibleError | None = None
    for order in orders:
        try:
            found = plan(order)
        except InfeasibleError as refusal:
            first = first or refusal
            continue
        if best is None or found.makespan < (1.0 - BETTER_SHARE) * best.makespan:
            best = found
    if best is None:
        assert first is not None  # there is an order
        raise first
    return best
