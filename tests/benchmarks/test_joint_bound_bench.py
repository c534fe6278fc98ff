"""The joint bound on generated rings: above no plan, and its certificates confirmed by another search.

The bound orders events in time. The other search asks no time at all: does any choice of sides let arms that go as far
as they may all arrive?
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import combinations, permutations

import pytest

from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, generate_cell
from armtempo.planners.coordination import (
    Motions,
    PassingOrders,
    PassingRegion,
    delayed,
    makespan,
    offset,
    optimal,
    plan_vci,
)


def lets_all_arrive(cell: CoordinationCell) -> bool:
    """Whether some choice of sides of all blocked regions is free of deadlock: depth first, in the regions' order."""
    pairs = list(combinations(range(len(cell.arms)), 2))
    charts = {pair: cell.bound_chart_between(*pair) for pair in pairs}
    empty = PassingOrders.of_charts([path.length for path in cell.paths], charts)
    regions = [PassingRegion(*pair, region) for pair in pairs for region in charts[pair].cores]

    def leads_on(sides: list[int]) -> bool:
        if sides:  # a precedence lets who has not started wait on the border of his first cell, but he is in it
            last = regions[len(sides) - 1].region
            if (last.begin_b, last.begin_a)[sides[-1]] == 0:
                return False
        decided = PassingOrders(
            lengths=empty.lengths, resolutions=empty.resolutions, regions=tuple(regions[: len(sides)])
        )
        try:
            decided.precedence(sides).check_deadlock_free()
        except InfeasibleError:
            return False
        return len(sides) == len(regions) or leads_on([*sides, 0]) or leads_on([*sides, 1])

    return leads_on([])


@pytest.mark.parametrize("arms", [3, 4, 5, 6])
def test_certificates_of_rings_are_confirmed_and_no_plan_is_below_the_bound(arms: int) -> None:
    for index in range(10):
        cell = generate_cell("ring", 1, index, arms=arms).cell
        least = cell.lower_bound
        assert cell.bound.joint.complete
        assert math.isfinite(least) == lets_all_arrive(cell), cell.name
        plans: list[Callable[[], Motions]] = [partial(_optimal, cell)]
        for order in permutations(range(arms)) if arms <= 4 else [tuple(range(arms))]:
            plans += [
                partial(delayed, cell.timing, cell.fastest, order),
                partial(offset, cell.timing, order),
                partial(_vci, cell, order),
            ]
        for plan in plans:
            with suppress(InfeasibleError):
                assert makespan(plan()) >= cell.planned_bound * (1.0 - 1e-9) >= least * (1.0 - 2e-9), cell.name


def test_a_neck_between_two_regions_is_found_though_no_cell_of_the_chart_is_small_enough() -> None:
    """Open, it would let arms arrive after 0.746 s."""
    cell = generate_cell("ring", 1, 8, arms=6).cell
    assert len(cell.bound_chart_between(1, 2).joined) == 1
    assert cell.lower_bound == pytest.approx(0.8931, rel=1e-3)
    assert makespan(optimal(cell.timing)[0]) <= 1.005 * cell.lower_bound


def test_a_passage_that_only_the_reserve_shuts_is_told_from_a_bad_plan() -> None:
    cell = generate_cell("ring", 1, 8, arms=5).cell
    assert cell.planned_bound > 1.1 * cell.lower_bound
    assert makespan(optimal(cell.timing)[0]) <= 1.005 * cell.planned_bound


def test_eight_arms_that_get_through_in_the_smallest_cells_only() -> None:
    cell = generate_cell("ring", 1, 5, arms=8).cell
    assert makespan(optimal(cell.timing)[0]) <= 1.02 * cell.lower_bound


def _optimal(cell: CoordinationCell) -> Motions:
    return optimal(cell.timing)[0]


def _vci(cell: CoordinationCell, order: tuple[int, ...]) -> Motions:
    return plan_vci(cell.planes, cell.chart_between, order, cell.control_period)[0]
