"""Coordination cells: charts found once per pair and clearance, bounds of a finer grid, and what is refused."""

from __future__ import annotations

import copy
import dataclasses

import numpy as np
import pytest

from armtempo.errors import CollisionError, InputError
from armtempo.planners import CoordinationCell, benchmark_instances, build_cell, schedule


def test_a_chart_is_found_once_and_turned_round_for_the_other_order(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart_between(0, 1)
    assert lee1991.chart_between(0, 1) is chart
    assert lee1991.chart is chart
    assert lee1991.chart_at(0, 1, lee1991.planned_clearance) is chart
    np.testing.assert_array_equal(lee1991.chart_between(1, 0).states, chart.states.T)
    assert chart.d_min == pytest.approx(lee1991.d_min + lee1991.clearance_reserve)
    assert lee1991.bound_chart_between(0, 1).d_min == lee1991.d_min


def test_a_pair_that_is_none_is_refused(lee1991: CoordinationCell) -> None:
    for pair in ((0, 0), (0, 2), (-1, 0)):
        with pytest.raises(InputError, match=r"has no pair of arms .*; it has 2 arms"):
            lee1991.chart_between(*pair)


def test_bound_motions_are_as_fast_as_the_plans_to_the_share_that_they_tell(lee1991: CoordinationCell) -> None:
    for (fine, share), planned in zip(lee1991.bound_motions, lee1991.fastest, strict=True):
        assert 0.0 <= share < 1e-3
        assert (1.0 - share) * fine.duration <= planned.duration
        assert len(fine.lam) > 8000
    assert lee1991.lower_bound == lee1991.bound.time
    assert lee1991.lower_bound >= max((1.0 - share) * fine.duration for fine, share in lee1991.bound_motions)


def test_one_after_the_other_takes_the_sum(lee1991: CoordinationCell) -> None:
    assert lee1991.sequential_makespan == sum(motion.duration for motion in lee1991.fastest)
    assert lee1991.holdable == (True, True)


def test_more_clearance_never_has_fewer_cells_in_the_way(lee1991: CoordinationCell) -> None:
    near, far = lee1991.passing_orders(), lee1991.passing_orders(0.05)
    assert len(near.regions) >= 1
    assert len(far.regions) >= 1
    shut = [(lee1991.chart_at(0, 1, lee1991.planned_clearance + extra).states != 0) for extra in (0.0, 0.05)]
    assert (shut[1] | ~shut[0]).all()
    assert shut[1].sum() > shut[0].sum()


def test_arms_that_start_or_end_too_near_are_refused(lee1991: CoordinationCell) -> None:
    gaps = [
        lee1991.clearance.arms([path.evaluate(end * path.length)[0] for path in lee1991.paths]).distance
        for end in (0.0, 1.0)
    ]
    least = min(gaps)
    where = ("start", "end")[int(np.argmin(gaps))]
    reserve = lee1991.config.clearance_reserve_m
    tight = lee1991.config.model_copy(update={"d_min_m": least - reserve + 1e-6})
    with pytest.raises(CollisionError, match=f"the arms collide where they {where}") as caught:
        CoordinationCell.from_config(tight)
    assert caught.value.data["clearance_m"] == pytest.approx(least)
    assert str(lee1991.config.source) in str(caught.value)
    allowed = dataclasses.replace(lee1991, config=lee1991.config.model_copy(update={"d_min_m": least - reserve - 1e-6}))
    allowed.check_ends()


def test_nothing_in_it_changes_so_a_copy_is_itself(lee1991: CoordinationCell) -> None:
    assert copy.deepcopy(lee1991) is lee1991


def test_one_arm_has_nobody_to_meet(lee1991: CoordinationCell) -> None:
    alone = build_cell(lee1991.config.model_copy(update={"arms": lee1991.config.arms[:1]}))
    assert isinstance(alone, CoordinationCell)
    assert alone.priority_class == "free"
    assert alone.fastest[0].duration == lee1991.fastest[0].duration
    assert alone.lower_bound <= alone.sequential_makespan


def test_a_passage_that_the_files_cells_close_is_found_in_smaller_ones() -> None:
    """One of the benchmark's: 1024 cells cost 7.7 % of the makespan, 2048 cost 0.1 %."""
    narrow = next(one for one in benchmark_instances() if one.name == "planar-1991-0065").build()
    assert narrow.chart_as_given(0, 1).resolution == narrow.config.chart_cells == 1024
    assert narrow.chart_between(0, 1).resolution == narrow.bound_chart_between(1, 0).resolution == 2048
    assert schedule(narrow, "optimal").gap_percent < 0.3


def test_charts_that_cost_nothing_stay_as_the_file_has_them(lee1991: CoordinationCell) -> None:
    assert lee1991.chart_as_given(0, 1) is lee1991.chart_between(0, 1)
