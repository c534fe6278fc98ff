"""Polylines as they come: every angle, legs from 0.1 mm to 1 m, tolerances from 10 um, jerks from 2 to 1000 m/s^3.

``ARMTEMPO_POLYLINES`` sets how many are tried (100; the claim is made for 10 000). The limits are looked at apart from
the library's certificate: at instants of every piece of the profile, and at lengths of every piece of the path.
"""

from __future__ import annotations

import os
from itertools import pairwise

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.planners import BlendedPath, LineSpeedLimits, LineSpeedProfile, limit_aware_profile

POLYLINES = int(os.environ.get("ARMTEMPO_POLYLINES", "100"))
CURVES = ("cubic", "quintic", "low-peak", "septic")


def unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v))


def polyline(rng: np.random.Generator) -> Floats:
    """Points of two to six legs; corners of any angle, and as many that nearly turn back or nearly go straight on."""
    count = int(rng.integers(1, 6))
    legs = 10.0 ** rng.uniform(-4.0, 0.0, count + 1)
    turns = np.choose(
        rng.integers(0, 3, count),
        [
            rng.uniform(1e-3, np.pi - 1e-3, count),
            np.pi - 10.0 ** rng.uniform(-3.9, -0.5, count),
            10.0 ** rng.uniform(-4.0, -0.3, count),
        ],
    )
    heading, points = unit(rng.normal(size=3)), [rng.uniform(-0.5, 0.5, 3)]
    points.append(points[0] + legs[0] * heading)
    for turn, leg in zip(turns, legs[1:], strict=True):
        heading = unit(np.cos(turn) * heading + np.sin(turn) * unit(np.cross(heading, rng.normal(size=3))))
        points.append(points[-1] + leg * heading)
    return np.array(points)


def worst_ratio(path: BlendedPath, profile: LineSpeedProfile, limits: LineSpeedLimits) -> float:
    """The worst ratio to any limit; shares of pieces keep off their ends, where rounding mixes both sides."""
    close = np.geomspace(1e-6, 1e-2, 30)
    shares = np.concatenate([close, np.linspace(0.0, 1.0, 400)[1:-1], 1.0 - close])
    s = (path.breakpoints[:-1, None] + np.diff(path.breakpoints)[:, None] * shares).ravel()
    t = (profile.knots[:-1, None] + np.diff(profile.knots)[:, None] * np.linspace(1e-6, 1.0 - 1e-6, 60)).ravel()
    s, v, a, j = profile.at(np.concatenate([t, profile.time_at(s)]))
    _, d1, d2, d3 = path.derivatives(s)
    acceleration = d1 * a[:, None] + d2 * (v**2)[:, None]
    across = np.linalg.norm(acceleration - (acceleration * d1).sum(axis=1, keepdims=True) * d1, axis=1)
    jerk = np.linalg.norm(d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None], axis=1)
    sizes = v, np.abs(a), across, jerk
    bounds = limits.speed, limits.acceleration, limits.normal, limits.jerk
    return max(float(size.max()) / bound for size, bound in zip(sizes, bounds, strict=True))


def stopping(points: Floats, limits: LineSpeedLimits) -> float:
    """Time with a stop at every vertex of the polyline [s], by ruckig."""
    return sum(LineSpeedProfile.plan(float(np.linalg.norm(b - a)), limits).duration for a, b in pairwise(points))


def back(degrees: float, tolerance: float, curve: str = "cubic") -> tuple[Floats, BlendedPath]:
    """Out by 0.3 m and back at an angle; the points and the path."""
    turn = np.radians(degrees)
    points = np.array([[0, 0, 0], [0.3, 0, 0], [0.3 + 0.3 * np.cos(turn), 0.3 * np.sin(turn), 0]])
    return points, BlendedPath.through(points, tolerance=tolerance, curve=curve)


@pytest.mark.parametrize("seed", range(POLYLINES))
def test_limits_hold_and_no_cubic_is_slower_than_stopping(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = polyline(rng)
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    half = 0.5 * np.minimum(legs[:-1], legs[1:])
    curve = CURVES[seed % 4]
    path = BlendedPath.through(points, half, tolerance=10.0 ** rng.uniform(-5.0, -1.5), curve=curve)
    speed, acceleration, jerk = 10.0 ** rng.uniform([-1.0, 0.0, 0.3], [0.3, 1.0, 3.0])
    limits = LineSpeedLimits(speed=speed, acceleration=acceleration, jerk=jerk)
    profile = limit_aware_profile(path, limits)
    assert worst_ratio(path, profile, limits) <= 1.0 + 1e-6
    assert profile.certificate.ratio_max <= 1.0 + 1e-6
    assert 0.0 < profile.bound.seconds <= profile.duration
    if curve == "cubic":  # others bend so much between straight ends that to stop in the corner can be quicker
        assert profile.duration <= stopping(points, limits) * (1.0 + 3e-3)


@pytest.mark.parametrize(("jerk", "tolerance", "first"), [(200.0, 0.005, 179.0), (20.0, 0.02, 160.0)])
@pytest.mark.parametrize("curve", CURVES)
def test_near_reversals_are_as_quick_as_their_neighbours_and_quicker_than_a_stop(
    jerk: float, tolerance: float, first: float, curve: str
) -> None:
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=jerk)
    for degrees in np.append(np.linspace(first, 179.9, 5), 179.94):
        times = []
        for near in (0.0, 0.05):
            points, path = back(float(degrees) + near, tolerance, curve)
            profile = limit_aware_profile(path, limits)
            assert profile.duration <= stopping(points, limits) * (1.0 if curve in ("cubic", "quintic") else 1.05)
            assert worst_ratio(path, profile, limits) <= 1.0 + 1e-6
            times.append(profile.duration)
        assert max(times) <= 1.02 * min(times)


def test_a_hatch_is_quicker_than_stops_at_every_vertex() -> None:
    limits = LineSpeedLimits(speed=0.25, acceleration=2.0, jerk=20.0)
    for pitch in (0.0005, 0.001, 0.004):
        k = np.arange(8)
        points: Floats = np.stack([0.15 * (k % 2), pitch * k, 0.0 * k], axis=1).astype(np.float64)
        path = BlendedPath.through(points, 0.05, tolerance=0.002)
        profile = limit_aware_profile(path, limits)
        assert profile.duration < stopping(points, limits)
        assert worst_ratio(path, profile, limits) <= 1.0 + 1e-6


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-9])
def test_corners_of_nanometres_keep_the_limits_and_cost_no_more_than_a_stop(curve: str, tolerance: float) -> None:
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
    for degrees in (5.0, 30.0, 90.0, 135.0, 160.0):
        points, path = back(degrees, tolerance, curve)
        profile = limit_aware_profile(path, limits)
        assert worst_ratio(path, profile, limits) <= 1.0 + 1e-6
        assert profile.duration <= stopping(points, limits) * 1.01


@pytest.mark.parametrize("curve", ["cubic", "quintic"])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
@pytest.mark.parametrize("at_end", [False, True])
def test_a_blend_right_beside_an_end_keeps_the_limits(curve: str, tolerance: float, at_end: bool) -> None:
    points = np.array([[0, 0, 0], [0.01, 0, 0], [0.01, 0.3, 0], [0.3, 0.3, 0]])
    path = BlendedPath.through(points[::-1] if at_end else points, tolerance=tolerance, curve=curve)
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=2.0)
    assert worst_ratio(path, limit_aware_profile(path, limits), limits) <= 1.0 + 1e-6


def test_a_certificate_sees_what_the_path_does_within_one_piece_of_a_profile() -> None:
    """A profile of seven pieces over sharp corners: 6 and more lie within one piece."""
    _, path = back(170.0, 1e-4)
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
    plain = LineSpeedProfile.plan(path.length, limits)
    profile = LineSpeedProfile(knots=plain.knots, coefficients=plain.coefficients, limits=limits, path=path)
    s = np.linspace(path.breakpoints[1], path.breakpoints[2], 200001)[1:-1]
    _, v, a, j = profile.at(profile.time_at(s))
    _, d1, d2, d3 = path.derivatives(s)
    jerk = np.linalg.norm(d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None], axis=1)
    said = profile.certificate
    assert said.normal_ratio_max == pytest.approx((np.linalg.norm(d2, axis=1) * v**2).max() / 5.0, rel=1e-6)
    assert said.jerk_ratio_max == pytest.approx(jerk.max() / 200.0, rel=1e-6)
