"""Limit-aware profiles: closed forms where there are some, and the limits as vectors on random paths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import Arc, BlendedPath, CartesianPath, Line, LineSpeedLimits, LineSpeedProfile, blend
from armtempo.planners import limit_aware_profile as aware
from armtempo.planners.blends import Blend

LIMITS = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
QUARTER = Arc(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), np.zeros(3))


def line(*points: list[float]) -> Line:
    return Line(*(np.array(point) for point in points))


SQUARE = line([-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]), line([0.0, 0.0, 0.0], [0.0, 1.0, 0.0])


def worst_ratio(path: BlendedPath, profile: LineSpeedProfile, limits: LineSpeedLimits) -> float:
    """By the acceleration and jerk vectors at even instants, apart from the certificate."""
    s, v, a, j = profile.at(np.linspace(0.0, profile.duration, 30000))
    _, d1, d2, d3 = path.derivatives(s)
    acceleration = d1 * a[:, None] + d2 * (v**2)[:, None]
    jerk = d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None]
    along = (acceleration * d1).sum(axis=1)
    across = np.linalg.norm(acceleration - along[:, None] * d1, axis=1)
    sizes = v, np.abs(along), across, np.linalg.norm(jerk, axis=1)
    bounds = limits.speed, limits.acceleration, limits.normal, limits.jerk
    return max(float(size.max()) / bound for size, bound in zip(sizes, bounds, strict=True))


@pytest.mark.parametrize("length", [1e-3, 0.05, 0.3, 2.0, 30.0])
def test_a_straight_path_takes_what_ruckig_takes(length: float) -> None:
    path = BlendedPath([line([0.0, 0.0, 0.0], [length, 0.0, 0.0])])
    profile, fastest = aware(path, LIMITS), LineSpeedProfile.plan(length, LIMITS)
    assert fastest.duration * (1.0 - 1e-9) <= profile.duration <= 1.01 * fastest.duration
    assert profile.certificate.end_error < 1e-12


@pytest.mark.parametrize("normal", [0.1, 0.3, 5.0])
def test_steady_speed_on_a_circle(normal: float) -> None:
    half = Arc(QUARTER.end, -QUARTER.start, np.zeros(3))
    limits = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0, normal_acceleration=normal)
    profile = aware(BlendedPath([QUARTER, half]), limits)
    steady = min(1.0, normal**0.5)
    speed = profile.at(0.5 * profile.duration)[1]
    assert 0.985 * steady <= speed <= steady * (1.0 + 1e-6)


def random_path(seed: int) -> BlendedPath:
    """A polyline in 3-D with cubic blends, or lines and arcs with quintic ones."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        turns = rng.uniform(0.4, 2.2, 4) * rng.choice([-1.0, 1.0], 4)
        headings = np.cumsum(np.concatenate([[0.0], turns]))
        steps = np.stack([np.cos(headings), np.sin(headings), rng.uniform(-0.3, 0.3, 5)], axis=1)
        points = np.concatenate([np.zeros((1, 3)), np.cumsum(rng.uniform(0.2, 0.7, (5, 1)) * steps, axis=0)])
        return BlendedPath.through(points, rng.uniform(0.03, 0.1, 4))
    first = line([0.0, 0.0, 0.0], [*rng.uniform(0.2, 0.5, 2), 0.1])
    far = first.end + np.array([0.5, 0.0, rng.uniform(-0.2, 0.2)])
    arc = Arc.through(first.end, first.end + rng.uniform(0.1, 0.3, 3), far)
    last = Line(arc.end, arc.end + np.array([*rng.uniform(0.1, 0.3, 2), 0.2]))
    return BlendedPath([first, arc, last], rng.uniform(0.05, 0.09), curve="quintic")


@pytest.mark.parametrize("seed", range(20))
def test_random_paths_keep_every_limit(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = random_path(seed)
    speed, acceleration, normal, jerk = 10.0 ** rng.uniform([-1.0, -0.5, -0.5, 0.5], [0.5, 1.5, 1.5, 3.5])
    limits = LineSpeedLimits(speed=speed, acceleration=acceleration, normal_acceleration=normal, jerk=jerk)
    profile = aware(path, limits)
    assert (path.continuity >= 2).all()
    assert 0.97 < worst_ratio(path, profile, limits) <= 1.0 + 1e-6  # not slower than asked, either
    certificate = profile.certificate
    assert certificate.ratio_max <= 1.0 + 1e-9
    assert certificate.gap < 1e-10
    assert certificate.lowest_speed > -1e-12
    assert profile.duration >= LineSpeedProfile.plan(path.length, limits).duration


def test_it_stops_where_the_curvature_jumps() -> None:
    segments: list[Line | Arc] = [
        line([1.0, -0.5, 0.0], [1.0, 0.0, 0.0]),
        QUARTER,
        line([0.0, 1.0, 0.0], [-0.5, 1.0, 0.0]),
    ]
    path = BlendedPath(segments)
    profile = aware(path, LIMITS)
    assert np.abs(profile.at(profile.time_at(path.breakpoints))[1]).max() < 1e-6
    assert profile.duration == pytest.approx(sum(aware(BlendedPath([part]), LIMITS).duration for part in segments))
    chain = aware(CartesianPath(segments), LIMITS)  # which does not say its continuity
    assert chain.duration == pytest.approx(profile.duration, rel=1e-9)


def test_corners_of_the_paper() -> None:
    points = np.array([[0.7, 0.0, 0.05], [0.3, 0.0, 0.05], [0.3, 0.65, 0.0], [-0.372, 0.65, 0.05]])
    path = BlendedPath.through(points, 0.15)
    profile = aware(path, LIMITS)
    stopping = sum(LineSpeedProfile.plan(float(np.linalg.norm(b - a)), LIMITS).duration for a, b in pairwise(points))
    assert LineSpeedProfile.plan(path.length, LIMITS).duration < profile.duration < stopping
    again = aware(path, LIMITS)
    assert again.knots.tobytes() == profile.knots.tobytes()
    assert again.coefficients.tobytes() == profile.coefficients.tobytes()


@pytest.mark.parametrize("segment", [QUARTER, blend(*SQUARE, 0.3, curve="quintic"), SQUARE[0]])
def test_a_single_segment_is_a_path(segment: Line | Arc | Blend) -> None:
    profile = aware(segment, LIMITS)
    assert profile.certificate.ratio_max <= 1.0 + 1e-9
    assert profile.at(profile.duration)[0] == pytest.approx(segment.length, abs=1e-12)
    if not isinstance(segment, Blend):
        assert profile.duration == pytest.approx(aware(BlendedPath([segment]), LIMITS).duration, rel=1e-9)


class Shifty:
    """A quarter circle that claims to bend more whenever it is asked again."""

    length, asked = QUARTER.length, 1.0

    def derivatives(self, s: Floats) -> tuple[Floats, ...]:
        self.asked *= 1.3
        p, d1, d2, d3 = QUARTER.derivatives(s)
        return p, d1, d2 * self.asked, d3 * self.asked


def test_no_profile_is_returned_that_breaks_a_limit() -> None:
    with pytest.raises(InfeasibleError, match=r"asks for \d.* times a limit.*numbers too far apart"):
        aware(Shifty(), LIMITS)


def test_nonsense_is_refused() -> None:
    for limits in (None, "x", (1.0, 2.0, 3.0)):
        with pytest.raises(InputError, match="give LineSpeedLimits"):
            aware(QUARTER, limits)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="is no path"):
        aware("x", LIMITS)


@pytest.mark.parametrize("speed", [1e-2, 1e-3, 1e-5])
def test_a_slow_motion_is_no_more_work(speed: float) -> None:
    path = BlendedPath.through(np.array([[0, 0, 0], [1, 0, 0], [1, 0.5, 0]]), 0.05)
    profile = aware(path, LineSpeedLimits(speed=speed, acceleration=1.0, jerk=100.0))
    assert len(profile.knots) < 1000
    assert profile.certificate.ratio_max <= 1.0 + 1e-9
    assert profile.duration == pytest.approx(path.length / speed, rel=2e-3)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_the_certificate_finds_the_peaks(seed: int) -> None:
    """Of a profile sped up by 0.05 %, against 2000 samples in every piece."""
    path, limits = random_path(seed), LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0, normal_acceleration=0.3)
    slow = aware(path, limits)
    fast = LineSpeedProfile(
        knots=0.9995 * slow.knots, coefficients=slow.coefficients / 0.9995 ** np.arange(6), limits=limits, path=path
    )
    s, v, a, j = fast.at(fast.samples(2000))
    _, d1, d2, d3 = path.derivatives(np.clip(s, 0.0, path.length))
    v, a, j = v[..., None], a[..., None], j[..., None]
    true = [
        v.max() / limits.speed,
        np.abs(a).max() / limits.acceleration,
        np.linalg.norm(d1 * j + 3.0 * d2 * v * a + d3 * v**3, axis=-1).max() / limits.jerk,
        np.linalg.norm(d2 * v**2, axis=-1).max() / limits.normal,
    ]
    said = fast.certificate
    figures = [said.speed_ratio_max, said.acceleration_ratio_max, said.jerk_ratio_max, said.normal_ratio_max]
    np.testing.assert_allclose(figures, true, rtol=2e-6)
