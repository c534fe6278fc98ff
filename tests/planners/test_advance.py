"""Motions under commands: whatever was commanded, the end can still be met at rest inside the torque limits."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import ActionError, InfeasibleError
from armtempo.planners import CoordinationCell, PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.planners.topp import Mode

SplineDynamics = Callable[..., PathDynamics]
MODES: tuple[Mode, ...] = get_args(Mode)
PERIODS = (1 / 240, 0.001, 0.004, 0.0003, 0.013, 0.1)


def feasible(spline_dynamics: SplineDynamics, seed: int, *, gravity: bool) -> PhasePlane:
    """A random path on which the arm can hold still everywhere."""
    while True:
        try:
            plane = PhasePlane(spline_dynamics(seed, gravity=gravity, intervals=1000))
        except InfeasibleError:
            seed += 1000
            continue
        if not plane.edges.low.any():
            return plane
        seed += 1000


@pytest.fixture(scope="module")
def planes(lee1991: CoordinationCell, spline_dynamics: SplineDynamics) -> list[PhasePlane]:
    random = [feasible(spline_dynamics, seed, gravity=seed % 2 == 0) for seed in range(6)]
    return [*lee1991.planes, *random]


def finish(plane: PhasePlane, commands: Floats, dt: float, mode: Mode) -> PhaseTrajectory:
    """The commands, then full speed to the end; every state on the way is checked."""
    lam = mu = 0.0
    for command in commands:
        before = lam
        lam, mu, used = plane.advance(lam, mu, float(command), dt, mode=mode)
        assert mu >= 0.0
        assert before <= lam <= plane.length
        assert 0.0 <= used <= dt
        assert used == dt or lam == plane.length
        assert mu <= float(plane.upper(lam)) + 1e-6
    motion = plane.motion(np.append(commands, 1.0), np.append(np.full(len(commands), dt), np.inf), mode=mode)
    assert (np.diff(motion.lam) >= 0.0).all()
    assert (np.diff(motion.time) >= 0.0).all()
    assert (motion.mu >= 0.0).all()
    return motion


@pytest.mark.parametrize("mode", MODES)
def test_after_any_commands_the_end_is_met_at_rest_inside_the_limits(planes: list[PhasePlane], mode: Mode) -> None:
    """The promise the environments are built on."""
    rng = np.random.default_rng(7)
    worst = 0.0
    for plane in planes:
        for trial in range(12):
            count = int(rng.integers(1, 120))
            commands = rng.uniform(0, 1, count)
            if trial % 3 == 0:
                commands = np.round(commands)
            elif trial % 3 == 1:
                commands = np.repeat(rng.uniform(0, 1, count), rng.integers(1, 6))[:count] ** 0.3
            motion = finish(plane, commands, float(rng.choice(PERIODS)), mode)
            assert motion.lam[-1] == plane.length
            assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
            worst = max(worst, motion.certificate.torque_excess)
    assert worst < 1e-3


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 7), mode=st.sampled_from(MODES), dt=st.sampled_from(PERIODS),
    commands=st.lists(st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.5, 1.0])), min_size=1, max_size=40),
)  # fmt: skip
def test_any_commands_at_all(planes: list[PhasePlane], seed: int, mode: Mode, dt: float, commands: list[float]) -> None:
    motion = finish(planes[seed], np.array(commands), dt, mode)
    assert motion.lam[-1] == planes[seed].length
    assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
    assert motion.certificate.torque_excess < 1e-3
    assert motion.certificate.speed_ratio_max < 1 + 1e-6


@pytest.mark.parametrize("dt", [1 / 240, 0.001, 0.0001])
def test_full_speed_is_the_minimum_time_motion(planes: list[PhasePlane], dt: float) -> None:
    for plane in planes:
        fastest = plane.fastest()
        steps = math.ceil(fastest.duration / dt) + 2
        motion = plane.motion(np.ones(steps + 1), np.append(np.full(steps, dt), np.inf))
        on_paper = plane.dynamics.path.__class__.__name__ == "TwoLinkPath"
        slower = 2e-4 if on_paper else 1e-2  # at zero-inertia points
        assert fastest.duration * (1 - 1e-3) < motion.duration < fastest.duration * (1 + slower)


@pytest.mark.parametrize("mode", MODES)
def test_splitting_a_step_changes_next_to_nothing(planes: list[PhasePlane], mode: Mode) -> None:
    rng = np.random.default_rng(3)
    for plane in planes:
        for _ in range(20):
            lam = float(rng.uniform(0, 0.97) * plane.length)
            mu = float(rng.uniform(0, 0.95) * plane.upper(lam))
            command = float(rng.choice([0.0, 1.0]))
            whole = plane.advance(lam, mu, command, 0.004, mode=mode)
            half = plane.advance(lam, mu, command, 0.002, mode=mode)
            rest = plane.advance(half[0], half[1], command, 0.002, mode=mode)
            assert rest[0] == pytest.approx(whole[0], abs=1e-3 * plane.length)
            assert rest[1] == pytest.approx(whole[1], abs=5e-2 * float(plane.upper(plane.dynamics.grid).max()))


def test_braking_comes_to_rest_and_stays(planes: list[PhasePlane]) -> None:
    for plane in planes:
        for share in (0.2, 0.5, 0.9, 0.99):
            lam = share * plane.length
            motion = plane.braking(lam, float(plane.upper(lam)))
            assert motion.certificate.torque_excess < 1e-3
            assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
            lam, mu = float(motion.lam[-1]), 0.0
            for _ in range(50):
                there, mu, used = plane.advance(lam, mu, 0.0, 0.01)
                assert (there, mu) == (lam, 0.0)
                assert used == 0.01 or lam == plane.length
            assert plane.motion([1.0], [np.inf], lam, 0.0).lam[-1] == plane.length


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("left", [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_starting_and_stopping_just_before_the_end(lee1991: CoordinationCell, mode: Mode, left: float) -> None:
    plane = lee1991.planes[0]
    lam = plane.length * (1.0 - left)
    motion = plane.motion([1.0], [np.inf], lam, 0.0, mode=mode)
    assert motion.lam[-1] == plane.length
    low, high = plane.acceleration_bounds(plane.length, 0.0)
    triangle = math.sqrt(2.0 * (plane.length - lam) * (1.0 / high - 1.0 / low))
    assert motion.duration == pytest.approx(triangle, rel=0.05, abs=1e-6)  # its top lies between stations
    if left > 1e-9:
        assert motion.certificate.torque_excess < 1e-3
    start, mu = lam, 0.0
    for command in (1.0, 0.0, 0.0, 1.0, 0.0, 0.3, 1.0):
        lam, mu, _ = plane.advance(lam, mu, command, 0.0004, mode=mode)
    assert start < lam <= plane.length
    lam, mu, used = plane.advance(lam, mu, 1.0, 10.0, mode=mode)
    assert (lam, mu) == (plane.length, 0.0)
    assert used < 0.2


def test_steps_of_any_size(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    lam, mu, used = plane.advance(0.0, 0.0, 1.0, 100.0)
    assert (lam, mu) == (plane.length, 0.0)
    assert used == pytest.approx(lee1991.fastest[0].duration, rel=1e-3)
    assert plane.advance(plane.length, 0.0, 1.0, 1.0) == (plane.length, 0.0, 0.0)
    assert plane.advance(0.1, 0.5, 1.0, 0.0)[:2] == pytest.approx((0.1, 0.5))
    for dt in (1e-5, 1e-6, 1e-8):
        lam, mu = 0.0, 0.0
        for _ in range(100):
            lam, mu, _ = plane.advance(lam, mu, 1.0, dt)
        wanted = plane.acceleration_bounds(0.0, 0.0)[1] * 100 * dt
        assert mu == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize("mode", MODES)
def test_commands_at_rest(lee1991: CoordinationCell, mode: Mode) -> None:
    plane = lee1991.planes[0]
    for command in (0.0, 1e-6, 0.5, 0.500001, 1.0):
        lam = mu = 0.0
        for _ in range(200):
            lam, mu, _ = plane.advance(lam, mu, command, 0.001, mode=mode)
        if command == 0.0:
            assert lam == 0.0
        if command == 1.0:
            assert lam > 0.2
        assert plane.motion([1.0], [np.inf], lam, mu, mode=mode).lam[-1] == plane.length


def test_in_speed_mode_the_command_is_a_share_of_the_fastest(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    for command in (0.1, 0.5, 0.9):
        lam, mu, shares = 0.0, 0.0, []
        while lam < 0.7 * plane.length:
            lam, mu, _ = plane.advance(lam, mu, command, 0.001)
            shares.append(mu / float(plane.upper(lam)))
        assert max(shares) <= command + 1e-3
        assert shares[-1] == pytest.approx(command, abs=0.02)


def test_in_acceleration_mode_the_command_is_a_share_of_the_interval(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    low, high = plane.acceleration_bounds(0.05, 0.2)
    for command in (0.0, 0.3, 0.5, 0.8, 1.0):
        _, mu, _ = plane.advance(0.05, 0.2, command, 1e-5, mode="acceleration")
        assert (mu - 0.2) / 1e-5 == pytest.approx(low + command * (high - low), abs=0.01 * (high - low))


def test_commands_beyond_their_range_are_clipped_and_nan_is_refused(lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    for mode in MODES:
        for wild, tame in ((1.5, 1.0), (-0.5, 0.0)):
            assert plane.advance(0.1, 1.0, wild, 0.001, mode=mode) == plane.advance(0.1, 1.0, tame, 0.001, mode=mode)
        for wrong in (
            (0.1, 1.0, math.nan, 0.001),
            (math.nan, 1.0, 0.5, 0.001),
            (0.1, math.nan, 0.5, 0.001),
            (0.1, 1.0, 0.5, math.inf),
        ):
            with pytest.raises(ActionError, match="must be finite"):
                plane.advance(*wrong, mode=mode)
    with pytest.raises(ActionError, match="must be finite"):
        plane.motion([1.0, math.nan], [0.01, 0.01])


def test_a_path_on_which_the_arm_cannot_hold_still_everywhere(spline_dynamics: SplineDynamics) -> None:
    """Swinging through: the static torque exceeds a limit at some stations, so there is a lowest speed."""
    rng = np.random.default_rng(0)
    found = 0
    for seed in range(200):
        try:
            plane = PhasePlane(spline_dynamics(seed, limits=(26.0, 12.0)))
        except InfeasibleError:
            continue
        if not plane.edges.low.any() or plane.edges.low[0] > 0.0:
            continue
        found += 1
        for mode in MODES:
            commands = rng.uniform(0, 1, 200) * rng.integers(0, 2, 200)
            motion = plane.motion(np.append(commands, 1.0), np.append(np.full(200, 0.004), np.inf), mode=mode)
            assert motion.lam[-1] == plane.length, (seed, mode)
            assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
            assert motion.certificate.torque_excess < 1e-2, (seed, mode)  # a coarse grid
        if found == 5:
            break
    assert found >= 3
