"""Starts of given motions that keep an order of passing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from armtempo.errors import InfeasibleError
from armtempo.planners.coordination import Precedence, TimingProblem, delayed, order_delays

MakeProblem = Callable[..., TimingProblem]


def precedence_of(problem: TimingProblem, starts: list[float]) -> Precedence:
    motions = [motion.delayed(start) for motion, start in zip(problem.fastest, starts, strict=True)]
    charts = {(i, j): problem.chart_between(i, j) for i in problem.arms for j in problem.arms if i < j}
    return Precedence.of_motions(motions, charts)


@pytest.mark.parametrize("starts", [[0.0, 5.0, 10.0], [10.0, 5.0, 0.0], [5.0, 0.0, 10.0]])
def test_starts_are_those_of_start_delays_in_that_order(make_problem: MakeProblem, starts: list[float]) -> None:
    """From an order that was kept with time to spare: the same as by delays of pairs."""
    blocks = [(0.3, 0.5, 0.4, 0.6)]
    problem = make_problem({(0, 1): blocks, (0, 2): blocks, (1, 2): [(0.55, 0.7, 0.2, 0.3)]}, arms=3)
    found = order_delays(precedence_of(problem, starts), problem.fastest, problem.names)
    wanted = delayed(problem, problem.fastest, tuple(np.argsort(starts)))
    ours = tuple(motion.delayed(float(start)) for motion, start in zip(problem.fastest, found, strict=True))
    assert problem.is_free(ours)
    for own, other in zip(ours, wanted, strict=True):
        assert own.duration == pytest.approx(other.duration, abs=2e-5)


def test_arms_that_never_meet_start_at_once(make_problem: MakeProblem) -> None:
    problem = make_problem({}, arms=2)
    assert order_delays(precedence_of(problem, [0.0, 3.0]), problem.fastest, problem.names).tolist() == [0.0, 0.0]


def test_arms_that_wait_for_each_other_are_named(make_problem: MakeProblem) -> None:
    """Each passes first somewhere, and neither place leaves time for it."""
    problem = make_problem({(0, 1): [(0.2, 0.4, 0.2, 0.4), (0.6, 0.8, 0.6, 0.8)]}, arms=2)
    cells = 256
    border = np.arange(cells) / cells
    limits = {
        (0, 1): np.where(border < 0.4, 0.2, np.inf),  # arm a behind b at the first place
        (1, 0): np.where(border < 0.8, 0.6, np.inf),  # and before it at the second
    }
    order = Precedence(lengths=(1.0, 1.0), limits=limits)
    with pytest.raises(InfeasibleError, match=r"arms 'a' and 'b' wait for each other .*delay, offset") as refusal:
        order_delays(order, problem.fastest, problem.names)
    assert refusal.value.data["reason"] == "arms wait for each other"
