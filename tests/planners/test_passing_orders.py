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
def test_limits_are_those_of_the_cells(chart: CoordinationChart) -> None:
    """Oracle: the rule, cell by cell."""
    orders = orders_of(chart)
    assert len(orders.regions) == chart.regions
    for label, region in enumerate(orders.regions, start=1):
        cells = np.argwhere(chart.labels == label)
        for c in range(CELLS):
            for begin, limit, along, step in (
                (region.begin_b, region.limit_a, cells[:, ::-1], chart.step_a),
                (region.begin_a, region.limit_b, cells, chart.step_b),
            ):
                ahead = along[along[:, 0] >= c, 1]
                expected = ahead.min() * step if len(ahead) else np.inf
                found = np.inf if c >= begin + len(limit) else limit[max(c - begin, 0)]
                assert found == expected


def walk_exists(chart: CoordinationChart, orders: PassingOrders, row: Ints) -> bool:
    """Exhaustive: a monotone walk over free cells from corner to corner that passes every region on its side."""
    free = chart.states == 0
    for region, order in zip(orders.regions, row, strict=True):
        for c in range(CELLS):  # cells past a limit are on the wrong side
            if order:
                limit = (
                    np.inf if c >= region.begin_b + len(region.limit_a) else region.limit_a[max(c - region.begin_b, 0)]
                )
                free = free & ~((np.arange(CELLS)[:, None] * chart.step_a >= limit) & (np.arange(CELLS)[None, :] == c))
            else:
                limit = (
                    np.inf if c >= region.begin_a + len(region.limit_b) else region.limit_b[max(c - region.begin_a, 0)]
                )
                free = free & ~((np.arange(CELLS)[None, :] * chart.step_b >= limit) & (np.arange(CELLS)[:, None] == c))
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
    for wrong in ([], [2], [0, 1]):
        with pytest.raises(InputError, match="orders must be"):
            orders.precedence(wrong)
    with pytest.raises(InputError, match="no pair"):
        PassingOrders.of_charts([2.0, 3.0], {(1, 0): chart_of(states.copy())})
