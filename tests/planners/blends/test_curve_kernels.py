"""Geometry of one polynomial curve, against numpy's polynomials, finite differences and dense samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from scipy.integrate import quad
from scipy.interpolate import BPoly

from armtempo.arrays import Floats
from armtempo.planners.blends._curve_kernels import (
    PANEL_NODES,
    by_arc_length,
    curve_derivatives,
    curve_distance,
    curve_position,
    curve_speed,
    fit_panel,
    powers_of,
)

seeds, degrees, places = st.integers(0, 10**6), st.sampled_from([3, 5, 7]), st.floats(0.0, 1.0)


def shape_of(seed: int, degree: int) -> Floats:
    shape = np.zeros((8, 3))
    shape[: degree + 1] = np.random.default_rng(seed).uniform(-1.0, 1.0, (degree + 1, 3))
    return shape


@given(seeds, degrees, places)
def test_position_and_derivatives_are_those_of_the_polynomial(seed: int, degree: int, u: float) -> None:
    shape, out, place = shape_of(seed, degree), np.empty((4, 3)), np.empty(3)
    curve_derivatives(shape, degree, u, out)
    curve_position(shape, degree, u, place)
    expected = [[Polynomial(column).deriv(k)(u) for column in shape.T] for k in range(4)]
    np.testing.assert_allclose(out, expected, rtol=1e-12, atol=1e-11)
    np.testing.assert_array_equal(place, out[0])
    assert curve_speed(shape, degree, u) == pytest.approx(float(np.linalg.norm(out[1])), rel=1e-12)


@given(seeds, degrees, places)
def test_control_points_in_powers_are_the_bezier_curve(seed: int, degree: int, u: float) -> None:
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (degree + 1, 3))
    shape, place = np.full((8, 3), 9.0), np.empty(3)
    powers_of(points, degree, shape)
    curve_position(shape, degree, u, place)
    np.testing.assert_allclose(place, BPoly(points[:, None], [0.0, 1.0])(u), atol=1e-12)
    assert not shape[degree + 1 :].any()


@settings(max_examples=50)
@given(seeds, degrees, st.floats(0.05, 0.95))
def test_derivatives_by_length_are_a_unit_tangent_and_its_changes(seed: int, degree: int, u: float) -> None:
    shape = shape_of(seed, degree)

    def at(place: float) -> Floats:
        out = np.empty((4, 3))
        curve_derivatives(shape, degree, place, out)
        by_arc_length(out)
        return out

    speed = curve_speed(shape, degree, u)
    if speed < 0.2:
        return
    h = 1e-5
    here, before, after = at(u), at(u - h), at(u + h)
    assert np.linalg.norm(here[1]) == pytest.approx(1.0, rel=1e-12)
    assert here[1] @ here[2] == pytest.approx(0.0, abs=1e-9 * (1.0 + np.abs(here[2]).max()))
    for k in (1, 2):
        differences = (after[k] - before[k]) / (2.0 * h * speed)
        np.testing.assert_allclose(here[k + 1], differences, atol=1e-4 * (1.0 + np.abs(here[k + 1]).max()))


@settings(max_examples=30)
@given(seeds, degrees)
def test_a_panels_length_is_that_of_quadrature_and_its_inverse_leads_back(seed: int, degree: int) -> None:
    shape, inverse = shape_of(seed, degree), np.empty(PANEL_NODES)
    shape[1] += [4.0, 0.0, 0.0]  # away from standing still
    start, h = 0.25, 1.0 / 64.0
    length = fit_panel(shape, degree, start, h, inverse, 1e-12)
    assert length > 0.0  # it fits
    assert length == pytest.approx(quad(lambda u: curve_speed(shape, degree, u), start, start + h)[0], rel=1e-12)
    for share in np.linspace(0.0, 1.0, 9):
        u = float(np.polynomial.polynomial.polyval(2.0 * share - 1.0, inverse))
        way = quad(lambda v: curve_speed(shape, degree, v), start, u)[0]
        assert way == pytest.approx(share * length, abs=1e-12)


def test_a_panel_that_fits_badly_says_so_by_its_sign() -> None:
    shape, inverse = np.zeros((8, 3)), np.empty(PANEL_NODES)
    shape[1], shape[2], shape[3] = [0.01, 0.0, 0.0], [0.0, 1.0, 0.0], [5.0, 0.0, 0.0]  # almost stands still
    whole = fit_panel(shape, 3, 0.0, 1.0, inverse, 1e-12)
    assert whole < 0.0
    assert -whole == pytest.approx(quad(lambda u: curve_speed(shape, 3, u), 0.0, 1.0, limit=200)[0], rel=1e-3)


@settings(max_examples=50)
@given(seeds, st.tuples(*[st.floats(-2.0, 2.0)] * 3))
def test_no_sample_is_nearer_than_the_distance(seed: int, vertex: tuple[float, float, float]) -> None:
    shape = shape_of(seed, 3)
    samples = np.polynomial.polynomial.polyval(np.linspace(0.0, 1.0, 5001), shape).T
    nearest = float(np.linalg.norm(samples - vertex, axis=1).min())
    told = curve_distance(shape, 3, np.array(vertex))
    assert told <= nearest + 1e-12
    assert told >= nearest - 1e-3
