"""The start delay of two arms: its closed form behind one region, and that nothing shorter keeps behind all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationChart, PhaseTrajectory
from armtempo.planners.coordination import TimingProblem, pair_is_free
from armtempo.planners.coordination._pair_delay import RELEASE_MARGIN, pair_delay

Motions = tuple[PhaseTrajectory, PhaseTrajectory]
CELLS = 32
NAMES = ("a", "b")


def both(problem: TimingProblem) -> Motions:
    one, other = problem.fastest
    return one, other


def there_at(place: float) -> float:
    """When a double integrator on a path of length 1, with |mu_dot| <= 1 from rest to rest, is at a place [s]."""
    return float(np.sqrt(2.0 * place) if place <= 0.5 else 2.0 - np.sqrt(2.0 * (1.0 - place)))


@st.composite
def charts(draw: st.DrawFn) -> CoordinationChart:
    """Regions by hand that neither hold the start of b nor the end of a in the way."""
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    for _ in range(draw(st.integers(1, 3))):
        a, b = draw(st.integers(0, CELLS - 6)), draw(st.integers(1, CELLS - 1))
        states[a : a + draw(st.integers(1, 5)), b : b + draw(st.integers(1, 5))] = draw(st.sampled_from([1, 2]))
    return CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)


@pytest.fixture(scope="module")
def motions(make_problem: Callable[..., TimingProblem]) -> Motions:
    """From 0 to 1 in 2 s, either of them."""
    return both(make_problem({}))


sides = st.tuples(st.integers(1, CELLS - 1), st.integers(1, CELLS - 1)).filter(lambda side: side[0] < side[1])


@given(sides, sides)
def test_behind_a_rectangle_one_leaves_as_the_other_enters(
    motions: Motions, a: tuple[int, int], b: tuple[int, int]
) -> None:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    states[slice(*a), slice(*b)] = 2
    chart = CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)
    wait = pair_delay(chart, NAMES, *motions)
    assert wait == pytest.approx(there_at(a[1] / CELLS) - there_at(b[0] / CELLS) + RELEASE_MARGIN, abs=1e-8)


@given(charts())
def test_the_delay_keeps_clear_and_a_hair_less_does_not(motions: Motions, chart: CoordinationChart) -> None:
    leading, following = motions
    wait = pair_delay(chart, NAMES, leading, following)
    late = max(0.0, -wait) + 1.0  # a negative delay lets the one in front start later
    assert pair_is_free(chart, leading.delayed(late), following.delayed(late + wait))
    assert not pair_is_free(chart, leading.delayed(late), following.delayed(late + wait - 4.0 * RELEASE_MARGIN))


def test_arms_that_never_meet_need_not_wait_at_all(make_problem: Callable[..., TimingProblem]) -> None:
    problem = make_problem({})
    assert pair_delay(problem.chart_between(0, 1), NAMES, *both(problem)) == -np.inf


@pytest.mark.parametrize(
    ("region", "message", "reason"),
    [
        ((0.3, 0.6, 0.0, 0.2), "arm 'b' cannot wait at its start: arm 'a' passes closer than 0.01 m", "unsafe start"),
        ((0.7, 1.0, 0.4, 0.5), "arm 'a' ends in the way of arm 'b'", "parked in the way"),
    ],
)
def test_who_cannot_wait_or_would_wait_for_ever_is_refused(
    make_problem: Callable[..., TimingProblem],
    region: tuple[float, float, float, float],
    message: str,
    reason: str,
) -> None:
    problem = make_problem({(0, 1): [region]})
    with pytest.raises(InfeasibleError, match=message) as caught:
        pair_delay(problem.chart_between(0, 1), NAMES, *both(problem))
    assert caught.value.data["reason"] == reason
