"""Plans of several arms that may all yield: closed forms, brute force, completeness, orders, and what is refused."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from armtempo.arrays import Bools
from armtempo.errors import InfeasibleError
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.coordination import TimingProblem
from armtempo.planners.coordination._best_responses import optimal, prioritised
from armtempo.planners.coordination._start_delays import delayed, offset, one_by_one
from armtempo.planners.coordination._stop_and_go import rest_to_rest, stop_and_go
from armtempo.planners.coordination._timing_problem import Motions, makespan
from armtempo.robots import njit

Problems = Callable[..., TimingProblem]
States = NDArray[np.uint8]
SWAP = [(0.0, 0.3125, 0.375, 1.0), (0.4375, 1.0, 0.0, 0.5)]  # each arm has to be out of the other's way in turn


def check(problem: TimingProblem, motions: Motions) -> None:
    assert problem.is_free(motions)
    assert makespan(motions) >= problem.bound.time * (1.0 - 1e-9)
    for motion in motions:
        assert motion.certificate.excess < 1e-3
        assert motion.certificate.end_error == 0.0
        assert motion.lam[0] == motion.mu[0] == 0.0


def random_blocks(seed: int, most: int = 4) -> list[tuple[float, ...]]:
    random = np.random.default_rng(seed)
    blocks: list[tuple[float, ...]] = []
    for _ in range(random.integers(1, most)):
        a, b = np.sort(random.integers(0, 17, 2)) / 16, np.sort(random.integers(0, 17, 2)) / 16
        blocks.append((a[0], a[1], b[0], b[1]))
    return blocks


# -- against closed forms and brute force -----------------------------------------------------------------------------


def test_one_block_is_the_optimum_of_the_paper(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.25, 0.75, 0.375, 0.5)]})
    theta = problem.fastest[0].time_at
    best = 2.0 + min(float(theta(0.75) - theta(0.375)), float(theta(0.5) - theta(0.25)))
    assert problem.bound.priority_class == "uniform"
    assert problem.bound.pairs[0, 1].natural == (False, True)
    assert problem.bound.time <= best <= problem.bound.time * 1.002
    motions, order = optimal(problem)
    assert order == (1, 0)
    assert makespan(motions) == pytest.approx(best, rel=2e-4)
    assert makespan(delayed(problem, problem.fastest, (1, 0))) == makespan(motions)


@njit
def _together(shut: Bools, steps_per_second: int, most: int) -> int:
    """Steps until both arrive at rest, u in -1, 0, 1 for each per step, or -1; eight boxes per step must be free."""
    units = 2 * steps_per_second**2
    speeds = steps_per_second + 2
    size = shut.shape[0]
    states = (units + 1) * speeds
    now = np.zeros((states, states), np.bool_)
    now[0, 0] = True
    end = units * speeds
    place = np.empty((2, 9))
    for step in range(most):
        after = np.zeros_like(now)
        for sa in range(states):
            for sb in range(states):
                if not now[sa, sb]:
                    continue
                for ua in (-1, 0, 1):
                    va, ta = sa % speeds + ua, sa // speeds + 2 * (sa % speeds) + ua
                    if va < 0 or va >= speeds or ta > units:
                        continue
                    for ub in (-1, 0, 1):
                        vb, tb = sb % speeds + ub, sb // speeds + 2 * (sb % speeds) + ub
                        if vb < 0 or vb >= speeds or tb > units or after[ta * speeds + va, tb * speeds + vb]:
                            continue
                        for k in range(9):
                            w = k / 8.0
                            place[0, k] = (sa // speeds + 2.0 * (sa % speeds) * w + ua * w * w) / units * size
                            place[1, k] = (sb // speeds + 2.0 * (sb % speeds) * w + ub * w * w) / units * size
                        free = True
                        for k in range(8):
                            i0, j0 = min(int(place[0, k] + 1e-9), size - 1), min(int(place[1, k] + 1e-9), size - 1)
                            for i in range(i0, max(int(np.ceil(place[0, k + 1] - 1e-9)), i0 + 1)):
                                for j in range(j0, max(int(np.ceil(place[1, k + 1] - 1e-9)), j0 + 1)):
                                    free = free and not shut[i, j]
                        if free:
                            after[ta * speeds + va, tb * speeds + vb] = True
        now = after
        if now[end, end]:
            return step + 1
    return -1


@pytest.mark.parametrize("seed", range(8))
def test_never_behind_a_brute_force_search_of_both(make_problem: Problems, seed: int) -> None:
    blocks = random_blocks(seed) if seed else SWAP
    problem = make_problem({(0, 1): blocks}, resolution=32)
    steps = int(_together(problem.chart_between(0, 1).states != 0, 6, 24))
    try:
        motions, _ = optimal(problem)
    except InfeasibleError:
        assert steps < 0
        return
    check(problem, motions)
    if steps > 0:
        assert makespan(motions) <= 1.005 * steps / 6


def test_b_two_regions_of_opposite_orders(make_problem: Problems) -> None:
    """No arm goes first through both: no delay; offsets and shapes do it, and the class says so."""
    problem = make_problem({(0, 1): SWAP})
    assert problem.bound.priority_class == "mixed"
    for order in ((0, 1), (1, 0)):
        with pytest.raises(InfeasibleError):
            delayed(problem, problem.fastest, order)
    motions, _ = optimal(problem)
    check(problem, motions)
    assert makespan(motions) <= 1.03 * problem.bound.time


@pytest.mark.parametrize("seed", range(20))
def test_f_g_delay_is_best_where_priority_is_uniform_and_nothing_is_below_the_bound(
    make_problem: Problems, seed: int
) -> None:
    problem = make_problem({(0, 1): random_blocks(seed)})
    found: dict[str, float] = {}
    plans: tuple[tuple[str, Callable[[tuple[int, ...]], Motions]], ...]
    plans = (
        ("delay", lambda order: delayed(problem, problem.fastest, order)),
        ("offset", lambda order: offset(problem, order)),
        ("interval", lambda order: prioritised(problem, order)),
    )
    for name, plan in plans:
        for order in ((0, 1), (1, 0)):
            try:
                motions = plan(order)
            except InfeasibleError:
                continue
            check(problem, motions)
            found[name] = min(found.get(name, math.inf), makespan(motions))
    if problem.bound.priority_class in ("free", "uniform"):
        best, _ = optimal(problem)
        check(problem, best)
        assert makespan(best) <= min(found.values())
    if problem.bound.priority_class == "uniform":
        assert found["delay"] <= 1.001 * makespan(best)
        assert found["delay"] <= 1.01 * found["interval"]
        assert found["delay"] <= 1.003 * problem.bound.time


# -- every instance gets an answer ------------------------------------------------------------------------------------


def monotone_path(free: Bools) -> bool:
    reached = np.zeros_like(free)
    for i in range(len(free)):
        for j in range(len(free)):
            before = (i == 0 and j == 0) or (i and reached[i - 1, j]) or (j and reached[i, j - 1])
            reached[i, j] = free[i, j] and before
    return bool(reached[-1, -1])


@pytest.mark.parametrize("seed", range(16))
def test_every_chart_with_a_monotone_path_is_solved_and_the_rest_is_named(make_problem: Problems, seed: int) -> None:
    random = np.random.default_rng(seed)
    states: States = (random.random((16, 16)) < random.choice([0.15, 0.3, 0.4])).astype(np.uint8)
    states *= random.choice([1, 2], (16, 16)).astype(np.uint8)  # undecided, blocked
    states[0, 0] = states[-1, -1] = 0
    problem = make_problem({(0, 1): states}, resolution=16)
    moves = stop_and_go(problem.planes[0], problem.planes[1], problem.chart_between(0, 1))
    assert (moves is not None) == monotone_path(states == 0)
    if monotone_path(states == 0):
        motions, order = optimal(problem)
        check(problem, motions)
        assert sorted(order) == [0, 1]
        return
    with pytest.raises(InfeasibleError) as refusal:
        optimal(problem)
    certified = not monotone_path(states < 2)
    assert refusal.value.data["reason"] == ("certified infeasible" if certified else "undecided")
    assert refusal.value.remedy
    assert (problem.bound.priority_class == "infeasible") == certified


def test_h_where_nothing_works_nobody_claims_it_does(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.25, 0.5, 0.0, 1.0)]})
    assert problem.bound.time == math.inf
    for plan in (
        lambda: delayed(problem, problem.fastest, (0, 1)),
        lambda: delayed(problem, problem.fastest, (1, 0)),
        lambda: offset(problem, (0, 1)),
        lambda: offset(problem, (1, 0)),
        lambda: prioritised(problem, (0, 1)),
        lambda: prioritised(problem, (1, 0)),
        lambda: one_by_one(problem, (0, 1)),
        lambda: optimal(problem),
    ):
        with pytest.raises(InfeasibleError):
            plan()


def stairs() -> list[tuple[float, ...]]:
    """Free only along a staircase of squares: the arms have to move one at a time, and to stop."""
    steps: list[tuple[float, ...]] = [(k / 8, (k + 1) / 8, 0.0, (k - 1) / 8) for k in range(2, 8)]
    return steps + [(k / 8, (k + 1) / 8, (k + 2) / 8 + 1 / 64, 1.0) for k in range(6)] + [(0.0, 1 / 8, 9 / 64, 1.0)]


def test_stop_and_go_finds_its_way_through_a_staircase(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): stairs()}, resolution=64)
    slow = stop_and_go(problem.planes[0], problem.planes[1], problem.chart_between(0, 1))
    assert slow is not None
    check(problem, slow)
    for first, second in zip(slow, slow[::-1], strict=True):  # while one moves the other stands
        middle = 0.5 * (first.time[1:] + first.time[:-1])
        moves = (first.mu[1:] + first.mu[:-1] > 1e-9) & (middle < second.duration)
        assert (second.at(middle[moves])[1] < 1e-9).all()
    motions, _ = optimal(problem)
    assert makespan(motions) < 0.8 * makespan(slow)


def test_a_move_from_rest_to_rest_is_as_fast_as_it_can_be(make_problem: Problems) -> None:
    plane = make_problem({}).planes[0]
    for start, stop in ((0.0, 1.0), (0.1234, 0.4321), (0.5, 0.5001), (0.75, 1.0)):
        move = rest_to_rest(plane, start, stop)
        assert (move.lam[0], move.lam[-1], move.mu[0], move.mu[-1]) == (start, stop, 0.0, 0.0)
        assert move.duration == pytest.approx(2.0 * math.sqrt(stop - start), rel=1e-3)


def test_an_arm_that_would_have_to_stand_where_it_cannot(make_problem: Problems) -> None:
    grid = np.linspace(0.0, 1.0, 401)
    load = np.where((grid > 0.1) & (grid < 0.9), 1.05, 0.0)[:, None]
    one, zero = np.ones((401, 1)), np.zeros((401, 1))
    heavy = PhasePlane(PathDynamics(grid, one, zero, zero, load, [-1.5], [1.0]))
    light = PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-1e-3], [1e-3]))
    problem = make_problem({(0, 1): stairs()}, resolution=64, planes=(light, heavy))
    assert problem.holdable == (True, False)
    with pytest.raises(InfeasibleError) as refusal:
        optimal(problem)
    assert refusal.value.data["reason"] == "not holdable"


# -- more than two ----------------------------------------------------------------------------------------------------


def test_delays_of_three_are_a_longest_path(make_problem: Problems) -> None:
    block = [(0.25, 0.75, 0.25, 0.5)]
    problem = make_problem({(0, 1): block, (1, 2): block, (0, 2): block}, arms=3)
    motions = delayed(problem, problem.fastest, (0, 1, 2))
    check(problem, motions)
    waits = [motion.duration - 2.0 for motion in motions]
    theta = problem.fastest[0].time_at
    step = float(theta(0.75) - theta(0.25))
    assert waits == pytest.approx([0.0, step, 2.0 * step], abs=0.02)


def test_e_three_arms_each_of_which_should_go_before_the_next(make_problem: Problems) -> None:
    """Round in a circle: every pair is uniform, all together are not."""
    late, early = (0.125, 0.25), (0.5, 0.75)
    first_goes_first = [(*late, *early)]
    problem = make_problem({(0, 1): first_goes_first, (1, 2): first_goes_first, (0, 2): [(*early, *late)]}, arms=3)
    blocked = make_problem(
        {pair: [(0.25, 0.5, 0.125, 0.375)] for pair in ((0, 1), (1, 2))} | {(0, 2): [(0.125, 0.375, 0.25, 0.5)]}, arms=3
    )
    for case in (problem, blocked):
        motions, order = optimal(case)
        check(case, motions)
        assert sorted(order) == [0, 1, 2]
    assert {blocked.bound.classes[pair] for pair in blocked.bound.classes} == {"uniform"}
    assert blocked.bound.priority_class == "mixed"


def test_one_by_one_takes_an_order_that_is_safe(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.25, 0.75, 0.0, 0.1)], (1, 2): [(0.25, 0.75, 0.0, 0.1)]}, arms=3)
    motions, order = one_by_one(problem, (0, 1, 2))
    assert order.index(2) < order.index(1) < order.index(0)
    check(problem, motions)


def test_six_arms_take_seconds(make_problem: Problems) -> None:
    random = np.random.default_rng(1)
    pairs = {}
    for i in range(6):
        for j in range(i + 1, 6):
            a, b = 0.1 + 0.5 * random.random(2)
            pairs[i, j] = [(a, a + 0.2, b, b + 0.2)]
    problem = make_problem(pairs, arms=6)
    begun = time.perf_counter()
    motions, order = optimal(problem)
    assert time.perf_counter() - begun < 40.0
    check(problem, motions)
    assert sorted(order) == list(range(6))
    assert makespan(motions) <= makespan(delayed(problem, problem.fastest, order))
    assert makespan(motions) <= makespan(offset(problem, (0, 1, 2, 3, 4, 5)))


def test_the_same_plan_twice(make_problem: Problems) -> None:
    plans = [optimal(make_problem({(0, 1): SWAP}))[0] for _ in range(2)]
    for one, other in zip(*plans, strict=True):
        np.testing.assert_array_equal(one.time, other.time)
        np.testing.assert_array_equal(one.lam, other.lam)
