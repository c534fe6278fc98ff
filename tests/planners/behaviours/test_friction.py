"""Viscous and Coulomb friction along a path: what no library of the field plans right."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import InfeasibleError
from armtempo.planners import (
    AbstractJointPath,
    JointPath,
    PathDynamics,
    PhasePlane,
    benchmark_instances,
    diagnose,
    minimum_time,
)
from armtempo.planners.topp import refined_plane
from armtempo.robots import Arm, njit

UPRIGHT = (0.0, -9.81, 0.0)  # gravity in the plane of motion
LIMITS = (80.0, 20.0)
SLOW_LIMITS = (30.0, 8.0)


def random_path(seed: int, dof: int = 2) -> AbstractJointPath:
    return JointPath.through(np.random.default_rng(seed).uniform(-1.2, 1.2, (5, dof)))


def mass(length: float, *, viscous: float = 0.0, dry: float = 0.0, stations: int = 2000) -> PathDynamics:
    """A mass of 1 kg on a line with friction, force within 1 N; the grid is graded to where friction is steep."""
    t = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, stations + 1))
    ones = np.ones((stations + 1, 1))
    return PathDynamics(length * t, ones, 0 * ones, viscous * ones, dry * ones, [-1.0], [1.0])


@pytest.mark.parametrize("viscous", [0.1, 0.5, 2.0, 5.0])
def test_a_mass_in_a_viscous_fluid_has_the_closed_form(viscous: float) -> None:
    """Full force, then full braking: v' = 1 - f v, then v' = -1 - f v."""
    f, length = viscous, 0.7

    def distance(top: float) -> float:
        speeding, braking = -math.log(1.0 - f * top) / f, math.log(1.0 + f * top) / f
        return (speeding - top) / f + (top - braking) / f - length

    top = brentq(distance, 1e-9, (1.0 - 1e-15) / f)
    wanted = (math.log(1.0 + f * top) - math.log(1.0 - f * top)) / f
    motion = minimum_time(mass(length, viscous=viscous))
    assert motion.duration == pytest.approx(wanted, rel=2e-3)
    assert motion.duration >= wanted * (1.0 - 1e-6)
    assert motion.mu.max() == pytest.approx(top, rel=2e-3)


@pytest.mark.parametrize("dry", [0.1, 0.6])
def test_a_mass_on_a_rough_line_has_the_closed_form(dry: float) -> None:
    """Coulomb friction: 1 - c to speed up, 1 + c to brake."""
    wanted = math.sqrt(2.0 * 0.7 * (1.0 / (1.0 - dry) + 1.0 / (1.0 + dry)))
    assert minimum_time(mass(0.7, dry=dry)).duration == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("viscous", [0.0, 0.3, 1.0, 4.0])
def test_300_of_300_random_paths_are_planned_inside_the_limits(make_arm: Callable[..., Arm], viscous: float) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, damping=(viscous, viscous))
    worst, solved = 0.0, 0
    for seed in range(300):
        motion = minimum_time(PathDynamics.from_path(arm, random_path(seed)))
        worst, solved = max(worst, motion.certificate.excess), solved + 1
        assert motion.certificate.end_error == motion.certificate.end_speed_error == 0.0
    assert solved == 300
    assert worst <= 1e-3


@njit
def _programme(
    station: Floats, a: Floats, b: Floats, r: Floats, low: Floats, high: Floats, speed: Floats, cost: Floats
) -> float:
    """Minimum time over all motions between given speeds at the stations, limits asked for at both ends."""
    count, n = speed.shape[0], a.shape[1]
    here = np.empty(count)
    for i in range(station.shape[0] - 2, -1, -1):
        step = station[i + 1] - station[i]
        for k in range(count):
            here[k] = np.inf
            least, most = -np.inf, np.inf
            for j in range(n):
                rest = b[i, j] * speed[k] ** 2 + r[i, j] * speed[k]
                ends = ((low[i, j] - rest) / a[i, j], (high[i, j] - rest) / a[i, j])
                least, most = max(least, min(ends)), min(most, max(ends))
            first_m = np.searchsorted(speed, np.sqrt(max(speed[k] ** 2 + 2.0 * step * least, 0.0)))
            last_m = np.searchsorted(speed, np.sqrt(max(speed[k] ** 2 + 2.0 * step * most, 0.0))) + 1
            for m in range(first_m, min(last_m, count)):
                if cost[m] == np.inf or speed[k] + speed[m] == 0.0:
                    continue
                time = 2.0 * step / (speed[k] + speed[m]) + cost[m]
                if time >= here[k]:
                    continue
                u = (speed[m] ** 2 - speed[k] ** 2) / (2.0 * step)
                fits = True
                for j in range(n):
                    first = a[i, j] * u + b[i, j] * speed[k] ** 2 + r[i, j] * speed[k]
                    last = a[i + 1, j] * u + b[i + 1, j] * speed[m] ** 2 + r[i + 1, j] * speed[m]
                    fits = fits and low[i, j] <= first <= high[i, j] and low[i + 1, j] <= last <= high[i + 1, j]
                if fits:
                    here[k] = time
        cost[:] = here
    return float(cost[0])


@pytest.mark.parametrize(("seed", "viscous"), [(0, 1.0), (5, 0.3), (19, 4.0)])
def test_a_brute_force_dynamic_programme_finds_nothing_faster(
    make_arm: Callable[..., Arm], seed: int, viscous: float
) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=SLOW_LIMITS, damping=(viscous, viscous))
    full = PathDynamics.from_path(arm, random_path(seed), intervals=100)
    once = np.append(np.diff(full.grid) > 0.0, True)  # splines have no jumps
    plane = PhasePlane(
        PathDynamics(
            full.grid[once], full.M[once], full.Q[once], full.R[once], full.S[once],
            full.torque_min[0], full.torque_max[0],
        )
    )  # fmt: skip
    motion, rows = plane.fastest(), plane.rows
    mine = motion.duration
    speed = np.linspace(0.0, 1.02 * float(motion.mu.max()), 1300)
    cost = np.where(speed == 0.0, 0.0, np.inf)
    theirs = _programme(rows.station, rows.a, rows.b, rows.r, rows.low, rows.high, speed, cost)
    assert mine <= theirs * 1.001
    assert mine >= theirs * 0.97  # the programme's speeds are a grid


@pytest.mark.parametrize("viscous", [0.0, 1.0])
def test_a_thousand_intervals_are_within_a_third_of_a_percent_of_twenty_thousand(
    make_arm: Callable[..., Arm], viscous: float
) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, damping=(viscous, viscous))
    gaps = []
    for seed in range(20):
        coarse, fine = (
            PhasePlane(PathDynamics.from_path(arm, random_path(seed), intervals=intervals)).fastest().duration
            for intervals in (1000, 20_000)
        )
        gaps.append(coarse / fine - 1.0)
    assert min(gaps) > -1e-5
    assert max(gaps) < 0.0035


def test_friction_splits_the_controllable_set_and_the_diagnostics_say_where(make_arm: Callable[..., Arm]) -> None:
    """Two intervals at one station: with [min, max] for a set the torque would exceed its limit in between."""
    arm = make_arm(gravity=UPRIGHT, torque_max=SLOW_LIMITS, damping=(4.0, 4.0))
    split = islands = 0
    for seed in range(40):
        try:
            plane = PhasePlane(PathDynamics.from_path(arm, random_path(seed), intervals=300))
        except InfeasibleError:
            continue
        found = diagnose(plane)
        assert (np.diff(found.controllable[:, 0], axis=-1) >= 0.0).all()
        split += int(plane.counts.max() > 1)
        islands += len(found.islands)
        for island in found.islands:
            k = int(np.searchsorted(plane.rows.station, island.lam_first))
            if island.lam_first < island.lam_last or island.mu_high - island.mu_low < 1e-6:
                continue
            x = (0.5 * (island.mu_low + island.mu_high)) ** 2  # inside: no mu_dot meets all rows
            rows = plane.rows
            rest = rows.b[k] * x + rows.r[k] * math.sqrt(x)
            ends = np.sort(np.stack([(rows.low[k] - rest) / rows.a[k], (rows.high[k] - rest) / rows.a[k]]), axis=0)
            assert ends[0].max() > ends[1].min()
        assert (found.active >= -2).all()
        assert "torque of joint" in found.describe(int(np.flatnonzero(found.active >= 0)[0]))
    assert islands > 0
    assert split > 0


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 200), viscous=st.sampled_from([0.3, 1.0, 4.0]),
    commands=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30), dt=st.sampled_from([0.001, 0.004]),
)  # fmt: skip
@example(seed=0, viscous=4.0, commands=[1.0, 0.0, 0.0], dt=0.001)  # comes to rest inside a piece: its friction is gone
def test_commands_keep_the_limits_with_friction_too(
    make_arm: Callable[..., Arm], seed: int, viscous: float, commands: list[float], dt: float
) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, damping=(viscous, viscous))
    plane = refined_plane(PathDynamics.from_path(arm, random_path(seed)), tick=dt)
    motion = plane.motion([*commands, 1.0], [*[dt] * len(commands), math.inf])
    assert motion.lam[-1] == plane.length
    assert motion.mu[-1] == pytest.approx(0.0, abs=1e-6)
    assert motion.certificate.excess < 2e-3


def test_coulomb_friction_jumps_where_a_joint_turns_back(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, coulomb=(3.0, 1.0))
    for seed in range(10):
        path = random_path(seed)
        dynamics = PathDynamics.from_path(arm, path)
        jumps = np.abs(np.diff(dynamics.S, axis=0))[np.diff(dynamics.grid) == 0.0]
        assert jumps.max() == pytest.approx(6.0) or jumps.max() == pytest.approx(2.0)  # from one sign to the other
        motion = minimum_time(dynamics)
        assert motion.certificate.excess <= 1e-3


def test_acceleration_limits_of_the_joints_are_kept(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, acceleration_max=(6.0, None), damping=(0.3, 0.3))
    for seed in range(10):
        dynamics = PathDynamics.from_path(arm, random_path(seed))
        assert dynamics.M.shape[1] == 3
        motion = minimum_time(dynamics)
        certificate = motion.certificate
        assert 0.99 < certificate.acceleration_ratio_max <= 1.001
        assert certificate.excess <= 1e-3
        assert motion.torque().shape[-1] == 2
        assert "acceleration of joint" in " ".join(diagnose(PhasePlane(dynamics)).limits)


def test_a_speed_cap_may_vary_along_the_path(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(torque_max=LIMITS, damping=(0.3, 0.3))
    path = random_path(3)
    slow_half = PathDynamics.from_path(arm, path, speed_max=lambda lam: np.where(lam < 0.5 * path.length, 0.4, 9.0))
    motion = minimum_time(slow_half)
    before = motion.lam < 0.5 * path.length
    assert motion.mu[before].max() == pytest.approx(0.4, rel=1e-6)
    assert motion.mu[~before].max() > 0.5
    assert minimum_time(PathDynamics.from_path(arm, path, speed_max=0.4)).mu.max() == pytest.approx(0.4)


@pytest.mark.parametrize("viscous", [0.0, 1.0])
@pytest.mark.parametrize("longer", [1.0, 1.0001, 1.3, 5.0, 100.0])
def test_a_duration_longer_than_the_minimum_is_met_exactly(
    make_arm: Callable[..., Arm], viscous: float, longer: float
) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=LIMITS, damping=(viscous, viscous))
    plane = PhasePlane(PathDynamics.from_path(arm, random_path(2)))
    wanted = longer * plane.fastest().duration
    motion = plane.with_duration(wanted)
    assert motion.duration == pytest.approx(wanted, rel=1e-9)
    assert motion.certificate.excess <= 1e-3
    with pytest.raises(InfeasibleError, match="the minimum is"):
        plane.with_duration(0.99 * plane.fastest().duration)


def test_an_arm_that_cannot_hold_still_has_a_slowest_motion(make_arm: Callable[..., Arm]) -> None:
    """Limits below the static torque for a while: the arm swings through."""
    for seed in range(300):
        arm = make_arm(gravity=UPRIGHT, torque_max=(26.0, 7.0), damping=(0.3, 0.3))
        try:
            plane = PhasePlane(PathDynamics.from_path(arm, random_path(seed)))
        except InfeasibleError:
            continue
        if not plane.holdable.all() and plane.holdable[0]:
            assert plane.with_duration(3.0 * plane.fastest().duration).duration == pytest.approx(
                3.0 * plane.fastest().duration
            )  # it waits at the start, where it can
            return
    pytest.fail("no such path among the seeds")


def test_what_stops_an_arm_is_named(make_arm: Callable[..., Arm]) -> None:
    arm = make_arm(gravity=UPRIGHT, torque_max=(20.0, 5.0), name="weak")
    dynamics = PathDynamics.from_path(arm, random_path(0))
    with pytest.raises(InfeasibleError, match=r"joint '\w+' of arm 'weak' needs .* N m to hold still at station"):
        minimum_time(dynamics)


@pytest.fixture(scope="module", params=["panda", "ur5e"])
def real_arm(request: pytest.FixtureRequest) -> Arm:
    """A 7-axis and a 6-axis arm with acceleration limits and plausible friction."""
    if request.param == "ur5e":
        return Arm.from_urdf(
            data_path("robots/ur5e_like.urdf"), acceleration_max=(20.0,) * 6,
            damping=(2.0,) * 3 + (0.3,) * 3, coulomb=(3.0,) * 3 + (0.5,) * 3,
        )  # fmt: skip
    return Arm.from_urdf(
        Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf", tip_link="panda_hand",
        torque_max=(87.0,) * 4 + (12.0,) * 3, acceleration_max=(15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0),
        damping=(1.0,) * 4 + (0.5,) * 3, coulomb=(0.5,) * 4 + (0.2,) * 3,
    )  # fmt: skip


def test_six_and_seven_axes_with_all_limits_and_all_friction(real_arm: Arm) -> None:
    low, high = np.maximum(real_arm.position_min, -2.9), np.minimum(real_arm.position_max, 2.9)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    active: set[str] = set()
    for seed in range(20):
        knots = middle + 0.5 * half * np.random.default_rng(seed).uniform(-1.0, 1.0, (5, real_arm.dof))
        motion = minimum_time(PathDynamics.from_path(real_arm, JointPath.through(knots)))
        assert motion.certificate.excess <= 1e-3
        found = diagnose(PhasePlane(motion.dynamics), motion)
        active |= {found.describe(k).split(" of ")[0] for k in range(len(found.active))}
    assert {"the torque", "the acceleration", "speed limit"} <= active


@pytest.mark.parametrize("intervals", [500, 1000, 8000])
def test_bands_far_above_take_no_room(intervals: int) -> None:
    """An iiwa with friction has more bands than there is room for, all of them above what it can reach."""
    cell = next(one for one in benchmark_instances(family="iiwa") if one.index == 1).build()
    for arm, path, motion in zip(cell.arms, cell.paths, cell.fastest, strict=True):
        plane = PhasePlane(PathDynamics.from_path(arm, path, intervals=intervals))
        assert plane.fastest().duration == pytest.approx(motion.duration, rel=0.01)
