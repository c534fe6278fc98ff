"""The joint bound: against every choice of sides, against a search over all places of three arms, against plans."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationChart, PhaseTrajectory
from armtempo.planners.coordination import (
    JointBound,
    PassingOrders,
    PassingRegion,
    TimingProblem,
    delayed,
    joint_bound,
    makespan,
    offset,
    optimal,
    pair_bound,
)

States = NDArray[np.uint8]
Rectangle = tuple[tuple[int, int], tuple[int, int]]
CELLS = 7  # of the charts that are searched exhaustively
PAIRS = ((0, 1), (0, 2), (1, 2))
side = st.tuples(st.integers(0, CELLS - 1), st.integers(1, CELLS)).filter(lambda ends: ends[0] < ends[1])
rectangles = st.lists(st.tuples(side, side), max_size=3)


@pytest.fixture(scope="module")
def alone(make_problem: Callable[..., TimingProblem]) -> TimingProblem:
    """Of three arms that never meet."""
    return make_problem({}, arms=3)


@pytest.fixture(scope="module")
def steady(alone: TimingProblem) -> tuple[PhaseTrajectory, ...]:
    """Motions that take one second per cell of ``CELLS``."""
    lam = np.linspace(0.0, 1.0, CELLS + 1)
    return tuple(
        PhaseTrajectory(lam=lam, mu=np.full_like(lam, 1.0 / CELLS), time=CELLS * lam, dynamics=plane.dynamics)
        for plane in alone.planes
    )


def states_of(blocked: Sequence[Rectangle]) -> States:
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    for a, b in blocked:
        states[slice(*a), slice(*b)] = 2
    return states


def regions_of(charts: Sequence[States]) -> tuple[PassingRegion, ...]:
    return tuple(
        PassingRegion(a, b, region)
        for (a, b), states in zip(PAIRS, charts, strict=True)
        for region in CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.0).cores
    )


def by_all_places(charts: Sequence[States]) -> float:
    """Seconds that three arms need, one cell per second, never two in a blocked cell: a search over all places.

    Arms that change cells in the same second do so one after the other in some order.
    """
    blocked = {pair: states == 2 for pair, states in zip(PAIRS, charts, strict=True)}

    def clear(place: tuple[int, ...]) -> bool:
        return not any(blocked[a, b][place[a], place[b]] for a, b in PAIRS)

    def reaches(place: tuple[int, ...], movers: tuple[int, ...]) -> bool:
        for order in itertools.permutations(movers):
            now = list(place)
            for arm in order:
                now[arm] += 1
                if not clear(tuple(now)):
                    break
            else:
                return True
        return False

    start: tuple[int, ...] = (0, 0, 0)
    end = (CELLS - 1,) * 3
    layer = {start} if clear(start) else set()
    seconds = 1.0  # the last cell's own
    while layer:
        if end in layer:
            return seconds
        after = set()
        for place in layer:
            can = [arm for arm in range(3) if place[arm] < CELLS - 1]
            for many in range(1, len(can) + 1):
                for movers in itertools.combinations(can, many):
                    if reaches(place, movers):
                        after.add(tuple(p + (arm in movers) for arm, p in enumerate(place)))
        layer = after
        seconds += 1.0
    return math.inf


def with_sides(regions: Sequence[PassingRegion], sides: Sequence[int]) -> float:
    """The makespan with all sides given, cell by cell, by repeated relaxation; infinite in a deadlock."""
    after = []  # arm i at border x before arm j at border y
    for (a, b, region), second in zip(regions, sides, strict=True):
        for p, q in zip(*np.nonzero(region.cells), strict=True):
            x, y = region.begin_a + int(p), region.begin_b + int(q)
            after.append((b, y + 1, a, x) if second else (a, x + 1, b, y))
    if any(x == CELLS or y == 0 for _, x, _, y in after):
        return math.inf
    tau = np.tile(np.arange(CELLS + 1.0), (3, 1))
    for _ in range(4 * 3 * CELLS):
        before = tau.copy()
        for i, x, j, y in after:
            # A thousandth more: who waits in a circle waits for ever.
            tau[j, y] = max(tau[j, y], tau[i, x] + 1e-3)
        for k in range(CELLS):
            tau[:, k + 1] = np.maximum(tau[:, k + 1], tau[:, k] + 1.0)
        if (tau == before).all():
            return float(np.floor(tau.max() + 0.5))
    return math.inf


@settings(max_examples=80)
@given(rectangles, rectangles, rectangles)
def test_it_is_what_a_search_over_all_places_finds(
    steady: tuple[PhaseTrajectory, ...], one: list[Rectangle], two: list[Rectangle], three: list[Rectangle]
) -> None:
    charts = [states_of(blocked) for blocked in (one, two, three)]
    found = joint_bound(steady, regions_of(charts))
    assert found.complete
    assert found.time == pytest.approx(by_all_places(charts), rel=1e-6)


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.35))
def test_it_is_what_a_search_over_all_places_finds_among_scattered_cells(
    steady: tuple[PhaseTrajectory, ...], seed: int, share: float
) -> None:
    generator = np.random.default_rng(seed)
    charts = [(2 * (generator.random((CELLS, CELLS)) < share)).astype(np.uint8) for _ in PAIRS]
    assert joint_bound(steady, regions_of(charts)).time == pytest.approx(by_all_places(charts), rel=1e-6)


@settings(max_examples=60)
@given(rectangles, rectangles, rectangles)
def test_it_is_the_best_of_all_choices_of_sides(
    steady: tuple[PhaseTrajectory, ...], one: list[Rectangle], two: list[Rectangle], three: list[Rectangle]
) -> None:
    regions = regions_of([states_of(blocked) for blocked in (one, two, three)])
    found = joint_bound(steady, regions)
    choices = itertools.product((0, 1), repeat=len(regions))
    assert found.time == pytest.approx(min(with_sides(regions, sides) for sides in choices), rel=1e-6)
    if found.sides is None:
        assert math.isinf(found.time)
    else:
        assert with_sides(regions, found.sides.tolist()) == pytest.approx(found.time, rel=1e-6)


@settings(max_examples=60)
@given(rectangles, rectangles, rectangles)
def test_the_sides_it_returns_are_orders_without_deadlock_that_its_times_keep(
    steady: tuple[PhaseTrajectory, ...], one: list[Rectangle], two: list[Rectangle], three: list[Rectangle]
) -> None:
    charts = {
        pair: CoordinationChart(states=states_of(blocked), length_a=1.0, length_b=1.0, d_min=0.0)
        for pair, blocked in zip(PAIRS, (one, two, three), strict=True)
    }
    orders = PassingOrders.of_charts((1.0, 1.0, 1.0), charts)
    found = joint_bound(steady, orders.regions)
    if found.sides is None:
        return
    orders.precedence(found.sides).check_deadlock_free()
    assert found.earliest is not None
    for (lam, time), motion in zip(found.earliest, steady, strict=True):
        assert lam[0] == time[0] == 0.0
        assert lam[-1] == 1.0
        assert (np.diff(time) >= np.diff(motion.time_at(lam)) - 1e-9).all()
    assert max(time[-1] for _, time in found.earliest) == pytest.approx(found.time)
    for (a, b, region), order in zip(orders.regions, found.sides, strict=True):
        tau = {arm: np.interp(np.arange(CELLS + 1) / CELLS, *found.earliest[arm]) for arm in (a, b)}
        for p, q in zip(*np.nonzero(region.cells), strict=True):
            x, y = region.begin_a + int(p), region.begin_b + int(q)
            if order == 0 and x + 1 in np.round(CELLS * found.earliest[a][0]):
                assert tau[a][x + 1] <= tau[b][y] + 1.0 + 1e-9


@settings(max_examples=20)
@given(rectangles)
def test_of_two_arms_it_is_no_less_than_the_pairs_bound(alone: TimingProblem, blocked: list[Rectangle]) -> None:
    chart = CoordinationChart(states=states_of(blocked), length_a=1.0, length_b=1.0, d_min=0.0)
    regions = [PassingRegion(0, 1, region) for region in chart.cores]
    one, other, _ = alone.fastest
    pair, joint = pair_bound(one, other, chart).time, joint_bound((one, other), regions).time
    assert joint >= pair * (1.0 - 1e-8)
    occupied = states_of(blocked) == 2
    if (occupied[:-1, 1:] & occupied[1:, :-1]).any():
        return  # cells that touch at a corner let nobody through, but for the pair's bound
    assert math.isinf(pair) == math.isinf(joint)
    if math.isfinite(pair):
        assert joint <= pair + 0.02  # steps of 1 ms, a few of them lost at every corner


def test_round_a_rectangle_one_arm_waits_until_the_other_has_left(alone: TimingProblem) -> None:
    # A double integrator from rest to rest, |mu_dot| <= 1: at 3/7 after sqrt(6/7) s, of 2 s, and at 4/7 before the end.
    regions = regions_of([states_of([((3, 4), (3, 4))]), states_of([]), states_of([])])
    wait = 2.0 - 2.0 * math.sqrt(6.0 / 7.0)
    assert joint_bound(alone.fastest, regions).time == pytest.approx(2.0 + wait, rel=1e-3)
    slow = joint_bound(alone.fastest, regions, shares=(0.1, 0.1, 0.1)).time
    assert slow == pytest.approx(0.9 * joint_bound(alone.fastest, regions).time)


@settings(max_examples=10)
@given(rectangles, rectangles, rectangles)
def test_it_is_above_no_plan(
    make_problem: Callable[..., TimingProblem],
    alone: TimingProblem,
    one: list[Rectangle],
    two: list[Rectangle],
    three: list[Rectangle],
) -> None:
    charts = {pair: states_of(blocked) for pair, blocked in zip(PAIRS, (one, two, three), strict=True)}
    problem = make_problem(charts, arms=3, planes=alone.planes)
    least = problem.bound.time
    assert least <= problem.attainable * (1.0 + 1e-9)
    for order in itertools.permutations(range(3)):
        with suppress(InfeasibleError):
            assert least <= makespan(delayed(problem, problem.fastest, order)) * (1.0 + 1e-9)
        with suppress(InfeasibleError):
            assert least <= makespan(offset(problem, order)) * (1.0 + 1e-9)


def test_it_stops_at_its_limits_with_what_it_has_and_says_so(
    make_problem: Callable[..., TimingProblem], alone: TimingProblem
) -> None:
    generator = np.random.default_rng(1)
    corners = generator.uniform(0.05, 0.7, (15, 2, 2))
    sizes = generator.uniform(0.05, 0.25, (15, 2, 2))
    problem = make_problem(
        {
            pair: [tuple(np.stack([low, low + size], axis=1).ravel()) for low, size in zip(lows, own, strict=True)]
            for pair, lows, own in zip(itertools.combinations(range(6), 2), corners, sizes, strict=True)
        },
        arms=6,
        planes=alone.planes * 2,
    )
    whole = problem.bounded()
    assert whole.complete
    assert whole.nodes > 4
    reports: list[tuple[float, int]] = []
    bounds: list[JointBound] = [
        problem.bounded(most_nodes=most, report=lambda least, count: reports.append((least, count)))
        for most in (0, 1, 3, whole.nodes - 1, whole.nodes)
    ]
    assert [bound.complete for bound in bounds] == [False] * 4 + [True]
    assert [bound.nodes for bound in bounds] == [0, 1, 3, whole.nodes - 1, whole.nodes]
    assert all(a.time <= b.time for a, b in itertools.pairwise(bounds))
    assert bounds[0].time == pytest.approx(2.0)
    assert bounds[-1].time == whole.time
    assert bounds[2].sides is None
    assert bounds[2].earliest is None
    assert reports
    assert all(count > 0 for _, count in reports)
    assert problem.bounded(time_limit_s=0.0).time <= whole.time
    told: list[tuple[float, int]] = []
    assert problem.find_joint(lambda least, count: told.append((least, count))).time == whole.time
    assert told
    assert problem.find_joint(lambda *_: pytest.fail("it is known")) is problem.joint


def test_three_arms_in_a_circle_are_certified_infeasible_though_every_pair_gets_past(
    make_problem: Callable[..., TimingProblem],
) -> None:
    """From the middle on each is in the way of one that has to be almost at its end by then: nobody can be first."""
    in_the_way = (0.8, 0.9, 0.5, 1.0)
    problem = make_problem({(0, 1): [in_the_way], (1, 2): [in_the_way], (0, 2): [(0.5, 1.0, 0.8, 0.9)]}, arms=3)
    assert all(math.isfinite(pair.time) for pair in problem.bound.pairs.values())
    assert problem.bound.time == math.inf
    assert problem.bound.joint.complete
    assert problem.bound.priority_class == "infeasible"
    with pytest.raises(InfeasibleError) as refusal:
        optimal(problem)
    assert refusal.value.data["reason"] == "certified infeasible"
