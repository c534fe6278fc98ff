"""The braking guard: what it foresees, that it never lets an arm past its limit, and that it holds back no more."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.planners import CoordinationChart, PhasePlane, Precedence
from armtempo.planners.coordination import BrakingGuard, TimingProblem
from armtempo.planners.coordination._guard import LIMIT_MARGIN
from armtempo.planners.topp import Mode

PERIOD, CHECKS = 0.02, 4
CELLS = 16


@pytest.fixture(scope="module")
def planes(make_problem: Callable[..., TimingProblem]) -> tuple[PhasePlane, ...]:
    """Two double integrators: 1 in 2 s."""
    return make_problem({}).planes


def guard_of(planes: tuple[PhasePlane, ...], mode: Mode) -> BrakingGuard:
    """Arm 0 passes before arm 1, which may not be beyond 0.5 before arm 0 is at 0.75."""
    states = np.zeros((CELLS, CELLS), dtype=np.uint8)
    states[4:12, 8:10] = 2
    chart = CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)
    precedence = Precedence.of_order([1.0, 1.0], [0, 1], {(0, 1): chart})
    return BrakingGuard(planes, precedence, PERIOD, mode, CHECKS)


def guarded(guard: BrakingGuard, command: float, lam: tuple[float, float], mu: tuple[float, float]) -> float:
    return guard.guarded(1, command, lam[1], mu[1], lambda j: guard.braking(j, lam[j], mu[j]))


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_who_brakes_stops_after_half_the_square_of_its_speed(
    planes: tuple[PhasePlane, ...], lam: float, share: float
) -> None:
    guard = guard_of(planes, "speed")
    mu = share * float(planes[0].upper(lam))
    places = guard.braking(0, lam, mu)
    instants = np.minimum(PERIOD / CHECKS * np.arange(len(places)), mu)
    expected = np.minimum(lam + mu * instants - 0.5 * instants**2, 1.0)
    np.testing.assert_allclose(places, expected, atol=2e-6)


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_behind_an_arm_that_stands_it_comes_to_rest_just_before_its_limit(
    planes: tuple[PhasePlane, ...], mode: Mode
) -> None:
    guard = guard_of(planes, mode)
    lam, mu = 0.0, 0.0
    for _ in range(200):
        command = guarded(guard, 1.0, (0.0, lam), (0.0, mu))
        lam, mu, _ = planes[1].advance(lam, mu, command, PERIOD, mode=mode)
        assert lam <= 0.5
    assert mu < 1e-3
    assert lam > 0.5 - 1e-3


def test_once_the_other_has_left_nothing_is_held_back(planes: tuple[PhasePlane, ...]) -> None:
    guard = guard_of(planes, "speed")
    assert guarded(guard, 1.0, (0.8, 0.49), (0.3, 0.6)) == 1.0
    assert guard.guarded(0, 1.0, 0.2, 0.3, lambda j: guard.braking(j, 0.49, 0.0)) == 1.0  # the first has no limit


def test_who_will_pass_while_braking_has_as_good_as_left(planes: tuple[PhasePlane, ...]) -> None:
    guard = guard_of(planes, "speed")
    lam, mu = 0.74, 0.5  # braking takes it to 0.865: past 0.75 in 0.02 s
    assert guarded(guard, 1.0, (lam, 0.3), (mu, 0.3)) == 1.0
    assert guarded(guard, 1.0, (lam, 0.4999), (mu, 0.1)) < 1.0  # in less time it must not be there


@settings(max_examples=50)
@given(st.floats(0.0, 0.49), st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.sampled_from(["speed", "acceleration"]))
def test_the_command_is_the_largest_from_which_braking_stays_behind(
    planes: tuple[PhasePlane, ...], lam: float, share: float, command: float, mode: Mode
) -> None:
    guard, plane = guard_of(planes, mode), planes[1]
    mu = share * min(float(plane.upper(lam)), np.sqrt(2.0 * (0.5 - LIMIT_MARGIN - lam)))  # it can stop in time

    def rests_at(tried: float) -> float:
        place, speed, _ = plane.advance(lam, mu, tried, PERIOD, mode=mode)
        return place + 0.5 * speed**2

    found = guarded(guard, command, (0.0, lam), (0.0, mu))
    assert 0.0 <= found <= command
    assert rests_at(found) <= 0.5 + 1e-9 or found == 0.0
    if found < command - 1e-4:
        assert rests_at(found + 1e-4) > 0.5 - LIMIT_MARGIN - 1e-6
