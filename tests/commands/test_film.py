"""Pictures of films: when they are taken, and what is on them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from armtempo.agents import evaluate
from armtempo.commands.figures._film import FILM_SIZE, FRAMES_PER_SECOND, film_times, pictures, usual_slowness
from armtempo.planners import CoordinationCell


@given(duration=st.floats(1e-3, 100.0), slow=st.floats(0.1, 50.0))
def test_films_run_evenly_from_the_first_instant_to_the_last(duration: float, slow: float) -> None:
    times = film_times(duration, slow)
    assert times[0] == 0.0
    assert times[-1] == duration
    steps = np.diff(times) * slow * FRAMES_PER_SECOND
    np.testing.assert_allclose(steps[:-1], 1.0, rtol=1e-6)
    assert (steps > 0.0).all()
    assert steps[-1] < 1.0 + 1e-6


@pytest.mark.parametrize(("duration", "slow"), [(0.35, 20), (0.8, 10), (1.9, 5), (2.2, 5), (12.6, 1), (300.0, 1)])
def test_films_last_about_seven_seconds(duration: float, slow: float) -> None:
    assert usual_slowness(duration) == slow


def test_pictures_move_between_the_ticks_and_show_the_clock(lee1991: CoordinationCell) -> None:
    trace = evaluate(lee1991, ["delay"], physics="ideal").results["delay"].trace
    times = np.array([0.1, 0.1005, 0.1005])  # its ticks are milliseconds
    first, second, again = pictures(lee1991, trace, times, "delay")
    assert first.shape == (FILM_SIZE[1], FILM_SIZE[0], 3)
    assert _moved(first, second) > 50
    assert _moved(second, again) == 0
    words, clock = (first[-56:, columns].min() for columns in (slice(0, 300), slice(1000, None)))
    assert max(words, clock) < 128


def _moved(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> int:
    """How many values differ by more than drivers round differently."""
    return int((np.abs(one.astype(int) - other) > 60).sum())
