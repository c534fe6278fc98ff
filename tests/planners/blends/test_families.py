"""Curve families: shares of named and of own curves, values for all corners or for each, and what is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InputError, UnknownNameError
from armtempo.planners.blends import CURVES
from armtempo.planners.blends._families import curve_shares, per_corner


@given(st.floats(0.01, 4.0))
def test_the_cubics_share_goes_with_its_shape_factor(factor: float) -> None:
    shares, degree = curve_shares("cubic", factor, 2)
    np.testing.assert_allclose(shares, [[1.0 - factor / 3.0, 0.0, 0.0]] * 2)
    np.testing.assert_array_equal(degree, 3)


@pytest.mark.parametrize(("name", "degree"), [("cubic", 3), ("quintic", 5), ("low-peak", 5), ("septic", 7)])
def test_a_named_curve_is_the_tuple_of_its_shares(name: str, degree: int) -> None:
    named, of_name = curve_shares(name, 3.0, 3)
    given_shares, of_shares = curve_shares(CURVES[name], 3.0, 3)
    np.testing.assert_array_equal(named, given_shares)
    assert of_name.tolist() == of_shares.tolist() == [degree] * 3


def test_each_corner_may_have_its_own_factor() -> None:
    shares, _ = curve_shares("cubic", [3.0, 1.5], 2)
    np.testing.assert_allclose(shares[:, 0], [0.0, 0.5])


@pytest.mark.parametrize(
    ("curve", "factor", "message"),
    [
        ("cubic", 0.0, r"is not in \(0, 4\]"),
        ("cubic", 4.1, r"is not in \(0, 4\]"),
        ("quintic", 2.0, "shape_factor belongs to the cubic, not to 'quintic'"),
        ((0.1,), 2.0, "shape_factor belongs to the cubic"),
        ((), 3.0, "is not one share"),
        ((0.1, 0.2, 0.3, 0.4), 3.0, "is not one share"),
        ((1.0,), 3.0, "is not one share"),
        ((-0.34,), 3.0, "is not one share"),
        ((-1.1, 0.2), 3.0, "is not one share"),
        ((np.nan, 0.2), 3.0, "is not one share"),
    ],
)
def test_what_is_no_curve_is_refused(curve: Any, factor: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        curve_shares(curve, factor, 1)


def test_a_misspelt_curve_is_told_the_nearest_name() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'quintic'"):
        curve_shares("quintik", 3.0, 1)
    with pytest.raises(UnknownNameError, match="least-time"):
        curve_shares("fastest", 3.0, 1)


def test_values_are_for_all_corners_for_each_or_for_both_sides_of_each() -> None:
    np.testing.assert_array_equal(per_corner("it", 2.0, 3), [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(per_corner("it", [1.0, 2.0], 2), [1.0, 2.0])
    np.testing.assert_array_equal(per_corner("it", 2.0, 2, pairs=True), [[2.0, 2.0], [2.0, 2.0]])
    np.testing.assert_array_equal(per_corner("it", [1.0, 2.0], 2, pairs=True), [[1.0, 1.0], [2.0, 2.0]])
    np.testing.assert_array_equal(per_corner("it", [[1.0, 2.0]], 2, pairs=True), [[1.0, 2.0], [1.0, 2.0]])


@pytest.mark.parametrize("bad", [[1.0, 2.0, 3.0], [[1.0], [2.0]], -1.0, np.inf, np.nan])
def test_too_many_values_or_impossible_ones_are_refused_by_name(bad: Any) -> None:
    with pytest.raises(InputError, match=r"it (has shape|must be finite)"):
        per_corner("it", bad, 2)
    values = np.array([1.0, 2.0])
    per_corner("it", values, 2)[0] = 9.0
    assert values[0] == 1.0  # copies
