"""Controllable and admissible sets, against linear programs station by station, and the parts they are made of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from armtempo.arrays import Floats
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.topp._controllable_sets import (
    SET_INTERVALS_MAX,
    _cut_bands,
    _half_plane,
    _merge,
    controllable_sets,
)
from armtempo.planners.topp._rows import Rows

SPEEDS = np.linspace(0.0, 4.0, 401)


def extremes(rows: Rows, i: int, low: float, high: float) -> tuple[float, float]:
    """The lowest and the highest ``x`` from which some ``u`` keeps the rows at both ends and ends in [low, high]."""
    d2 = 2.0 * (rows.station[i + 1] - rows.station[i])
    A = [*np.stack([rows.a[i], rows.b[i]], axis=1), *np.stack([rows.a[i + 1] + d2 * rows.b[i + 1], rows.b[i + 1]], 1)]
    A.append(np.array([d2, 1.0]))
    upper = np.concatenate([rows.high[i], rows.high[i + 1], [high]])
    lower = np.concatenate([rows.low[i], rows.low[i + 1], [low]])
    found = [
        linprog(
            [0.0, sign], np.vstack([A, -np.array(A)]), np.concatenate([upper, -lower]),
            bounds=[(None, None), (0.0, rows.x_cap[i])],
        )
        for sign in (1.0, -1.0)
    ]  # fmt: skip
    assert all(solution.status == 0 for solution in found)
    least, most = (np.asarray(solution.x)[1] for solution in found)
    return float(least), float(most)


@pytest.mark.parametrize(("seed", "gravity"), [(0, True), (1, True), (2, False)])
def test_every_set_is_what_a_linear_program_finds(
    spline_dynamics: Callable[..., PathDynamics], seed: int, gravity: bool
) -> None:
    plane = PhasePlane(spline_dynamics(seed, gravity=gravity, intervals=60))
    assert (plane.counts == 1).all()
    for i in range(len(plane.rows.station) - 1):
        if plane.rows.station[i + 1] == plane.rows.station[i]:
            continue
        low, high = extremes(plane.rows, i, *plane.sets[i + 1, 0])
        assert plane.sets[i, 0, 0] == pytest.approx(low, rel=1e-6, abs=1e-7)
        assert plane.sets[i, 0, 1] == pytest.approx(high, rel=1e-6, abs=1e-7)


def test_a_double_integrator_may_go_the_faster_the_farther_from_its_end() -> None:
    grid, one, zero = np.linspace(0.0, 1.0, 101), np.ones((101, 1)), np.zeros((101, 1))
    plane = PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-2.0], [5.0]), mu_end=0.5)
    np.testing.assert_allclose(plane.sets[:, 0, 1], 0.25 + 2.0 * 2.0 * (1.0 - grid), rtol=1e-12)  # braking at 2
    np.testing.assert_allclose(plane.sets[:, 0, 0], np.maximum(0.25 - 2.0 * 5.0 * (1.0 - grid), 0.0), atol=1e-12)


def test_an_end_faster_than_its_cap_is_told_by_its_station() -> None:
    one, zero = np.ones((3, 1)), np.zeros((3, 1))
    rows = Rows(np.array([0.0, 0.5, 1.0]), one, zero, zero, -one, one.copy(), np.array([9.0, 9.0, 1.0]))
    sets, counts = np.zeros((3, SET_INTERVALS_MAX, 2)), np.zeros(3, dtype=np.int64)
    assert controllable_sets(rows, 1.1, False, np.empty(0), sets, counts) == 2
    assert controllable_sets(rows, 0.9, False, np.empty(0), sets, counts) == -1
    rows.high[0] = rows.low[0] = 50.0  # no such acceleration leads into the next set
    assert controllable_sets(rows, 0.9, False, np.empty(0), sets, counts) == 0


def test_admissible_sets_of_an_arc_end_where_it_takes_all_the_force() -> None:
    """a u + b x within 1, and u alone within 10: from b x = 1 + 10 a on nothing holds."""
    grid, one, zero = np.linspace(0.0, 1.0, 11), np.ones((11, 1)), np.zeros((11, 1))
    M, Q = np.hstack([0.01 * one, one]), np.hstack([one, zero])
    plane = PhasePlane(PathDynamics(grid, M, Q, 0.0 * M, 0.0 * M, [-1.0, -10.0], [1.0, 10.0]))
    np.testing.assert_allclose(plane.admissible[:, 0], [[0.0, np.sqrt(1.1)]] * 11)
    assert np.isnan(plane.admissible[:, 1:]).all()


number = st.floats(-2.0, 2.0).map(lambda value: round(value, 3))


@settings(max_examples=300)
@given(number, number, number)
def test_half_planes_are_cut_exactly(A: float, B: float, C: float) -> None:
    if A == 0.0 and B == 0.0:
        return
    low, high, band_low, band_high = _half_plane(A, B, C, 0.0, 4.0)
    for x in SPEEDS:
        lack = A * x + B * np.sqrt(x) - C
        if abs(lack) < 1e-7 or min(abs(x - edge) for edge in (low, high, band_low, band_high)) < 1e-7:
            continue
        assert (lack < 0.0) == (low <= x <= high and not band_low < x < band_high)


spans = st.lists(st.tuples(st.floats(0.0, 4.0), st.floats(0.0, 4.0)).map(sorted), min_size=1, max_size=3)


@given(spans)
def test_bands_are_taken_out(bands: list[list[float]]) -> None:
    out = np.zeros((SET_INTERVALS_MAX, 2))
    out[0] = 0.5, 3.5
    left = _cut_bands(np.array(bands), len(bands), out)
    for x in SPEEDS:
        if any(x in band for band in bands):
            continue  # bands that touch leave a single speed between them, which may be lost
        expected = 0.5 <= x <= 3.5 and not any(low < x < high for low, high in bands)
        assert any(low <= x <= high for low, high in out[:left]) == expected


@given(spans)
def test_merged_spans_are_sorted_apart_and_cover_the_same(given_spans: list[list[float]]) -> None:
    spans = np.array(given_spans)
    kept = _merge(spans, len(spans))
    ends: Floats = spans[:kept].ravel()
    assert (np.diff(ends)[1::2] > 0.0).all()
    for x in SPEEDS:
        assert any(low <= x <= high for low, high in spans[:kept]) == any(low <= x <= high for low, high in given_spans)
