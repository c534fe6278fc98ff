"""Passing orders region by region, against the charts' cells themselves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from armtempo.arrays import Ints
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationChart, Precedence
from armtempo.planners.coordination import PassingOrders

CELLS = 8


def chart_of(states: NDArray[np.uint8]) -> CoordinationChart:
    return CoordinationChart(states=states, length_a=2.0, length_b=3.0, d_min=0.01)


@st.composite
def charts(draw: st.DrawFn) -> CoordinationChart:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    for _ in range(draw(st.integers(1, 4))):
        a, b = draw(st.integers(0, CELLS - 1)), draw(st.integers(0, CELLS - 1))
        states[a : a + draw(st.integers(1, 3)), b : b + draw(st.integers(1, 3))] = draw(st.sampled_from([1, 2]))
    states[0, 0] = states[-1, -1] = 0
    return chart_of(states)


def orders_of(chart: CoordinationChart) -> PassingOrders:
    return PassingOrders.of_charts([chart.length_a, chart.length_b], {(0, 1): chart})


@given(charts())
def test_regions_are_those_of_the_chart(chart: CoordinationChart) -> None:
    assert orders_of(chart).regions == tuple((0, 1, region) for region in chart.components)


def walk_exists(chart: CoordinationChart, orders: PassingOrders, row: Ints) -> bool:
    """Exhaustive: a monotone walk over free cells from corner to corner that passes every region on its side."""
    free = chart.states == 0
    for (_, _, region), order in zip(orders.regions, row, strict=True):  # cells past a limit are on the wrong side
        if order:
            free = free & ~(np.arange(CELLS)[:, None] * chart.step_a >= region.whole_limit_a[None, :])
        else:
            free = free & ~(np.arange(CELLS)[None, :] * chart.step_b >= region.whole_limit_b[:, None])
    reached = np.zeros_like(free)
    reached[0, 0] = free[0, 0]
    for a in range(CELLS):
        for b in range(CELLS):
            before = (a > 0 and reached[a - 1, b]) or (b > 0 and reached[a, b - 1])
            reached[a, b] = reached[a, b] or (free[a, b] and before)
    return bool(reached[-1, -1])


@settings(max_examples=200)
@given(charts())
def test_feasible_is_what_an_exhaustive_search_finds(chart: CoordinationChart) -> None:
    orders = orders_of(chart)
    any_order = False
    for number in range(2 ** len(orders.regions)):
        row = (number >> np.arange(len(orders.regions))) & 1
        meant = orders.precedence(row)
        try:
            meant.check_deadlock_free()
            # Who may not even stand at the start of its path is in the way there.
            feasible = all(limit[0] > 0.0 for limit in meant.limits.values())
        except InfeasibleError:
            feasible = False
        assert feasible == walk_exists(chart, orders, row)
        any_order = any_order or feasible
    assert any_order == bool(chart.passable[-1, -1] and chart.passable[0, 0])


@given(charts(), st.permutations([0, 1]))
def test_ranks_mean_the_same_limits_as_a_precedence_of_order(chart: CoordinationChart, rank: list[int]) -> None:
    orders = orders_of(chart)
    by_regions = orders.precedence(orders.of_ranks(rank))
    whole = Precedence.of_order([2.0, 3.0], rank, {(0, 1): chart})
    first, second = rank
    np.testing.assert_array_equal(by_regions.limit(second, first) * np.ones(CELLS), whole.limit(second, first))
    np.testing.assert_array_equal(orders.of_precedence(whole), orders.of_ranks(rank))


@given(charts())
def test_orders_survive_the_way_through_a_precedence(chart: CoordinationChart) -> None:
    orders = orders_of(chart)
    for number in range(2 ** len(orders.regions)):
        row = (number >> np.arange(len(orders.regions))) & 1
        meant = orders.precedence(row)
        try:
            meant.check_deadlock_free()
        except InfeasibleError:
            continue
        np.testing.assert_array_equal(orders.of_precedence(meant), row)


def test_wrong_orders_are_refused() -> None:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    states[3, 3] = 2
    orders = orders_of(chart_of(states))
    for wrong in ([], [3], [0, 1]):
        with pytest.raises(InputError, match="orders must be"):
            orders.precedence(wrong)
    with pytest.raises(InputError, match="no pair"):
        PassingOrders.of_charts([2.0, 3.0], {(1, 0): chart_of(states.copy())})
