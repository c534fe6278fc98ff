"""What a timing problem knows of its arms: bounds and classes of all pairs together, found once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.coordination import TimingProblem, makespan, offset

Problems = Callable[..., TimingProblem]
MIDDLE = (0.4, 0.6, 0.4, 0.6)
WALL = (0.4, 0.5, 0.0, 1.0)


@pytest.fixture(scope="module")
def three(make_problem: Problems) -> TimingProblem:
    """Arms a and b meet in the middle, a and c earlier, b and c not at all."""
    return make_problem({(0, 1): [MIDDLE], (0, 2): [(0.3, 0.5, 0.3, 0.5)]}, arms=3)


def test_the_bound_is_that_of_all_arms_together_and_of_no_pair_less(three: TimingProblem) -> None:
    bound = three.bound
    assert bound.time == bound.joint.time
    assert bound.time >= max(pair.time for pair in bound.pairs.values())
    assert bound.joint.sides is not None
    assert len(bound.joint.sides) == len(three.passing_orders.regions)  # their two charts are the same here
    assert bound.classes == {(0, 1): "uniform", (0, 2): "uniform", (1, 2): "free"}
    assert set(bound.natural) == {(0, 1), (0, 2)}


def test_slower_bound_motions_are_discounted_by_their_share(three: TimingProblem) -> None:
    slow = replace(three, bound_motions=lambda: tuple((motion, 0.25) for motion in three.fastest))
    assert slow.bound.time == pytest.approx(0.75 * three.bound.time)


def test_nothing_in_free_cells_beats_what_is_attainable(three: TimingProblem) -> None:
    assert three.bound.time - 1e-9 <= three.attainable <= makespan(offset(three, (0, 1, 2))) + 1e-9


def test_a_pair_behind_a_wall_makes_all_infeasible(make_problem: Problems) -> None:
    problem = make_problem({(0, 1): [MIDDLE], (1, 2): [WALL]}, arms=3)
    assert problem.bound.classes[1, 2] == "infeasible"
    assert problem.bound.priority_class == "infeasible"
    assert np.isinf(problem.bound.time)


def test_undecided_cells_bound_nothing_but_are_kept_out_of(make_problem: Problems) -> None:
    states = np.zeros((256, 256), dtype=np.uint8)
    states[100:150, 100:150] = 1
    problem = make_problem({(0, 1): states})
    assert problem.bound.time == pytest.approx(2.0)
    assert not problem.is_free(problem.fastest)
    assert problem.attainable > 2.1


def test_both_views_of_a_pair_shut_the_same_cells(three: TimingProblem) -> None:
    one, other = three.runs(0, 1), three.runs(1, 0)
    shut = [np.zeros((256, 256), dtype=bool) for _ in range(2)]
    for runs, cells in zip((one, other), shut, strict=True):
        for row in range(256):
            for k in range(runs.first[row], runs.first[row + 1]):
                cells[runs.low[k] : runs.high[k] + 1, row] = True
    np.testing.assert_array_equal(shut[0], shut[1].T)
    assert shut[0].any()
    assert three.runs(0, 1) is one  # found once


def test_arms_that_cannot_stand_still_are_told_from_those_that_can(make_problem: Problems) -> None:
    grid, one, zero = np.linspace(0.0, 1.0, 101), np.ones((101, 1)), np.zeros((101, 1))
    pushed = np.where((grid > 0.4) & (grid < 0.6), 1.5, 0.0)[:, None]  # a force that the drive cannot hold
    planes = (
        PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-1.0], [1.0])),
        PhasePlane(PathDynamics(grid, one, zero, zero, -pushed, [-1.0], [1.0])),
    )
    assert make_problem({}, planes=planes).holdable == (True, False)
