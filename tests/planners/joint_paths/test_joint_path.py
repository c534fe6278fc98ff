"""Tables of joint paths: quintic pieces that reproduce what they were made from, jumps of the curvature too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from armtempo.arrays import Floats
from armtempo.planners import CoordinationCell, JointPath
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.planners.joint_paths.kernels import path_point


class Polynomial(JointPath):
    """Two joints on polynomials of degree 5, others behind ``middle`` with another second derivative."""

    def __init__(self, coefficients: Floats, middle: float, bend: float) -> None:
        self.length, self.dof, self.breakpoints = 2.0, 2, np.array([0.0, middle, 2.0])
        self._p, self._middle, self._bend = coefficients, middle, bend

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        lam = np.clip(np.asarray(lam, dtype=np.float64), 0.0, 2.0)[..., None]
        parts = [sum(c * lam**k for k, c in enumerate(self._p))]
        parts.append(sum(k * c * lam ** (k - 1) for k, c in enumerate(self._p) if k > 0))
        parts.append(sum(k * (k - 1) * c * lam ** (k - 2) for k, c in enumerate(self._p) if k > 1))
        past = lam - self._middle
        behind = past > 0.0 if before else past >= 0.0
        bends = (0.5 * self._bend * past**2, self._bend * past, self._bend + 0.0 * past)
        q, dq, ddq = (np.asarray(part + behind * bend) for part, bend in zip(parts, bends, strict=True))
        return q, dq, ddq

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        raise NotImplementedError


def point(path: AbstractJointPath, lam: float, pieces: int) -> Floats:
    q = np.empty(path.dof)
    path_point(path.table(pieces), lam, q)
    return q


@settings(max_examples=50)
@given(st.integers(0, 10**6), st.floats(0.1, 1.9), st.floats(-5.0, 5.0), st.integers(1, 7), st.floats(0.0, 2.0))
def test_quintics_come_out_exactly_from_any_number_of_pieces(
    seed: int, middle: float, bend: float, pieces: int, lam: float
) -> None:
    path = Polynomial(np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 2)), middle, bend)
    np.testing.assert_allclose(point(path, lam, pieces), path.evaluate(lam)[0], atol=1e-10)


def test_before_the_start_and_past_the_end_it_stands_at_the_ends() -> None:
    path = Polynomial(np.ones((6, 2)), 1.0, 0.0)
    np.testing.assert_array_equal(point(path, -0.5, 4), path.evaluate(0.0)[0])
    np.testing.assert_allclose(point(path, 2.5, 4), path.evaluate(2.0)[0], rtol=1e-14)


def test_breakpoints_are_stations_with_the_curvature_of_both_sides() -> None:
    path = Polynomial(np.zeros((6, 2)), 0.3, 4.0)
    table = path.table(4)
    np.testing.assert_allclose(table.station, [0.0, 0.3, 0.5, 1.0, 1.5, 2.0])
    np.testing.assert_array_equal(table.ddq[1], [4.0, 4.0])
    np.testing.assert_array_equal(table.ddq_before[1], [0.0, 0.0])


def test_twice_the_pieces_miss_a_sixty_fourth() -> None:
    """Of sixth order, as quintic pieces are."""

    class Sine(Polynomial):
        def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
            lam = np.clip(np.asarray(lam, dtype=np.float64), 0.0, 2.0)[..., None] * np.array([3.0, 2.0])
            return np.sin(lam), np.cos(lam) * [3.0, 2.0], -np.sin(lam) * [9.0, 4.0]

    path = Sine(np.zeros((6, 2)), 1.0, 0.0)
    samples = np.linspace(0.0, 2.0, 301)
    coarse, fine = (
        max(float(np.abs(point(path, float(lam), pieces) - path.evaluate(lam)[0]).max()) for lam in samples)
        for pieces in (8, 16)
    )
    assert coarse / fine == pytest.approx(64.0, rel=0.1)


def test_the_papers_paths_come_out_of_their_tables(lee1991: CoordinationCell) -> None:
    for path in lee1991.paths:
        table, q = path.table(), np.empty(path.dof)
        for lam in np.random.default_rng(2).uniform(0.0, path.length, 300):
            path_point(table, float(lam), q)
            np.testing.assert_allclose(q, path.evaluate(lam)[0], atol=1e-11)


def test_a_path_of_ones_own_needs_its_two_methods(joint_spline: Callable[[Floats], JointPath]) -> None:
    class Half(JointPath):
        def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
            raise NotImplementedError

    with pytest.raises(TypeError, match="speed_bound"):
        Half()  # type: ignore[abstract]
    assert joint_spline(np.zeros((3, 2))).unit == "m"


def test_third_derivatives_are_those_of_the_spline(joint_spline: Callable[[Floats], JointPath]) -> None:
    """By differences inside pieces, and by a path that knows; at a knot the side counts."""
    points = np.random.default_rng(2).uniform(-1.0, 1.0, (5, 3))
    path = joint_spline(points)
    wanted = CubicSpline(path.breakpoints, points, bc_type="natural")
    s = np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(path.third(s), wanted(s, 3), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(path.third(path.breakpoints[1:], before=True), wanted.c[0] * 6.0, rtol=1e-6, atol=1e-6)
    assert path.third(0.3).shape == (3,)
    assert path.third(np.zeros((2, 4))).shape == (2, 4, 3)
    waypoints = JointPath.through(points)
    knots, h = waypoints.breakpoints, 1e-5
    ahead = (waypoints.evaluate(knots[:-1] + 2 * h)[2] - waypoints.evaluate(knots[:-1] + h)[2]) / h
    np.testing.assert_allclose(waypoints.third(knots[:-1]), ahead, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(waypoints.third(knots[1:], before=True), ahead, rtol=1e-6, atol=1e-6)
