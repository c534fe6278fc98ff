"""Least times of intervals against the integral that they stand for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from armtempo.planners.geometry import least_times


@given(*(st.floats(0.05, 2.0) for _ in range(5)))
def test_least_times_are_integrals_of_the_pace(
    way: float, first: float, last: float, most: float, slope: float
) -> None:
    first, last = min(first, last + 2.0 * slope * way), min(last, first + 2.0 * slope * way)  # else no motion has both
    peak = min(max(first, last, most), 0.5 * (first + last) + slope * way)

    def pace(s: float) -> float:
        return float(min(first + 2.0 * slope * s, last + 2.0 * slope * (way - s), peak) ** -0.5)

    bends = [(peak - first) / (2.0 * slope), way - (peak - last) / (2.0 * slope)]
    expected = quad(pace, 0.0, way, points=sorted(min(max(bend, 0.0), way) for bend in bends))[0]
    found = least_times(*(np.array([value]) for value in (way, first, last, peak, slope)))
    assert found == pytest.approx([expected], rel=1e-7)
