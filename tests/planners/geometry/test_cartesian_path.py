"""Lines, arcs and their chains: closed forms, derivatives, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InputError, PathError
from armtempo.planners import Arc, CartesianPath, Line
from armtempo.planners.geometry import Segment

point = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def differences(segment: Segment | CartesianPath, s: Floats, h: float = 1e-5) -> tuple[Floats, Floats]:
    ahead, here, behind = (segment.evaluate(s + shift)[0] for shift in (h, 0.0, -h))
    return (ahead - behind) / (2 * h), (ahead - 2 * here + behind) / h**2


def test_a_line_is_its_closed_form() -> None:
    line = Line(np.array([0.1, 0.2, 0.3]), np.array([0.4, 0.6, 0.3]))
    assert line.length == pytest.approx(0.5, abs=1e-15)
    p, dp, ddp = line.evaluate(np.array([0.0, 0.25, 0.5]))
    np.testing.assert_allclose(p, [[0.1, 0.2, 0.3], [0.25, 0.4, 0.3], [0.4, 0.6, 0.3]], atol=1e-15)
    np.testing.assert_allclose(dp, [[0.6, 0.8, 0.0]] * 3, atol=1e-15)
    assert not ddp.any()
    assert line.evaluate(0.1)[0].shape == (3,)


def test_an_arc_is_its_closed_form() -> None:
    arc = Arc(np.array([0.4, 0.35, 0.0]), np.array([0.4, 0.05, 0.0]), np.array([0.25, 0.2, 0.0]))
    assert arc.radius == pytest.approx(0.15 * math.sqrt(2.0), abs=1e-12)
    assert arc.length == pytest.approx(0.5 * math.pi * arc.radius, abs=1e-12)
    p, dp, ddp = arc.evaluate(np.array([0.0, 0.5 * arc.length, arc.length]))
    np.testing.assert_allclose(p, [[0.4, 0.35, 0], [0.25 + arc.radius, 0.2, 0], [0.4, 0.05, 0]], atol=1e-12)
    np.testing.assert_allclose(dp[1], [0.0, -1.0, 0.0], atol=1e-12)  # clockwise, in -y as in the paper
    np.testing.assert_allclose(ddp[1], [-1.0 / arc.radius, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(("turn", "quarters"), [(1.0, 1), (-1.0, 3)])
def test_the_normal_chooses_the_way_round(turn: float, quarters: int) -> None:
    arc = Arc(np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), np.zeros(3), np.array([0, 0, turn]))
    assert arc.length == pytest.approx(quarters * 0.5 * math.pi)
    np.testing.assert_allclose(arc.evaluate(arc.length)[0], [0, 1, 0], atol=1e-12)


@given(point, point, st.floats(0.05, 1.0), st.floats(0.1, 6.0), st.floats(0.0, 1.0))
def test_arcs_anywhere_in_space_have_true_derivatives(
    a: Floats, b: Floats, radius: float, angle: float, share: float
) -> None:
    normal, other = a + np.array([0.0, 0.0, 3.0]), b + np.array([0.0, 5.0, 0.0])
    normal = normal / np.linalg.norm(normal)
    x = np.cross(normal, other)
    x /= np.linalg.norm(x)
    center, y = b, np.cross(normal, x)
    arc = Arc(center + radius * x, center + radius * (math.cos(angle) * x + math.sin(angle) * y), center, normal)
    assert arc.length == pytest.approx(radius * angle, rel=1e-6)
    s = np.array([share * arc.length])
    _, dp, ddp = arc.evaluate(s)
    first, second = differences(arc, s)
    np.testing.assert_allclose(dp, first, atol=1e-6)
    np.testing.assert_allclose(ddp, second, atol=1e-3 / radius)
    np.testing.assert_allclose(np.linalg.norm(dp, axis=-1), 1.0, atol=1e-12)
    np.testing.assert_allclose(arc.evaluate(arc.length)[0], arc.end, atol=1e-9)


@given(point, point, point)
def test_an_arc_through_three_points_passes_them_in_order(start: Floats, via: Floats, end: Floats) -> None:
    try:
        arc = Arc.through(start, via, end)
    except PathError:
        u, v = via - start, end - start
        sides = [float(np.linalg.norm(side)) for side in (u, v, end - via)]
        area = float(np.linalg.norm(np.cross(u, v)))
        assert min(sides) < 1e-9 or area * max(sides) < 1.001e-6 * math.prod(sides)
        return
    outward, tangent = (start - arc.center) / arc.radius, arc.evaluate(0.0)[1]
    turned = math.atan2((via - arc.center) @ tangent, (via - arc.center) @ outward) % (2.0 * math.pi)
    assert 0.0 < turned < arc.angle
    np.testing.assert_allclose(arc.evaluate([0.0, arc.length])[0], [start, end], atol=1e-6)
    assert abs(np.linalg.norm(via - arc.center) - arc.radius) < 1e-6 * max(arc.radius, 1.0)


def test_the_papers_arc_is_a_shallow_vertical_one() -> None:
    arc = Arc.through([0.3, 0.65, 0.0], [0.0, 0.65, 0.05], [-0.372, 0.65, 0.05])
    assert arc.radius == pytest.approx(2.049458, abs=1e-6)
    assert arc.length == pytest.approx(0.67693, abs=1e-5)
    np.testing.assert_allclose(arc.center, [-0.186, 0.65, -1.991], atol=1e-9)
    np.testing.assert_allclose(arc.evaluate(0.0)[1], [-0.9715, 0.0, 0.2371], atol=1e-4)


def test_third_derivatives_and_parts() -> None:
    path = rounded_corner()
    s, h = np.array([0.1, 0.35, 0.4, 0.5]), 1e-6
    _, tangent, bent, third = path.derivatives(s)
    np.testing.assert_allclose(third, (path.evaluate(s + h)[2] - path.evaluate(s - h)[2]) / (2 * h), atol=1e-5)
    np.testing.assert_allclose(third[1:3], -100.0 * tangent[1:3], atol=1e-9)
    np.testing.assert_array_equal(bent, path.evaluate(s)[2])
    for segment in path.segments:
        assert isinstance(segment, Line | Arc)
        part = segment.part(0.2 * segment.length, 0.7 * segment.length)
        assert part.length == pytest.approx(0.5 * segment.length, abs=1e-15)
        np.testing.assert_allclose(part.evaluate(0.01), segment.evaluate(0.2 * segment.length + 0.01), atol=1e-12)


def rounded_corner() -> CartesianPath:
    return CartesianPath(
        [
            Line(np.array([0.0, 0, 0]), np.array([0.3, 0, 0])),
            Arc(np.array([0.3, 0, 0]), np.array([0.4, 0.1, 0]), np.array([0.3, 0.1, 0])),
            Line(np.array([0.4, 0.1, 0]), np.array([0.4, 0.2, 0])),
        ]
    )


def test_a_chain_is_continuous_and_its_curvature_jumps_at_the_breakpoints() -> None:
    path = rounded_corner()
    joints = [0.0, 0.3, 0.3 + 0.05 * math.pi, 0.4 + 0.05 * math.pi]
    np.testing.assert_allclose(path.breakpoints, joints, atol=1e-12)
    assert path.length == path.breakpoints[-1]
    inner = path.breakpoints[1:-1]
    before, after = path.evaluate(inner, before=True), path.evaluate(inner)
    np.testing.assert_allclose(before[0], after[0], atol=1e-12)
    np.testing.assert_allclose(before[1], after[1], atol=1e-12)
    np.testing.assert_allclose(before[2], [[0, 0, 0], [-10, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(after[2], [[0, 10, 0], [0, 0, 0]], atol=1e-9)
    s = np.linspace(0.001, path.length - 0.001, 501)
    s = s[np.abs(s[:, None] - inner).min(axis=1) > 1e-4]
    np.testing.assert_allclose(path.evaluate(s)[1], differences(path, s)[0], atol=1e-6)


def test_beyond_its_ends_a_path_stands_still() -> None:
    path = rounded_corner()
    np.testing.assert_array_equal(path.evaluate(-1.0)[0], path.evaluate(0.0)[0])
    np.testing.assert_array_equal(path.evaluate(9.0)[0], path.evaluate(path.length)[0])


def test_points_are_read_only() -> None:
    line = Line(np.zeros(3), np.ones(3))
    with pytest.raises(ValueError, match="read-only"):
        line.start[0] = 1.0


@pytest.mark.parametrize(("step", "radius"), [(2.54e-6, 5e-4), (2.54e-6, 0.005), (2.54e-6, 0.5), (1e-6, 5e-4)])
def test_arcs_of_rounded_coordinates_run_from_point_to_point(step: float, radius: float) -> None:
    """Start and end rounded, and the centre from the start, as programs of machines give it."""
    rng = np.random.default_rng(0)
    for _ in range(1000):
        center, first = rng.uniform(0.0, 0.2, 2), rng.uniform(0.0, 2.0 * math.pi)
        angles = first + np.array([0.0, rng.uniform(0.05, 6.0)])
        start, end = np.round((center + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)) / step) * step
        given = start + np.round((center - start) / step) * step
        arc = Arc(a(*start, 0), a(*end, 0), a(*given, 0), a(0, 0, 1))
        np.testing.assert_allclose(arc.evaluate([0.0, arc.length])[0][:, :2], [start, end], atol=1e-12)
        assert arc.center_shift == pytest.approx(np.linalg.norm(arc.center[:2] - given), abs=1e-15)
        assert np.linalg.norm(arc.center[:2] - center) <= 0.25 * radius
        assert arc.length == pytest.approx(radius * (angles[1] - angles[0]), abs=30.0 * step, rel=0.01)


def test_centres_are_moved_within_a_thousandth_of_the_radius_and_refused_beyond() -> None:
    assert QUARTER.center_shift == 0.0
    moved = Arc(a(1, 0, 0), a(0, 1.0004, 0), a(0, 0, 0))
    assert moved.center_shift == pytest.approx(0.0004 / math.sqrt(2.0), rel=1e-3)
    np.testing.assert_allclose(np.linalg.norm([moved.start, moved.end] - moved.center, axis=1), moved.radius)
    with pytest.raises(PathError, match="equal distances"):
        Arc(a(1, 0, 0), a(0, 1.0006, 0), a(0, 0, 0))  # half a millimetre is too much, however large the radius
    with pytest.raises(PathError, match="equal distances"):
        Arc(a(0.005, 0, 0), a(0, 0.0050081, 0), a(0, 0, 0))


def a(*coordinates: float) -> Floats:
    return np.array(coordinates)


QUARTER = Arc(a(1, 0, 0), a(0, 1, 0), a(0, 0, 0))
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "zero line": (lambda: Line(a(1, 2, 3), a(1, 2, 3)), "no length"),
    "two coordinates": (lambda: Line(a(1, 2), a(1, 2, 3)), "three finite coordinates"),
    "NaN": (lambda: Line(a(1, 2, math.nan), a(1, 2, 3)), "start of a line"),
    "radii": (
        lambda: Arc(a(1, 0, 0), a(0, 1.1, 0), a(0, 0, 0)),
        r"is 1 m from its start but 1.1 m from its end.*equal distances",
    ),
    "centre on start": (lambda: Arc(a(1, 0, 0), a(1, 0, 0), a(1, 0, 0)), "equal distances"),
    "half circle": (lambda: Arc(a(1, 0, 0), a(-1, 0, 0), a(0, 0, 0)), "not determined.*cw or ccw"),
    "nearly half": (lambda: Arc(a(1, 0, 0), a(-1, 1e-8, 0), a(0, 0, 0)), "not determined.*cw or ccw"),
    "zero arc": (lambda: Arc(a(1, 0, 0), a(1, 0, 0), a(0, 0, 0)), "not determined|no length"),
    "zero normal": (lambda: Arc(a(1, 0, 0), a(-1, 0, 0), a(0, 0, 0), a(0, 0, 0)), "not determined"),
    "tilted normal": (lambda: Arc(a(1, 0, 0), a(0, 1, 0), a(0, 0, 0), a(0, 1, 1)), "perpendicular"),
    "through a line": (lambda: Arc.through(a(0, 0, 0), a(1, 1, 0), a(3, 3, 0)), "lie on one line.*use a Line"),
    "through nearly a line": (lambda: Arc.through(a(0, 0, 0), a(1, 4e-7, 0), a(2, 0, 0)), "or nearly.*use a Line"),
    "small radii": (lambda: Arc(a(1e-4, 0, 0), a(0, 1.03e-4, 0), a(0, 0, 0)), "equal distances"),
    "words": (lambda: Line("abc", a(0, 0, 0)), "must be numbers"),  # type: ignore[arg-type]
    "ragged": (lambda: Line([[1], [2, 3]], a(0, 0, 0)), "must be numbers"),  # type: ignore[arg-type]
    "piece of none": (lambda: QUARTER.part(0.3, 0.3), "0 <= low < high"),
    "piece backwards": (lambda: QUARTER.part(1.0, 0.2), "0 <= low < high"),
    "piece beyond": (lambda: QUARTER.part(0.0, 100.0), "is not in 0 .. 1.5708 m"),
    "piece before": (lambda: Line(a(0, 0, 0), a(1, 0, 0)).part(-0.1, 0.5), "0 <= low < high"),
    "piece nowhere": (lambda: Line(a(0, 0, 0), a(1, 0, 0)).part(math.nan, 0.5), "0 <= low < high"),
    "through twice": (lambda: Arc.through(a(0, 0, 0), a(1, 1, 0), a(0, 0, 0)), "are the same.*two arcs"),
    "empty": (lambda: CartesianPath([]), "at least one segment"),
    "gap": (
        lambda: CartesianPath([Line(a(0, 0, 0), a(1, 0, 0)), Line(a(1.1, 0, 0), a(2, 0, 0))]),
        "segments 0 and 1 are 0.1 m apart",
    ),
    "corner": (
        lambda: CartesianPath([Line(a(0, 0, 0), a(1, 0, 0)), Line(a(1, 0, 0), a(1, 1, 0))]),
        "segments 0 and 1 meet in a corner of 90 degrees at 1 m.*round it",
    ),
    "reversal": (
        lambda: CartesianPath([Line(a(0, 0, 0), a(1, 0, 0)), Line(a(1, 0, 0), a(0, 0, 0))]),
        "corner of 180 degrees",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_path_is_refused_with_the_reason(case: str) -> None:
    make, message = REFUSED[case]
    with pytest.raises((PathError, InputError), match=message) as refusal:
        make()
    assert "\n" not in str(refusal.value)


def test_a_half_circle_with_a_turn_is_an_arc() -> None:
    arc = Arc(a(1, 0, 0), a(-1, 0, 0), a(0, 0, 0), a(0, 0, 2))
    assert arc.length == pytest.approx(math.pi)
    np.testing.assert_allclose(arc.evaluate(0.5 * arc.length)[0], [0, 1, 0], atol=1e-12)
