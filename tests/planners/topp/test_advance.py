"""Motions under commands: whatever was commanded, the end can still be met at rest inside the torque limits.

As the environments move their arms (places at ticks) and as plans are told (a record of pieces).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Floats
from armtempo.errors import ActionError, InfeasibleError
from armtempo.planners import (
    CoordinationCell,
    JointPath,
    PathDynamics,
    PhasePlane,
    PhaseTrajectory,
    build_cell,
    generate_cell,
)
from armtempo.planners.instances._generator import config_of
from armtempo.planners.topp import Mode
from armtempo.planners.topp._advance import advance, record_pieces
from armtempo.robots import Arm

SplineDynamics = Callable[..., PathDynamics]
MODES: tuple[Mode, ...] = get_args(Mode)
PERIODS = (0.0003, 0.001, 1 / 240, 0.013, 0.016, 0.1)
FRICTION = ((0.0, 0.0), (0.3, 0.0), (1.0, 0.0), (0.3, 0.4), (0.0, 2.0))  # viscous, dry
NEAR = 1e-7  # rounding, at rest its square root


def run(
    plane: PhasePlane, lam: float, mu: float, command: float, period: float, mode: Mode, reads: int = 0,
    share: float = 1.0,
) -> tuple[float, float, float, Floats, Floats]:  # fmt: skip
    """State after a period and the time used; places and speeds ``reads`` times on the way, equally far apart."""
    places, speeds = np.empty(reads), np.empty(reads)
    tick, ticks = (period / reads, reads) if reads else (period, 1)
    steps = plane.edges.steps
    lam, mu, used = advance(steps, lam, mu, command, mode == "speed", tick, ticks, places, speeds, share)
    return float(lam), float(mu), float(used), places, speeds


@pytest.fixture(scope="module")
def planes(
    lee1991: CoordinationCell, spline_dynamics: SplineDynamics, make_arm: Callable[..., Arm]
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

    random = [feasible(plain, seed) for seed in range(6)]
    return [*lee1991.planes, *random, *(feasible(rubbing(pair), 100 + k) for k, pair in enumerate(FRICTION))]


def swinging(spline_dynamics: SplineDynamics) -> Iterator[PhasePlane]:
    """Random planes with a lowest speed: the static torque exceeds a limit at some stations."""
    for seed in range(200):
        try:
            plane = PhasePlane(spline_dynamics(seed, limits=(26.0, 12.0)))
        except InfeasibleError:
            continue
        if plane.edges.low.any() and plane.edges.low[0] <= 0.0:
            yield plane


def finish(plane: PhasePlane, commands: Sequence[float] | Floats, period: float, mode: Mode) -> list[PhaseTrajectory]:
    """The commands, then full speed to the end: in periods, every state on the way checked, and at once.

    In periods: every piece of constant acceleration is recorded, and what ``advance`` reads lies on them but for
    rounding. Just before rest that is as large as its square root.
    """
    reads = 16
    lam = mu = clock = 0.0
    pieces, read = [np.zeros((1, 3))], []
    fastest = float(plane.upper(plane.rows.station).max())
    record = np.empty((8 * len(plane.rows.station), 3))
    instants = (np.arange(reads) + 1.0) * (period / reads)
    for k in range(100_000):
        command = float(commands[k]) if k < len(commands) else 1.0
        was = lam
        want = record_pieces(plane.edges.steps, lam, mu, command, mode == "speed", period, record)
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

    whole = plane.motion(np.append(commands, 1.0), np.append(np.full(len(commands), period), np.inf), mode=mode)
    assert whole.lam[-1] == plane.length
    assert whole.mu[-1] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(whole.lam) >= 0.0).all()
    assert (np.diff(whole.time) >= 0.0).all()
    assert (whole.mu >= 0.0).all()
    return [motion, whole]


@pytest.mark.parametrize("mode", MODES)
def test_after_any_commands_the_end_is_met_at_rest_inside_the_limits(planes: list[PhasePlane], mode: Mode) -> None:
    """The promise the environments are built on."""
    rng = np.random.default_rng(7)
    worst = []
    for plane in planes:
        for trial in range(6):
            count = int(rng.integers(1, 120))
            commands = rng.uniform(0, 1, count)
            if trial % 3 == 0:
                commands = np.round(commands)
            elif trial % 3 == 1:
                commands = np.repeat(rng.uniform(0, 1, count), rng.integers(1, 6))[:count] ** 0.3
            motions = finish(plane, commands, float(rng.choice(PERIODS)), mode)
            worst += [motion.certificate.excess for motion in motions]
    assert max(worst) < 1e-3


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 12), mode=st.sampled_from(MODES), period=st.sampled_from(PERIODS[1:]),
    commands=st.lists(st.one_of(st.floats(0.0, 1.0), st.sampled_from([0.0, 0.5, 1.0])), min_size=1, max_size=40),
)  # fmt: skip
def test_any_commands_at_all(
    planes: list[PhasePlane], seed: int, mode: Mode, period: float, commands: list[float]
) -> None:
    for motion in finish(planes[seed], commands, period, mode):
        assert motion.certificate.excess < 1e-2  # pieces inside intervals: to the second order of their length
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


@pytest.mark.parametrize("period", [0.0001, 0.001, 1 / 240, 0.01])
def test_full_speed_is_the_minimum_time_motion(planes: list[PhasePlane], period: float) -> None:
    for plane in planes:
        fastest = plane.fastest().duration
        steps = math.ceil(fastest / period) + 2
        motions = [plane.motion(np.ones(steps + 1), np.append(np.full(steps, period), np.inf))]
        if period >= 0.001:
            motions += finish(plane, [], period, "speed")
        on_paper = plane.dynamics.path.__class__.__name__ == "TwoLinkPath"
        slower = 2e-4 if on_paper else 1e-2  # at zero-inertia points
        for motion in motions:
            assert fastest * (1 - 1e-3) < motion.duration < fastest * (1 + slower)


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
            assert motion.certificate.excess < 1e-3
            assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
            lam, mu = float(motion.lam[-1]), 0.0
            for _ in range(50):
                there, mu, used = plane.advance(lam, mu, 0.0, 0.01)
                assert (there, mu) == (lam, 0.0)
                assert used == 0.01 or lam == plane.length
            assert plane.motion([1.0], [np.inf], lam, 0.0).lam[-1] == plane.length


def test_braking_in_periods_stops_where_braking_at_once_does(planes: list[PhasePlane]) -> None:
    """Hardly elsewhere: each period splits one interval."""
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
        assert motion.certificate.excess < 1e-3
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
    """Swinging through: there is a lowest speed, whole intervals keep to it as well."""
    found = 0
    rng = np.random.default_rng(0)
    for plane in swinging(spline_dynamics):
        found += 1
        for mode in MODES:
            for count, period in ((60, 0.016), (200, 0.004)):
                for motion in finish(plane, rng.uniform(0, 1, count) * rng.integers(0, 2, count), period, mode):
                    assert (motion.mu >= plane.lower(motion.lam) - 1e-6).all()
                    assert motion.certificate.excess < 1e-2  # a coarse grid
        if found == 5:
            break
    assert found >= 3


@pytest.mark.parametrize("mode", MODES)
def test_an_arm_that_has_not_begun_waits_also_where_its_torques_do_not_hold_it(
    spline_dynamics: SplineDynamics, mode: Mode
) -> None:
    """Brakes do; told to go, it goes, at least as fast as it has to."""
    plane = next(one for one in swinging(spline_dynamics) if not one.holdable[0])
    assert run(plane, 0.0, 0.0, 0.0, 0.02, mode, 4)[:3] == (0.0, 0.0, 0.02)
    assert run(plane, 0.0, 0.0, 1e-6, 0.02, mode)[1] > 0.0


def goes_on(plane: PhasePlane, lam: float, mu: float, command: float, period: float, mode: Mode, share: float) -> float:
    """Where one period leads to: it is used up or ends the path, and who moves or is told to move does."""
    there, speed, used, *_ = run(plane, lam, mu, command, period, mode, 4, share)
    assert used == period or there == plane.length, (lam, mu, command, period, mode, share)
    told = command > 0.0 and (mode == "speed" or command == 1.0)
    assert (there, speed) != (lam, mu) or lam == plane.length or (mu == 0.0 and not told)
    return there


@pytest.mark.parametrize("mode", MODES)
def test_before_the_end_nothing_freezes(planes: list[PhasePlane], mode: Mode) -> None:
    """Speeds within rounding of the one asked for: braking down to it had no length, and was tried for ever."""
    rng = np.random.default_rng(17)
    for plane in planes:
        station = plane.rows.station
        for trial in range(300):
            i, w = int(rng.integers(-4, -1)), float(rng.choice([0.0, rng.random(), 1.0 - 10.0 ** rng.uniform(-9, -1)]))
            lam = float(station[i] + w * (station[i + 1] - station[i]))
            command, share = float(rng.choice([0.0, 1e-7, 0.4, 1.0, rng.random()])), float(rng.choice([1.0, 0.3]))
            part = float(rng.choice([0.0, rng.random(), command * share if mode == "speed" else share]))
            edge = float(plane.edge_speed(lam))
            mu = min(part * edge * (1.0 + int(rng.integers(-3, 4)) * 2.0**-52), edge)
            goes_on(plane, lam, mu, command, float(rng.choice([0.00025, 0.001, 0.004, 0.1])), mode, share)
            if trial % 10:
                continue
            motion = plane.motion([command, 1.0], [0.002, np.inf], lam, mu, mode=mode, share=share)
            assert motion.lam[-1] == plane.length
            assert motion.certificate.excess < 1e-3 or plane.length - lam < 1e-9 * plane.length


@pytest.mark.parametrize("mode", MODES)
def test_constant_commands_arrive(planes: list[PhasePlane], mode: Mode) -> None:
    for plane in planes[:5]:
        for share in (0.1, 0.35, 0.8, 1.0):
            command, share = (share, 1.0) if mode == "speed" else (1.0, share)
            for period in (0.001, 0.01):
                lam, mu, most = 0.0, 0.0, int(20.0 * plane.fastest().duration / (command * share * period))
                for _ in range(most):
                    lam, mu, *_ = run(plane, lam, mu, command, period, mode, 4, share)
                    if lam == plane.length:
                        break
                assert lam == plane.length


def test_three_arms_that_froze(lee1991: CoordinationCell) -> None:
    """Found in shielded episodes, in physics with errors of the model, and by this file's random commands."""
    ring = generate_cell("ring", 1, 0, arms=3).cell.planes[0]
    place, mu = 5.474480252415095, 0.04294693951730485  # at a station, as fast as commanded but for rounding
    for share in (0.448894423685308, 0.5, 0.9, 1.0, 0.0):
        goes_on(ring, place, mu, share, 0.001, "speed", 1.0)
    drawn = generate_cell("ring", 7, 0, arms=3)
    reserved = build_cell(config_of(drawn.cell.name, {**drawn.data, "torque_reserve": 0.05})).planes[0]
    rng = np.random.default_rng(3)
    for command, tick in [(1.0, 0.001), *rng.uniform(0.1, 1.0, (20, 2)) * (1.0, 0.001)]:
        lam = mu = 0.0
        while lam < reserved.length:
            lam, mu, used, *_ = run(reserved, lam, mu, command, 4 * tick, "speed", 4)
            assert used == 4 * tick or lam == reserved.length
    for motion in finish(lee1991.planes[0], [1.0, 0.5, 1.0, 0.5], 0.1, "speed"):
        assert motion.certificate.excess < 1e-3


def test_a_slow_arm_takes_a_share_of_the_largest_speed(planes: list[PhasePlane]) -> None:
    """In both modes alike: at full speed the same motion; never above that share; inside the limits."""
    rng = np.random.default_rng(5)
    for plane in planes:
        for share in (0.05, 0.6):
            times = np.append(np.full(80, 0.004), np.inf)
            motions = [plane.motion(np.ones(81), times, mode=mode, share=share) for mode in MODES]
            scaled = plane.motion(np.full(81, share), times)
            for motion in motions:
                assert motion.duration == pytest.approx(scaled.duration, rel=1e-9)
                np.testing.assert_allclose(motion.at(scaled.time)[0], scaled.lam, atol=1e-7 * plane.length, rtol=0)
                assert motion.certificate.excess < 1e-3
            commands = np.append(rng.uniform(0.3, 1.0, 80), 1.0)
            slow = plane.motion(commands, times, mode="acceleration", share=share)
            full = plane.motion(commands, times, mode="acceleration")
            assert slow.lam[-1] == plane.length
            assert slow.certificate.excess < 1e-3
            assert (slow.mu <= share * plane.upper(slow.lam) * (1.0 + 1e-2) + 1e-6).all()
            clock = np.linspace(0.0, full.duration, 400)
            assert (slow.at(clock)[0] <= full.at(clock)[0] + 1e-6 * plane.length).all()
