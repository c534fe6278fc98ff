"""Joint refinement against closed forms, best responses and the checks that every plan must pass."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from armtempo.errors import InfeasibleError
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.coordination import Precedence, TimingProblem
from armtempo.planners.coordination._best_responses import prioritised
from armtempo.planners.coordination._joint_refinement import Refinement, refine
from armtempo.planners.coordination._passing_corners import corners_of
from armtempo.planners.coordination._timing_problem import makespan
from armtempo.planners.topp import LIMIT_EXCESS_MAX

Problems = Callable[..., TimingProblem]


def refined(problem: TimingProblem, *sides: int) -> Refinement:
    found = refine(problem, np.array(sides, dtype=np.int8))
    assert found is not None
    return found


def check(problem: TimingProblem, found: Refinement) -> None:
    assert found.missed < 1e-6
    assert problem.is_free(found.motions)
    assert all(motion.certificate.excess <= LIMIT_EXCESS_MAX for motion in found.motions)
    assert all(motion.certificate.end_error == 0.0 for motion in found.motions)


def test_arms_that_never_meet_move_in_minimum_time(make_problem: Problems) -> None:
    problem = make_problem({}, arms=3)
    found = refined(problem)
    check(problem, found)
    assert makespan(found.motions) == pytest.approx(makespan(problem.fastest), rel=1e-4)


@pytest.mark.parametrize("side", [0, 1])
def test_one_block_is_passed_in_closed_form(make_problem: Problems, side: int) -> None:
    """The second arm is at full speed where the first leaves, so it may as well have waited at its start."""
    problem = make_problem({(0, 1): [(0.25, 0.75, 0.375, 0.5)]})
    theta = problem.fastest[0].time_at
    wait = float(theta(0.5) - theta(0.25)) if side else float(theta(0.75) - theta(0.375))
    found = refined(problem, side)
    check(problem, found)
    assert makespan(found.motions) == pytest.approx(2.0 + wait, rel=2e-4)
    assert found.critical == pytest.approx([1.0], abs=1e-2)


def test_a_chain_of_three_adds_up(make_problem: Problems) -> None:
    block = [(0.375, 0.5, 0.375, 0.5)]
    problem = make_problem({(0, 1): block, (1, 2): block, (0, 2): block}, arms=3)
    theta = problem.fastest[0].time_at
    found = refined(problem, 0, 0, 0)
    check(problem, found)
    assert makespan(found.motions) == pytest.approx(2.0 + 2.0 * float(theta(0.5) - theta(0.375)), rel=3e-4)


@pytest.mark.parametrize("seed", range(4))
def test_never_behind_one_arm_after_the_other_in_the_same_class(
    make_problem: Problems, spline_dynamics: Callable[..., PathDynamics], seed: int
) -> None:
    random = np.random.default_rng(seed)
    planes = tuple(PhasePlane(spline_dynamics(10 * seed + k, gravity=False)) for k in range(3))
    pairs = {}
    for pair in ((0, 1), (0, 2), (1, 2)):
        a, b = random.uniform(0.1, 0.6, 2)
        pairs[pair] = [(a, a + 0.2, b, b + 0.1), (a + 0.1, a + 0.3, b + 0.05, b + 0.25)]
    problem = make_problem(pairs, arms=3, planes=planes)
    for order in ((0, 1, 2), (2, 0, 1)):
        try:
            plan = prioritised(problem, order)
        except InfeasibleError:
            continue
        charts = {pair: problem.chart_between(*pair) for pair in pairs}
        sides = problem.passing_orders.of_precedence(Precedence.of_motions(plan, charts))
        found = refine(problem, sides)
        assert found is not None
        check(problem, found)
        assert makespan(found.motions) <= 1.0005 * makespan(plan)


def test_the_same_bits_every_time(make_problem: Problems) -> None:
    first, second = (refined(make_problem({(0, 1): [(0.25, 0.75, 0.375, 0.5)]}), 1) for _ in range(2))
    for one, other in zip(first.motions, second.motions, strict=True):
        np.testing.assert_array_equal(one.time, other.time)
        np.testing.assert_array_equal(one.mu, other.mu)


def test_what_cannot_be_refined_is_none(make_problem: Problems) -> None:
    behind = make_problem({(0, 1): [(0.5, 1.0, 0.25, 0.5)]})  # arm a ends in the way
    assert corners_of(behind.passing_orders, np.array([0], dtype=np.int8)) is None
    assert refine(behind, np.array([0], dtype=np.int8)) is None
    check(behind, refined(behind, 1))
    assert refine(behind, np.array([1], dtype=np.int8), deadline=time.perf_counter()) is None
    grid, one, zero = np.linspace(0.0, 1.0, 101), np.ones((101, 1)), np.zeros((101, 1))
    falling = PhasePlane(PathDynamics(grid, one, zero, zero, zero, [0.1], [1.0]), mu_end=0.9)
    problem = make_problem({}, planes=(falling, falling))
    assert refine(problem, np.empty(0, dtype=np.int8)) is None


def test_every_class_without_a_deadlock_is_found(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.2, 0.3, 0.2, 0.3), (0.6, 0.7, 0.5, 0.6)]})
    for sides in product((0, 1), repeat=2):
        check(problem, refined(problem, *sides))
