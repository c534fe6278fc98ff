"""Limits of line speeds: what is refused, and how fast they let a bend be passed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.errors import InputError
from armtempo.planners import LineSpeedLimits
from armtempo.planners.line_speed._limits import square_caps


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "fast", None])
def test_nonsense_is_refused(value: object) -> None:
    with pytest.raises(InputError, match="limit speed"):
        LineSpeedLimits(speed=value, acceleration=1.0, jerk=1.0)  # type: ignore[arg-type]


def test_bends_are_passed_at_the_normal_acceleration_or_at_line_speed() -> None:
    limits = LineSpeedLimits(speed=2.0, acceleration=5.0, jerk=100.0, normal_acceleration=3.0)
    bend = np.array([[0.0, 0.5], [0.75, 12.0]])
    assert np.array_equal(square_caps(limits, bend), [[4.0, 4.0], [4.0, 0.25]])
    assert LineSpeedLimits(speed=2.0, acceleration=5.0, jerk=100.0).normal == 5.0
