"""The earliest starts of given motions that keep who passes first where.

While arm j is in a cell of its path, arm i may go up to a limit (``Precedence``): motion i passes that place only after
motion j has left the cell. Each of these events asks that i starts later than j by some time; the earliest starts are
longest paths over these times, if no arms wait for each other in a circle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.coordination._pair_delay import RELEASE_MARGIN
from armtempo.planners.coordination._precedence import Precedence
from armtempo.planners.topp import PhaseTrajectory


def order_delays(precedence: Precedence, motions: Sequence[PhaseTrajectory], names: Sequence[str]) -> Floats:
    """The earliest starts (A,) [s] of motions, one per arm, that obey ``precedence``.

    Raises:
        InfeasibleError: Arms wait for each other: motions would have to be shaped.
    """
    waits = {
        (i, j): _wait(limit, precedence.lengths[j], motions[i], motions[j])
        for (i, j), limit in precedence.limits.items()
    }
    start, circle = np.zeros(len(motions)), set[int]()
    for _ in range(len(motions) + 1):
        later, circle = start.copy(), set()
        for (i, j), wait in waits.items():
            if start[j] + wait > later[i]:
                later[i] = start[j] + wait
                circle |= {i, j}
        if not circle:
            return start
        start = later
    raise InfeasibleError(
        "no start delays keep this plan's passing order with these motions: arms "
        f"{' and '.join(repr(names[i]) for i in sorted(circle))} wait for each other",
        remedy="try a method that only shifts motions (delay, offset), or another order",
        reason="arms wait for each other",
    )


def _wait(limit: Floats, length: float, behind: PhaseTrajectory, ahead: PhaseTrajectory) -> float:
    """How much later than ``ahead`` an arm must start that stays within ``limit`` (cells of the other's path) [s]."""
    cells = np.flatnonzero(limit < behind.lam[-1])
    if not len(cells):
        return -np.inf
    left = ahead.time_at(np.minimum((cells + 1) * (length / len(limit)), ahead.lam[-1]))
    return float((left - behind.time_at(limit[cells])).max()) + RELEASE_MARGIN
