"""Dwells take exactly their time and stops are stops, whoever plans, and whatever arms are told."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from armtempo.planners import (
    METHODS,
    CoordinationCell,
    JointPath,
    PathDynamics,
    PhasePlane,
    load_cell,
    minimum_time,
    schedule,
)
from armtempo.planners.joint_paths import Wait
from armtempo.planners.schedules._trapezoidal import trapezoidal
from armtempo.planners.topp import Mode, refined_plane
from armtempo.robots import Arm

DWELL = 0.1
EXACT = 1e-6  # [s]


@pytest.fixture(scope="module")
def corner(lee1991: CoordinationCell) -> tuple[Arm, list[JointPath]]:
    """The paper's first arm, and two moves that meet in a sharp corner."""
    path = lee1991.paths[0]
    a, b, c = path.evaluate(path.length * np.array([0.0, 0.5, 1.0]))[0]
    middle = b + np.array([0.3, -0.2])
    moves: list[JointPath] = [JointPath.through([a, b, middle]), JointPath.through([middle, c])]  # type: ignore[list-item]
    return lee1991.arms[0], moves


def apart(arm: Arm, moves: list[JointPath]) -> float:
    """What the moves take one after the other [s]."""
    return sum(minimum_time(PathDynamics.from_path(arm, move, intervals=4000)).duration for move in moves)


@pytest.mark.parametrize("dwell", [1e-3, DWELL, 2.0])
def test_a_dwell_takes_its_time_to_a_microsecond(corner: tuple[Arm, list[JointPath]], dwell: float) -> None:
    arm, (first, second) = corner
    path = JointPath.sequence([first, dwell, second])
    motion = minimum_time(PathDynamics.from_path(arm, path))
    _, start, stop, _ = path.border
    at_end = motion.time[np.flatnonzero(motion.lam == stop)[0]]
    at_start = motion.time[np.flatnonzero(motion.lam == start)[-1]]
    assert at_end - at_start == pytest.approx(dwell, abs=EXACT)
    assert motion.certificate.dwell_error_max == pytest.approx(abs(at_end - at_start - dwell), abs=1e-7)
    assert motion.certificate.excess <= 1e-3


def test_a_corner_costs_what_its_moves_take_apart(corner: tuple[Arm, list[JointPath]]) -> None:
    arm, moves = corner
    path = JointPath.sequence(moves)
    for intervals, share in ((500, 2e-3), (1000, 1e-3), (4000, 1e-4)):
        motion = PhasePlane(PathDynamics.from_path(arm, path, intervals=intervals)).fastest()
        assert motion.duration == pytest.approx(apart(arm, moves), rel=share)
    assert motion.mu[motion.lam == path.border[1]].tolist() == [0.0, 0.0]


def test_a_wait_takes_its_time_at_least_and_may_take_more(corner: tuple[Arm, list[JointPath]]) -> None:
    arm, (first, second) = corner
    path = JointPath.sequence([first, Wait(0.01), second])
    plane = PhasePlane(PathDynamics.from_path(arm, path))
    fastest = plane.fastest()
    assert fastest.duration == pytest.approx(apart(arm, [first, second]) + 0.01, rel=1e-3)
    assert fastest.waiting(int(np.flatnonzero(fastest.lam == path.border[1])[0]), 0.5).dwell_error == 0.0
    assert plane.holdable.all()
    assert not plane.dwelling.any()


@pytest.mark.parametrize("mode", get_args(Mode))
def test_no_command_is_left_standing_before_a_stop(corner: tuple[Arm, list[JointPath]], mode: Mode) -> None:
    """An arm at rest in the interval before a stop stayed there for ever: 186 of 400 random sequences."""
    arm, (first, second) = corner
    plane = refined_plane(PathDynamics.from_path(arm, JointPath.sequence([first, Wait(0.001), DWELL, second])))
    generator = np.random.default_rng(7)
    for _ in range(200):
        lam = mu = 0.0
        for _ in range(3000):
            command = float(generator.choice([generator.uniform(), 0.0, 1.0], p=[0.7, 0.1, 0.2]))
            lam, mu, _ = plane.advance(lam, mu, command, 0.004, mode=mode)
            if lam >= 1.0:
                break
        assert lam == 1.0


@pytest.mark.parametrize("mode", get_args(Mode))
def test_no_command_stretches_a_dwell(corner: tuple[Arm, list[JointPath]], mode: Mode) -> None:
    arm, (first, second) = corner
    path = JointPath.sequence([first, DWELL, second])
    plane = refined_plane(PathDynamics.from_path(arm, path, intervals=1000))
    generator = np.random.default_rng(3)
    for _ in range(20):
        commands = np.maximum(generator.uniform(-0.3, 1.0, 2500), 0.0)
        motion = plane.motion(commands, np.full(2500, 0.004), mode=mode)
        if motion.lam[-1] >= path.border[2]:
            assert motion.dwell_error < 4e-4 * DWELL  # standing a billionth of the path before its end is there
            assert motion.certificate.torque_ratio_max < 1.0 + 1e-3


def test_at_a_stop_an_arm_waits_until_it_is_told_to_go(corner: tuple[Arm, list[JointPath]]) -> None:
    arm, (first, second) = corner
    path = JointPath.sequence([first, DWELL, second])
    plane = PhasePlane(PathDynamics.from_path(arm, path))
    start, stop = path.border[1:3]
    assert plane.advance(start, 0.0, 0.0, 1.0) == (start, 0.0, 1.0)
    lam, mu, _ = plane.advance(start, 0.0, 1e-3, 0.5 * DWELL)
    assert lam == pytest.approx(0.5 * (start + stop), rel=1e-6)  # by its own clock
    lam, mu, _ = plane.advance(lam, mu, 0.0, DWELL)
    assert (lam, mu) == (stop, 0.0)  # the dwell is over, and nobody says go on
    assert plane.dwelling.sum() == 8  # rows inside


@pytest.mark.parametrize("factor", [1.3, 5.0, 60.0])
def test_slower_motions_wait_elsewhere(corner: tuple[Arm, list[JointPath]], factor: float) -> None:
    arm, (first, second) = corner
    plane = PhasePlane(PathDynamics.from_path(arm, JointPath.sequence([first, DWELL, second])))
    motion = plane.with_duration(factor * plane.fastest().duration)
    assert motion.duration == pytest.approx(factor * plane.fastest().duration)
    assert motion.dwell_error < EXACT


@pytest.mark.parametrize("ramp", [0.25, 0.5])
def test_trapezoids_are_those_of_every_move(corner: tuple[Arm, list[JointPath]], ramp: float) -> None:
    arm, (first, second) = corner
    plane = PhasePlane(PathDynamics.from_path(arm, JointPath.sequence([first, DWELL, second]), intervals=1000))
    motion = trapezoidal(plane, ramp)
    alone = [
        trapezoidal(PhasePlane(PathDynamics.from_path(arm, move, intervals=1000)), ramp) for move in (first, second)
    ]
    assert motion.duration == pytest.approx(sum(one.duration for one in alone) + DWELL, rel=2e-3)
    assert motion.certificate.torque_ratio_max == pytest.approx(1.0, abs=5e-3)
    assert motion.dwell_error < EXACT


def test_the_speed_beside_a_stop_is_no_excess(corner: tuple[Arm, list[JointPath]]) -> None:
    """Zero over a cap of zero was an excess of 1e144 %."""
    arm, moves = corner
    plane = refined_plane(PathDynamics.from_path(arm, JointPath.sequence(moves), intervals=600, speed_max=1.0))
    assert len(plane.rows.station) < 700  # and was refined in vain
    assert plane.fastest().certificate.speed_ratio_max == pytest.approx(1.0, abs=1e-3)


def test_a_part_between_stops_can_be_planned_by_itself(corner: tuple[Arm, list[JointPath]]) -> None:
    arm, (first, second) = corner
    path = JointPath.sequence([first, DWELL, second])
    dynamics = PathDynamics.from_path(arm, path)
    _, start, stop, _ = path.border
    parts = [PhasePlane(dynamics.between(*ends)).fastest() for ends in ((0.0, start), (start, stop), (stop, 1.0))]
    assert sum(part.duration for part in parts) == pytest.approx(PhasePlane(dynamics).fastest().duration, rel=1e-3)
    assert parts[1].duration == pytest.approx(DWELL, abs=EXACT)


def test_jerk_limits_hold_beside_dwells() -> None:
    arm = load_cell("panda-pair").arms[0]
    q = load_cell("panda-pair").paths[0].waypoints  # type: ignore[attr-defined]
    moves = [JointPath.through(q), JointPath.through(q[::-1])]
    motion = minimum_time(PathDynamics.from_path(arm, JointPath.sequence([moves[0], 0.3, moves[1]])), jerk=True)
    alone = [minimum_time(PathDynamics.from_path(arm, move), jerk=True).duration for move in moves]
    assert motion.duration == pytest.approx(sum(alone) + 0.3, rel=1e-3)
    assert motion.certificate.jerk_ratio_max < 1.0 + 1e-3
    assert motion.certificate.dwell_error_max < EXACT


@pytest.mark.parametrize("method", METHODS)
def test_every_method_keeps_dwells(there_and_back: CoordinationCell, method: str) -> None:
    plan = schedule(there_and_back, method)
    assert plan.gap_percent > -0.1
    assert plan.certificate.certified_free
    assert plan.certificate.min_clearance >= there_and_back.d_min
    assert plan.certificate.torque_ratio_max < 1.0 + 1e-3
    # velocity control moves by ticks, see above
    assert all(motion.dwell_error < (EXACT if method != "vci" else 2e-6) for motion in plan.trajectories)
    plan.precedence.check_deadlock_free()


def test_the_best_plan_is_near_the_bound(there_and_back: CoordinationCell) -> None:
    """Coarse lattices skipped the stop's station: 1.12 times as long."""
    assert schedule(there_and_back, "optimal").gap_percent < 1.0
    assert schedule(there_and_back, "interval").gap_percent < 1.0
