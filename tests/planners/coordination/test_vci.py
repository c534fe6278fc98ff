"""Velocity control intervals: both cases of the paper (Figs. 3 and 4), and control behind a master as it comes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, CoordinationChart, PhaseTrajectory, VelocityControl
from armtempo.planners.coordination import VciPlan
from armtempo.planners.topp import Mode


def wall(like: CoordinationChart, release: float, place: float) -> CoordinationChart:
    """One rectangle: with the master before ``release`` (share of its path), the slave may not be past ``place``."""
    states = np.zeros((512, 512), dtype=np.uint8)
    states[: int(release * 512), int(place * 512) : int(place * 512) + 60] = 2
    return CoordinationChart(states=states, length_a=like.length_a, length_b=like.length_b, d_min=like.d_min)


def control(
    cell: CoordinationCell, *, period: float = 0.004, chart: CoordinationChart | None = None, checks: int = 0
) -> VelocityControl:
    return VelocityControl(
        slave=cell.planes[1],
        masters=(cell.planes[0],),
        charts=(chart or cell.chart,),
        period=period,
        checks=checks,
    )


def last_correction(plan: VciPlan) -> tuple[int, int, int, Floats]:
    """Step of the collision, first step of its VCI, adjusted step, and the commands from the VCI on."""
    hit, first, adjusted = (int(value) for value in plan.history[-1, :3])
    return hit, first, adjusted, plan.commands


@pytest.mark.parametrize(("period", "release"), [(0.004, 0.6), (0.002, 0.525), (0.002, 0.75)])
def test_fig_3_the_last_step_of_the_interval_is_adjusted(
    lee1991: CoordinationCell, period: float, release: float
) -> None:
    plan = control(lee1991, period=period, chart=wall(lee1991.chart, release, 0.3)).plan(lee1991.fastest[:1])
    assert plan.last_step_adjusted > 0
    hit, first, adjusted, commands = last_correction(plan)
    assert first < adjusted == hit
    assert (commands[first:hit] == 0.0).all()  # maximum braking over all but the last step
    assert 0.0 < commands[hit] < 1.0
    assert commands[hit] == plan.history[-1, 3]
    assert (commands[hit + 1 :] == 1.0).all()


@pytest.mark.parametrize(("period", "release", "place"), [(0.004, 0.375, 0.3), (0.004, 0.75, 0.7), (0.002, 0.75, 0.5)])
def test_fig_4_an_earlier_step_is_adjusted_and_full_acceleration_follows(
    lee1991: CoordinationCell, period: float, release: float, place: float
) -> None:
    plan = control(lee1991, period=period, chart=wall(lee1991.chart, release, place)).plan(lee1991.fastest[:1])
    assert plan.earlier_step_adjusted > 0
    hit, first, adjusted, commands = last_correction(plan)
    assert first <= adjusted < hit
    assert (commands[first:adjusted] == 0.0).all()
    assert 0.0 < commands[adjusted] < 1.0
    assert (commands[adjusted + 1 :] == 1.0).all()  # the rest of the VCI too
    assert plan.longest_interval >= (hit - first + 1) * period - 1e-12


def test_a_single_correction_is_the_shortest_interval_that_avoids_the_collision(lee1991: CoordinationCell) -> None:
    """With one step of braking less, the slave collides."""
    chart = wall(lee1991.chart, 0.525, 0.5)
    own = control(lee1991, chart=chart)
    plan = own.plan(lee1991.fastest[:1])
    assert plan.corrections == 1
    hit, first, _, _ = last_correction(plan)
    assert hit - first + 1 > 1
    released = float(lee1991.fastest[0].time_at(int(0.525 * 512) * chart.step_a))
    corner = int(0.5 * 512) * chart.step_b
    for start, safe in ((first, True), (first + 1, False)):
        commands = np.ones(hit + 2)
        commands[start:] = 0.0
        motion = lee1991.planes[1].motion(commands, np.full(hit + 2, own.period), mode="acceleration")
        end = min(released, (hit + 1) * own.period)
        assert (float(motion.at(end)[0]) <= corner) is safe


def test_the_papers_cell_reaches_both_cases(lee1991: CoordinationCell) -> None:
    plan = control(lee1991, period=0.001).plan(lee1991.fastest[:1])
    assert plan.last_step_adjusted > 0
    assert plan.earlier_step_adjusted > 0
    assert plan.corrections == plan.last_step_adjusted + plan.earlier_step_adjusted


def test_the_adjusted_motion_grazes_the_collision_point(lee1991: CoordinationCell) -> None:
    """The room that is left is used: the slave passes the wall's corner within a check of its release."""
    for release, place in ((0.6, 0.4), (0.8, 0.5), (0.7, 0.3)):
        chart = wall(lee1991.chart, release, place)
        plan = control(lee1991, chart=chart).plan(lee1991.fastest[:1])
        released = float(lee1991.fastest[0].time_at(int(release * 512) * chart.step_a))
        reached = float(plan.trajectory.time_at(int(place * 512) * chart.step_b))
        assert -1e-9 <= reached - released < 0.004 + 1e-3


def test_nothing_to_avoid_nothing_to_brake_for(lee1991: CoordinationCell) -> None:
    free = wall(lee1991.chart, 0.0, 0.5)
    plan = control(lee1991, chart=free).plan(lee1991.fastest[:1])
    assert (plan.commands == 1.0).all()
    assert plan.corrections == 0
    assert plan.longest_interval == 0.0
    assert plan.trajectory.duration == pytest.approx(lee1991.fastest[1].duration, rel=1e-3)
    passed = wall(lee1991.chart, 0.05, 0.5)  # released long before the slave comes
    assert control(lee1991, chart=passed).plan(lee1991.fastest[:1]).corrections == 0


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_both_modes_are_safe_and_quick(lee1991: CoordinationCell, mode: Mode) -> None:
    own = VelocityControl(
        slave=lee1991.planes[1],
        masters=(lee1991.planes[0],),
        charts=(lee1991.chart,),
        period=0.002,
        mode=mode,
    )
    plan = own.plan(lee1991.fastest[:1])
    assert 0.3283 < plan.trajectory.duration < 0.35
    assert plan.trajectory.certificate.excess < 1e-3


Master = Callable[[int], float]


def simulate(
    cell: CoordinationCell, master: Master, *, ticks: int = 4, exact: bool = True, most: float = 3.0
) -> tuple[float, float, int, float]:
    """Slave behind any master; arrival times, ticks in a cell that is not free, and how far past C the slave was.

    ``exact``: the control foresees the motion in the same ticks in which it is executed.
    """
    tick = 0.001
    own = control(cell, period=tick * ticks, checks=ticks if exact else 0)
    chart = cell.chart
    a, b = [0.0, 0.0], [0.0, 0.0]
    arrival = [np.inf, np.inf]
    command, outside, past = 0.0, 0, 0.0
    commands: list[float] = []
    expected = (-1.0, -1.0)
    for n in range(round(most / tick)):
        if n % ticks == 0:
            if not commands or max(abs(b[0] - expected[0]), abs(a[0] - expected[1])) > 1e-4:
                try:
                    commands = list(own.plan(own.expected([(a[0], a[1])]), b[0], b[1]).commands)
                except InfeasibleError:
                    commands = [0.0]
            command = own.guarded(commands.pop(0) if commands else 1.0, b[0], b[1], [(a[0], a[1])])
            expected = (
                cell.planes[1].advance(b[0], b[1], command, own.period, mode="acceleration")[0],
                cell.planes[0].advance(a[0], a[1], 1.0, own.period)[0],
            )
        before = (a[0], b[0])
        a[0], a[1], used_a = cell.planes[0].advance(a[0], a[1], master(n), tick)
        b[0], b[1], used_b = cell.planes[1].advance(b[0], b[1], command, tick, mode="acceleration")
        arrival[0] = min(arrival[0], n * tick + used_a) if a[0] >= chart.length_a else np.inf
        arrival[1] = min(arrival[1], n * tick + used_b) if b[0] >= chart.length_b else np.inf
        past = max(past, b[0] - float(chart.closure[max(int(a[0] / chart.step_a - 1e-9), 0)]))
        if not chart.is_free((before[0], a[0]), (before[1], b[0])) and not (
            chart.is_free(*before)
            and chart.is_free(a[0], b[0])
            and chart.is_free(*np.mean([before, (a[0], b[0])], axis=0))
        ):
            outside += 1
        if max(arrival) < np.inf:
            break
    return arrival[0], arrival[1], outside, past


@pytest.mark.parametrize("ticks", [1, 4, 5])
@pytest.mark.parametrize("late", [0.0, 0.03, 0.1, 0.15])
def test_on_line_behind_a_master_that_starts_late(lee1991: CoordinationCell, late: float, ticks: int) -> None:
    master, slave, outside, past = simulate(lee1991, lambda n: float(n * 0.001 >= late - 1e-12), ticks=ticks)
    assert outside == 0
    assert past <= 0.0
    assert master == pytest.approx(0.2862 + late, abs=0.002)
    assert slave < 0.345 + late + 0.02


@pytest.mark.parametrize("seed", range(8))
def test_on_line_behind_a_master_that_stops_and_goes(lee1991: CoordinationCell, seed: int) -> None:
    rng = np.random.default_rng(seed)
    commands = np.repeat(rng.choice([0.0, 0.0, 0.3, 1.0], 400), rng.integers(5, 80, 400))
    commands[rng.integers(700, 1200) :] = 1.0  # at last it goes on
    master, slave, outside, past = simulate(lee1991, lambda n: float(commands[n]))
    assert outside == 0
    assert past <= 0.0
    assert master < 1.6
    assert slave < master + 0.35


def test_foreseen_in_finer_steps_than_executed_the_slave_overruns_by_less_than_the_reserve(
    lee1991: CoordinationCell,
) -> None:
    for late in (0.03, 0.15):
        _, slave, _, past = simulate(lee1991, lambda n, late=late: float(n * 0.001 >= late - 1e-12), exact=False)  # type: ignore[misc]
        assert past < 0.2 * lee1991.config.clearance_reserve_m
        assert slave < 0.345 + late + 0.02


def test_a_master_that_stands_still_is_waited_for(lee1991: CoordinationCell) -> None:
    own = control(lee1991, checks=1)
    lam = mu = 0.0
    for _ in range(200):
        lam, mu, _ = lee1991.planes[1].advance(
            lam, mu, own.guarded(1.0, lam, mu, [(0.05, 0.0)]), 0.004, mode="acceleration"
        )
    assert lee1991.chart.is_free(0.05, lam)
    assert mu < 1e-3
    assert lam == pytest.approx(
        float(lee1991.chart.closure[int(0.05 / lee1991.chart.step_a)]), abs=0.01
    )  # as far as it may


def test_behind_an_arrived_master_the_way_is_free(lee1991: CoordinationCell) -> None:
    own = control(lee1991)
    assert own.guarded(1.0, 0.0, 0.0, [(lee1991.paths[0].length, 0.0)]) == 1.0
    assert own.expected([(lee1991.paths[0].length, 0.0)])[0].duration == 0.0
    assert (own.plan(own.expected([(lee1991.paths[0].length, 0.0)])).commands == 1.0).all()


def boxes(like: CoordinationChart, *regions: tuple[float, float, float, float]) -> CoordinationChart:
    """Blocked boxes (master from, to, slave from, to) in shares of the paths."""
    states = np.zeros((512, 512), dtype=np.uint8)
    for a, a_end, b, b_end in regions:
        states[int(a * 512) : int(a_end * 512), int(b * 512) : int(b_end * 512)] = 2
    return CoordinationChart(states=states, length_a=like.length_a, length_b=like.length_b, d_min=like.d_min)


MASTER_FIRST = (0.2, 0.45, 0.4, 0.5)  # both at full speed: the slave would be there with the master
SLAVE_FIRST = (0.75, 0.95, 0.4, 0.65)  # the slave has left when the master comes


def free_all_the_way(chart: CoordinationChart, master: PhaseTrajectory, slave: PhaseTrajectory, until: float) -> bool:
    instants = np.arange(0.0, until, 0.0002)
    a, b = (motion.at(np.minimum(instants, motion.duration))[0].tolist() for motion in (master, slave))
    boxes = zip(pairwise(a), pairwise(b), strict=True)
    return all(chart.is_free(x if x[0] < x[1] else x[0], y if y[0] < y[1] else y[0]) for x, y in boxes)


def test_a_slave_that_passes_first_does_not_brake(lee1991: CoordinationCell) -> None:
    """Test (a) of the research: today's paper takes every region for the master's."""
    chart = boxes(lee1991.chart, SLAVE_FIRST)
    plan = control(lee1991, chart=chart).plan(lee1991.fastest[:1])
    assert plan.corrections == 0
    assert (plan.commands == 1.0).all()
    assert plan.trajectory.duration == pytest.approx(lee1991.fastest[1].duration, rel=1e-3)
    assert free_all_the_way(chart, lee1991.fastest[0], plan.trajectory, 0.28)


def test_two_regions_in_opposite_orders(lee1991: CoordinationCell) -> None:
    """It brakes for the first as if it were alone, and passes the second before the master."""
    alone = control(lee1991, chart=boxes(lee1991.chart, MASTER_FIRST)).plan(lee1991.fastest[:1])
    assert alone.corrections > 0
    late = (0.85, 0.95, 0.55, 0.6)  # far enough that braking for the first does not spoil it
    chart = boxes(lee1991.chart, MASTER_FIRST, late)
    plan = control(lee1991, chart=chart).plan(lee1991.fastest[:1])
    np.testing.assert_array_equal(plan.commands, alone.commands)
    assert free_all_the_way(chart, lee1991.fastest[0], plan.trajectory, 0.28)
    master_in = float(lee1991.fastest[0].time_at(0.85 * chart.length_a))
    assert float(plan.trajectory.time_at(0.6 * chart.length_b)) < master_in


def test_what_braking_spoils_goes_to_the_master(lee1991: CoordinationCell) -> None:
    """At full speed the slave would pass the second region first; behind the first one it no longer does."""
    soon = (0.62, 0.95, 0.55, 0.6)
    assert control(lee1991, chart=boxes(lee1991.chart, soon)).plan(lee1991.fastest[:1]).corrections == 0
    chart = boxes(lee1991.chart, MASTER_FIRST, soon)
    plan = control(lee1991, chart=chart).plan(lee1991.fastest[:1])
    assert free_all_the_way(chart, lee1991.fastest[0], plan.trajectory, plan.trajectory.duration)
    master_out = float(lee1991.fastest[0].time_at(0.95 * chart.length_a))
    assert float(plan.trajectory.time_at(0.55 * chart.length_b)) > master_out - 1e-3


def test_a_start_in_the_way_and_a_master_that_parks_there(lee1991: CoordinationCell) -> None:
    """Tests (c) and (d): the slave must pass first; where it cannot, velocity control says why."""
    for region in ((0.6, 0.8, 0.0, 0.2), (0.8, 1.0, 0.3, 0.4)):
        chart = boxes(lee1991.chart, region)
        assert control(lee1991, chart=chart).plan(lee1991.fastest[:1]).corrections == 0
    with pytest.raises(InfeasibleError, match="even if it brakes at once") as start:
        control(lee1991, chart=boxes(lee1991.chart, (0.1, 0.8, 0.0, 0.6))).plan(lee1991.fastest[:1])
    assert start.value.data["reason"] == "braking from the start is not enough"
    with pytest.raises(InfeasibleError, match="ends in the way") as end:
        control(lee1991, chart=boxes(lee1991.chart, (0.5, 1.0, 0.6, 0.7))).plan(lee1991.fastest[:1])
    assert end.value.data["reason"] == "parked in the way"


def test_a_slave_does_not_park_where_the_master_still_has_to_pass(lee1991: CoordinationCell) -> None:
    """Its end is in the region: having arrived there is not having left it."""
    for region in ((0.9, 0.95, 0.9, 1.0), (0.6, 0.95, 0.7, 1.0)):
        chart = boxes(lee1991.chart, region)
        own = control(lee1991, chart=chart)
        plan = own.plan(lee1991.fastest[:1])
        assert free_all_the_way(chart, lee1991.fastest[0], plan.trajectory, plan.trajectory.duration + 0.1)
        master_out = float(lee1991.fastest[0].time_at(0.95 * chart.length_a))
        assert plan.trajectory.duration > master_out
        near = 0.85 * region[2] * chart.length_b
        stands = (region[0] * chart.length_a, 0.0)
        assert own.guarded(1.0, near, 0.9 * lee1991.planes[1].edge_speed(near), [stands]) < 1.0


@pytest.mark.parametrize("seed", range(6))
def test_on_line_leaving_first_is_safe_behind_any_master(lee1991: CoordinationCell, seed: int) -> None:
    """The slave runs through in front of the master as long as it surely gets out; else it waits."""
    chart = boxes(lee1991.chart, SLAVE_FIRST, MASTER_FIRST if seed % 2 else SLAVE_FIRST)
    own = control(lee1991, chart=chart, checks=4)
    rng = np.random.default_rng(seed)
    commands = np.repeat(rng.choice([0.0, 0.3, 1.0, 1.0], 400), rng.integers(5, 80, 400))
    commands[600:] = 1.0
    held = rng.integers(0, 60)  # the slave itself is late
    a, b = [0.0, 0.0], [0.0, 0.0]
    command = 1.0
    for n in range(1500):
        if n % 4 == 0:
            command = 0.0 if n < held else own.guarded(1.0, b[0], b[1], [(a[0], a[1])])
        before = (a[0], b[0])
        a[0], a[1], _ = lee1991.planes[0].advance(a[0], a[1], float(commands[n]), 0.001)
        b[0], b[1], _ = lee1991.planes[1].advance(b[0], b[1], command, 0.001, mode="acceleration")
        middle = np.mean([before, (a[0], b[0])], axis=0)
        assert chart.is_free(a[0], b[0])
        assert chart.is_free(float(middle[0]), float(middle[1]))
        if a[0] >= chart.length_a and b[0] >= chart.length_b:
            break
    else:
        pytest.fail("it never arrived")


def test_behind_two_masters(lee1991: CoordinationCell) -> None:
    """Two masters on the same path, one late, each with a region of its own."""
    master, slave = lee1991.planes
    motions = [lee1991.fastest[0], lee1991.fastest[0].delayed(0.05)]
    both = VelocityControl(
        slave=slave,
        masters=(master, master),
        charts=(wall(lee1991.chart, 0.4, 0.2), wall(lee1991.chart, 0.7, 0.6)),
        period=0.004,
    ).plan(motions)
    assert both.corrections >= 2
    for motion, chart in zip(motions, (wall(lee1991.chart, 0.4, 0.2), wall(lee1991.chart, 0.7, 0.6)), strict=True):
        assert free_all_the_way(chart, motion, both.trajectory, both.trajectory.duration)
