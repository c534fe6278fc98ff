"""Blended paths at size: setting up 10 000 corners, points per second, and what a tick of each mapping costs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.planners import BlendedPath, Line, blend, least_time_blend
from armtempo.planners.blends import CURVES, Blend, passing_cost
from armtempo.planners.blends import _length_mapping as mapping
from armtempo.robots import njit

TICKS = 1_000_000


@dataclass(frozen=True)
class Limits:
    """Of the paper: 1 m/s, 5 m/s^2, 200 m/s^3."""

    speed: float = 1.0
    acceleration: float = 5.0
    jerk: float = 200.0
    normal_acceleration: float | None = None


def say(capsys: pytest.CaptureFixture[str], text: str) -> None:
    with capsys.disabled():
        print(f"\n{text}")  # noqa: T201


def square_corner(remaining: float = 0.15, **options: Any) -> Blend:
    vertex = np.zeros(3)
    a, b = Line(np.array([1.0, 0, 0]), vertex), Line(vertex, np.array([0.0, 1, 0]))
    return blend(a, b, remaining, **options)


def polyline(corners: int) -> Floats:
    generator = np.random.default_rng(1)
    steps = generator.normal(size=(corners + 2, 3))
    return np.cumsum(generator.uniform(0.5, 1.0, (corners + 2, 1)) * steps / np.linalg.norm(steps, axis=1)[:, None], 0)


@pytest.mark.parametrize("curve", list(CURVES))
def test_ten_thousand_corners_are_set_up_in_a_second(
    benchmark: Any, capsys: pytest.CaptureFixture[str], curve: str
) -> None:
    points = polyline(10_000)
    make = lambda: BlendedPath.through(points, 0.2, curve=curve)  # noqa: E731
    path = benchmark.pedantic(make, rounds=3, warmup_rounds=1)
    seconds = benchmark.stats.stats.min
    say(capsys, f"{curve}: 10 000 corners in {seconds:.3f} s, {len(path.packed.panel_start) / 1e4:.1f} panels each")
    assert seconds < 1.0


def test_a_million_points_of_ten_thousand_corners(benchmark: Any, capsys: pytest.CaptureFixture[str]) -> None:
    path = BlendedPath.through(polyline(10_000), 0.2)
    s = np.linspace(0.0, path.length, TICKS)
    p, tangent, _, _ = benchmark.pedantic(path.derivatives, (s,), rounds=3, warmup_rounds=1)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(np.diff(p, axis=0), axis=1).max() <= s[1] * (1.0 + 1e-9)  # no chord is longer than its arc
    say(capsys, f"position and three derivatives: {1e6 * benchmark.stats.stats.min / TICKS:.3f} us per point")


@njit
def paper_on_a_cubic(c: Floats, step: float, u: Floats) -> None:
    """The paper's mapping written for one cubic only: the least its scheme can cost."""
    now = before = 0.0
    for i in range(u.shape[0]):
        here = np.sqrt(
            (c[1, 0] + now * (2 * c[2, 0] + now * 3 * c[3, 0])) ** 2
            + (c[1, 1] + now * (2 * c[2, 1] + now * 3 * c[3, 1])) ** 2
            + (c[1, 2] + now * (2 * c[2, 2] + now * 3 * c[3, 2])) ** 2
        )
        ahead = before + 2.0 * step / here
        for _ in range(3):
            there = np.sqrt(
                (c[1, 0] + ahead * (2 * c[2, 0] + ahead * 3 * c[3, 0])) ** 2
                + (c[1, 1] + ahead * (2 * c[2, 1] + ahead * 3 * c[3, 1])) ** 2
                + (c[1, 2] + ahead * (2 * c[2, 2] + ahead * 3 * c[3, 2])) ** 2
            )
            ahead = now + 2.0 * step / (here + there)
        before, now = now, ahead
        u[i] = now


def best(run: Callable[[], None]) -> float:
    run()
    times = []
    for _ in range(9):
        start = perf_counter()
        run()
        times.append(perf_counter() - start)
    return min(times)


def test_cost_of_a_tick_of_each_mapping(capsys: pytest.CaptureFixture[str]) -> None:
    made = square_corner()
    lengths = np.linspace(0.0, made.length, TICKS)
    piece, u, v, w = np.zeros(TICKS, dtype=np.int64), np.zeros(TICKS), np.zeros(TICKS), np.zeros(TICKS)
    exact = best(lambda: mapping.exact_parameters(made.packed, lengths, piece, u))
    paper = best(lambda: mapping.corrected_parameters(made.packed, lengths, 3, True, np.zeros(7), piece, v))
    bare = best(lambda: paper_on_a_cubic(made.coefficients, lengths[1], w))
    np.testing.assert_allclose(v, u, atol=1e-9)
    np.testing.assert_allclose(w[:-1], u[1:], atol=1e-9)
    say(
        capsys,
        f"microseconds per tick: exact {1e6 * exact / TICKS:.4f}, paper (3 iterations) {1e6 * paper / TICKS:.4f}, "
        f"paper on a cubic only {1e6 * bare / TICKS:.4f}: exact / paper = {exact / paper:.2f}, {exact / bare:.2f}",
    )
    assert exact < paper
    assert exact < bare


def test_least_time_against_the_families(capsys: pytest.CaptureFixture[str]) -> None:
    limits, lines = Limits(), ["cost of a corner against running through it [ms], at the paper's limits"]
    for degrees in (45, 90, 135):
        for tolerance in (0.002, 0.0265):
            phi = np.radians(degrees)
            a = Line(np.array([2.0, 0, 0]), np.zeros(3))
            b = Line(np.zeros(3), 2.0 * np.array([np.cos(phi), np.sin(phi), 0.0]))
            costs = {name: passing_cost(blend(a, b, tolerance=tolerance, curve=name), limits) for name in CURVES}
            start = perf_counter()
            quickest = least_time_blend(a, b, tolerance, limits)
            taken = perf_counter() - start
            cost = passing_cost(quickest, limits)
            listed = ", ".join(f"{name} {1e3 * value:.1f}" for name, value in costs.items())
            lines.append(
                f"{degrees} deg, {1e3 * tolerance:g} mm: {listed}; least-time {1e3 * cost:.1f} ({taken:.4f} s)"
            )
            assert cost <= min(costs.values())
    say(capsys, "\n".join(lines))
