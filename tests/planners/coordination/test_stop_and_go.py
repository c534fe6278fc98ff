"""One arm at a time through free cells: never both, as few stops as the chart allows, and only where there is a way."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armtempo.arrays import Bools
from armtempo.planners.coordination import TimingProblem, pair_is_free
from armtempo.planners.coordination._stop_and_go import _corners, rest_to_rest, stop_and_go

Problems = Callable[..., TimingProblem]
CELLS = 6


def turns_by_search(shut: Bools) -> float:
    """The fewest turns of a monotone path from the first cell to the last, by trying all."""
    best = np.inf
    stack = [(0, 0, -1, 0)] if not shut[0, 0] else []
    while stack:
        i, j, along, turns = stack.pop()
        if (i, j) == (CELLS - 1, CELLS - 1):
            best = min(best, turns)
        for axis, (k, m) in enumerate(((i + 1, j), (i, j + 1))):
            if k < CELLS and m < CELLS and not shut[k, m]:
                stack.append((k, m, axis, turns + (along >= 0 and axis != along)))
    return best


@given(arrays(np.bool_, (CELLS, CELLS), elements=st.sampled_from([False, False, False, True])))
def test_the_corners_are_those_of_a_free_path_with_the_fewest_turns(shut: Bools) -> None:
    corners = _corners(shut)
    fewest = turns_by_search(shut)
    if corners is None:
        assert fewest == np.inf
        return
    assert corners[0] == (0, 0)
    assert corners[-1] == (CELLS - 1, CELLS - 1)
    assert len(corners) - 2 == fewest
    for (i, j), (k, m) in pairwise(corners):
        assert (i == k) != (j == m)
        assert not shut[i : k + 1, j : m + 1].any()


def test_one_block_in_the_middle_takes_two_whole_moves(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.3, 0.6, 0.3, 0.6)]})
    chart = problem.chart_between(0, 1)
    plan = stop_and_go(problem.planes[0], problem.planes[1], chart)
    assert plan is not None
    assert sorted(motion.duration for motion in plan) == pytest.approx([2.0, 4.0], abs=1e-3)
    assert pair_is_free(chart, *plan)


def test_they_never_move_both(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.0, 0.2, 0.3, 1.0), (0.4, 1.0, 0.0, 0.6), (0.5, 0.6, 0.7, 0.9)]})
    chart = problem.chart_between(0, 1)
    plan = stop_and_go(problem.planes[0], problem.planes[1], chart)
    assert plan is not None
    instants = np.linspace(0.0, max(motion.duration for motion in plan), 2001)
    speeds = [motion.at(instants)[1] for motion in plan]
    assert (np.minimum(*speeds) < 1e-9).all()
    assert (np.maximum(*speeds) > 1e-9).mean() > 0.99  # and never wait for nothing
    assert pair_is_free(chart, *plan)
    for motion in plan:
        assert motion.certificate.excess < 1e-6
        assert motion.certificate.end_error == 0.0


def test_behind_a_wall_there_is_no_way(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.4, 0.5, 0.0, 1.0)]})
    assert stop_and_go(problem.planes[0], problem.planes[1], problem.chart_between(0, 1)) is None


def test_a_gap_that_only_the_finest_cells_show_is_found(make_problem: Problems) -> None:
    states = np.zeros((1024, 1024), dtype=np.uint8)
    states[301:303] = 2  # a wall through one column of pairs of cells, with a gap of one cell
    states[301:303, 701] = 0
    problem = make_problem({(0, 1): states}, resolution=1024)
    plan = stop_and_go(problem.planes[0], problem.planes[1], problem.chart_between(0, 1))
    assert plan is not None
    assert float(plan[1].lam[np.searchsorted(plan[1].lam, 0.6)]) <= 702 / 1024
    instants = np.linspace(0.0, plan[0].duration, 2001)
    place = plan[0].at(instants)[0] * 1024
    passing = (place > 301.001) & (place < 302.999)
    assert passing.any()
    assert (np.floor(plan[1].at(instants[passing])[0] * 1024) == 701).all()


def test_from_rest_to_rest_it_takes_the_square_root_of_four_times_the_way(make_problem: Problems) -> None:
    plane = make_problem({}).planes[0]
    for start, stop in ((0.0, 0.25), (0.25, 0.75), (0.9, 1.0)):
        move = rest_to_rest(plane, start, stop)
        assert move.duration == pytest.approx(2.0 * np.sqrt(stop - start), rel=1e-3)
        assert (move.lam[0], move.lam[-1]) == (start, stop)
        assert (move.mu[0], move.mu[-1]) == (0.0, 0.0)
