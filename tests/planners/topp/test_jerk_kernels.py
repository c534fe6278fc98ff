"""The interior point's parts against scipy, NumPy and finite differences; an optimum known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from armtempo.arrays import Floats
from armtempo.planners.topp._jerk_kernels import (
    Normal,
    Point,
    Slacks,
    ThirdOrder,
    add_slopes,
    advance_rows,
    bands,
    bend_jerk_rows,
    bend_point_rows,
    bend_time_and_caps,
    correct_rows,
    descend,
    factor,
    fold,
    fold_right,
    predict_rows,
    rises,
    solve,
    spline,
    to_coefficients,
    unfold,
    values,
)


def problem_of(seed: int, count: int = 9, limits: int = 3, joints: int = 2) -> ThirdOrder:
    """Random limits on an uneven grid; one station has two point rows, as where coefficients jump."""
    rng = np.random.default_rng(seed)
    at = np.sort(np.append(np.arange(count + 1), count // 2)).astype(np.int64)
    a, b, r = (0.3 * rng.normal(size=(len(at), limits)) for _ in range(3))
    d1, d2, d3 = (0.02 * rng.normal(size=(count, 2, joints)) for _ in range(3))
    step = rng.uniform(0.5, 1.5, count)
    return ThirdOrder(
        step, rng.uniform(0.5, 1.5, count + 1), np.array([1.4, 1.7]), rng.uniform(3.0, 5.0, count + 1),
        rng.uniform(0.8, 1.2, count + 1), at, a, b, r, -rng.uniform(2.0, 3.0, a.shape), rng.uniform(2.0, 3.0, a.shape),
        d1, d2, d3,
    )  # fmt: skip


def states(problem: ThirdOrder, y: Floats) -> Point:
    c = np.empty(len(y) + 2)
    unfold(problem, y, c)
    point = Point(np.empty(len(y) + 1), np.empty(len(y) + 1), np.empty(len(y)))
    spline(problem, c, point)
    return point


def empty_normal(count: int) -> Normal:
    at, ends, between = np.zeros((5, count + 1)), np.zeros((2, count, 2)), np.zeros((2, count))
    return Normal(at[0], at[1], at[2], ends[0], ends[1], between[0], at[3], at[4], between[1])


def slacks_of(s: Floats, l: Floats) -> Slacks:  # noqa: E741
    return Slacks(s.copy(), 1.0 / s, l.copy(), np.zeros_like(s), np.zeros_like(s), np.zeros_like(s))


def rows_of(problem: ThirdOrder, y: Floats) -> Floats:
    """All g, written down once more and plainly."""
    x, u, z = states(problem, y)
    caps = 1.0 - x / problem.cap
    x_at, u_at = x[problem.at, None], u[problem.at, None]
    value = problem.a * u_at + problem.b * x_at + problem.r * np.sqrt(x_at)
    points = np.stack([problem.high - value, value - problem.low], axis=-1)
    ends = np.stack([x[:-1], x[1:]], axis=1)[..., None], np.stack([u[:-1], u[1:]], axis=1)[..., None]
    scale = np.stack([problem.scale[:-1], problem.scale[1:]], axis=1)[..., None]
    jerk = problem.d1 * z[:, None, None] + problem.d2 * ends[1] + problem.d3 * ends[0]
    jerks = np.stack([scale / np.sqrt(ends[0]) - jerk, scale / np.sqrt(ends[0]) + jerk], axis=-1)
    return np.concatenate([caps, points.ravel(), jerks.ravel()])


def slopes_of(problem: ThirdOrder, y: Floats) -> Floats:
    return np.stack([(rows_of(problem, y + e) - rows_of(problem, y - e)) / 2e-4 for e in 1e-4 * np.eye(9)], axis=1)


def time_of(problem: ThirdOrder, y: Floats) -> float:
    return float((problem.weight / np.sqrt(states(problem, y).x)).sum())


def test_the_spline_is_scipys() -> None:
    problem = problem_of(3)
    station = np.concatenate([[0.0], np.cumsum(problem.step)])
    y = np.random.default_rng(1).uniform(0.5, 1.5, 9)
    c = np.empty(11)
    unfold(problem, y, c)
    theirs = BSpline(np.concatenate([station[:1], station[:1], station, station[-1:], station[-1:]]), c, 2)
    ours = states(problem, y)
    np.testing.assert_allclose(ours.x, theirs(station), rtol=1e-13)
    np.testing.assert_allclose(ours.u, 0.5 * theirs.derivative()(station), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(ours.z, 0.5 * theirs.derivative(2)(station[:-1] + 0.5 * problem.step), atol=1e-12)
    assert ours.u[0] == pytest.approx(0.4 / problem.step[0] * y[0])  # folded ends


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.integers(3, 40))
def test_five_diagonals_are_solved_as_numpy_does(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    lower = np.tril(np.triu(rng.normal(size=(n, n)), -2))
    matrix = lower @ lower.T + 0.1 * np.eye(n)
    band = np.zeros((n, 3))
    for d in range(3):
        band[: n - d, d] = np.diagonal(matrix, d)
    right = rng.normal(size=n)
    wanted = np.linalg.solve(matrix, right)
    assert factor(band)
    solve(band, right)
    np.testing.assert_allclose(right, wanted, rtol=1e-6, atol=1e-8)


def test_a_matrix_that_is_not_positive_definite_is_refused() -> None:
    assert not factor(np.array([[1.0, 2.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    assert not factor(np.full((3, 3), np.nan))


@pytest.mark.parametrize("seed", range(4))
def test_the_normal_equations_are_those_of_finite_differences(seed: int) -> None:
    """Second derivatives of the time and slopes of all rows, and the right side of Newton's step."""
    problem = problem_of(seed)._replace(r=np.zeros((11, 3)))  # no curvature but the time's and the hollow rows'
    rng = np.random.default_rng(seed + 100)
    y = rng.uniform(0.8, 1.6, 9)
    s, l = rng.uniform(0.2, 2.0, (2, len(rows_of(problem, y))))  # noqa: E741
    slacks, normal, point = slacks_of(s, l), empty_normal(9), states(problem, y)
    values(problem, point, slacks.g)
    np.testing.assert_allclose(slacks.g, rows_of(problem, y), rtol=1e-12, atol=1e-13)
    bend_time_and_caps(problem, point, slacks, normal)
    bend_point_rows(problem, point, slacks, normal)
    bend_jerk_rows(problem, point, slacks, normal)
    band, free = np.zeros((11, 3)), np.zeros((9, 3))
    bands(problem, normal, band)
    fold(problem, band, free)
    ours = np.zeros((9, 9))
    for d in range(3):
        for k in range(9 - d):
            ours[k, k + d] = ours[k + d, k] = free[k, d]
    eye = 1e-4 * np.eye(9)
    slopes = slopes_of(problem, y)
    bend = np.array(
        [
            [
                time_of(problem, y + e + f) - time_of(problem, y + e - f) - time_of(problem, y - e + f)
                + time_of(problem, y - e - f)
                for e in eye
            ]
            for f in eye
        ]
    ) / 4e-8  # fmt: skip
    np.testing.assert_allclose(ours, bend + slopes.T @ ((l / s)[:, None] * slopes), rtol=2e-5, atol=2e-5)
    push, right, folded = rng.normal(size=len(s)), np.zeros(11), np.zeros(9)
    add_slopes(problem, point, push, normal)
    to_coefficients(problem, normal, right)
    fold_right(problem, right, folded)
    np.testing.assert_allclose(folded, slopes.T @ push, rtol=1e-5, atol=1e-6)


def test_friction_adds_the_curvature_of_its_full_side_alone() -> None:
    problem = problem_of(2)
    y = np.full(9, 1.2)
    point, count = states(problem, y), len(rows_of(problem, y))
    for held, sign in ((np.array([1.0, 0.0]), -1.0), (np.array([0.0, 1.0]), 1.0)):
        slacks, normal = slacks_of(np.full(count, 1e12), np.tile(1.0, count)), empty_normal(9)
        slacks.l[10 : 10 + problem.a.size * 2] = np.tile(held, problem.a.size)
        bend_point_rows(problem, point, slacks, normal)
        wanted = np.zeros(10)
        np.add.at(wanted, problem.at, np.maximum(0.0, sign * problem.r.sum(axis=1) * 0.25 / point.x[problem.at] ** 1.5))
        np.testing.assert_allclose(normal.xx, wanted, rtol=1e-6, atol=1e-9)


def test_directions_meet_the_linear_equations() -> None:
    problem = problem_of(7)
    rng = np.random.default_rng(5)
    y, change = rng.uniform(0.8, 1.6, 9), 1e-3 * rng.normal(size=9)
    s, l = rng.uniform(0.2, 2.0, (2, len(rows_of(problem, y))))  # noqa: E741
    slacks, rise = slacks_of(s, l), np.empty(len(s))
    values(problem, states(problem, y), slacks.g)
    rises(problem, states(problem, y), states(problem, change), rise)
    np.testing.assert_allclose(rise, slopes_of(problem, y) @ change, rtol=1e-5, atol=1e-8)
    primal, dual, left = predict_rows(slacks, rise)
    ds, dl = slacks.ds.copy(), slacks.dl.copy()
    np.testing.assert_allclose(ds, rise + slacks.g - s, atol=1e-12)
    np.testing.assert_allclose(s * dl + l * ds, -s * l, atol=1e-12)
    assert primal == pytest.approx(min(1.0, (-s / np.where(ds < 0.0, ds, -1e-12)).min()))
    assert dual == pytest.approx(min(1.0, (-l / np.where(dl < 0.0, dl, -1e-12)).min()))
    assert left == pytest.approx((s + primal * ds) @ (l + dual * dl) / (s @ l))
    primal, dual = correct_rows(slacks, rise, 0.3)
    np.testing.assert_allclose(s * slacks.dl + l * slacks.ds, 0.3 - s * l - ds * dl, atol=1e-12)
    assert primal == pytest.approx((-s / np.where(slacks.ds < 0.0, slacks.ds, -1e-12)).min())
    assert dual == pytest.approx((-l / np.where(slacks.dl < 0.0, slacks.dl, -1e-12)).min())
    gap, worst, row = advance_rows(slacks, 0.1, 0.2)
    np.testing.assert_allclose(slacks.s, np.maximum(s + 0.1 * ds, slacks.g), atol=1e-12)
    assert gap == pytest.approx(slacks.s @ slacks.l)
    assert worst == pytest.approx((slacks.s - slacks.g).max())
    assert row == (slacks.s - slacks.g).argmax()


@pytest.mark.parametrize("seed", range(8))
def test_the_optimum_keeps_all_rows_and_no_start_finds_a_better_one(seed: int) -> None:
    problem = problem_of(seed, count=40)
    times = []
    for start in (0.3, 1.0, 2.5):
        y = np.full(40, start)
        steps, gap, excess, _, time = descend(problem, y, 0.1, 1.0)
        assert steps < 60
        assert gap <= 3e-4 * time
        assert excess <= 1e-6
        assert rows_of(problem, y).min() >= -1e-6
        times.append(time)
    np.testing.assert_allclose(times, times[0], rtol=5e-4)


def test_a_cap_alone_is_reached() -> None:
    """Nothing else limited: x is the cap wherever the ends let it."""
    count = 50
    none = np.zeros((0, 1))
    step = np.full(count, 1.0)
    jerk = np.full((count, 2, 1), 1e-9)
    problem = ThirdOrder(
        step, np.ones(count + 1), np.array([1.01, 1.01]), np.full(count + 1, 4.0), np.ones(count + 1),
        np.zeros(0, dtype=np.int64), none, none, none, none, none, jerk, jerk, jerk,
    )  # fmt: skip
    y = np.ones(count)
    assert descend(problem, y, 0.1, 1.0)[4] == pytest.approx((count + 1) / 2.0, rel=1e-3)
    np.testing.assert_allclose(states(problem, y).x[2:-2], 4.0, rtol=5e-3)
