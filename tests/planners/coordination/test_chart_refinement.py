"""Which charts get smaller cells: those whose undecided cells cost time, no others."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from armtempo.planners import CoordinationChart
from armtempo.planners.coordination import TimingProblem, pairs_to_refine

CELLS = 256
PAIRS = ((0, 1), (0, 2), (1, 2))
States = NDArray[np.uint8]


@pytest.fixture(scope="module")
def alone(make_problem: Callable[..., TimingProblem]) -> TimingProblem:
    """Of three arms that never meet."""
    return make_problem({}, arms=3)


def block(low: int, high: int, *, rim: int = 0) -> States:
    """Cells ``low`` to ``high`` of both paths are blocked, ``rim`` cells round them undecided."""
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    states[low - rim : high + rim, low - rim : high + rim] = 1
    states[low:high, low:high] = 2
    return states


def charts_of(states: Mapping[tuple[int, int], States]) -> dict[tuple[int, int], CoordinationChart]:
    free = np.zeros((CELLS, CELLS), dtype=np.uint8)
    return {
        pair: CoordinationChart(states=states.get(pair, free), length_a=1.0, length_b=1.0, d_min=0.01) for pair in PAIRS
    }


def test_a_rim_that_makes_an_arm_wait_longer_is_refined_and_one_aside_is_not(alone: TimingProblem) -> None:
    aside = np.zeros((CELLS, CELLS), dtype=np.uint8)
    aside[20:60, 180:220], aside[24:56, 184:216] = 1, 2
    charts = charts_of({(0, 1): block(100, 156, rim=4), (1, 2): aside})
    assert pairs_to_refine(alone.fastest, charts) == ((0, 1),)


def test_a_passage_that_undecided_cells_close_is_refined(alone: TimingProblem) -> None:
    wall = np.zeros((CELLS, CELLS), dtype=np.uint8)
    wall[100:120], wall[100:120, 60:70] = 2, 1
    assert pairs_to_refine(alone.fastest, charts_of({(0, 2): wall})) == ((0, 2),)


def test_two_that_are_equally_in_the_way_are_both_refined(alone: TimingProblem) -> None:
    charts = charts_of({(0, 1): block(100, 156, rim=4), (0, 2): block(100, 156, rim=4)})
    assert set(pairs_to_refine(alone.fastest, charts)) >= {(0, 1), (0, 2)}


WALL = np.zeros((CELLS, CELLS), dtype=np.uint8)
WALL[100], WALL[100, 50:60], WALL[140] = 2, 1, 2


@pytest.mark.parametrize(
    ("why", "states"),
    [
        ("all is decided", block(100, 156)),
        ("there is no way at all", WALL),
        ("shapes that overlap are undecided in cells of any size", block(60, 180, rim=40)),
    ],
)
def test_nothing_is_refined_where_nothing_is_to_gain(alone: TimingProblem, why: str, states: States) -> None:
    assert pairs_to_refine(alone.fastest, charts_of({(0, 1): states})) == (), why


def test_charts_of_many_cells_are_refined_only_where_arms_would_not_get_through(alone: TimingProblem) -> None:
    states = np.zeros((4096, 4096), dtype=np.uint8)
    states[2000:2100, 2000:2100] = 1
    chart = CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)
    for last_resort in (False, True):
        assert pairs_to_refine(alone.fastest[:2], {(0, 1): chart}, last_resort=last_resort) == ()
    shut = states.copy()
    shut[2000] = 1
    chart = CoordinationChart(states=shut, length_a=1.0, length_b=1.0, d_min=0.01)
    assert pairs_to_refine(alone.fastest[:2], {(0, 1): chart}) == ()
    assert pairs_to_refine(alone.fastest[:2], {(0, 1): chart}, last_resort=True) == ((0, 1),)


def test_of_more_arms_less_is_allowed(alone: TimingProblem) -> None:
    states = np.kron(block(100, 156), np.ones((4, 4), dtype=np.uint8))
    states[398:626, 398:626] = np.maximum(states[398:626, 398:626], 1)
    charts = {(0, 1): CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)}
    assert [pairs_to_refine(alone.fastest[:arms], charts) for arms in (2, 3)] == [(), ((0, 1),)]
