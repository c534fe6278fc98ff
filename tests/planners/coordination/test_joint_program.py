"""The joint program: clocks against motions, derivatives against differences, the condensed matrix against a dense."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.planners import PathDynamics, PhasePlane
from armtempo.planners.coordination import TimingProblem
from armtempo.planners.coordination import _joint_kernels as kernels
from armtempo.planners.coordination._joint_program import CORNER_MARGIN, JointProgram
from armtempo.planners.coordination._passing_corners import corners_of


def _rubbed(dynamics: PathDynamics) -> PathDynamics:
    """The same with viscous friction."""
    rows = (dynamics.M, dynamics.Q, 0.3 * np.abs(dynamics.M), dynamics.S)
    return PathDynamics(
        dynamics.grid, *rows, dynamics.torque_min, dynamics.torque_max, np.full(len(dynamics.grid), 9.0)
    )


@pytest.fixture(scope="module")
def program(
    make_problem: Callable[..., TimingProblem], spline_dynamics: Callable[..., PathDynamics]
) -> tuple[JointProgram, Floats, Floats]:
    """Three arms, one with friction and caps, and an inner point."""
    length = [spline_dynamics(seed, gravity=False, intervals=60) for seed in (1, 2, 3)]
    planes = tuple(
        PhasePlane(_rubbed(d) if k == 1 else PathDynamics(d.grid, d.M, d.Q, d.R, d.S, d.torque_min, d.torque_max))
        for k, d in enumerate(length)
    )
    blocks = np.zeros((32, 32), dtype=np.uint8)
    blocks[8:12, 8:20] = blocks[10:18, 12:24] = 2
    problem = make_problem({(0, 1): blocks, (1, 2): blocks.T.copy(), (0, 2): blocks}, arms=3, planes=planes)
    assert all(plane.length == pytest.approx(1.0) for plane in planes)
    corners = corners_of(problem.passing_orders, np.array([0, 1, 0], dtype=np.int8))
    assert corners is not None
    made = JointProgram.of(problem, corners)
    x = 0.5 * made.fastest
    x[made.chain.first[1:] - 1] = 0.0
    return made, x, np.array([0.1, 0.2, 0.05, 9.0])


def test_clocks_and_gaps_are_those_of_the_motions(program: tuple[JointProgram, Floats, Floats]) -> None:
    made, x, waits = program
    motions = made.motions(x, waits)
    assert [motion.time[1] for motion in motions] == pytest.approx(waits[:-1])
    corners = corners_of(made.problem.passing_orders, np.array([0, 1, 0], dtype=np.int8))
    assert corners is not None
    expected = [
        float(motions[second].time_at(enters) - motions[first].time_at(leaves)) - CORNER_MARGIN
        for _, first, leaves, second, enters in zip(*corners, strict=True)
    ]
    expected += [waits[-1] - motion.duration for motion in motions]
    np.testing.assert_allclose(made.gaps(x, waits), expected, atol=1e-12)
    left = made.room(x, waits)
    assert left is not None
    assert 0.0 < left.rows.min() < 1.0
    assert made.room(2.5 * x, waits) is None


def _gradients(made: JointProgram, x: Floats) -> Floats:
    """(P, S) how the time at each place changes with every x, by differences; 0 for what is fixed."""

    def clocks(at: Floats) -> Floats:
        time = np.zeros(len(made.places.station) + 1)
        kernels.read_clocks(made.chain, made.places, at, time)
        return time[:-1]

    out = np.zeros((len(made.places.station), len(x)))
    for s in np.setdiff1d(np.arange(len(x)), [*made.chain.first[:-1], *(made.chain.first[1:] - 1)]):
        step = np.zeros_like(x)
        step[s] = 1e-6 * x[s]
        out[:, s] = (clocks(x + step) - clocks(x - step)) / (2.0 * step[s])
    return out


def test_the_condensed_matrix_is_that_of_a_dense_solve(program: tuple[JointProgram, Floats, Floats]) -> None:
    made, x, waits = program
    chain, places, size = made.chain, made.places, len(x)
    left = made.room(x, waits)
    assert left is not None
    barrier, random = 1e-3, np.random.default_rng(0)
    weight = random.uniform(-0.1, 1.0, len(places.station) + 1)
    slope, ends = np.empty((size, 2)), np.empty((len(places.station), 2))
    diagonal, beside, gradient = np.empty(size), np.empty(size), np.empty(size)
    kernels.slopes(chain, places, x, slope, ends)
    kernels.assemble(
        chain, places, x, left.rows, left.x, barrier / left.rows, barrier / left.x, barrier, weight, 0.0,
        diagonal, beside, gradient,
    )  # fmt: skip
    dense = np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1)
    assert np.linalg.eigvalsh(dense).min() > 0.0
    times, value = _gradients(made, x), gradient.copy()
    force = random.normal(size=len(weight))
    expected = np.linalg.solve(dense, np.column_stack([times.T, value]))
    compliance = np.zeros((len(weight), len(weight)))
    kernels.factor(chain, diagonal, beside)
    kernels.condense(chain, places, diagonal, beside, slope, ends, value, compliance)
    np.testing.assert_allclose(compliance[:-1], times @ expected, rtol=1e-5, atol=1e-7 * np.abs(compliance).max())
    kernels.back_substitute(chain, places, diagonal, beside, slope, ends, force, value)
    step = -np.linalg.solve(dense, gradient + times.T @ force[:-1])
    np.testing.assert_allclose(value, step, rtol=1e-5, atol=1e-7 * np.abs(step).max())


def test_the_barrier_falls_as_its_gradient_says(program: tuple[JointProgram, Floats, Floats]) -> None:
    made, x, waits = program
    left = made.room(x, waits)
    assert left is not None
    diagonal, beside, gradient = (np.empty_like(x) for _ in range(3))
    none = np.zeros(len(made.places.station) + 1)
    kernels.assemble(
        made.chain, made.places, x, left.rows, left.x, 1.0 / left.rows, 1.0 / left.x, 1.0, none, 0.0,
        diagonal, beside, gradient,
    )  # fmt: skip
    for s in (5, made.chain.first[1] + 7, made.chain.first[2] + 30):
        values = []
        for sign in (1.0, -1.0):
            moved = x.copy()
            moved[s] *= 1.0 + sign * 1e-6
            there = made.room(moved, waits)
            assert there is not None
            values.append(-made.logarithms(there, np.ones(1), waits))
        assert gradient[s] == pytest.approx((values[0] - values[1]) / (2e-6 * x[s]), rel=1e-4, abs=1e-5)
