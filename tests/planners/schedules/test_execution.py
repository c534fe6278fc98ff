"""Execution by precedence: on time when nobody is late, behind when somebody is, and never stuck in small lags."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.planners import CoordinationCell, Schedule, schedule
from armtempo.planners.schedules import ScheduleExecution
from armtempo.planners.schedules._execution import _command_to, _reachable, checks_per_period, foresee


@pytest.fixture(scope="module")
def plan(lee1991: CoordinationCell) -> Schedule:
    return schedule(lee1991, "delay")


def run(
    plan: Schedule, execution: ScheduleExecution, *, late: tuple[float, float] = (0.0, 0.0)
) -> tuple[Floats, list[float]]:
    """Places (K, 2) at every decision and when each arm arrives, with arms that do not listen before a time [s]."""
    cell = plan.cell
    lam, mu, arrived = np.zeros(2), np.zeros(2), [np.inf, np.inf]
    rows = [lam.copy()]
    execution.reset()
    for period in range(400):
        time = period * cell.control_period
        commands = execution.commands(lam.copy(), mu.copy())
        for i, plane in enumerate(cell.planes):
            if lam[i] >= plane.length:
                continue
            command = 0.0 if time < late[i] else float(commands[i])
            steps = plane.edges.steps
            lam[i], mu[i], used = foresee(
                steps, lam[i], mu[i], command, execution.mode == "speed", cell.physics_tick, cell.ticks_per_period
            )
            if lam[i] >= plane.length:
                arrived[i] = time + used
        rows.append(lam.copy())
        if np.isfinite(arrived).all():
            return np.array(rows), arrived
    raise AssertionError("somebody never arrived")


def test_undisturbed_it_arrives_with_the_plan(plan: Schedule) -> None:
    rows, arrived = run(plan, ScheduleExecution(plan))
    assert max(arrived) <= plan.makespan + plan.cell.control_period
    for k, row in enumerate(rows[:-1]):
        planned = [float(motion.at(k * plan.cell.control_period)[0]) for motion in plan.trajectories]
        assert (row <= np.array(planned) + 1e-5).all()  # never ahead


@pytest.mark.parametrize("late", [0.02, 0.15])
def test_behind_a_late_arm_the_other_waits_and_both_keep_clear(plan: Schedule, late: float) -> None:
    cell = plan.cell
    first, second = plan.order
    delays = (late, 0.0) if first == 0 else (0.0, late)
    rows, arrived = run(plan, ScheduleExecution(plan), late=delays)
    chart = cell.chart_between(0, 1)
    assert all(chart.is_free(float(a), float(b)) for a, b in np.minimum(rows, [plane.length for plane in cell.planes]))
    assert plan.makespan < max(arrived) < plan.makespan + late + 0.05
    assert arrived[second] > arrived[first]


def test_a_reset_forgets_the_clocks(plan: Schedule) -> None:
    execution = ScheduleExecution(plan)
    once = run(plan, execution, late=(0.1, 0.0))[0]
    np.testing.assert_array_equal(run(plan, execution, late=(0.1, 0.0))[0], once)


def test_the_command_to_a_place_is_the_largest_that_does_not_pass_it(lee1991: CoordinationCell) -> None:
    plane, tick = lee1991.planes[0], lee1991.physics_tick
    steps, ticks = plane.edges.steps, lee1991.ticks_per_period
    lam, mu = 0.3 * plane.length, 0.5 * float(plane.upper(0.3 * plane.length))
    slowest, fastest = (foresee(steps, lam, mu, command, True, tick, ticks)[0] for command in (0.0, 1.0))
    for share in (0.1, 0.5, 0.9):
        target = slowest + share * (fastest - slowest)
        command = _command_to(steps, lam, mu, True, tick, ticks, target, 0.0, 0.0)
        assert foresee(steps, lam, mu, command, True, tick, ticks)[0] == pytest.approx(target, abs=1e-7)
        assert foresee(steps, lam, mu, command, True, tick, ticks)[0] <= target
    assert _command_to(steps, lam, mu, True, tick, ticks, fastest, 0.0, 0.0) == 1.0
    assert _command_to(steps, lam, mu, True, tick, ticks, slowest - 1e-3, 0.0, 0.0) < 1e-6
    assert _command_to(steps, lam, 0.0, True, tick, ticks, lam, 0.0, 1e-9) == 0.0  # at rest where it is to be


def test_no_arm_arrives_before_its_time(lee1991: CoordinationCell) -> None:
    plane, tick, ticks = lee1991.planes[0], lee1991.physics_tick, lee1991.ticks_per_period
    steps, motion = plane.edges.steps, plane.fastest()
    period = lee1991.control_period
    lam, mu, _ = (float(part) for part in motion.at(motion.duration - 0.6 * period))
    mu *= 0.7  # slower than the fastest motion: it may choose when it arrives
    reached, _, soonest = foresee(steps, lam, mu, 1.0, True, tick, ticks)
    assert reached >= plane.length
    earliest = 0.5 * (soonest + period)
    command = _command_to(steps, lam, mu, True, tick, ticks, 2.0 * plane.length, earliest, 0.0)
    assert 0.0 < command < 1.0
    reached, _, used = foresee(steps, lam, mu, command, True, tick, ticks)
    assert reached < plane.length or used >= earliest
    reached, _, used = foresee(steps, lam, mu, command + 1e-3, True, tick, ticks)
    assert reached >= plane.length
    assert used < earliest


def test_limits_are_asked_once_per_tick_or_oftener(lee1991: CoordinationCell) -> None:
    checks = checks_per_period(lee1991)
    assert checks % lee1991.ticks_per_period == 0
    assert lee1991.control_period / checks <= 0.0015


def test_who_is_waited_for_is_found_through_others() -> None:
    waits: list[tuple[int, ...]] = [(1,), (2,), (), (0, 3), (5,), (4,)]
    assert _reachable(0, waits) == {1, 2}
    assert _reachable(3, waits) == {0, 1, 2, 3}
    assert _reachable(2, waits) == set()
    assert _reachable(4, waits) == {4, 5}  # a ring
