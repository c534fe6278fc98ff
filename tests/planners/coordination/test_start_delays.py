"""Plans that only shift motions in time, against sums of delays and a search over starts."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError
from armtempo.planners import PhasePlane
from armtempo.planners.coordination import TimingProblem, delayed, offset, one_by_one, pair_is_free
from armtempo.planners.coordination._pair_delay import pair_delay
from armtempo.planners.coordination._start_delays import start_offset

Problems = Callable[..., TimingProblem]
RESOLUTION = 32


@pytest.fixture(scope="module")
def plane(make_problem: Problems) -> PhasePlane:
    """Of a double integrator that takes 2 s."""
    return make_problem({}).planes[0]


@st.composite
def regions(draw: st.DrawFn) -> list[tuple[float, ...]]:
    found = []
    for _ in range(draw(st.integers(1, 3))):
        a, b = draw(st.integers(1, RESOLUTION - 8)), draw(st.integers(1, RESOLUTION - 8))
        found.append((a, a + draw(st.integers(1, 6)), b, b + draw(st.integers(1, 6))))
    return [tuple(side / RESOLUTION for side in region) for region in found]


@settings(max_examples=30)
@given(regions(), regions(), regions(), st.permutations([0, 1, 2]))
def test_the_last_of_three_waits_for_the_longest_chain_of_waits(
    make_problem: Problems,
    plane: PhasePlane,
    one: list[tuple[float, ...]],
    two: list[tuple[float, ...]],
    three: list[tuple[float, ...]],
    order: list[int],
) -> None:
    problem = make_problem(
        {(0, 1): one, (0, 2): two, (1, 2): three}, arms=3, resolution=RESOLUTION, planes=(plane, plane, plane)
    )
    a, b, c = order

    def wait(first: int, second: int) -> float:
        motions = problem.fastest[first], problem.fastest[second]
        return pair_delay(problem.chart_between(first, second), ("first", "second"), *motions)

    motions = delayed(problem, problem.fastest, (a, b, c))
    starts = [motion.duration - 2.0 for motion in motions]
    assert starts[a] == pytest.approx(0.0, abs=1e-8)
    assert starts[b] == pytest.approx(max(0.0, wait(a, b)), abs=1e-8)
    assert starts[c] == pytest.approx(max(0.0, wait(a, c), max(0.0, wait(a, b)) + wait(b, c)), abs=1e-8)
    assert problem.is_free(motions)


@settings(max_examples=30)
@given(regions())
def test_no_earlier_start_meets_nothing(
    make_problem: Problems, plane: PhasePlane, blocked: list[tuple[float, ...]]
) -> None:
    problem = make_problem({(0, 1): blocked}, resolution=RESOLUTION, planes=(plane, plane))
    master, slave = problem.fastest
    try:
        start = start_offset(problem, 1, {0: master})
    except InfeasibleError:
        assume(False)
    chart = problem.chart_between(0, 1)
    assert pair_is_free(chart, master, slave.delayed(start))
    for earlier in np.arange(0.0, start - 1e-4, 0.02):
        assert not pair_is_free(chart, master, slave.delayed(float(earlier)))


def test_an_offset_may_pass_before_one_and_behind_another(make_problem: Problems) -> None:
    early, late = (0.4, 0.5, 0.4, 0.5), (0.95, 1.0, 0.2, 0.3)  # where the second parks it must be passed before
    problem = make_problem({(0, 1): [], (0, 2): [early], (1, 2): [late]}, arms=3)
    motions = offset(problem, (0, 1, 2))
    assert 0.0 < motions[2].duration - 2.0 < 0.2
    assert problem.is_free(motions)
    with pytest.raises(InfeasibleError, match="ends in the way"):
        delayed(problem, problem.fastest, (0, 1, 2))


def test_where_no_start_helps_the_arms_in_the_way_are_named(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.0, 1.0, 0.5, 0.6)]})
    with pytest.raises(InfeasibleError, match="no start of the minimum-time motion of arm 'b' keeps clear of 'a'"):
        offset(problem, (0, 1))


def test_one_by_one_each_starts_when_the_one_before_has_arrived(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.3, 0.6, 0.3, 0.6)]}, arms=3)
    motions, order = one_by_one(problem, (2, 0, 1))
    assert order == (2, 0, 1)
    assert [motions[arm].duration for arm in order] == pytest.approx([2.0, 4.0, 6.0], abs=1e-8)


def test_one_by_one_turns_an_order_round_in_which_somebody_stands_in_the_way(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.3, 0.6, 0.0, 0.2)]})
    motions, order = one_by_one(problem, (0, 1))
    assert order == (1, 0)
    assert problem.is_free(motions)


def test_one_by_one_refuses_with_what_is_wrong_with_the_order_asked_for(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.3, 0.6, 0.0, 0.2), (0.0, 0.2, 0.3, 0.6)]})
    with pytest.raises(InfeasibleError, match="arm 'b' cannot wait at its start"):
        one_by_one(problem, (0, 1))
    with pytest.raises(InfeasibleError, match="arm 'a' cannot wait at its start"):
        one_by_one(problem, (1, 0))
