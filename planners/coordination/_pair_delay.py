"""The start delay of two arms: the wait that keeps one behind the other in every region (coordination FACT 3)."""

from __future__ import annotations

import numpy as np

from armtempo.errors import InfeasibleError
from armtempo.planners.charts import CoordinationChart
from armtempo.planners.topp import PhaseTrajectory

RELEASE_MARGIN = 1e-5  # [s] added to a start delay, so that the motion passes beside the corner of a chart cell


def pair_delay(
    chart: CoordinationChart, names: tuple[str, str], leading: PhaseTrajectory, following: PhaseTrajectory
) -> float:
    """How much later than the first arm the second must start to stay behind it everywhere [s]; may be negative.

    Args:
        chart: Their chart, the first arm along its first index.
        names: Their names.
        leading: The first arm's motion.
        following: The second's.

    Raises:
        InfeasibleError: The start of the second is not safe to wait in, or the end of the first is in its way.
    """
    rows = np.flatnonzero(chart.last_column >= 0)
    if not len(rows):
        return -np.inf
    if rows[0] == 0:
        _refuse_for_rule(chart, int(chart.last_column[0]), 0, f"arm {names[1]!r} cannot wait at its start")
        raise InfeasibleError(
            f"arm {names[1]!r} cannot wait at its start: arm {names[0]!r} passes closer than {chart.d_min:.4g} m",
            remedy="let it go first (swap the order of the arms), lower d_min_m, or move its start",
            reason="unsafe start",
        )
    last = chart.last_column[rows]
    if last.max() >= chart.resolution - 1:
        _refuse_for_rule(
            chart, int(last.max()), int(rows[last.argmax()]), f"arm {names[0]!r} cannot go first everywhere"
        )
        raise InfeasibleError(
            f"arm {names[0]!r} ends in the way of arm {names[1]!r}: closer than {chart.d_min:.4g} m for ever",
            remedy="let the other go first (swap the order of the arms), or move its end",
            reason="parked in the way",
        )
    released = leading.time_at((last + 1) * chart.step_a)
    reached = following.time_at(rows * chart.step_b)
    return float((released - reached).max()) + RELEASE_MARGIN


def _refuse_for_rule(chart: CoordinationChart, cell_a: int, cell_b: int, what: str) -> None:
    """Raise InfeasibleError if it is a rule that shuts a cell."""
    rule = chart.rule_at(cell_a, cell_b)
    if rule is not None:
        raise InfeasibleError(
            f"{what}: {rule}", remedy="use a method that shapes motions (optimal, interval)", reason="rule"
        )
