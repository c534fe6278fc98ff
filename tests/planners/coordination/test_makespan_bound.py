"""The lower bound on makespans: its closed form round one region, the paths it rests on, and the class of a cell."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationChart, PhaseTrajectory
from armtempo.planners.coordination import (
    JointBound,
    MakespanBound,
    PairBound,
    PriorityClass,
    TimingProblem,
    delayed,
    makespan,
    pair_bound,
)
from armtempo.planners.coordination._makespan_bound import guide_path

Motions = tuple[PhaseTrajectory, PhaseTrajectory]
CELLS = 32
LONGEST = 2.0  # [s] either arm alone
JOINT = JointBound(time=1.0, complete=True, nodes=0)
side = st.tuples(st.integers(1, CELLS - 1), st.integers(1, CELLS - 1)).filter(lambda ends: ends[0] < ends[1])


def both(problem: TimingProblem) -> Motions:
    one, other = problem.fastest
    return one, other


@pytest.fixture(scope="module")
def alone(make_problem: Callable[..., TimingProblem]) -> TimingProblem:
    """Of two arms that never meet."""
    return make_problem({})


@pytest.fixture(scope="module")
def motions(alone: TimingProblem) -> Motions:
    return both(alone)


def chart_of(*regions: tuple[tuple[int, int], tuple[int, int]], state: int = 2) -> CoordinationChart:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    for a, b in regions:
        states[slice(*a), slice(*b)] = state
    return CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)


def there_at(cell: int) -> float:
    """When a double integrator on a path of length 1, with |mu_dot| <= 1 from rest to rest, enters a cell [s]."""
    place = cell / CELLS
    return math.sqrt(2.0 * place) if place <= 0.5 else LONGEST - math.sqrt(2.0 * (1.0 - place))


@settings(max_examples=20)
@given(side, side)
def test_round_a_rectangle_it_is_the_shorter_way_by_a_corner(
    alone: TimingProblem, a: tuple[int, int], b: tuple[int, int]
) -> None:
    found = pair_bound(*both(alone), chart_of((a, b)))
    waits = there_at(a[1]) - there_at(b[0]), there_at(b[1]) - there_at(a[0])
    ways = [LONGEST + max(0.0, wait) for wait in waits]  # who goes second is as fast as it can be, before and after
    for first, way in zip(found.first_times, ways, strict=True):
        assert way - 6.0 * found.step <= first <= way + 1e-9
    assert min(ways) - 6.0 * found.step <= found.time <= min(ways) + 1e-9


@settings(max_examples=30)
@given(side, side, side, side)
def test_it_is_above_no_plan_of_start_delays(
    make_problem: Callable[..., TimingProblem],
    alone: TimingProblem,
    one: tuple[int, int],
    two: tuple[int, int],
    three: tuple[int, int],
    four: tuple[int, int],
) -> None:
    chart = chart_of((one, two), (three, four))
    problem = make_problem({(0, 1): chart.states.copy()}, planes=alone.planes)
    least = pair_bound(*both(alone), chart).time
    assert least >= LONGEST - 1e-9
    for order in ((0, 1), (1, 0)):
        try:
            plan = delayed(problem, problem.fastest, order)
        except InfeasibleError:
            continue
        assert least <= makespan(plan) + 1e-9


def test_it_is_infinite_exactly_where_a_wall_stands(motions: Motions) -> None:
    wall = (10, 12), (0, CELLS)
    assert pair_bound(*motions, chart_of(wall)).time == math.inf
    assert pair_bound(*motions, chart_of(wall)).path is None
    assert math.isfinite(pair_bound(*motions, chart_of(((10, 12), (1, CELLS)))).time)


def test_arms_that_never_meet_go_side_by_side_and_the_quicker_one_starts_later(motions: Motions) -> None:
    quick = motions[0]
    slow = PhaseTrajectory(lam=quick.lam, mu=0.5 * quick.mu, time=2.0 * quick.time, dynamics=quick.dynamics)
    found = pair_bound(slow, motions[0], chart_of())
    assert found.time == found.first_times[0] == found.first_times[1] == slow.duration
    assert found.path is not None
    np.testing.assert_array_equal(found.path[0], [0.0, 0.0])
    np.testing.assert_allclose(found.path[-1], [slow.duration - found.step, LONGEST - found.step], atol=1e-9)
    aside = pair_bound(slow, motions[0], chart_of(((0, 1), (CELLS - 1, CELLS))))  # a region in nobody's way
    assert aside.path is not None
    np.testing.assert_array_equal(aside.path, found.path)


def test_undecided_cells_count_only_for_plans_in_free_cells(motions: Motions) -> None:
    chart = chart_of(((8, 24), (8, 24)), state=1)
    assert pair_bound(*motions, chart).time == pytest.approx(LONGEST)
    guide = guide_path(*motions, chart)
    assert guide is not None
    assert len(guide) * float(np.diff(guide, axis=0).max()) > LONGEST + 0.5


@settings(max_examples=20)
@given(side, side, side, side)
def test_shortest_paths_rise_by_one_step_at_most_from_start_to_end(
    alone: TimingProblem, one: tuple[int, int], two: tuple[int, int], three: tuple[int, int], four: tuple[int, int]
) -> None:
    chart = chart_of((one, two), (three, four))
    path = guide_path(*both(alone), chart)
    step = LONGEST / 2000
    if path is None:
        assert not chart.passable[-1, -1]
        return
    rise = np.round(np.diff(path, axis=0) / step)
    assert set(np.unique(rise)) <= {0.0, 1.0}
    assert (rise.max(axis=1) == 1.0).all()
    np.testing.assert_array_equal(path[0], [0.0, 0.0])
    np.testing.assert_allclose(path[-1], LONGEST - step, atol=1e-9)
    cells = [
        (motion.at(theta + 0.5 * step)[0] * CELLS).astype(int)
        for motion, theta in zip(alone.fastest, path.T, strict=True)
    ]
    assert (chart.states[cells[0], cells[1]] == 0).all()


def test_going_first_is_natural_up_to_a_fifth_of_a_percent_and_two_steps() -> None:
    def bound(first_b: float) -> PairBound:
        return PairBound(time=10.0, first_times=(10.0, first_b), path=None, step=0.01)

    assert bound(10.039).natural == (True, True)
    assert bound(10.041).natural == (True, False)
    assert bound(math.inf).natural == (True, False)


@pytest.mark.parametrize(
    ("last", "expected"), [((False, True), "mixed"), ((True, False), "uniform"), ((True, True), "uniform")]
)
def test_natural_orders_that_go_round_in_a_circle_are_mixed(last: tuple[bool, bool], expected: PriorityClass) -> None:
    pairs = {(0, 1): (True, False), (1, 2): (True, False), (0, 2): last}
    bound = PairBound(time=1.0, first_times=(1.0, 1.0), path=None, step=0.01)
    together = MakespanBound(
        time=1.0, joint=JOINT, pairs=dict.fromkeys(pairs, bound), classes=dict.fromkeys(pairs, "uniform"), natural=pairs
    )
    assert together.priority_class == expected


@pytest.mark.parametrize(
    ("classes", "expected"),
    [
        (("free", "free", "free"), "free"),
        (("free", "uniform", "free"), "uniform"),
        (("free", "uniform", "mixed"), "mixed"),
        (("infeasible", "mixed", "uniform"), "infeasible"),
    ],
)
def test_the_worst_pair_gives_its_class_to_the_cell(
    classes: tuple[PriorityClass, ...], expected: PriorityClass
) -> None:
    pairs = ((0, 1), (0, 2), (1, 2))
    bound = PairBound(time=1.0, first_times=(1.0, 1.0), path=None, step=0.01)
    together = MakespanBound(
        time=1.0,
        joint=JOINT,
        pairs=dict.fromkeys(pairs, bound),
        classes=dict(zip(pairs, classes, strict=True)),
        natural=dict.fromkeys(pairs, (True, False)),
    )
    assert together.priority_class == expected
