"""One blend: the paper's tables and laws, continuity with lines and arcs in space, tolerances, least time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from armtempo.errors import ArmtempoError, InputError, PathError, UnknownNameError
from armtempo.planners import Arc, BlendedPath, Line, blend, least_time_blend
from armtempo.planners.blends import CURVES, Blend, passing_cost

NAMED = tuple(CURVES)


@dataclass(frozen=True)
class Limits:
    speed: float = 1.0
    acceleration: float = 5.0
    jerk: float = 200.0
    normal_acceleration: float | None = None


def corner(phi: float, size: float = 1.0) -> tuple[Line, Line]:
    """Two lines that meet at the interior angle phi [rad], in a tilted plane."""
    x, y = np.array([2.0, 1.0, 2.0]) / 3.0, np.array([1.0, 2.0, -2.0]) / 3.0
    vertex = np.array([0.3, -0.2, 0.1])
    return Line(vertex + size * x, vertex), Line(vertex, vertex + size * (math.cos(phi) * x + math.sin(phi) * y))


def random_chain(generator: np.random.Generator, count: int) -> list[Line | Arc]:
    """Lines and arcs in space, end to end; no corner sharper than 20 degrees."""
    chain: list[Line | Arc] = []
    here = np.zeros(3)
    while len(chain) < count:
        end = here + generator.uniform(-1.0, 1.0, 3)
        piece = (
            Line(here, end) if generator.random() < 0.4 else Arc.through(here, here + generator.uniform(-1, 1, 3), end)
        )
        if piece.length < 0.2 or (isinstance(piece, Arc) and not 0.05 < piece.radius < 20.0):
            continue
        if chain and chain[-1].evaluate(chain[-1].length)[1] @ piece.evaluate(0.0)[1] < -0.94:
            continue
        chain.append(piece)
        here = end
    return chain


TABLE_2 = [  # L_r [mm], lambda, interior angle, gamma; the print has 0.443 in the third row
    (30, 30 / 30, 90, 0.530), (25, 30 / 25, 90, 0.495), (20, 30 / 20, 90, 0.442), (15, 30 / 15, 90, 0.354),
    (30, 1, 90, 0.530), (25, 1, 90, 0.530), (20, 1, 90, 0.530), (15, 1, 90, 0.530),
    (30, 1, 45, 0.693), (25, 1, 45, 0.693), (20, 1, 45, 0.693), (15, 1, 45, 0.693),
]  # fmt: skip


@pytest.mark.parametrize(("remaining_mm", "shape_factor", "phi", "gamma"), TABLE_2)
def test_table_2_of_the_paper(remaining_mm: float, shape_factor: float, phi: float, gamma: float) -> None:
    curve = blend(*corner(math.radians(phi)), 1e-3 * remaining_mm, shape_factor)
    assert round(curve.deviation / (1e-3 * remaining_mm), 3) == gamma


@given(st.floats(0.2, 3.1), st.floats(0.3, 4.0), st.floats(0.01, 0.9))
@settings(max_examples=60, deadline=None)
def test_deviation_and_end_curvature_follow_their_laws(phi: float, factor: float, remaining: float) -> None:
    curve = blend(*corner(phi), remaining, factor)
    assert curve.deviation == pytest.approx(remaining * math.cos(phi / 2) * (1 - factor / 4), abs=1e-12)
    bent = np.linalg.norm(curve.evaluate([0.0, curve.length])[2], axis=1) * remaining
    np.testing.assert_allclose(bent, abs(6 - 2 * factor) * math.sin(phi) / factor**2, atol=1e-11, rtol=1e-11)
    assert curve.continuity == ((2, 2) if abs(factor - 3.0) < 1e-9 else curve.continuity)


@given(st.floats(0.01, 3.1), st.floats(0.01, 0.9), st.floats(0.01, 0.9))
@settings(max_examples=60, deadline=None)
def test_shape_factor_3_is_exactly_g2_at_any_angle_and_unequal_distances(phi: float, first: float, last: float) -> None:
    a, b = corner(phi)
    curve = blend(a, b, (first, last))
    bent = np.linalg.norm(curve.evaluate([0.0, curve.length])[2], axis=1)
    assert (bent * [first, last] <= 1e-12).all()
    assert curve.continuity == (2, 2)
    points = [a.part(1 - first, 1).start, b.start, b.start, b.part(0, last).end]
    c0, c1, c2, c3 = curve.coefficients
    bezier = [c0, c0 + c1 / 3, c0 + 2 * c1 / 3 + c2 / 3, c0 + c1 + c2 + c3]
    np.testing.assert_allclose(bezier, points, atol=1e-15)
    np.testing.assert_allclose(curve.coefficients[1], 3.0 * first * a.evaluate(0.0)[1], atol=1e-14)


def test_a_shape_factor_beside_3_is_only_tangent() -> None:
    assert blend(*corner(1.0), 0.1, 2.9).continuity == (1, 1)


FAMILIES = [  # kappa eps, eps / L_r, kappa L_r, eps^2 max dkappa/ds at a square corner
    ("cubic", 3.0, (0.667, 0.177, 3.77, 0.468), (2, 2)),
    ("cubic", 1.0, (2.12, 0.530, 4.00, 8.43), (1, 1)),
    ((0.60, 0.20), 3.0, (0.563, 0.265, 2.12, 0.294), (2, 2)),
    ("low-peak", 3.0, (0.422, 0.380, 1.11, 1.90), (2, 2)),
    ("septic", 3.0, (0.485, 0.309, 1.57, 0.307), (3, 3)),
    ("quintic", 3.0, (0.499, 0.309, 1.61, 0.276), (2, 2)),
]


@pytest.mark.parametrize(("curve", "factor", "figures", "continuity"), FAMILIES)
def test_how_good_a_square_corner_can_be(
    curve: str | tuple[float, ...], factor: float, figures: tuple[float, ...], continuity: tuple[int, int]
) -> None:
    a, b = corner(math.pi / 2)
    made = blend(a, b, 0.5, factor, curve=curve)
    _, tangent, bent, third = made.derivatives(np.linspace(0.0, made.length, 20001))
    normal = np.cross(np.cross(a.end - a.start, b.end - b.start), tangent)
    kappa, slope, eps = np.linalg.norm(bent, axis=1).max(), np.abs(np.sum(third * normal, axis=1)).max(), made.deviation
    np.testing.assert_allclose((kappa * eps, eps / 0.5, kappa * 0.5, eps**2 * slope), figures, rtol=4e-3)
    assert made.continuity == continuity


@pytest.mark.parametrize("curve", ["quintic", "low-peak", "septic"])
def test_no_curvature_jump_between_a_thousand_random_lines_and_arcs_in_space(curve: str) -> None:
    generator = np.random.default_rng(4)
    chain = random_chain(generator, 1001)
    lengths = np.array([piece.length for piece in chain])
    room = np.minimum(lengths[:-1], lengths[1:])
    path = BlendedPath(chain, generator.uniform(0.05, 0.45, (1000, 2)) * room[:, None], curve=curve)
    joints = path.breakpoints[1:-1]
    before, after = path.derivatives(joints, before=True), path.derivatives(joints)
    blends = np.repeat(np.diff(path.breakpoints)[1::2], 2)
    np.testing.assert_allclose(after[0], before[0], atol=1e-12)
    np.testing.assert_allclose(after[1], before[1], atol=1e-12)
    scale = np.maximum(1.0 / blends, np.linalg.norm(before[2], axis=1))
    assert (np.linalg.norm(after[2] - before[2], axis=1) <= 1e-9 * scale).all()
    assert path.continuity.min() == (3 if curve == "septic" else 2)
    if curve == "septic":
        assert (np.linalg.norm(after[3] - before[3], axis=1) <= 1e-8 * scale**2).all()


def test_the_cubic_leaves_two_thirds_of_an_arcs_curvature() -> None:
    radius = 2.0
    arc = Arc(np.zeros(3), np.array([radius, radius, 0.0]), np.array([0.0, radius, 0.0]))  # leaves along x
    made = blend(Line(np.array([0.0, 0.0, 1.0]), np.zeros(3)), arc, 0.01)
    jump = arc.evaluate(0.01)[2] - made.evaluate(made.length)[2]
    assert float(np.linalg.norm(jump)) == pytest.approx(2 / (3 * radius), rel=1e-3)
    assert made.continuity == (1, 1)


@given(st.integers(0, 10**6), st.sampled_from(NAMED), st.floats(1e-4, 0.02))
@settings(max_examples=60, deadline=None)
def test_the_corner_tolerance_is_met(seed: int, curve: str, tolerance: float) -> None:
    a, b = random_chain(np.random.default_rng(seed), 2)
    try:
        made = blend(a, b, tolerance=tolerance, curve=curve)
    except PathError:
        assume(False)  # segments too short for it
    assert made.deviation == pytest.approx(tolerance, abs=1e-12)
    points = made.evaluate(np.linspace(0.0, made.length, 4001))[0]
    assert np.linalg.norm(points - b.evaluate(0.0)[0], axis=1).min() == pytest.approx(tolerance, abs=1e-6)


def test_tolerance_of_the_cubic_is_a_closed_form_and_may_be_capped() -> None:
    assert blend(*corner(1.2), tolerance=0.01).start_remaining == pytest.approx(0.04 / math.cos(0.6), abs=1e-14)
    capped = blend(*corner(1.2), 0.02, tolerance=0.01)
    assert capped.start_remaining == 0.02
    assert capped.deviation < 0.01


@pytest.mark.parametrize("curve", [*NAMED, (0.9, 0.1)])
def test_derivatives_by_arc_length_are_those_of_the_curve(curve: str | tuple[float, ...]) -> None:
    a, b = random_chain(np.random.default_rng(3), 2)
    made = blend(a, b, (0.1, 0.15), curve=curve)
    s, h = np.linspace(0.05, 0.95, 40) * made.length, 1e-5
    ahead, here, behind = (made.derivatives(s + shift) for shift in (h, 0.0, -h))
    for order in range(3):
        slope = (ahead[order] - behind[order]) / (2 * h)
        np.testing.assert_allclose(here[order + 1], slope, atol=1e-5 * np.abs(slope).max())
    np.testing.assert_allclose(np.linalg.norm(here[1], axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(made.evaluate(0.0)[0], a.evaluate(a.length - 0.1)[0], atol=1e-15)
    np.testing.assert_allclose(made.evaluate(made.length)[0], b.evaluate(0.15)[0], atol=1e-14)


@pytest.mark.parametrize("phi", [45.0, 90.0, 135.0])
@pytest.mark.parametrize("tolerance", [0.002, 0.0265])
def test_least_time_is_not_slower_than_any_family(phi: float, tolerance: float) -> None:
    a, b = corner(math.radians(phi))
    quickest = least_time_blend(a, b, tolerance, Limits())
    assert quickest.deviation == pytest.approx(tolerance, abs=1e-12)
    costs = [passing_cost(blend(a, b, tolerance=tolerance, curve=name), Limits()) for name in NAMED]
    assert passing_cost(quickest, Limits()) < min(costs)
    assert min(quickest.continuity) >= 2
    far = least_time_blend(*corner(3.0, size=0.05), 0.05, Limits())  # wants more than there is
    assert far.start_remaining == pytest.approx(0.05)
    assert far.deviation < 0.05


def line_and_arc(turn: float, radius: float, angle: float) -> tuple[Line, Arc]:
    """A line of 1 m that meets an arc at a corner of ``turn`` [rad]; the arc bends back towards it."""
    along, across = (np.array([math.cos(x), math.sin(x), 0.0]) for x in (turn, turn - math.pi / 2))
    center = radius * across
    end = center + radius * (math.sin(angle) * along - math.cos(angle) * across)
    return Line(np.array([-1.0, 0.0, 0.0]), np.zeros(3)), Arc(np.zeros(3), end, center, np.cross(along, across))


@pytest.mark.parametrize(
    ("turn", "radius", "angle", "tolerance"),
    [(0.8864, 1.0, 0.5, 0.01), (1.2, 0.2, 3.0, 0.02), (0.1, 0.3, 2.0, 0.005), (0.6, 1.0, 1.0, 0.0004)],
)
def test_least_time_beside_an_arc_keeps_tolerance_and_curvature(
    turn: float, radius: float, angle: float, tolerance: float
) -> None:
    segments = line_and_arc(turn, radius, angle)
    made = least_time_blend(*segments, tolerance, Limits())
    assert made.deviation <= tolerance * (1.0 + 1e-9)
    assert min(made.continuity) >= 2
    pair = blend(*segments, (1.0, 0.02), tolerance=tolerance, curve="quintic")  # less is left on one side
    assert pair.start_remaining == pair.end_remaining <= 0.02
    assert pair.deviation <= tolerance * (1.0 + 1e-9)


def test_a_list_of_shares_is_a_curve() -> None:
    named = square(curve="quintic").coefficients
    for shares in ([0.64, 0.28], np.array([0.64, 0.28])):
        np.testing.assert_array_equal(square(curve=shares).coefficients, named)


def test_a_blend_that_keeps_the_line_speed_costs_what_its_length_saves() -> None:
    made = blend(*corner(2.0), 0.5, curve="quintic")
    slow = Limits(speed=0.1)
    assert passing_cost(made, slow) == pytest.approx((made.length - 1.0) / 0.1, rel=1e-6)
    peak = np.linalg.norm(made.evaluate(0.5 * made.length)[2])
    tight = Limits(speed=0.1, normal_acceleration=0.5 * 0.1**2 * float(peak))  # half of what it would take
    assert passing_cost(made, tight) > passing_cost(made, slow) + 0.01
    with pytest.raises(InputError, match="positive"):
        passing_cost(made, Limits(jerk=0.0))


def square(**changes: object) -> Blend:
    arguments: dict[str, object] = {"remaining_distance": 0.1} | changes
    return blend(*corner(math.pi / 2), **arguments)  # type: ignore[arg-type]


a, b = corner(math.pi / 2)
REFUSED: dict[str, tuple[Callable[[], object], type[ArmtempoError], str]] = {
    "nothing asked": (lambda: blend(a, b), InputError, "corner of 90 degrees.*remaining_distance or tolerance"),
    "negative": (lambda: square(remaining_distance=-0.1), InputError, "not negative"),
    "nan": (lambda: square(remaining_distance=math.nan), InputError, "finite"),
    "zero": (lambda: square(remaining_distance=0.0), PathError, "remaining distance is 0"),
    "too long": (lambda: square(remaining_distance=1.5), PathError, "needs 1.5 m of segment 0, which is 1 m long"),
    "zero tolerance": (lambda: blend(a, b, tolerance=0.0), InputError, "tolerance must be positive"),
    "factor": (lambda: square(shape_factor=4.5), InputError, r"not in \(0, 4\]"),
    "factor of a quintic": (lambda: square(shape_factor=2.0, curve="quintic"), InputError, "belongs to the cubic"),
    "through the vertex": (lambda: blend(a, b, None, 4.0, tolerance=0.01), InputError, "passes through the vertex"),
    "unknown": (lambda: square(curve="quintik"), UnknownNameError, "did you mean 'quintic'"),
    "shares": (lambda: square(curve=(1.2, 0.1)), InputError, "share of the remaining distance"),
    "cubic share": (lambda: square(curve=(-0.34,)), InputError, r"share of the remaining distance in \[-1/3, 1\)"),
    "cubic that stands": (lambda: square(curve=(1.0 - 1e-12,)), InputError, "stands still.*other shares"),
    "quintic that stands": (lambda: square(curve=(0.999999, 0.1)), InputError, "stands still"),
    "three distances": (lambda: square(remaining_distance=(0.1, 0.2, 0.3)), InputError, "one number or a pair"),
    "word": (lambda: square(remaining_distance="x"), InputError, "remaining_distance must be numbers"),
    "tolerance word": (lambda: blend(a, b, tolerance="x"), InputError, "tolerance must be numbers"),  # type: ignore[arg-type]
    "two tolerances": (lambda: blend(a, b, tolerance=[0.1, 0.1]), InputError, "not one number"),  # type: ignore[arg-type]
    "no curve": (lambda: square(curve=None), InputError, "curve None is not"),
    "words": (lambda: square(curve=("a", "b")), InputError, "shares of a curve must be numbers"),
    "limits word": (
        lambda: blend(a, b, tolerance=0.01, curve="least-time", limits="x"),  # type: ignore[arg-type]
        InputError,
        "no limits.*LineSpeedLimits",
    ),
    "nowhere": (lambda: square().derivatives(math.nan), InputError, "not a number"),
    "least time of what": (lambda: square(curve="least-time"), InputError, "needs a tolerance"),
    "least time without limits": (lambda: blend(a, b, tolerance=0.01, curve="least-time"), InputError, "needs limits"),
    "reversal": (lambda: blend(a, Line(a.end, a.start), 0.1), PathError, "turns straight back"),
    "collinear": (lambda: blend(a, Line(a.end, 2 * a.end - a.start), 0.1), PathError, "continue each other"),
    "gap": (lambda: blend(a, Line(b.start + 0.01, b.end), 0.1), PathError, "segments 0 and 1 are 0.0173205 m apart"),
    "no segment": (lambda: blend(a, square(), 0.1), InputError, "segment 1 is a Blend"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_blend_is_refused_with_the_reason(case: str) -> None:
    make, error, message = REFUSED[case]
    with pytest.raises(error, match=message) as refusal:
        make()
    assert "\n" not in str(refusal.value)
