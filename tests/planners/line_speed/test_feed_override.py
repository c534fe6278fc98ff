"""Overrides of a profile that runs: closed forms at constant override, and the limits under any requests."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import (
    BlendedPath,
    CartesianPath,
    FeedOverride,
    Line,
    LineSpeedLimits,
    LineSpeedProfile,
    limit_aware_profile,
)

LIMITS = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
POINTS = np.array([[0.7, 0.0, 0.05], [0.3, 0.0, 0.05], [0.3, 0.65, 0.0], [-0.2, 0.5, 0.1]])
TICK = 1e-3


@pytest.fixture(scope="module")
def path() -> BlendedPath:
    return BlendedPath.through(POINTS, 0.15)


@pytest.fixture(scope="module")
def aware(path: BlendedPath) -> LineSpeedProfile:
    return limit_aware_profile(path, LineSpeedLimits(speed=0.95, acceleration=4.6, jerk=180.0))


def test_untouched_it_is_the_profile() -> None:
    profile = LineSpeedProfile.plan(1.5, LIMITS)
    feed = FeedOverride(profile)
    rows = np.array([feed.step(TICK) for _ in range(2000)])
    expected = profile.at(TICK * np.arange(1, 2001))
    assert np.abs(rows - np.stack(expected[:3], axis=1)).max() < 1e-9
    assert feed.done
    feed.reset()
    assert (feed.sigma, feed.override, feed.done) == (0.0, 1.0, False)


def test_half_speed_takes_twice_as_long() -> None:
    profile = LineSpeedProfile.plan(1.5, LIMITS)
    feed = FeedOverride(profile)
    assert feed.request(0.5)  # at rest nothing moves: the shortest transition
    time = 0.0
    while not feed.done:
        feed.step(TICK)
        time += TICK
    assert time == pytest.approx(2.0 * profile.duration, abs=0.01)


def test_stop_and_go_on() -> None:
    profile = LineSpeedProfile.plan(1.5, LIMITS)
    feed = FeedOverride(profile)
    for _ in range(600):
        feed.step(TICK)
    assert feed.request(0.0)
    speeds = [feed.step(TICK)[1] for _ in range(1000)]
    stopped = int(np.argmax(np.array(speeds) == 0.0)) * TICK
    # the quintic's largest slope is 15/8 and its largest bend 10/sqrt(3), over T and T^2; durations grow by 1.25
    shortest = max(15.0 / 8.0 * 1.0 / 5.0, (10.0 / 3.0**0.5 / 200.0) ** 0.5)
    assert shortest < stopped < 1.3 * shortest
    here = feed.step(TICK)[0]
    assert feed.step(1.0)[0] == here
    assert feed.request(1.0)
    while not feed.done:
        feed.step(TICK)
    assert feed.step(TICK) == pytest.approx((1.5, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("vector", [False, True])
def test_any_requests_keep_the_limits_and_arrive(path: BlendedPath, aware: LineSpeedProfile, vector: bool) -> None:
    plain = LineSpeedProfile.plan(path.length, LIMITS)
    feed = FeedOverride(aware if vector else plain, LIMITS, path if vector else None)
    taken: list[bool] = []

    @settings(max_examples=25, deadline=None)
    @given(st.lists(st.tuples(st.integers(1, 400), st.sampled_from([0.0, 0.1, 0.5, 0.77, 1.0])), max_size=12))
    def run(requests: list[tuple[int, float]]) -> None:
        feed.reset()
        rows: list[tuple[float, ...]] = []
        for ticks, wanted in [*requests, (1, 1.0)]:
            rows.extend((*feed.step(TICK), feed.jerk) for _ in range(ticks))
            taken.append(feed.request(wanted))
        while not feed.done:
            rows.append((*feed.step(TICK), feed.jerk))
            if feed.override < 1.0:
                feed.request(1.0)
            assert len(rows) < 20000
        s, v, a, j = np.array(rows).T
        assert (np.diff(s) >= -1e-12).all()
        assert s[-1] == pytest.approx(path.length, abs=1e-9)
        if vector:
            _, d1, d2, d3 = path.derivatives(s)
            size = np.linalg.norm(d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * v[:, None] ** 3, axis=1)
            assert (np.linalg.norm(d2, axis=1) * v**2).max() <= LIMITS.normal * (1.0 + 1e-6)
        else:
            size = np.abs(j)
        assert v.max() <= LIMITS.speed * (1.0 + 1e-6)
        assert np.abs(a).max() <= LIMITS.acceleration * (1.0 + 1e-6)
        assert size.max() <= LIMITS.jerk * (1.0 + 1e-6)

    run()
    assert np.mean(taken) > 0.5  # limits kept by refusing everything would prove nothing


def test_nonsense_is_refused(path: BlendedPath) -> None:
    profile = LineSpeedProfile.plan(path.length, LIMITS)
    with pytest.raises(InputError, match="override"):
        FeedOverride(profile).request(1.5)
    with pytest.raises(InputError, match="override"):
        FeedOverride(profile).request(float("nan"))
    with pytest.raises(InfeasibleError, match="times its limits"):  # it does not slow in the blends
        FeedOverride(profile, path=path)
    with pytest.raises(InputError, match="override"):
        FeedOverride(profile).request("x")  # type: ignore[arg-type]
    for dt in (float("nan"), float("inf"), -0.1, "x"):
        with pytest.raises(InputError, match="a step is"):
            FeedOverride(profile).step(dt)  # type: ignore[arg-type]
    for other, message in ((BlendedPath.through(2.0 * POINTS, 0.15), "m long but its profile"), ("x", "is a str")):
        with pytest.raises(InputError, match=message):
            FeedOverride(profile, path=other)  # type: ignore[arg-type]


def test_it_keeps_the_path_of_its_profile(path: BlendedPath, aware: LineSpeedProfile) -> None:
    feed, given = FeedOverride(aware), FeedOverride(aware, path=path)
    for each in (feed, given):
        each.step(0.3)
        assert each.request(0.5)
    assert feed.step(0.05) == given.step(0.05)
    line = Line(POINTS[0], POINTS[1])
    for single in (line, CartesianPath([line])):
        assert FeedOverride(limit_aware_profile(single, LIMITS), LIMITS).request(1.0)


def test_it_stands_however_long(path: BlendedPath) -> None:
    feed = FeedOverride(LineSpeedProfile.plan(path.length, LIMITS))
    feed.step(0.3)
    assert feed.request(0.0)
    feed.step(10.0)
    stood = feed.step(0.0)
    for _ in range(3):
        assert feed.step(1e308) == stood
