"""Collision regions of charts and their limits, cell by cell, against brute force on small grids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Bools, Floats
from armtempo.planners import CoordinationChart
from armtempo.planners.charts import FREE, CollisionRegion, cells_at, limit_at
from armtempo.planners.charts.kernels import cell_at
from armtempo.robots import njit

CELLS = 8


@st.composite
def charts(draw: st.DrawFn) -> CoordinationChart:
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    share = draw(st.floats(0.0, 0.4))
    states = np.where(generator.random((CELLS, CELLS)) < share, generator.integers(1, 3, (CELLS, CELLS)), FREE)
    return CoordinationChart(states=states.astype(np.uint8), length_a=2.0, length_b=0.5, d_min=0.0)


def whole_chart(region: CollisionRegion) -> Bools:
    """The region's cells where they are in the chart."""
    out = np.zeros((CELLS, CELLS), dtype=np.bool_)
    a, b = region.cells.shape
    out[region.begin_a : region.begin_a + a, region.begin_b : region.begin_b + b] = region.cells
    return out


@settings(max_examples=80, deadline=None)
@given(charts())
def test_every_cell_that_is_not_free_is_of_one_region_with_all_that_touch_it(chart: CoordinationChart) -> None:
    assert chart.regions == len(chart.components)
    labels = np.zeros((CELLS, CELLS), dtype=np.int64)
    for number, region in enumerate(chart.components, start=1):
        cells = whole_chart(region)
        assert not labels[cells].any()
        labels[cells] = number
        reached = np.zeros_like(cells)  # by steps to neighbours, corners included
        reached[tuple(np.argwhere(cells)[0])] = True
        for _ in range(CELLS * CELLS):
            for i, j in np.argwhere(reached):
                reached[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2] = True
            reached &= cells
        np.testing.assert_array_equal(reached, cells)
    np.testing.assert_array_equal(labels > 0, chart.states != FREE)
    for i, j in np.argwhere(labels > 0):
        about = labels[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2]
        assert (about[about > 0] == labels[i, j]).all()
    begins = [region.begin_a for region in chart.components]
    assert begins == sorted(begins)


@settings(max_examples=80, deadline=None)
@given(charts())
def test_limits_and_ends_are_those_of_the_cells(chart: CoordinationChart) -> None:
    for region in chart.components:
        cells = np.argwhere(whole_chart(region))
        low, high = cells.min(axis=0), cells.max(axis=0) + 1
        assert region.lam_a == (low[0] * chart.step_a, high[0] * chart.step_a)
        assert region.lam_b == (low[1] * chart.step_b, high[1] * chart.step_b)
        for whole, along, step in (
            (region.whole_limit_a, cells[:, ::-1], chart.step_a),
            (region.whole_limit_b, cells, chart.step_b),
        ):
            for c in range(CELLS):
                ahead = along[along[:, 0] >= c, 1]
                assert whole[c] == (ahead.min() * step if len(ahead) else np.inf)
        for a, end in enumerate(region.end_b, start=region.begin_a):
            last = cells[cells[:, 0] == a, 1].max() + 1
            assert end == (last * chart.step_b if last < CELLS else np.inf)


@settings(max_examples=40, deadline=None)
@given(charts())
def test_the_least_limit_of_all_regions_is_the_closure_of_the_chart(chart: CoordinationChart) -> None:
    for one, whole in (
        (chart.closure, [region.whole_limit_b for region in chart.components]),
        (chart.swapped.closure, [region.whole_limit_a for region in chart.components]),
    ):
        np.testing.assert_array_equal(np.min([np.full(CELLS, np.inf), *whole], axis=0), one[:-1])


def test_regions_are_found_once_and_cannot_be_written() -> None:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    states[2, 3] = 1
    chart = CoordinationChart(states=states, length_a=2.0, length_b=0.5, d_min=0.0)
    assert chart.components is chart.components
    (region,) = chart.components
    for array in (region.cells, region.limit_a, region.limit_b, region.end_b):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@njit
def _cells_one_by_one(lam: Floats, length: float, cells: int, out: Floats) -> None:
    for k in range(lam.shape[0]):
        out[k] = cell_at(lam[k], cells / length, cells)


def test_the_border_of_two_cells_is_in_the_earlier_one_compiled_or_not() -> None:
    length, cells = 0.7, 5
    border: Floats = length / cells * np.arange(cells + 1, dtype=np.float64)
    found = np.empty(cells + 1)
    _cells_one_by_one(border, length, cells, found)
    np.testing.assert_array_equal(found, [0, 0, 1, 2, 3, 4])
    np.testing.assert_array_equal(cells_at(border, length, cells), found)
    behind: Floats = border[:-1] + 1e-6
    np.testing.assert_array_equal(cells_at(behind, length, cells), np.arange(cells))
    limit = np.array([1.0, 2.0, 3.0, 4.0, np.inf])
    np.testing.assert_array_equal(limit_at(limit, length, behind), limit)
