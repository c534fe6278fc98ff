"""Windows of time in which another arm shuts a piece of a path, against what samples of its motion say."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from armtempo.planners import CoordinationChart, PhaseTrajectory
from armtempo.planners.coordination import TimingProblem, pair_is_free
from armtempo.planners.coordination._time_windows import WINDOW_MARGIN, Occupancy, blocked_runs, forbidden_windows

CELLS = 8
States = NDArray[np.uint8]
any_states = arrays(np.uint8, (CELLS, CELLS), elements=st.sampled_from([0, 0, 0, 1, 2]))


def chart_of(states: States) -> CoordinationChart:
    return CoordinationChart(states=states.copy(), length_a=1.0, length_b=1.0, d_min=0.01)


@pytest.fixture(scope="module")
def motion(make_problem: Callable[..., TimingProblem]) -> PhaseTrajectory:
    """Half a second of waiting, then 1 in 2 s."""
    return make_problem({}).fastest[0].delayed(0.5)


def test_an_arm_is_in_a_column_from_its_entering_to_its_leaving(motion: PhaseTrajectory) -> None:
    occupancy = Occupancy.of(motion, 1.0, CELLS)
    assert occupancy.enter[0] == -np.inf
    assert occupancy.leave[-1] == np.inf
    np.testing.assert_allclose(motion.at(occupancy.enter[1:])[0], np.arange(1, CELLS) / CELLS, atol=1e-9)
    np.testing.assert_allclose(motion.at(occupancy.leave[:-1])[0], np.arange(1, CELLS) / CELLS, atol=1e-9)
    for t in np.linspace(0.0, motion.duration, 997):
        column = min(int(motion.at(t)[0] * CELLS), CELLS - 1)
        assert occupancy.enter[column] - 1e-9 <= t <= occupancy.leave[column] + 1e-9


def test_a_dwell_on_a_border_is_in_the_columns_on_both_sides(motion: PhaseTrajectory) -> None:
    k = int(np.searchsorted(motion.lam, 0.5))
    half = motion.lam[k]
    assert half == 0.5
    mu = motion.mu.copy()
    mu[k] = 0.0
    stop = PhaseTrajectory(
        lam=np.insert(motion.lam, k, half),
        mu=np.insert(mu, k, 0.0),
        time=np.concatenate([motion.time[: k + 1], motion.time[k:] + 3.0]),
        dynamics=motion.dynamics,
    )
    occupancy = Occupancy.of(stop, 1.0, CELLS)
    arrived = float(motion.time[k])
    assert occupancy.enter[CELLS // 2] == pytest.approx(arrived)
    assert occupancy.leave[CELLS // 2 - 1] == pytest.approx(arrived + 3.0)


@given(any_states)
def test_runs_are_the_cells_that_are_not_free(states: States) -> None:
    runs = blocked_runs(chart_of(states))
    found = np.zeros_like(states, dtype=bool)
    for row in range(CELLS):
        own = range(runs.first[row], runs.first[row + 1])
        for k in own:
            assert not found[max(runs.low[k] - 1, 0) : runs.high[k] + 1, row].any()  # neither overlap nor touch
            found[runs.low[k] : runs.high[k] + 1, row] = True
    np.testing.assert_array_equal(found, states != 0)


@settings(max_examples=50)
@given(any_states, st.lists(st.integers(0, 64), min_size=2, max_size=5, unique=True))
def test_a_slot_is_shut_exactly_while_the_other_is_beside_what_is_not_free(
    motion: PhaseTrajectory, states: States, ends: list[int]
) -> None:
    border = np.sort(np.array(ends)) / 64
    first, start, stop = forbidden_windows(border, [(blocked_runs(chart_of(states)), motion)])
    occupancy = Occupancy.of(motion, 1.0, CELLS)
    for slot in range(len(border) - 1):
        windows = list(zip(start[first[slot] : first[slot + 1]], stop[first[slot] : first[slot + 1]], strict=True))
        assert all(one[1] < other[0] for one, other in pairwise(windows))
        rows = [r for r in range(CELLS) if r / CELLS < border[slot + 1] and (r + 1) / CELLS > border[slot]]
        for t in np.linspace(0.0, motion.duration + 1.0, 97):
            in_column = (occupancy.enter - WINDOW_MARGIN <= t) & (t <= occupancy.leave + WINDOW_MARGIN)
            assert any(a <= t <= b for a, b in windows) == bool((states[in_column][:, rows] != 0).any())


@settings(max_examples=50)
@given(any_states, st.floats(0.0, 3.0))
def test_what_is_called_free_meets_nothing_and_what_meets_something_is_not_called_free(
    motion: PhaseTrajectory, states: States, late: float
) -> None:
    chart, other = chart_of(states), motion.delayed(late)
    instants = np.linspace(0.0, other.duration, 4001)
    cells = [np.clip(one.at(instants)[0] * CELLS, 0.0, CELLS - 1e-9) for one in (motion, other)]
    inside = np.all([np.abs(cell - np.round(cell)) > 1e-6 for cell in cells], axis=0)  # clear of borders
    meets = bool((states[cells[0].astype(int), cells[1].astype(int)] != 0)[inside].any())
    assert not (meets and pair_is_free(chart, motion, other))


def test_passing_a_corner_a_little_late_is_free_and_a_little_early_is_not(
    make_problem: Callable[..., TimingProblem],
) -> None:
    problem = make_problem({(0, 1): [(0.25, 0.5, 0.25, 0.5)]})
    chart, one = problem.chart_between(0, 1), problem.fastest[0]
    wait = 1.0 - np.sqrt(0.5)  # until the first is at 0.5 the other must not be at 0.25
    assert pair_is_free(chart, one, one.delayed(wait + 1e-5))
    assert not pair_is_free(chart, one, one.delayed(wait - 1e-5))
