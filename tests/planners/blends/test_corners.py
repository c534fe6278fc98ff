"""Corners of a chain: closed forms of reach and deviation, what is joined, and the geometry that kernels get."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InputError, PathError
from armtempo.planners.blends._corners import Corners, packed_segments, plan_corners
from armtempo.planners.geometry import Arc, Line

ORIGIN, X, Y = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def bent(turn: float, length: float = 1.0) -> list[Line | Arc]:
    """Two lines that meet at ORIGIN and turn by an angle [rad]."""
    return [Line(-X, ORIGIN), Line(ORIGIN, length * np.array([math.cos(turn), math.sin(turn), 0.0]))]


def planned(segments: list[Line | Arc], remaining: float | None, tolerance: float | None = None) -> Corners:
    return plan_corners(*packed_segments(segments), remaining, tolerance=tolerance)


@given(st.floats(0.05, 3.0), st.floats(0.01, 0.9))
def test_a_cubics_deviation_is_a_quarter_of_what_a_corner_stands_out(turn: float, remaining: float) -> None:
    """With shape factor 3 the inner control points are the vertex: F(1/2) - V = L (n2 - n1) / 8."""
    corners = planned(bent(turn), remaining)
    assert corners.turn[0] == pytest.approx(turn)
    assert corners.deviation[0] == pytest.approx(remaining * 2.0 * math.sin(turn / 2.0) / 8.0, rel=1e-9)
    np.testing.assert_array_equal(corners.remaining, [[remaining, remaining]])


@given(st.floats(0.2, 2.8), st.floats(1e-4, 0.02))
def test_a_tolerance_is_used_up(turn: float, tolerance: float) -> None:
    corners = planned(bent(turn), None, tolerance)
    assert corners.deviation[0] == pytest.approx(tolerance, rel=1e-9)
    assert corners.remaining[0, 0] == pytest.approx(4.0 * tolerance / math.sin(turn / 2.0), rel=1e-9)


def test_of_distance_and_tolerance_the_smaller_reach_counts() -> None:
    by_tolerance = planned(bent(1.0), None, 0.01).remaining[0, 0]
    np.testing.assert_allclose(planned(bent(1.0), 0.5 * by_tolerance, 0.01).remaining, 0.5 * by_tolerance)
    np.testing.assert_allclose(planned(bent(1.0), 2.0 * by_tolerance, 0.01).remaining, by_tolerance)


def test_a_straight_joint_is_no_corner_and_a_sharp_one_needs_a_blend() -> None:
    np.testing.assert_array_equal(planned(bent(0.0), 0.1).remaining, [[0.0, 0.0]])
    with pytest.raises(InputError, match=r"segments 0 and 1 meet in a corner of 57\.3 degrees"):
        planned(bent(1.0), None)
    with pytest.raises(PathError, match="its remaining distance is 0"):
        planned(bent(1.0), 0.0)


def test_gaps_reversals_and_blends_that_are_too_long_are_told_with_their_place() -> None:
    with pytest.raises(PathError, match=r"segments 0 and 1 are 0\.1 m apart at 1 m") as caught:
        planned([Line(-X, ORIGIN), Line(0.1 * X, X)], 0.1)
    assert caught.value.data["segments"] == (0, 1)
    with pytest.raises(PathError, match="segment 1 turns straight back on segment 0 at 1 m"):
        planned(bent(math.pi), 0.1)
    with pytest.raises(PathError, match=r"needs 0\.3 m of segment 1, which is 0\.2 m long"):
        planned(bent(1.0, length=0.2), 0.3)
    square = [*bent(math.pi / 2, length=0.5), Line(0.5 * Y, 0.5 * Y + X)]
    with pytest.raises(PathError, match=r"overlap by 0\.1 m on segment 1, which is 0\.5 m long"):
        planned(square, 0.3)


def test_packed_lines_and_arcs_are_their_start_direction_and_radius() -> None:
    arc = Arc.through(ORIGIN, [1.0, 1.0, 0.0], [2.0, 0.0, 0.0])
    kind, shape, lengths = packed_segments([Line(-2.0 * X, ORIGIN), arc])
    assert kind[0] != kind[1]
    np.testing.assert_allclose(shape[0, :2], [-2.0 * X, X])
    np.testing.assert_allclose(shape[1, 0], ORIGIN, atol=1e-15)
    np.testing.assert_allclose(shape[1, 1], -X, atol=1e-12)  # from the centre to the start
    np.testing.assert_allclose(shape[1, 2], Y, atol=1e-12)
    assert shape[1, 3, 0] == pytest.approx(1.0)
    np.testing.assert_allclose(lengths, [2.0, math.pi])


def test_what_is_no_list_of_segments_is_refused() -> None:
    for wrong, message in (
        (Line(ORIGIN, X), "must be a list of lines and arcs, got a Line"),
        ([3], "segment 0 is a int"),
    ):
        with pytest.raises(InputError, match=message):
            packed_segments(wrong)  # type: ignore[arg-type]
