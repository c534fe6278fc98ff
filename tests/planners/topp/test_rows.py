"""What one interval may do, against the rows themselves at many speeds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.topp._rows import (
    EDGE_HIGH,
    EDGE_LOW,
    STATION,
    STATION_BEFORE,
    TWICE_LENGTH,
    Rows,
    beside,
    end_row,
    reach,
)

coefficient = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))
positive = st.floats(0.01, 3.0).map(lambda value: round(value, 3))
ENDS = np.linspace(0.0, 8.0, 401)


def is_inside(value: float, low: float, high: float, margin: float) -> bool | None:
    """Whether it is; None where rounding may decide."""
    if min(abs(value - low), abs(value - high)) < margin:
        return None
    return low < value < high


@settings(max_examples=300)
@given(coefficient, coefficient, coefficient, coefficient, positive, positive, positive)
def test_a_row_at_the_end_allows_exactly_the_speeds_that_keep_it(
    a: float, b: float, r: float, low: float, width: float, d2: float, x: float
) -> None:
    high = low + width
    first, last, band_low, band_high = end_row(a, b, r, low, high, d2, x)
    for y in ENDS:
        kept = is_inside(a * (y - x) / d2 + b * y + r * np.sqrt(y), low, high, 1e-7)
        told = is_inside(y, first, last, 1e-7)
        banned = is_inside(y, band_low, band_high, 1e-7) if band_high > band_low else False
        if kept is None or told is None or banned is None:
            continue
        assert kept == (told and not banned)


def rows_of(a: list[list[float]], b: list[list[float]], r: list[list[float]], low: float, high: float) -> Rows:
    shape = np.shape(a)
    return Rows(
        np.array([0.0, 0.5]), np.array(a), np.array(b), np.array(r), np.full(shape, low), np.full(shape, high),
        np.full(2, 1e12),
    )  # fmt: skip


two_rows = st.lists(st.lists(coefficient, min_size=2, max_size=2), min_size=2, max_size=2)


@settings(max_examples=200)
@given(two_rows, two_rows, two_rows, positive)
def test_an_interval_reaches_exactly_what_keeps_the_rows_at_both_its_ends(
    a: list[list[float]], b: list[list[float]], r: list[list[float]], x: float
) -> None:
    rows = rows_of(a, b, r, -2.0, 3.0)
    bands = np.empty((2, 2))
    first, last, taken = reach(rows, 0, x, 0.0, 6.0, bands)
    for y in ENDS:
        u = (y - x) / (2.0 * 0.5)
        verdicts: list[bool | None] = [is_inside(y, 0.0, 6.0, 1e-7)]
        for k, value in ((0, x), (1, y)):
            for j in range(2):
                if k == 0 and a[0][j] == 0.0:
                    continue  # says nothing of u
                asked = a[k][j] * u + b[k][j] * value + r[k][j] * np.sqrt(value)
                verdicts.append(is_inside(asked, -2.0, 3.0, 1e-6))
        told: list[bool | None] = [is_inside(y, first, last, 1e-6)]
        told += [
            not inside if inside is not None else None
            for inside in (is_inside(y, band[0], band[1], 1e-6) for band in bands[:taken])
        ]
        if None in verdicts or None in told:
            continue
        assert all(verdicts) == all(told)


def test_beside_leaves_bands_that_hang_together_on_the_side_asked_for() -> None:
    bands = np.array([[1.0, 2.0], [1.9, 3.0], [5.0, 6.0]])
    assert beside(1.5, True, bands, 3) == 3.0
    assert beside(2.5, False, bands, 3) == 1.0
    assert beside(4.0, True, bands, 3) == 4.0
    assert beside(2.0, True, bands, 1) == 2.0  # the border is outside; other bands are not looked at
    assert beside(5.5, False, bands, 2) == 5.5


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_steps_hold_stations_edges_and_a_start_for_the_search(friction: float) -> None:
    grid = np.array([0.0, 0.1, 0.15, 0.5, 0.5, 0.8, 1.0])
    one, zero = np.ones((7, 1)), np.zeros((7, 1))
    plane = PhasePlane(PathDynamics(grid, one, zero, friction * one, zero, [-1.0], [1.0]))
    steps, last = plane.edges.steps, len(grid) - 1
    np.testing.assert_array_equal(steps[:, STATION], grid)
    np.testing.assert_array_equal(steps[:, EDGE_LOW], plane.edges.low)
    np.testing.assert_array_equal(steps[:, EDGE_HIGH], plane.edges.high)
    lengths = np.append(2.0 * np.diff(grid), np.nan)
    lengths[lengths == 0.0] = np.nan  # nothing happens in an empty interval
    np.testing.assert_allclose(steps[:, TWICE_LENGTH], lengths if friction == 0.0 else np.nan)
    for k in range(last + 1):
        before = int(steps[k, STATION_BEFORE])
        assert before == 0 or grid[before] <= k / last


def test_the_edges_of_every_interval_can_be_followed(spline_dynamics: Callable[..., PathDynamics]) -> None:
    plane = PhasePlane(spline_dynamics(3, intervals=100))
    rows, edges = plane.rows, plane.edges
    bands = np.empty((2, 2))
    for i in range(len(rows.station) - 1):
        if rows.station[i + 1] == rows.station[i]:
            continue
        for x, there in ((edges.low[i], edges.low_next[i]), (edges.high[i], edges.high_next[i])):
            first, last, _ = reach(rows, i, x, edges.low[i + 1], edges.high[i + 1], bands)
            assert first - 1e-6 * (1.0 + x) <= there <= last + 1e-6 * (1.0 + x)
