"""The joint optimum: classes beyond the best responses', starts, gaps, limits, determinism, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import permutations, product
from typing import Any

import numpy as np
import pytest

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.coordination import Motions, TimingProblem, makespan, optimal, prioritised, refine
from armtempo.planners.coordination._best_responses import best_responses
from armtempo.planners.coordination._joint_optimum import _apart

Problems = Callable[..., TimingProblem]


def crossing(make_problem: Problems, seed: int, arms: int = 4) -> TimingProblem:
    """Arms that meet somewhere, each with each."""
    random = np.random.default_rng(seed)
    pairs = {}
    for i in range(arms):
        for j in range(i + 1, arms):
            a, b = 0.1 + 0.5 * random.random(2)
            pairs[i, j] = [(a, a + 0.2, b, b + 0.2)]
    return make_problem(pairs, arms=arms)


def check(problem: TimingProblem, motions: Motions) -> None:
    assert problem.is_free(motions)
    assert makespan(motions) >= problem.bound.time * (1.0 - 1e-9)
    assert all(motion.certificate.excess < 1e-3 and motion.certificate.end_error == 0.0 for motion in motions)


@pytest.mark.parametrize("seed", range(3))
def test_as_good_as_the_best_of_all_classes(make_problem: Problems, seed: int) -> None:
    problem = crossing(make_problem, seed, arms=3)
    best = math.inf
    for sides in product((0, 1), repeat=len(problem.passing_orders.regions)):
        found = refine(problem, np.array(sides, dtype=np.int8))
        if found is not None and found.missed == 0.0 and problem.is_free(found.motions):
            best = min(best, makespan(found.motions))
    motions, order = optimal(problem, gap=0.0)
    check(problem, motions)
    assert sorted(order) == [0, 1, 2]
    assert makespan(motions) <= 1.002 * best


@pytest.mark.parametrize("seed", range(3))
def test_never_behind_best_responses_or_priorities(make_problem: Problems, seed: int) -> None:
    problem = crossing(make_problem, seed)
    motions, _ = optimal(problem)
    check(problem, motions)
    answered = best_responses(problem).motions
    assert answered is None or makespan(motions) <= 1.0001 * makespan(answered)
    for order in list(permutations(range(4)))[::5]:
        try:
            plan = prioritised(problem, order)
        except InfeasibleError:
            continue
        assert makespan(motions) <= 1.005 * makespan(plan)


def test_a_gap_that_is_reached_stops_the_search(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [(0.0, 0.3125, 0.375, 1.0), (0.4375, 1.0, 0.0, 0.5)]})
    answered, closer = best_responses(problem).motions, optimal(problem, gap=0.0)[0]
    assert answered is not None
    assert makespan(optimal(problem, gap=math.inf)[0]) == makespan(answered)
    assert makespan(closer) <= makespan(answered)
    first = optimal(crossing(make_problem, 1), gap=math.inf)[0]
    check(crossing(make_problem, 1), first)


def test_what_starts_are_given_is_refined(make_problem: Problems) -> None:
    problem = crossing(make_problem, 2)
    sides = problem.relaxed.sides
    assert sides is not None
    found = refine(problem, sides)
    assert found is not None
    motions, _ = optimal(problem, gap=0.0, starts=[sides])
    assert makespan(motions) <= makespan(found.motions)


def test_the_same_plan_twice(make_problem: Problems) -> None:
    plans = [optimal(crossing(make_problem, 0), gap=0.0, time_limit_s=1e6)[0] for _ in range(2)]
    for one, other in zip(*plans, strict=True):
        np.testing.assert_array_equal(one.time, other.time)
        np.testing.assert_array_equal(one.mu, other.mu)


def test_motions_that_meet_are_taken_apart(make_problem: Problems) -> None:
    problem = crossing(make_problem, 0)
    assert not problem.is_free(problem.fastest)
    check(problem, _apart(problem, problem.fastest))


@pytest.mark.parametrize(
    "limits", [{"gap": -0.1}, {"gap": math.nan}, {"time_limit_s": 0.0}, {"time_limit_s": math.nan}, {"gap": "much"}]
)
def test_limits_out_of_range_are_named(make_problem: Problems, limits: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(limits))):
        optimal(make_problem({}), **limits)
