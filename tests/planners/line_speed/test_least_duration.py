"""Lower bounds of line-speed profiles: below every motion that there is, and near the best ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.planners import Arc, BlendedPath, CartesianPath, Line, LineSpeedLimits, LineSpeedProfile
from armtempo.planners import limit_aware_profile as aware
from armtempo.planners.cells import BlendCell, as_cell
from armtempo.planners.line_speed._least_duration import least_duration

LIMITS = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)


def line(length: float) -> Line:
    return Line(np.zeros(3), np.array([length, 0.0, 0.0]))


@settings(max_examples=100, deadline=None)
@given(*(st.floats(-3.0, 3.0) for _ in range(4)))
def test_a_line_takes_no_less_however_far_apart_the_limits_are(
    size: float, speed: float, accel: float, jerk: float
) -> None:
    limits = LineSpeedLimits(speed=10**speed, acceleration=10**accel, jerk=10**jerk)
    fastest = LineSpeedProfile.plan(10**size, limits)
    bound = least_duration(line(10**size), 10**size, limits)
    assert 0.9 * fastest.duration <= bound <= fastest.duration  # (3/4)^(1/3): only the jerk beside the rests
    assert fastest.duration * (1.0 - 2e-9) <= fastest.bound.seconds <= fastest.duration
    assert fastest.bound.proven


def test_a_line_in_several_pieces_is_one_line() -> None:
    pieces = CartesianPath([Line(np.array([x, 0.0, 0.0]), np.array([x + 0.25, 0.0, 0.0])) for x in (0.0, 0.25, 0.5)])
    whole, parts = (least_duration(path, path.length, LIMITS) for path in (line(0.75), pieces))
    assert parts == pytest.approx(whole, rel=2e-3)


def test_a_circle_at_its_steady_speed() -> None:
    circle = Arc(np.array([1.0, 0.0, 0.0]), np.array([-1.0, 1e-3, 0.0]) / np.hypot(1.0, 1e-3), np.zeros(3))
    steady = 0.3**0.5
    bound = least_duration(circle, circle.length, replace(LIMITS, normal_acceleration=0.3))
    ramps = LineSpeedProfile.plan(circle.length, replace(LIMITS, speed=steady)).duration
    assert 0.998 * ramps <= bound <= ramps * (1.0 + 1e-9)


def test_a_jump_of_curvature_is_a_stop() -> None:
    arc = Arc(np.array([0.5, 0.0, 0.0]), np.array([1.0, 0.5, 0.0]), np.array([0.5, 0.5, 0.0]))
    path = CartesianPath([line(0.5), arc])
    apart = [least_duration(piece, piece.length, LIMITS) for piece in (line(0.5), arc)]
    assert least_duration(path, path.length, LIMITS) == pytest.approx(sum(apart), rel=1e-4)
    assert least_duration(path, 0.5, LIMITS) == pytest.approx(apart[0], rel=1e-4)  # a profile over a part of it


@pytest.mark.parametrize("seed", range(12))
def test_no_profile_is_below_its_bound_nor_far_above(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(rng.normal(0.0, 0.3, (5, 3)), axis=0)])
    path = BlendedPath.through(points, tolerance=0.02, curve=("quintic", "low-peak", "septic")[seed % 3])
    limits = replace(LIMITS, jerk=float(rng.choice([50.0, 200.0, 2000.0])))
    profile = aware(path, limits)
    assert profile.bound.proven
    assert profile.bound.seconds <= profile.duration
    if limits.jerk > 1000.0:  # the jerk in bends is left out
        assert profile.duration <= 1.05 * profile.bound.seconds


def test_the_bundled_cell() -> None:
    cell = as_cell("lee2006", BlendCell)
    assert cell.line_speed.duration == pytest.approx(cell.line_speed.bound.seconds, rel=2e-9)
    smooth = cell.variant(curve="quintic").limit_aware
    assert smooth.bound.seconds <= smooth.duration <= 1.002 * smooth.bound.seconds
