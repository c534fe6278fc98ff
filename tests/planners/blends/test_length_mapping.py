"""The paper's length and mapping with the errors it has, the exact ones without, and what chords do to both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError
from armtempo.planners import BlendedPath, CartesianPath, Line, PredictorCorrector, blend
from armtempo.planners.blends import Blend, ExactMapping, LengthMapping, arc_length, rk4_length

SPEED = 1.0  # m/s


@pytest.fixture(scope="module")
def papers_blend() -> Blend:
    """A square corner, 150 mm, lambda = 3."""
    return blend(Line(np.array([1.0, 0, 0]), np.zeros(3)), Line(np.zeros(3), np.array([0.0, 1, 0])), 0.15)


def speed_errors(mapping: LengthMapping, made: Blend, tick: float) -> tuple[Floats, Floats, float]:
    """Relative speed errors per tick along the arc and between points; drift at the end [m]."""
    lengths = np.arange(0.0, made.length, SPEED * tick)
    travelled = arc_length(made, mapping.parameters(lengths)[1])
    chords = np.linalg.norm(np.diff(mapping.positions(lengths), axis=0), axis=1)
    step = SPEED * tick
    return np.diff(travelled) / step - 1.0, chords / step - 1.0, float(travelled[-1] - lengths[-1])


@pytest.mark.parametrize(("steps", "length_mm"), [(1, 256.07), (2, 271.31), (4, 270.348), (10, 270.321459)])
def test_runge_kutta_lengths_of_the_paper(papers_blend: Blend, steps: int, length_mm: float) -> None:
    decimals = len(str(length_mm).split(".")[1])
    assert round(1e3 * rk4_length(papers_blend, steps), decimals) == pytest.approx(
        length_mm, abs=1.01 * 10.0**-decimals
    )
    assert 1e3 * papers_blend.length == pytest.approx(270.321455, abs=5e-7)
    assert papers_blend.length / 0.15 == pytest.approx(1.802143, abs=5e-7)


def test_runge_kutta_converges_to_the_exact_length() -> None:
    lopsided = blend(
        Line(np.array([1.0, 0, 0]), np.zeros(3)), Line(np.zeros(3), np.array([0.0, 1, 0])), (0.15, 0.4), 2.5
    )
    errors = [rk4_length(lopsided, n) - lopsided.length for n in (20, 40)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.03)
    with pytest.raises(InputError, match="at least 1"):
        rk4_length(lopsided, 0)


@pytest.mark.parametrize(
    ("tick", "iterations", "along", "between"),
    [(1e-3, 1, 0.0079, 0.0105), (1e-3, 3, 0.0079, 0.0105), (2e-3, 1, 0.0318, 0.0422), (2e-3, 3, 0.0315, 0.0420)],
)
def test_speed_error_of_the_papers_mapping(
    papers_blend: Blend, tick: float, iterations: int, along: float, between: float
) -> None:
    arc, points, _ = speed_errors(PredictorCorrector(papers_blend, iterations=iterations), papers_blend, tick)
    assert 100 * np.abs(arc).max() == pytest.approx(along, abs=6e-5)
    assert 100 * np.abs(points).max() == pytest.approx(between, abs=1.01e-4)


def test_the_papers_own_figures_are_those_of_a_2_ms_tick(papers_blend: Blend) -> None:
    _, points, drift = speed_errors(PredictorCorrector(papers_blend), papers_blend, 2e-3)
    assert 1e3 * SPEED * points.min() == pytest.approx(-0.42, abs=0.005)  # mm/s; the paper: -0.4, 0.04 %
    assert 1e3 * drift == pytest.approx(-0.0149, abs=5e-5)


@pytest.mark.parametrize("tick", [0.5e-3, 1e-3, 2e-3, 4e-3])
def test_the_trapezoid_rule_and_the_chords_explain_all_of_it(papers_blend: Blend, tick: float) -> None:
    arc, points, _ = speed_errors(PredictorCorrector(papers_blend, iterations=20), papers_blend, tick)
    exact_arc, exact_points, _ = speed_errors(ExactMapping(papers_blend), papers_blend, tick)
    step = SPEED * tick
    u = np.linspace(0.0, 1.0, 20001)
    speed = np.gradient(arc_length_on(papers_blend, u), u)[2:-2]
    bend = np.gradient(np.gradient(speed, u[2:-2]), u[2:-2])[2:-2]
    assert arc.min() == pytest.approx(-(step**2 * bend / (12 * speed[2:-2] ** 3)).max(), rel=0.02)
    chord = (papers_blend_peak(papers_blend) * step) ** 2 / 24
    assert exact_points.min() == pytest.approx(-chord, rel=0.01)
    assert np.abs(exact_arc).max() <= 1e-11  # 1e-9 %
    assert points.min() == pytest.approx(arc.min() - chord, rel=0.02)


def arc_length_on(made: Blend, u: Floats) -> Floats:
    """Cumulative length by Simpson's rule: no code of the library."""
    slopes = np.polynomial.polynomial.polyder(made.coefficients)
    middle = 0.5 * (u[1:] + u[:-1])
    ends, inner = (np.linalg.norm(np.polynomial.polynomial.polyval(x, slopes), axis=0) for x in (u, middle))
    return np.concatenate([[0.0], np.cumsum(np.diff(u) * (ends[:-1] + 4 * inner + ends[1:]) / 6)])


def papers_blend_peak(made: Blend) -> float:
    return float(np.linalg.norm(made.evaluate(0.5 * made.length)[2]))


@pytest.fixture(scope="module")
def hundred_corners() -> BlendedPath:
    generator = np.random.default_rng(7)
    steps = generator.normal(size=(101, 3))
    points = np.cumsum(0.1 * steps / np.linalg.norm(steps, axis=1)[:, None], axis=0)
    return BlendedPath.through(np.vstack([np.zeros(3), points]), 0.03)


def travelled(path: BlendedPath, piece: Ints, u: Floats) -> Floats:
    """True length behind each tick, by quadrature."""
    out = np.empty(len(u))
    for k, part in enumerate(path.pieces):
        inside = piece == k
        local = arc_length(part, u[inside]) if isinstance(part, Blend) else u[inside] * part.length
        out[inside] = path.breakpoints[k] + local
    return out


def test_exact_mapping_over_100_corners_has_neither_speed_error_nor_drift(hundred_corners: BlendedPath) -> None:
    path, step = hundred_corners, 2e-3
    assert len(path.deviation) == 100
    lengths = np.arange(0.0, path.length, step)
    true = travelled(path, *ExactMapping(path).parameters(lengths))
    assert np.abs(true - lengths).max() <= 1e-12  # m: 1e-9 mm
    assert np.abs(np.diff(true) / step - 1.0).max() <= 1e-11  # 1e-9 %
    np.testing.assert_allclose(ExactMapping(path).positions(lengths), path.position(lengths), atol=1e-12)


def test_the_papers_compensation_throws_the_drift_away_at_every_junction(hundred_corners: BlendedPath) -> None:
    path = hundred_corners
    lengths = np.append(np.arange(0.0, path.length, 2e-3), path.length)
    exact = path.position(lengths)
    with_it, without = (PredictorCorrector(path, compensate=c).positions(lengths) for c in (True, False))
    piece = ExactMapping(path).parameters(lengths)[0]
    straight = piece % 2 == 0
    np.testing.assert_allclose(with_it[straight], exact[straight], atol=1e-14)
    off = np.linalg.norm(with_it - exact, axis=1)
    assert off.max() > 1e-5
    assert np.linalg.norm(without[-2] - exact[-2]) > 10 * off.max()  # it piles up


def test_one_iteration_is_as_good_as_three_and_zero_is_the_predictor(papers_blend: Blend) -> None:
    errors = [
        np.abs(speed_errors(PredictorCorrector(papers_blend, iterations=n), papers_blend, 2e-3)[0]).max()
        for n in (0, 1, 3)
    ]
    assert errors[0] > 3 * errors[1]
    assert math.isclose(errors[1], errors[2], rel_tol=0.02)


def test_lengths_that_fall_are_refused(papers_blend: Blend) -> None:
    for wrong in ([0.1, 0.0], [[0.0, 0.1]], [0.0, math.nan]):
        with pytest.raises(InputError, match="never falls"):
            ExactMapping(papers_blend).positions(wrong)


def test_nonsense_is_refused(papers_blend: Blend) -> None:
    for u in (math.nan, -0.5, 2.0, "x"):
        with pytest.raises(InputError, match="u must be"):
            arc_length(papers_blend, u)
    for iterations in (-1, 2.5, math.nan, "x"):
        with pytest.raises(InputError, match="iterations is"):
            PredictorCorrector(papers_blend, iterations=iterations)  # type: ignore[arg-type]
        with pytest.raises(InputError, match="steps is"):
            rk4_length(papers_blend, iterations)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="must be numbers"):
        ExactMapping(papers_blend).positions("x")
    for path in ("x", CartesianPath([Line(np.zeros(3), np.ones(3))])):
        with pytest.raises(InputError, match="BlendedPath or a Blend"):
            ExactMapping(path)  # type: ignore[arg-type]


@pytest.mark.parametrize("compensate", [True, False])
def test_a_run_by_little_gives_the_bits_of_the_whole(hundred_corners: BlendedPath, compensate: bool) -> None:
    mapping = PredictorCorrector(hundred_corners, compensate=compensate)
    lengths = np.linspace(0.0, hundred_corners.length, 2001)
    run = mapping.start()
    parts = [run.advance(part) for part in np.split(lengths, [1, 2, 30, 31, 700])]
    np.testing.assert_array_equal(np.concatenate(parts), mapping.positions(lengths))
    with pytest.raises(InputError, match="from one call to the next"):
        run.advance(lengths[:3])
