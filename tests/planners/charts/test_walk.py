"""Curves and passable cells of charts, against brute force on small grids."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Ints
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, CoordinationChart

FREE = 0


def chart_of(states: list[list[int]] | Ints, a: float = 1.0, b: float = 1.0) -> CoordinationChart:
    return CoordinationChart(states=np.array(states, dtype=np.uint8), length_a=a, length_b=b, d_min=0.0)


def random_chart(seed: int, share: float = 0.25, cells: int = 8) -> CoordinationChart:
    generator = np.random.default_rng(seed)
    states = np.where(generator.random((cells, cells)) < share, generator.integers(1, 3, (cells, cells)), 0)
    return chart_of(states, 2.0, 0.5)


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 4), on_grid=st.booleans())
def test_a_curve_is_free_where_all_it_touches_is(seed: int, count: int, on_grid: bool) -> None:
    """A segment must be told blocked as soon as one of its points is, and free where a thin tube about it is."""
    generator = np.random.default_rng(seed)
    chart = random_chart(seed, 0.12)
    points = generator.uniform(0.0, 1.0, (count, 2))
    if on_grid:
        points = np.round(points * 8) / 8
    points *= [chart.length_a, chart.length_b]
    told = chart.is_free_along(points[:, 0], points[:, 1])
    dense = np.concatenate(
        [low + (high - low) * np.linspace(0, 1, 400)[:, None] for low, high in itertools.pairwise(points)] or [points]
    )
    seen = all(chart.is_free(*point) for point in dense)
    assert seen or not told
    if seen and not told:  # something is grazed between the samples: a tube about the curve finds it
        near = 1e-3 * np.array([chart.length_a, chart.length_b])
        assert not all(
            chart.is_free(*((max(x - r, 0.0), min(x + r, top)) for x, r, top in zip(
                point, near, (chart.length_a, chart.length_b), strict=True)))
            for point in dense
        )  # fmt: skip
    boxes = all(
        chart.is_free(*(tuple(sorted(side)) for side in zip(low, high, strict=True)))
        for low, high in itertools.pairwise(points)
    ) if count > 1 else told  # fmt: skip
    assert chart.is_free_along(points[:, 0], points[:, 1], straight=False) == boxes
    assert told or not boxes
    assert chart.is_free_along(points[::-1, 0], points[::-1, 1]) == told


def test_a_diagonal_touches_the_corners() -> None:
    chart = chart_of([[0, 1], [0, 0]])
    assert not chart.is_free_along([0.0, 1.0], [0.0, 1.0])  # through the corner of the blocked cell
    assert chart.is_free_along([0.1, 1.0], [0.0, 0.85])
    assert not chart.is_free_along([0.1, 1.0], [0.0, 0.85], straight=False)
    assert chart.is_free_along([0.1, 0.6, 1.0], [0.0, 0.1, 0.85], straight=True)
    assert chart.is_free_along(0.25, 0.25)


def test_wrong_curves_are_refused(lee1991: CoordinationCell) -> None:
    chart = lee1991.chart
    for a, b, what in (
        ([0.0, 0.1], [0.0], "shapes"),
        ([], [], "shapes"),
        ([[0.0]], [[0.0]], "shapes"),
        ([0.0, 9.0], [0.0, 0.1], "leaves the path"),
        ([0.0, np.nan], [0.0, 0.1], "leaves the path"),
    ):
        with pytest.raises(InputError, match=what):
            chart.is_free_along(a, b)


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), share=st.floats(0.0, 0.6))
def test_passable_cells_are_those_on_some_monotone_walk(seed: int, share: float) -> None:
    chart = random_chart(seed, share, 6)
    free = chart.states == FREE
    wanted = np.zeros((6, 6), dtype=bool)
    walks = [[(0, 0)]] if free[0, 0] else []
    while walks:  # all of them, one by one
        walk = walks.pop()
        i, j = walk[-1]
        if (i, j) == (5, 5):
            wanted[tuple(np.transpose(walk))] = True
        walks += [[*walk, (k, m)] for k, m in ((i + 1, j), (i, j + 1)) if k < 6 and m < 6 and free[k, m]]
    np.testing.assert_array_equal(chart.passable, wanted)
    np.testing.assert_array_equal(chart.swapped.passable, wanted.T)


def test_deadlocks_and_dead_ends_are_not_passable(lee1991: CoordinationCell) -> None:
    # A pocket open to the south-west is a deadlock; one open to the north-east cannot be entered.
    states = np.zeros((8, 8), dtype=np.int64)
    states[4, 1:5] = states[1:5, 4] = 1
    passable = chart_of(states).passable
    assert not passable[1:4, 1:4].any()
    assert not passable[states > 0].any()
    assert passable[0].all()
    assert passable[:, 0].all()
    assert passable[5:, 5:].all()
    states = np.zeros((8, 8), dtype=np.int64)
    states[3, 3:7] = states[3:7, 3] = 1
    assert not chart_of(states).passable[4:7, 4:7].any()
    chart = lee1991.chart
    assert chart.passable[0, 0]
    assert chart.passable[-1, -1]
    # With the first arm first nothing above the closure is entered before it has passed: both orders are in passable.
    columns = np.minimum(np.floor(chart.closure[:-1] / chart.step_b), chart.resolution)
    below = np.arange(chart.resolution)[None, :] < columns[:, None]
    assert (chart.states[below] == FREE).all()
    left = chart.swapped.closure
    aside = np.arange(chart.resolution)[:, None] < np.minimum(np.floor(left[:-1] / chart.step_a), 1e9)[None, :]
    assert (chart.states[aside] == FREE).all()
    assert chart.passable[below].mean() > 0.99
    assert chart.passable[aside].mean() > 0.99
    with pytest.raises(ValueError, match="read-only"):
        chart.passable[0, 0] = False
