"""Whole control periods at once, as the environments move their arms: the promises of ``advance``, at ticks too."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, JointPath, PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.planners.topp import Mode
from armtempo.planners.topp import _kernels_all as phase_kernels
from armtempo.robots import Arm

MODES: tuple[Mode, ...] = get_args(Mode)
PERIODS = (0.0003, 0.001, 1 / 240, 0.016, 0.1)
FRICTION = ((0.0, 0.0), (0.3, 0.0), (1.0, 0.0), (0.3, 0.4), (0.0, 2.0))  # viscous, dry
NEAR = 1e-7  # rounding, at rest its square root


def run(
    plane: PhasePlane, lam: float, mu: float, command: float, period: float, mode: Mode, reads: int = 0
) -> tuple[float, float, float, Floats, Floats]:
    """State after a period and the time used; places and speeds ``reads`` times on the way, equally far apart."""
    places, speeds = np.empty(reads), np.empty(reads)
    tick, ticks = (period / reads, reads) if reads else (period, 1)
    lam, mu, used = phase_kernels.run(plane.edges.steps, lam, mu, command, mode == "speed", tick, ticks, places, speeds)
    return float(lam), float(mu), float(used), places, speeds


@pytest.fixture(scope="module")
def planes(
    lee1991: CoordinationCell, spline_dynamics: Callable[..., PathDynamics], make_arm: Callable[..., Arm]
) -> list[PhasePlane]:
    """The paper's two, random ones, random ones with friction; on all of them the arm can hold still everywhere."""

    def feasible(dynamics: Callable[[int], PathDynamics], seed: int) -> PhasePlane:
        while True:
            try:
                plane = PhasePlane(dynamics(seed))
            except InfeasibleError:
                seed += 1000
                continue
            if not plane.edges.low.any():
                return plane
            seed += 1000

    def rubbing(friction: tuple[float, float]) -> Callable[[int], PathDynamics]:
        viscous, dry = friction
        arm = make_arm(gravity=(0.0, -9.81, 0.0), torque_max=(80.0, 20.0), damping=[viscous] * 2, coulomb=[dry] * 2)

        def dynamics(seed: int) -> PathDynamics:
            knots = np.random.default_rng(seed).uniform(-1.2, 1.2, (5, 2))
            return PathDynamics.from_path(arm, JointPath.through(knots), intervals=2000)

        return dynamics

    def plain(seed: int) -> PathDynamics:
        return spline_dynamics(seed, gravity=seed % 2 == 0, intervals=1000)

    random = [feasible(plain, seed) for seed in range(4)]
    return [*lee1991.planes, *random, *(feasible(rubbing(pair), 100 + k) for k, pair in enumerate(FRICTION))]


def finish(plane: PhasePlane, commands: Any, period: float, mode: Mode, reads: int = 16) -> PhaseTrajectory:
    """The commands, then full speed to the end; every state on the way is checked.

    Returns the motion with every piece of constant acceleration in it: ``advance`` tells them, and is asked again in
    every period. It sets the same pieces, so what is read of ``run`` lies on them but for rounding. Just before rest
    that is as large as its square root.
    """
    lam = mu = clock = 0.0
    pieces, read = [np.zeros((1, 3))], []
    fastest = float(plane.upper(plane.rows.station).max())
    record = np.empty((8 * len(plane.rows.station), 3))
    instants = (np.arange(reads) + 1.0) * (period / reads)
    for k in range(100_000):
        command = float(commands[k]) if k < len(commands) else 1.0
        was = lam
        want = phase_kernels.advance(plane.rows, plane.edges, lam, mu, command, mode == "speed", period, record, 0)
        lam, mu, used, places, speeds = run(plane, lam, mu, command, period, mode, reads)
        assert (np.diff(places) >= 0.0).all()
        assert was <= places[0]
        assert places[-1] == lam
        assert 0.0 <= used <= period
        assert used == period or lam == plane.length
        assert abs(lam - want[0]) <= NEAR * plane.length
        assert abs(mu - want[1]) <= NEAR * fastest
        assert abs(used - want[2]) <= NEAR * period
        read.append(np.column_stack([clock + np.minimum(instants, used), places, speeds]))
        count = want[3]
        pieces.append(record[:count] + np.array([clock, 0.0, 0.0]))
        clock += used
        if not count or pieces[-1][-1, 0] < clock:
            pieces.append(np.array([[clock, lam, mu]]))
        if lam == plane.length:
            break
    assert lam == plane.length
    assert mu == pytest.approx(0.0, abs=1e-6)
    rows, seen = np.concatenate(pieces), np.concatenate(read)
    motion = PhaseTrajectory(time=rows[:, 0], lam=rows[:, 1], mu=rows[:, 2], dynamics=plane.dynamics)
    places, speeds, _ = motion.at(seen[:, 0])
    before_end = seen[:, 0] < clock
    np.testing.assert_allclose(seen[:, 1], places, atol=NEAR * plane.length, rtol=0)
    np.testing.assert_allclose(seen[before_end, 2], speeds[before_end], atol=NEAR * fastest, rtol=0)
    assert (seen[:, 2] >= 0.0).all()
    assert (seen[:, 2] <= plane.upper(seen[:, 1]) + 1e-6).all()
    return motion


@pytest.mark.parametrize("mode", MODES)
def test_after_any_commands_the_end_is_met_at_rest_inside_the_limits(planes: list[PhasePlane], mode: Mode) -> None:
    rng = np.random.default_rng(7)
    worst = []
    for plane in planes:
        for trial in range(5):
            count = int(rng.integers(1, 80))
            commands = rng.uniform(0, 1, count)
            if trial % 3 == 0:
                commands = np.round(commands)
            elif trial % 3 == 1:
                commands = np.repeat(rng.uniform(0, 1, count), rng.integers(1, 6))[:count] ** 0.3
            motion = finish(plane, commands, float(rng.choice(PERIODS)), mode)
            worst.append(motion.certificate.torque_excess)
    assert max(worst) < 1e-3


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10), mode=st.sampled_from(MODES), period=st.sampled_from(PERIODS[1:]),
    commands=st.lists(st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.5, 1.0])), min_size=1, max_size=30),
)  # fmt: skip
def test_any_commands_at_all(
    planes: list[PhasePlane], seed: int, mode: Mode, period: float, commands: list[float]
) -> None:
    motion = finish(planes[seed], commands, period, mode)
    assert motion.certificate.torque_excess < 1e-3
    assert motion.certificate.speed_ratio_max < 1 + 1e-6


@pytest.mark.parametrize("mode", MODES)
def test_reading_changes_nothing(planes: list[PhasePlane], mode: Mode) -> None:
    """The same bits however often places are read; also where a period begins at a station, at rest, or ends the path.

    Powers of two, so that the ticks add up to exactly the period.
    """
    rng = np.random.default_rng(3)
    for plane in planes:
        station = plane.rows.station
        for trial in range(60):
            lam = float(rng.choice(station[:-1]) if trial % 2 else rng.uniform(0.0, 0.999) * plane.length)
            mu = float(rng.choice([0.0, 0.3, 0.9, 1.0]) * plane.upper(lam))
            command, period = float(rng.choice([0.0, 0.4, 1.0])), float(rng.choice([0.001, 0.01, 0.1]))
            alone = run(plane, lam, mu, command, period, mode)[:3]
            last = np.empty(0)
            for reads in (1, 4, 64):
                *state, places, speeds = run(plane, lam, mu, command, period, mode, reads)
                assert tuple(state) == alone
                assert (places[-1], speeds[-1]) == alone[:2]
                if len(last):  # every fourth, or more, of these was read before
                    np.testing.assert_allclose(
                        places[len(places) // len(last) - 1 :: len(places) // len(last)],
                        last,
                        atol=1e-12 * plane.length,
                        rtol=0,
                    )
                last = places


@pytest.mark.parametrize("period", [0.001, 0.01])
def test_full_speed_is_the_minimum_time_motion(planes: list[PhasePlane], period: float) -> None:
    for plane in planes:
        fastest = plane.fastest().duration
        on_paper = plane.dynamics.path.__class__.__name__ == "TwoLinkPath"
        slower = 2e-4 if on_paper else 1e-2  # at zero-inertia points
        assert fastest * (1 - 1e-3) < finish(plane, [], period, "speed").duration < fastest * (1 + slower)


def test_braking_comes_to_rest_and_stays(planes: list[PhasePlane]) -> None:
    """Where, hardly depends on the periods: each of them splits one interval."""
    for plane in planes:
        for share in (0.2, 0.5, 0.9):
            lam = share * plane.length
            mu = float(plane.upper(lam))
            stop, periods = plane.braking(lam, mu), 0
            while mu > 0.0:
                lam, mu, *_ = run(plane, lam, mu, 0.0, 0.01, "speed", 4)
                periods += 1
                assert periods < 1000
            assert abs(lam - stop.lam[-1]) <= periods * np.diff(plane.rows.station).max()
            if lam < plane.length:
                assert run(plane, lam, 0.0, 0.0, 0.01, "speed")[:3] == (lam, 0.0, 0.01)


def test_where_the_arm_cannot_hold_still(spline_dynamics: Callable[..., PathDynamics]) -> None:
    """Swinging through: there is a lowest speed, whole intervals keep to it as well."""
    found = 0
    rng = np.random.default_rng(0)
    for seed in range(200):
        try:
            plane = PhasePlane(spline_dynamics(seed, limits=(26.0, 12.0)))
        except InfeasibleError:
            continue
        if not plane.edges.low.any() or plane.edges.low[0] > 0.0:
            continue
        found += 1
        for mode in MODES:
            motion = finish(plane, rng.uniform(0, 1, 60) * rng.integers(0, 2, 60), 0.016, mode)
            assert (motion.mu >= plane.lower(motion.lam) - 1e-6).all()
            assert motion.certificate.torque_excess < 1e-2  # a coarse grid
        if found == 3:
            break
    assert found == 3
