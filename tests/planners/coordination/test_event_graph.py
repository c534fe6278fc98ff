"""Waiting at stops alone: the best of all orders by linear programs, free of collision, quick where there are many."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from armtempo.planners import CoordinationCell, JointPath, PathDynamics, PhasePlane, schedule
from armtempo.planners.coordination import Motions, TimingProblem, makespan
from armtempo.planners.coordination._event_graph import event_graph
from armtempo.planners.coordination._passing_corners import corners_of

Problem = Callable[..., TimingProblem]


@pytest.fixture(scope="module")
def planes(lee1991: CoordinationCell) -> tuple[PhasePlane, ...]:
    """Three moves each, with a dwell between."""
    found = []
    for arm, path in zip(lee1991.arms, lee1991.paths, strict=True):
        q = path.evaluate(np.linspace(0.0, path.length, 13))[0]
        moves = [JointPath.through(q[k : k + 5]) for k in (0, 4, 8)]
        whole = JointPath.sequence([moves[0], moves[1], 0.05, moves[2]])
        found.append(PhasePlane(PathDynamics.from_path(arm, whole, intervals=300)))
    return tuple(found)


def by_programs(problem: TimingProblem) -> float:
    """The least makespan over all orders, each a linear program of begins of runs."""
    borders = [np.concatenate([[0.0], m.dynamics.path.stops, [1.0]]) for m in problem.fastest if m.dynamics.path]
    clocks = [motion.time_at(border) for motion, border in zip(problem.fastest, borders, strict=True)]
    first: list[int] = np.cumsum([0, *(len(border) - 1 for border in borders)]).tolist()
    count = first[-1]
    best = np.inf
    for orders in product((0, 1), repeat=len(problem.passing_orders.regions)):
        corners = corners_of(problem.passing_orders, np.array(orders, dtype=np.int8))
        if corners is None:
            continue
        rows: list[tuple[int, int, float]] = []  # run, than, by
        for arm, clock in enumerate(clocks):
            rows += [(first[arm] + k + 1, first[arm] + k, clock[k + 1] - clock[k]) for k in range(len(clock) - 2)]
        for i, leaves, j, enters in zip(corners.first, corners.leaves, corners.second, corners.enters, strict=True):
            a = max(int(np.searchsorted(borders[i], leaves, side="left")) - 1, 0)
            b = int(np.searchsorted(borders[j], enters, side="right")) - 1
            past = problem.fastest[i].time_at(leaves) - clocks[i][a]
            comes = problem.fastest[j].time_at(enters) - clocks[j][b]
            rows.append((int(first[j]) + b, int(first[i]) + a, float(past - comes)))
        A, rhs = np.zeros((len(rows) + len(clocks), count + 1)), np.zeros(len(rows) + len(clocks))
        for k, (run, than, by) in enumerate(rows):
            A[k, than], A[k, run], rhs[k] = 1.0, -1.0, -by
        for arm, clock in enumerate(clocks):
            A[len(rows) + arm, [first[arm + 1] - 1, count]] = 1.0, -1.0
            rhs[len(rows) + arm] = -(clock[-1] - clock[-2])
        found = linprog(np.append(np.zeros(count), 1.0), A, rhs, bounds=(0.0, None))
        if found.status == 0:
            best = min(best, float(np.asarray(found.x)[-1]))
    return best


@pytest.mark.parametrize("seed", range(12))
def test_is_the_best_of_all_orders(make_problem: Problem, planes: tuple[PhasePlane, ...], seed: int) -> None:
    generator = np.random.default_rng(seed)
    boxes = []
    for k in range(4):  # apart along the first path
        a, b = 0.05 + 0.23 * k, generator.uniform(0.05, 0.7)
        boxes.append((a, a + generator.uniform(0.02, 0.18), b, b + generator.uniform(0.02, 0.25)))
    problem = make_problem({(0, 1): boxes}, resolution=1024, planes=planes)
    motions, best = event_graph(problem), by_programs(problem)
    if motions is None:
        assert best == np.inf
        return
    assert makespan(motions) == pytest.approx(best, abs=1e-3)  # but for the margins of windows
    assert makespan(motions) >= best - 1e-9
    assert problem.is_free(motions)
    assert all(motion.dwell_error < 1e-6 for motion in motions)
    assert all(motion.certificate.end_error == 0.0 for motion in motions)


def waits(motions: Motions) -> list[list[float]]:
    """Where each arm stands without being told by its path."""
    return [
        [float(m.lam[k]) for k in np.flatnonzero((np.diff(m.lam) == 0.0) & (np.diff(m.time) > 1e-9))] for m in motions
    ]


def test_an_arm_waits_at_the_last_stop_before_a_region(make_problem: Problem, planes: tuple[PhasePlane, ...]) -> None:
    border = planes[1].dynamics.path.border  # type: ignore[union-attr]
    inside = float(border[1] + 0.5 * (border[2] - border[1]))
    problem = make_problem({(0, 1): [(0.7, 0.8, inside, inside + 0.05)]}, resolution=1024, planes=planes)
    motions = event_graph(problem)
    assert motions is not None
    assert waits(motions)[0] == []
    assert set(waits(motions)[1]) <= set(border[[0, 1]])


def test_a_deadlock_has_no_plan(make_problem: Problem, planes: tuple[PhasePlane, ...]) -> None:
    """Each must be past the other's way before it may move at all."""
    problem = make_problem({(0, 1): [(0.0, 0.6, 0.4, 1.0), (0.4, 1.0, 0.0, 0.6)]}, resolution=1024, planes=planes)
    assert event_graph(problem) is None


def test_optimal_begins_with_it(there_and_back: CoordinationCell) -> None:
    motions = event_graph(there_and_back.timing)
    assert motions is not None
    started = time.perf_counter()
    plan = schedule(there_and_back, "optimal")
    assert plan.makespan <= makespan(motions) + 1e-9
    assert plan.gap_percent < 1.0
    assert time.perf_counter() - started < 30.0
