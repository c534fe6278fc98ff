"""The joint optimum against a direct NLP that starts from it. ``make bench``; not part of the default run.

``ARMTEMPO_BENCH_RINGS`` names the rings, as arms:index (4:1,5:2).
"""

from __future__ import annotations

import os
import time
from itertools import permutations
from typing import Any

import casadi
import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from armtempo.arrays import Floats
from armtempo.errors import ArmtempoError
from armtempo.planners import CoordinationCell, Precedence, schedule
from armtempo.planners.coordination import Motions, TimingProblem, makespan
from armtempo.planners.coordination._joint_kernels import HIGH, LOW, A, B, R
from armtempo.planners.coordination._joint_program import CORNER_MARGIN, JointProgram
from armtempo.planners.coordination._passing_corners import corners_of
from armtempo.planners.instances import generate_cell

RINGS = [
    tuple(int(part) for part in ring.split(":"))
    for ring in os.environ.get("ARMTEMPO_BENCH_RINGS", "3:7,4:1,4:7,5:2").split(",")
]


def _expressions(program: JointProgram, x: Any) -> tuple[Any, Any]:
    """Values of all rows (rising by station, end, row), and the clock at every place."""
    chain, places = program.chain, program.places
    values, clocks = [], []
    for arm in range(len(chain.first) - 1):
        begin, last = int(chain.first[arm]), int(chain.first[arm + 1]) - 1
        now, there, length = x[begin:last], x[begin + 1 : last + 1], np.diff(chain.station[begin : last + 1])
        rows = chain.rows[begin:last]
        for e, here in enumerate((now, there)):
            for j in range(rows.shape[2]):
                a, b, r = (rows[:, e, j, column] for column in (A, B, R))
                values.append(a * (there - now) + b * here + r * casadi.sqrt(here))
        passed = casadi.vertcat(0.0, casadi.cumsum(2.0 * length / (casadi.sqrt(now) + casadi.sqrt(there))))
        for p in range(places.first[arm], places.first[arm + 1]):
            s, way = int(places.station[p]), float(places.way[p])
            share = way / float(chain.station[s + 1] - chain.station[s])
            part = 2.0 * way / (casadi.sqrt(x[s]) + casadi.sqrt((1.0 - share) * x[s] + share * x[s + 1]))
            clocks.append(passed[s - begin] + part)
    return casadi.vertcat(*values), casadi.vertcat(*clocks)


def _row_limits(program: JointProgram, column: int) -> Floats:
    chain = program.chain
    parts = [
        chain.rows[begin : end - 1, e, j, column]
        for begin, end in zip(chain.first[:-1], chain.first[1:], strict=True)
        for e in range(2)
        for j in range(chain.rows.shape[2])
    ]
    return np.concatenate(parts)


def direct(problem: TimingProblem, motions: Motions) -> float | None:
    """The least makespan in the plan's passing class by ipopt, every station and corner, started from the plan [s]."""
    passing = problem.passing_orders
    charts = {(a, b): problem.chart_between(a, b) for a, b, _ in passing.regions}
    corners = corners_of(passing, passing.of_precedence(Precedence.of_motions(motions, charts)))
    assert corners is not None
    program = JointProgram.of(problem, corners)
    arms, chain = len(motions), program.chain
    x, waits = casadi.SX.sym("x", len(chain.station)), casadi.SX.sym("waits", arms + 1)
    rows, clocks = _expressions(program, x)
    clocks = casadi.vertcat(clocks, 0.0)
    share = casadi.DM(program.share)
    gaps = clocks[program.plus.tolist()] - clocks[program.minus.tolist()] + share @ waits
    margin = np.where(np.arange(gaps.shape[0]) < program.corners, CORNER_MARGIN, 0.0)
    begin = []
    for motion, start, stop in zip(motions, chain.first[:-1], chain.first[1:], strict=True):
        lam = chain.station[start:stop]
        begin.append(np.interp(lam, motion.lam, motion.mu**2))
    x0 = np.maximum(np.concatenate(begin), 1e-9)
    fixed = np.concatenate([chain.first[:-1], chain.first[1:] - 1])
    low, high = np.full(len(x0), 1e-9), np.where(np.isfinite(chain.cap), chain.cap, np.inf)
    low[fixed] = high[fixed] = 1e-12
    moves = [float(m.time[np.flatnonzero(m.lam == m.lam[0])[-1]]) for m in motions]
    options: dict[str, Any] = {
        "print_time": 0, "ipopt.print_level": 0, "ipopt.sb": "yes", "ipopt.tol": 1e-7, "ipopt.max_iter": 400,
        "ipopt.mu_init": 1e-6, "ipopt.bound_push": 1e-9, "ipopt.bound_frac": 1e-9,
    }  # fmt: skip
    solver: Any = casadi.nlpsol(
        "direct", "ipopt",
        {"x": casadi.vertcat(x, waits), "f": waits[arms], "g": casadi.vertcat(rows, gaps)}, options,
    )  # fmt: skip
    found = solver(
        x0=np.concatenate([x0, moves, [makespan(motions)]]),
        lbx=np.concatenate([low, np.zeros(arms + 1)]),
        ubx=np.concatenate([high, np.full(arms + 1, np.inf)]),
        lbg=np.concatenate([_row_limits(program, LOW), margin]),
        ubg=np.concatenate([_row_limits(program, HIGH), np.full(len(margin), np.inf)]),
    )
    return float(found["f"]) if solver.stats()["success"] else None


def ring(arms: int, index: int) -> CoordinationCell:
    return generate_cell("ring", 1, index, arms=arms).cell


def test_a_direct_nlp_gains_nothing_that_counts() -> None:
    table = Table("ring", "bound [s]", "optimal [s]", "gap [%]", "time [s]", "direct NLP [s]", "gains [%]", "time [s]")
    gains = []
    for arms, index in RINGS:
        cell = ring(arms, index)
        schedule(cell, "optimal")  # compiled, bounded
        begun = time.perf_counter()
        plan = schedule(cell, "optimal")
        planned = time.perf_counter() - begun
        begun = time.perf_counter()
        best = direct(cell.timing, plan.trajectories)
        spent = time.perf_counter() - begun
        if best is not None:
            gains.append(100.0 * (1.0 - best / plan.makespan))
        table.add_row(
            cell.name, f"{plan.lower_bound:.4f}", f"{plan.makespan:.4f}", f"{plan.gap_percent:.2f}", f"{planned:.2f}",
            "fails" if best is None else f"{best:.4f}", "" if best is None else f"{gains[-1]:.3f}", f"{spent:.1f}",
        )  # fmt: skip
    Console(width=120).print(table)
    assert len(gains) >= len(RINGS) // 2
    assert max(gains) < 0.3


@pytest.mark.parametrize(("seed", "index"), [(1, 1), (1, 7), (777, 3)])
def test_velocity_control_in_any_order_is_not_quicker(seed: int, index: int) -> None:
    cell = generate_cell("ring", seed, index, arms=4).cell
    best = schedule(cell, "optimal").makespan
    for order in permutations(range(4)):
        try:
            plan = schedule(cell, "vci", order=order)
        except ArmtempoError:
            continue
        assert best <= plan.makespan
