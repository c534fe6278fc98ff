"""Largest rows over ranges, against looking at all of them."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armtempo.arrays import Floats
from armtempo.planners.geometry import RangeMax

tables = arrays(np.float64, st.tuples(st.integers(1, 40), st.integers(1, 3)), elements=st.floats(-1e6, 1e6))


@given(tables, st.data())
def test_over_any_range_it_is_the_largest_of_its_rows(values: Floats, data: st.DataObject) -> None:
    rows = st.integers(0, len(values) - 1)
    ranges = np.sort(np.array(data.draw(st.lists(st.tuples(rows, rows), min_size=1, max_size=20))), axis=1)
    found = RangeMax(values).over(ranges[:, 0], ranges[:, 1])
    expected = [values[first : last + 1].max(axis=0) for first, last in ranges]
    np.testing.assert_array_equal(found, expected)


@given(tables)
def test_every_range_of_every_length_is_answered(values: Floats) -> None:
    first, last = np.triu_indices(len(values))
    expected = [values[i : j + 1].max(axis=0) for i, j in zip(first, last, strict=True)]
    np.testing.assert_array_equal(RangeMax(values).over(first, last), expected)


def test_ranges_may_have_any_shape() -> None:
    values = np.array([[3.0], [1.0], [2.0], [5.0]])
    found = RangeMax(values).over(np.array([[0, 1], [1, 3]]), np.array([[1, 2], [3, 3]]))
    np.testing.assert_array_equal(found[..., 0], [[3.0, 2.0], [5.0, 5.0]])
