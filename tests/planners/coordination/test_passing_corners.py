"""Corners against the limits that the same orders mean."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armtempo.planners import CoordinationChart
from armtempo.planners.coordination import PassingOrders
from armtempo.planners.coordination._passing_corners import corners_of

CELLS = 12


@st.composite
def passing(draw: st.DrawFn) -> PassingOrders:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    for _ in range(draw(st.integers(1, 5))):
        a, b = draw(st.integers(0, CELLS - 1)), draw(st.integers(0, CELLS - 1))
        states[a : a + draw(st.integers(1, 4)), b : b + draw(st.integers(1, 4))] = 2
    chart = CoordinationChart(states=states, length_a=2.0, length_b=3.0, d_min=0.01)
    return PassingOrders.of_charts([2.0, 3.0], {(0, 1): chart})


@given(passing(), st.data())
def test_corners_say_what_the_limits_say(orders: PassingOrders, data: st.DataObject) -> None:
    row = np.array(data.draw(st.lists(st.integers(0, 1), min_size=len(orders.regions), max_size=len(orders.regions))))
    corners, precedence = corners_of(orders, row.astype(np.int8)), orders.precedence(row)
    middles = {arm: (np.arange(CELLS) + 0.5) * (orders.lengths[arm] / CELLS) for arm in (0, 1)}
    if corners is None:  # somebody would have to wait before the start, or for an arm that stays
        impossible = [
            (region.limit_a if order else region.limit_b)[0] == 0.0
            or (region.begin_b + len(region.limit_a) if order else region.begin_a + len(region.limit_b)) == CELLS
            for (_, _, region), order in zip(orders.regions, row, strict=True)
        ]
        assert any(impossible)
        return
    for first, second in ((0, 1), (1, 0)):
        own = corners.first == first
        for place in middles[first]:
            held = corners.enters[own & (corners.leaves > place)]
            assert held.min(initial=np.inf) == precedence.farthest(second, first, place)


def test_a_block_has_one_corner_on_either_side() -> None:
    states = np.zeros((8, 8), dtype=np.uint8)
    states[2:4, 5:7] = 1
    chart = CoordinationChart(states=states, length_a=8.0, length_b=16.0, d_min=0.01)
    orders = PassingOrders.of_charts([8.0, 16.0], {(0, 1): chart})
    for order, expected in ((0, (0, 4.0, 1, 10.0)), (1, (1, 14.0, 0, 2.0))):
        corners = corners_of(orders, np.array([order], dtype=np.int8))
        assert corners is not None
        assert [column.tolist() for column in corners[1:]] == [[value] for value in expected]
