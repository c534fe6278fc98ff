"""Which charts deserve smaller cells: those whose undecided cells cost time, as far as relaxed searches can tell.

With all undecided cells shut the joint relaxed search tells what plans in free cells can attain at best; with all of
them open, what they could if every cell were decided, each for the best. Where the two differ, finer cells may gain as
much, and nowhere else. A passage that is a little too narrow for the cells shows as a large difference, too.

Every arm more is one more that waits, and hands on what it has lost to the next: of many arms less is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from armtempo.planners.charts import MAX_RESOLUTION, UNDECIDED, CoordinationChart
from armtempo.planners.coordination._joint_bound import joint_bound
from armtempo.planners.coordination._passing_orders import PassingRegion
from armtempo.planners.topp import PhaseTrajectory

Pair = tuple[int, int]

COST_SHARE = 0.003  # of the relaxed makespan of two arms: what undecided cells of all pairs together may cost
PAIR_SHARE = 0.001  # likewise one pair's, if all together cost more
USUAL_RESOLUTION = 4096  # finer ones only for arms that would not get through at all
MOST_UNDECIDED = 40  # cells per row: of more it is not the borders of regions that are undecided, and will stay so


def _may_be_refined(chart: CoordinationChart, finest: int) -> bool:
    undecided = int((chart.states == UNDECIDED).sum())
    return 2 * chart.resolution <= finest and 0 < undecided <= MOST_UNDECIDED * chart.resolution


def pairs_to_refine(
    fastest: Sequence[PhaseTrajectory], charts: Mapping[Pair, CoordinationChart], *, last_resort: bool = False
) -> tuple[Pair, ...]:
    """The pairs whose charts should get cells of half the side; none where undecided cells cost next to nothing.

    Args:
        fastest: Minimum-time motion of every arm.
        charts: Planning charts of all pairs i < j.
        last_resort: Only where arms would not get through at all; then to charts of more cells than usual, too.
    """
    finest = MAX_RESOLUTION if last_resort else USUAL_RESOLUTION
    usable = [pair for pair, chart in charts.items() if _may_be_refined(chart, finest)]
    if not usable:
        return ()

    def least(opened: Sequence[Pair]) -> float:
        """The relaxed makespan with the undecided cells of some pairs open."""
        regions = [
            PassingRegion(*pair, region)
            for pair, chart in charts.items()
            for region in (chart.cores if pair in opened else chart.components)
        ]
        return joint_bound(fastest, regions).time

    shut = least(())
    if last_resort and math.isfinite(shut):
        return ()
    opened, others = least(usable), len(fastest) - 1
    if not _worse(shut, opened, COST_SHARE / others):
        return ()
    costly = [
        pair
        for pair in usable
        if _worse(shut, least((pair,)), PAIR_SHARE / others)
        or _worse(least([other for other in usable if other != pair]), opened, PAIR_SHARE / others)
    ]
    return tuple(costly or usable)


def _worse(time: float, than: float, share: float) -> bool:
    return math.isfinite(than) and time > (1.0 + share) * than
