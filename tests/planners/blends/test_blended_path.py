"""Whole blended paths: lengths and their inverse, joints, orientation, and the chains that are refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from armtempo.arrays import Floats
from armtempo.errors import ArmtempoError, InputError, PathError
from armtempo.planners import Arc, BlendedPath, Line, LineSpeedLimits, blend, limit_aware_profile
from armtempo.planners.blends import Blend, arc_length
from armtempo.planners.blends.kernels import blended_point


def scara(remaining: float = 0.15, **options: object) -> BlendedPath:
    """The paper's task (section IV)."""
    corner, turn = [0.3, 0.0, 0.05], [0.3, 0.65, 0.0]
    segments = [
        Line(np.array([0.7, 0.0, 0.05]), np.array(corner)),
        Line(np.array(corner), np.array(turn)),
        Arc.through(turn, [0.0, 0.65, 0.05], [-0.372, 0.65, 0.05]),
    ]
    return BlendedPath(segments, remaining, **options)  # type: ignore[arg-type]


def test_lengths_of_the_papers_path() -> None:
    path = scara()
    np.testing.assert_allclose(1e3 * np.diff(path.breakpoints), [250.0, 270.32, 351.92, 269.65, 526.93], atol=6e-3)
    assert path.length == pytest.approx(1.66883, abs=1e-5)
    assert [type(piece) for piece in path.pieces] == [Line, Blend, Line, Blend, Arc]
    assert path.continuity.tolist() == [2, 2, 1, 1]  # the cubic is not G2 beside an arc
    assert scara(curve="quintic").continuity.tolist() == [2, 2, 2, 2]
    assert scara(curve="septic").continuity.tolist() == [3, 3, 3, 3]
    peak = path.curvature(np.linspace(0.25, 0.52, 2001)).max()
    assert 1.0**2 * peak == pytest.approx(25.142, abs=2e-3)  # m/s^2 at 1 m/s, five times the paper's limit


@pytest.mark.parametrize("phi", [0.02, 0.3, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("curve", ["cubic", "quintic", "septic"])
def test_lengths_are_those_of_quadrature(phi: float, curve: str) -> None:
    a = Line(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    made = blend(a, Line(np.zeros(3), np.array([math.cos(phi), math.sin(phi), 0.0])), (0.3, 0.7), curve=curve)
    slopes = np.polynomial.polynomial.polyder(made.coefficients)

    def speed(u: float) -> float:
        return float(np.linalg.norm(np.polynomial.polynomial.polyval(u, slopes)))

    cuts = np.linspace(0.0, 1.0, 65)
    reference = math.fsum(quad(speed, p, q, epsabs=0.0, epsrel=2e-14)[0] for p, q in pairwise(cuts))
    assert made.length == pytest.approx(reference, rel=1e-13)
    assert float(arc_length(made, 1.0)) == pytest.approx(reference, rel=1e-13)


@given(st.floats(2e-4, 3.1), st.floats(0.1, 1.0), st.sampled_from(["cubic", "quintic", "low-peak", "septic"]))
@settings(max_examples=40, deadline=None)
def test_the_inverse_of_the_length_is_exact(phi: float, ratio: float, curve: str) -> None:
    a = Line(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    made = blend(a, Line(np.zeros(3), np.array([math.cos(phi), math.sin(phi), 0.0])), (ratio, 1.0), curve=curve)
    s = np.linspace(0.0, made.length, 101)
    u = np.array([parameter(made, x) for x in s])
    np.testing.assert_allclose(arc_length(made, u), s, atol=1e-12 * made.length, rtol=0.0)  # round trip
    pieces = np.diff(arc_length(made, u))
    np.testing.assert_allclose(pieces.sum(), made.length, rtol=1e-14)  # additivity
    assert (np.diff(u) > 0.0).all()


def parameter(made: Blend, s: float) -> float:
    from armtempo.planners.blends._path_kernels import curve_parameter

    return curve_parameter(made.packed, 0, s)


def random_polyline(count: int, seed: int = 0) -> Floats:
    generator = np.random.default_rng(seed)
    return np.cumsum(generator.uniform(0.2, 1.0, (count, 1)) * unit(generator.normal(size=(count, 3))), axis=0)


def unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


@pytest.mark.parametrize("curve", ["cubic", "quintic", "septic"])
def test_a_path_moves_one_metre_per_metre_and_its_derivatives_are_true(curve: str) -> None:
    path = BlendedPath.through(random_polyline(40), 0.08, curve=curve)
    s, h = np.linspace(0.01, path.length - 0.01, 4001), 2e-6
    s = s[np.abs(s[:, None] - path.breakpoints).min(axis=1) > 2 * h]
    here, ahead, behind = path.derivatives(s), path.derivatives(s + h), path.derivatives(s - h)
    for order in range(3):
        slope = (ahead[order] - behind[order]) / (2 * h)
        size = np.maximum(1.0, np.linalg.norm(slope, axis=1).max())
        np.testing.assert_allclose(here[order + 1], slope, atol=2e-5 * size)
    np.testing.assert_allclose(np.linalg.norm(here[1], axis=1), 1.0, atol=1e-13)
    np.testing.assert_allclose(np.sum(here[1] * here[2], axis=1), 0.0, atol=1e-9)
    joints = path.breakpoints[1:-1]
    before, after = path.derivatives(joints, before=True), path.derivatives(joints)
    for order in range(4 if curve == "septic" else 3):
        np.testing.assert_allclose(after[order], before[order], atol=1e-12 * 10.0 ** (2 * order))
    for points, order in ((path.position(s), 0), (path.tangent(s), 1), (path.evaluate(s)[2], 2)):
        np.testing.assert_array_equal(points, here[order])
    np.testing.assert_array_equal(path.curvature(s), np.linalg.norm(here[2], axis=1))


def test_kernel_and_pieces_are_the_path() -> None:
    path, out = scara(curve="quintic"), np.empty((4, 3))
    for s in (0.0, 0.3, 0.6, 0.8, 1.2, path.length):
        blended_point(path.packed, s, out)
        np.testing.assert_array_equal(out, np.stack(path.derivatives(s)))
    for k, piece in enumerate(path.pieces):
        inside = 0.3 * piece.length
        np.testing.assert_allclose(
            np.stack(piece.derivatives(inside)), np.stack(path.derivatives(path.breakpoints[k] + inside)), atol=1e-11
        )
        assert piece.length == pytest.approx(path.breakpoints[k + 1] - path.breakpoints[k], abs=1e-14)


def test_beyond_its_ends_a_path_stands_still_and_shapes_are_kept() -> None:
    path = scara()
    np.testing.assert_array_equal(path.position(-1.0), path.position(0.0))
    np.testing.assert_array_equal(path.position(9.0), path.position(path.length))
    np.testing.assert_allclose(
        path.position([[0.0, path.length]]), [[[0.7, 0, 0.05], [-0.372, 0.65, 0.05]]], atol=1e-12
    )
    assert path.curvature(np.zeros((2, 3))).shape == (2, 3)
    with pytest.raises(ValueError, match="read-only"):
        path.breakpoints[0] = 1.0


def test_through_points_is_the_path_of_their_lines() -> None:
    points = random_polyline(30, seed=5)
    lines = [Line(p, q) for p, q in pairwise(points)]
    remaining = np.random.default_rng(1).uniform(0.01, 0.09, (28, 2))
    one, other = BlendedPath.through(points, remaining), BlendedPath(lines, remaining)
    s = np.linspace(0.0, one.length, 501)
    np.testing.assert_allclose(one.position(s), other.position(s), atol=1e-13)
    np.testing.assert_array_equal(one.remaining, remaining)
    alone = blend(lines[3], lines[4], (remaining[3, 0], remaining[3, 1]))
    assert one.deviation[3] == alone.deviation


def test_each_corner_may_have_its_own_values() -> None:
    points = random_polyline(5)
    path = BlendedPath.through(points, tolerance=[1e-3, 2e-3, 3e-3], curve="septic")
    np.testing.assert_allclose(path.deviation, [1e-3, 2e-3, 3e-3], atol=1e-12)
    shaped = BlendedPath.through(points, [0.05, 0.06, 0.07], shape_factor=[2.0, 3.0, 3.5])
    assert shaped.continuity.tolist() == [1, 1, 2, 2, 1, 1]
    np.testing.assert_array_equal(shaped.remaining, [[0.05] * 2, [0.06] * 2, [0.07] * 2])


def test_segments_that_continue_each_other_are_joined_and_used_up_ones_dropped() -> None:
    path = BlendedPath.through([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [3, 1, 0]], 0.5)
    assert [type(piece) for piece in path.pieces] == [Line, Line, Blend, Blend, Line]
    assert path.continuity.tolist() == [3, 2, 3, 2]  # an S: the curvature runs straight through where the blends meet
    assert path.deviation[0] == 0.0
    arc = Arc(np.array([1.0, 0, 0]), np.array([2.0, 1, 0]), np.array([1.0, 1, 0]))
    into_arc: list[Line | Arc] = [Line(np.zeros(3), np.array([1.0, 0, 0])), arc]
    assert BlendedPath(into_arc).continuity.tolist() == [1]
    assert BlendedPath(into_arc, tolerance=0.01).continuity.tolist() == [1]
    assert BlendedPath(into_arc, 0.3, curve="quintic").continuity.tolist() == [2, 2]
    assert BlendedPath([arc]).length == pytest.approx(0.5 * math.pi)


def test_what_is_left_of_a_segment_is_a_segment() -> None:
    """However little two blends leave, whatever the radius: as a piece, or not at all."""
    radius, start, aside = 100.0, np.array([100.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.5])
    arc = Arc(start, radius * np.array([math.cos(0.01), math.sin(0.01), 0.0]), np.zeros(3))
    before, after = Line(start - aside, start), Line(arc.end, arc.end + aside)
    for left in (0.0, 0.9e-9, 1.1e-9, 2.1e-9, 5e-8, 1e-5):
        path = BlendedPath([before, arc, after], [[0.3, 0.5], [arc.length - 0.5 - left, 0.3]], curve="quintic")
        assert len(path.pieces) == (5 if left > 2e-9 else 4)
        assert sum(piece.length for piece in path.pieces) == pytest.approx(path.length, abs=1e-11)


def test_a_smooth_joint_is_blended_where_a_distance_is_given_by_its_own_lengths() -> None:
    line = Line(np.array([1.0, 0, 0]), np.zeros(3))
    arc = Arc(np.zeros(3), np.array([-10.0, 10, 0]), np.array([0.0, 10, 0]))  # goes on along -x
    assert BlendedPath([line, arc], tolerance=0.005, curve="quintic").continuity.tolist() == [1]
    both = BlendedPath([line, arc], 0.05, tolerance=0.005, curve="quintic")
    assert both.continuity.tolist() == [2, 2]
    assert both.remaining.tolist() == [[0.05, 0.05]]
    tight = BlendedPath([line, arc], 0.5, tolerance=1e-5, curve="quintic")
    assert tight.deviation[0] == pytest.approx(1e-5, rel=1e-9)
    assert tight.remaining[0, 0] < 0.5
    tiny = Line(arc.end, arc.end + np.array([0.0, 2e-9, 0]))
    path = BlendedPath([line, arc, tiny], [0.1, 0.0], curve="quintic")
    assert path.remaining.tolist() == [[0.1, 0.1], [0.0, 0.0]]


SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [2, 1, 0]])
CHORDS = 0.004 * np.stack([f(np.linspace(0.0, np.pi, 51)) for f in (np.cos, np.sin, np.zeros_like)], axis=1)
SHALLOW = np.array([[0.7, 0.0, 0.05], [0.5, 0.001, 0.05], [0.3, 0.0, 0.05], [0.3, 0.65, 0.0], [-0.3, 0.65, 0.0]])


@pytest.mark.parametrize("curve", ["cubic", "quintic", "low-peak", "septic", "least-time"])
@pytest.mark.parametrize(("points", "tolerance"), [(CHORDS, 1e-5), (SHALLOW, 0.02), (SQUARE, 0.2)])
def test_a_tolerance_is_the_most_and_a_corner_takes_what_there_is(points: Floats, tolerance: float, curve: str) -> None:
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0) if curve == "least-time" else None
    path = BlendedPath.through(points, tolerance=tolerance, curve=curve, limits=limits)
    legs = np.linalg.norm(np.diff(points, axis=0), axis=1)
    taken = path.remaining
    assert (path.deviation <= tolerance * (1.0 + 1e-9)).all()
    assert (taken[1:, 0] + taken[:-1, 1] <= legs[1:-1] + 1e-12).all()
    assert (taken <= np.stack([legs[:-1], legs[1:]], axis=1) + 1e-12).all()
    used = path.deviation >= tolerance * (1.0 - 1e-6)
    half = np.minimum(0.5 * legs[:-1], 0.5 * legs[1:])
    assert (used | (taken[:, 0] >= half - 1e-12)).all()  # all of the tolerance, or half a segment at least
    assert (path.continuity >= 2).all()
    back = BlendedPath.through(points[::-1], tolerance=tolerance, curve=curve, limits=limits)
    np.testing.assert_allclose(back.remaining[::-1, ::-1], taken, rtol=1e-6)


def test_a_corner_takes_what_its_neighbour_leaves() -> None:
    """0.1 m between a shallow corner and a square one: the square one needs 40 mm at 7.07 mm, the shallow one all."""
    points = np.array([[-1.0, 0.005, 0.0], [0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 1.0, 0.0]])
    path = BlendedPath.through(points, tolerance=0.01 / math.sqrt(2.0))
    np.testing.assert_allclose(path.remaining, [[0.06, 0.06], [0.04, 0.04]], rtol=1e-9)
    nearly_straight = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.6, 0.3 * math.radians(1e-4), 0.0]])
    np.testing.assert_allclose(BlendedPath.through(nearly_straight, tolerance=0.005).remaining, 0.3)


def test_a_nearly_tangent_arc_is_blended_within_its_tolerance() -> None:
    line = Line(np.array([0.42, -0.25, 0.1]), np.array([0.58, -0.02, 0.1]))
    arc = Arc.through(line.end, [0.58, 0.05, 0.1], [0.54, 0.1, 0.1])
    last = Line(arc.end, np.array([0.35, 0.2, 0.1]))
    for curve in ("quintic", "low-peak", "septic"):
        path = BlendedPath([line, arc, last], tolerance=0.01, curve=curve)
        assert (path.deviation <= 0.01 + 1e-12).all()
        assert (path.continuity >= 2).all()


@pytest.mark.parametrize("curve", ["cubic", "quintic", "low-peak", "septic"])
@pytest.mark.parametrize("degrees", [30.0, 135.0, 160.0])
def test_tolerances_of_nanometres_are_all_accepted(curve: str, degrees: float) -> None:
    turn = math.radians(degrees)
    points = np.array([[0, 0, 0], [0.3, 0, 0], [0.3 + 0.3 * math.cos(turn), 0.3 * math.sin(turn), 0]])
    for tolerance in 10.0 ** np.linspace(-10.0, -6.0, 9):
        path = BlendedPath.through(points, tolerance=tolerance, curve=curve)
        assert path.deviation[0] == pytest.approx(tolerance, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("radius", [0.01, 0.5])
def test_a_thousand_chords_are_timed_like_their_arc(radius: float) -> None:
    turn = np.linspace(0.0, math.pi, 1001)
    points = radius * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    path = BlendedPath.fit(points, 1e-4)
    assert len(path.pieces) <= 16
    assert (path.continuity == 3).all()
    assert path.deviation.max() <= 1e-4
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
    arc = limit_aware_profile(Arc(points[0], points[-1], np.zeros(3), np.array([0.0, 0.0, 1.0])), limits)
    assert limit_aware_profile(path, limits).duration == pytest.approx(arc.duration, rel=0.01)


def test_a_fit_is_a_path_like_others() -> None:
    points = random_polyline(12)
    path = BlendedPath.fit(points, 0.01, orientation=[0, 0, 1, 0])
    np.testing.assert_allclose(path.position([0.0, path.length]), points[[0, -1]], atol=1e-12)
    s, h = np.linspace(0.01, path.length - 0.01, 2001), 1e-6
    here, ahead, behind = path.derivatives(s), path.derivatives(s + h), path.derivatives(s - h)
    np.testing.assert_allclose(np.linalg.norm(here[1], axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(here[1], (ahead[0] - behind[0]) / (2 * h), atol=1e-5)
    assert sum(piece.length for piece in path.pieces) == pytest.approx(path.length)
    assert path.oriented
    nearest = np.linalg.norm(points[:, None] - path.position(np.linspace(0.0, path.length, 20001)), axis=2).min(axis=1)
    assert nearest.max() <= path.deviation[0] + 1e-3


def test_orientation_turns_in_proportion_to_the_length() -> None:
    half = math.sqrt(0.5)
    path = scara(orientation=[[0, 0, 0, 1], [0, 0, -half, -half]])  # 90 degrees about z, the shorter way
    q = path.orientation(np.linspace(0.0, path.length, 5))
    np.testing.assert_allclose(2.0 * np.degrees(np.arctan2(q[:, 2], q[:, 3])), [0, 22.5, 45, 67.5, 90], atol=1e-12)
    np.testing.assert_array_equal(scara(orientation=[0, 0, 1, 0]).orientation([[0.1, 0.2]]), [[[0, 0, 1, 0]] * 2])
    np.testing.assert_array_equal(scara().orientation(0.5), [0, 0, 0, 1])


REFUSED: dict[str, tuple[Callable[[], object], type[ArmtempoError], str]] = {
    "empty": (lambda: BlendedPath([], 0.1), PathError, "at least one segment"),
    "overlap": (lambda: BlendedPath.through(SQUARE, 0.6), PathError, "1 m and 2 m overlap by 0.2 m on segment 1"),
    "too long": (
        lambda: BlendedPath.through(SQUARE, [0.2, 1.2]),
        PathError,
        "segments 1 and 2 at 2 m needs 1.2 m of s",
    ),
    "no blends": (lambda: BlendedPath.through(SQUARE), InputError, "corner of 90 degrees"),
    "one left out": (
        lambda: BlendedPath.through(SQUARE, [0.1, 0.0]),
        PathError,
        "90 degrees at 2 m, and its remaining",
    ),
    "reversal": (lambda: BlendedPath.through([[0, 0, 0], [1, 0, 0], [0, 0, 0]], 0.1), PathError, "segment 1 turns"),
    "twice the same": (
        lambda: BlendedPath.through([[0, 0, 0], [1, 0, 0], [1, 0, 0]], 0.1),
        PathError,
        "points 1 and 2",
    ),
    "points": (lambda: BlendedPath.through([[0, 0], [1, 0]], 0.1), InputError, r"\(N, 3\)"),
    "nan": (lambda: BlendedPath.through([[0.0, 0, 0], [math.nan, 0, 0]], 0.1), InputError, "finite"),
    "count": (lambda: BlendedPath.through(SQUARE, [0.1, 0.1, 0.1]), InputError, "has 2 corners"),
    "fit of one": (lambda: BlendedPath.fit([[0, 0, 0]], 0.1), InputError, r"\(N, 3\)"),
    "fit of none": (lambda: BlendedPath.fit(SQUARE, 0.0), InputError, "tolerance must be positive"),
    "fit there and back": (
        lambda: BlendedPath.fit([[0, 0, 0], [1, 0, 0], [0, 0, 0]], 1e-3),
        PathError,
        "turns straight back",
    ),
    "gap": (
        lambda: BlendedPath([Line(np.zeros(3), np.ones(3)), Line(1.1 * np.ones(3), 3 * np.ones(3))], 0.1),
        PathError,
        "segments 0 and 1 are 0.173205 m apart at 1.73205 m",
    ),
    "ragged": (lambda: BlendedPath.through([[0, 0, 0], [1, 0]], 0.1), InputError, "points must be numbers"),
    "words": (lambda: BlendedPath.through("abc", 0.1), InputError, "points must be numbers"),
    "one left empty": (lambda: BlendedPath.through(SQUARE, [None]), InputError, "finite"),  # type: ignore[arg-type]
    "generator": (lambda: BlendedPath((x for x in scara().pieces), 0.1), InputError, "a generator"),  # type: ignore[arg-type]
    "one segment": (lambda: BlendedPath(Line(np.zeros(3), np.ones(3))), InputError, "got a Line"),  # type: ignore[arg-type]
    "nowhere": (lambda: scara().derivatives([0.0, math.nan]), InputError, "not a number"),
    "no orientation": (lambda: scara().orientation(math.nan), InputError, "not a number"),
    "ragged quaternions": (lambda: scara(orientation=[[0, 0, 0, 1], [0, 1]]), InputError, "must be numbers"),
    "number": (lambda: scara(orientation=1.0), InputError, "unit quaternions"),
    "zero quaternion": (lambda: scara(orientation=[0, 0, 0, 0]), InputError, "unit quaternions"),
    "quaternion": (lambda: scara(orientation=[0, 0, 1, 1]), InputError, "unit quaternions"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_path_is_refused_with_the_reason(case: str) -> None:
    make, error, message = REFUSED[case]
    with pytest.raises(error, match=message) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_refusals_say_which_segments() -> None:
    with pytest.raises(PathError) as refusal:
        BlendedPath.through(SQUARE, 0.6)
    assert refusal.value.data == {"station": 1.0, "segments": (0, 1, 2)}
