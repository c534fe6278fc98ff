"""Line-speed profiles against the closed forms and the paper's figures [lee2006]."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.planners import LineSpeedLimits, LineSpeedProfile

PAPER = LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=200.0)
LENGTH = 1.66883


def test_the_papers_ramp() -> None:
    mean, peak = (LineSpeedProfile.plan(LENGTH, PAPER, reading=r) for r in ("mean", "peak"))
    assert mean.limits.acceleration == pytest.approx(5.8579, abs=1e-4)
    assert mean.knots[1] == pytest.approx(0.02929, abs=1e-5)
    assert mean.knots[3] == pytest.approx(0.2, abs=1e-12)
    assert mean.duration == pytest.approx(LENGTH + 0.2, abs=1e-11)
    assert peak.knots[1] == pytest.approx(0.025, abs=1e-12)
    assert peak.knots[3] == pytest.approx(0.225, abs=1e-12)
    assert mean.certificate.ratio_max <= 1.0 + 1e-12
    assert mean.certificate.gap < 1e-12
    assert mean.certificate.end_error < 1e-12


def test_windows_of_the_blends() -> None:
    lengths = np.array([0.25, 0.52032, 0.87224, 1.14189])
    for reading, expected in (("mean", [0.3500, 0.6203, 0.9722, 1.2419]), ("peak", [0.3625, 0.6328, 0.9847, 1.2544])):
        profile = LineSpeedProfile.plan(LENGTH, PAPER, reading=reading)  # type: ignore[arg-type]
        assert profile.time_at(lengths) == pytest.approx(expected, abs=6e-5)


def test_mean_that_the_jerk_forbids_is_the_ramp_of_the_jerk() -> None:
    soft = LineSpeedProfile.plan(10.0, LineSpeedLimits(speed=1.0, acceleration=5.0, jerk=9.0), reading="mean")
    assert float(soft.knots[-1]) == pytest.approx(10.0 + 2.0 / 3.0, abs=1e-9)  # two ramps of 2 sqrt(v / j), less half
    assert soft.limits.acceleration == pytest.approx(3.0)


def test_a_short_path_is_four_jerks() -> None:
    length = 1e-4
    profile = LineSpeedProfile.plan(length, PAPER)
    assert profile.duration == pytest.approx(4.0 * (length / (2.0 * PAPER.jerk)) ** (1.0 / 3.0), rel=1e-12)
    assert profile.certificate.speed_ratio_max < 0.1


@settings(max_examples=60, deadline=None)
@given(*(st.floats(-3.0, 3.0) for _ in range(4)))
def test_any_profile_keeps_its_limits_and_inverts(length: float, speed: float, accel: float, jerk: float) -> None:
    limits = LineSpeedLimits(speed=10**speed, acceleration=10**accel, jerk=10**jerk)
    profile = LineSpeedProfile.plan(10**length, limits)
    certificate = profile.certificate
    assert certificate.ratio_max <= 1.0 + 1e-9
    assert certificate.lowest_speed >= -1e-9 * limits.speed
    rounding = 4.0 * np.finfo(float).eps * profile.duration * limits.jerk / limits.acceleration  # of instants, late
    assert certificate.gap <= 1e-8 + rounding
    assert certificate.end_error <= 1e-8 * profile.length
    s = np.linspace(0.0, 1.0, 40) * profile.length
    assert np.abs(profile.at(profile.time_at(s))[0] - s).max() <= 1e-8 * profile.length


def test_at_is_its_own_derivative_and_clips() -> None:
    profile = LineSpeedProfile.plan(LENGTH, PAPER, reading="mean")
    t = profile.samples().reshape(-1, 3)
    s, v, a, _ = profile.at(t)
    h = 1e-6
    assert s.shape == t.shape
    ahead, behind = profile.at(t + h), profile.at(t - h)
    inside = (t > h) & (t < profile.duration - h)
    assert np.abs((ahead[0] - behind[0]) / (2 * h) - v)[inside].max() < 1e-8
    assert np.abs((ahead[1] - behind[1]) / (2 * h) - a)[inside].max() < 1e-3  # a bends at the knots
    assert profile.at(-1.0)[0] == 0.0
    assert profile.at(9.0)[0] == pytest.approx(LENGTH, abs=1e-12)


def test_other_nonsense() -> None:
    with pytest.raises(InputError, match="positive length"):
        LineSpeedProfile.plan(0.0, PAPER)
    with pytest.raises(InputError, match="reading"):
        LineSpeedProfile.plan(1.0, PAPER, reading="median")  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"lengths must be"):
        LineSpeedProfile.plan(1.0, PAPER).time_at(1.1)
    with pytest.raises(InputError, match="knots"):
        LineSpeedProfile(knots=[0.0, 0.0], coefficients=np.zeros((1, 6)), limits=PAPER)  # type: ignore[arg-type]
