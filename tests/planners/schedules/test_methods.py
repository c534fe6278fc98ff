"""Schedules of the paper's cell: its numbers, the lower bound, certificates, and what is refused."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.planners import (
    METHODS,
    CoordinationCell,
    CoordinationChart,
    Schedule,
    load_cell,
    schedule,
)
from armtempo.planners.coordination import pair_bound


@pytest.fixture(scope="module")
def plans(lee1991: CoordinationCell) -> dict[str, Schedule]:
    return {method: schedule(lee1991, method) for method in METHODS}


def test_the_methods_are_those_of_the_paper_and_better_ones() -> None:
    assert METHODS[:5] == ("sequential", "constant-speed", "constant-acceleration", "delay", "vci")
    assert METHODS[5:] == ("offset", "interval", "optimal")


def test_makespans_of_the_paper(plans: dict[str, Schedule], lee1991: CoordinationCell) -> None:
    assert plans["sequential"].makespan == pytest.approx(0.5724, abs=0.001)
    assert plans["sequential"].makespan == pytest.approx(lee1991.sequential_makespan)
    assert plans["delay"].makespan == pytest.approx(0.328, abs=0.002)
    assert plans["optimal"].makespan == pytest.approx(0.328, abs=0.002)
    assert plans["optimal"].makespan == pytest.approx(plans["delay"].makespan, rel=1e-12)  # the cell is a mirror image
    assert plans["delay"].makespan <= plans["vci"].makespan <= 0.352
    for slow in ("constant-speed", "constant-acceleration"):
        assert plans["vci"].makespan < plans[slow].makespan < plans["sequential"].makespan
    for method in ("delay", "optimal", "vci"):
        saving = 100 * (1 - plans[method].makespan / plans["sequential"].makespan)
        assert (40.0 if method == "vci" else 42.0) <= saving <= 45.0


@pytest.mark.parametrize("period", [0.0005, 0.001, 0.002, 0.003, 0.004, 0.0045, 0.005])
def test_vci_by_control_period(lee1991: CoordinationCell, plans: dict[str, Schedule], period: float) -> None:
    plan = schedule(lee1991, "vci", period=period)
    assert plans["delay"].makespan - 1e-4 <= plan.makespan <= (0.345 if period <= 0.002 else 0.352)
    if period <= 0.002:
        assert 100 * (1 - plan.makespan / plans["sequential"].makespan) == pytest.approx(41.0, abs=1.3)
    certificate = plan.certificate
    assert certificate.torque_ratio_max < 1 + 1e-3
    assert certificate.min_clearance >= lee1991.planned_clearance - 1e-9
    assert certificate.certified_free
    assert certificate.end_error == 0.0


@pytest.mark.parametrize("period", [0.0007, 0.0063, 0.0083, 0.01, 0.0123, 0.02, 0.035, 0.05])
def test_vci_finishes_safely_with_other_periods_too(lee1991: CoordinationCell, period: float) -> None:
    plan = schedule(lee1991, "vci", period=period)
    assert plan.makespan < 0.42
    assert plan.certificate.certified_free
    assert plan.certificate.torque_ratio_max < 1 + 1e-3


@pytest.mark.parametrize("method", METHODS)
def test_every_plan_certifies_itself(plans: dict[str, Schedule], lee1991: CoordinationCell, method: str) -> None:
    plan = plans[method]
    assert plan.method == method
    assert plan.cell is lee1991
    assert len(plan.trajectories) == 2
    assert plan.certificate.torque_ratio_max < 1 + 1e-3
    assert plan.certificate.speed_ratio_max < 1 + 1e-3
    assert plan.certificate.min_clearance >= lee1991.planned_clearance - 1e-9
    assert plan.certificate.certified_free
    assert plan.certificate.end_error == 0.0
    assert plan.makespan == max(motion.duration for motion in plan.trajectories)
    assert plan.gap_percent >= -0.1
    assert plan.lower_bound <= plan.makespan
    for motion in plan.trajectories:
        assert motion.certificate.end_speed_error < 1e-6
        assert motion.lam[0] == 0.0
        assert motion.mu[0] == 0.0


def test_the_certificate_of_a_plan_that_collides_says_so(plans: dict[str, Schedule], lee1991: CoordinationCell) -> None:
    together = Schedule(method="delay", cell=lee1991, trajectories=lee1991.fastest, order=(0, 1))
    assert not together.certificate.certified_free
    assert together.certificate.min_clearance < lee1991.d_min
    hasty = dataclasses.replace(
        plans["delay"],
        trajectories=(
            lee1991.fastest[0],
            lee1991.fastest[1].delayed(plans["delay"].makespan - lee1991.fastest[1].duration - 0.002),
        ),
    )
    assert not hasty.certificate.certified_free


def test_the_delay_is_the_shortest_one(plans: dict[str, Schedule], lee1991: CoordinationCell) -> None:
    wait = plans["delay"].makespan - lee1991.fastest[1].duration
    for share, free in ((1.0, True), (0.99, False), (1.05, True)):
        motions = (lee1991.fastest[0], lee1991.fastest[1].delayed(share * wait))
        plan = Schedule(method="delay", cell=lee1991, trajectories=motions, order=(0, 1))
        assert plan.certificate.certified_free is free


def test_constant_shapes_are_constant_and_as_fast_as_the_limits_allow(plans: dict[str, Schedule]) -> None:
    for method, ramp in (("constant-speed", 0.25), ("constant-acceleration", 0.5)):
        motion = plans[method].trajectories[0]
        length = motion.lam[-1]
        inside = 0.5 * (motion.lam[1:] + motion.lam[:-1])
        up, flat = inside < ramp * length, (inside > ramp * length) & (inside < (1 - ramp) * length)
        assert np.ptp(motion.mu_dot[up]) < 1e-6 * np.abs(motion.mu_dot).max()
        assert np.abs(motion.mu_dot[flat]).max(initial=0.0) < 1e-6 * np.abs(motion.mu_dot).max()
        assert motion.certificate.torque_ratio_max == pytest.approx(1.0, abs=1e-3)


def chart_of(states: Floats, like: CoordinationChart) -> CoordinationChart:
    return CoordinationChart(
        states=states.astype(np.uint8), length_a=like.length_a, length_b=like.length_b, d_min=like.d_min
    )


def test_the_bound_without_collisions_is_the_slower_arm(lee1991: CoordinationCell) -> None:
    empty = chart_of(np.zeros((64, 64)), lee1991.chart)
    a, b = lee1991.fastest
    assert pair_bound(a, b, empty).time == pytest.approx(max(a.duration, b.duration))
    assert pair_bound(a, b.delayed(0.1), empty).time == pytest.approx(b.duration + 0.1)


def test_the_bound_behind_a_wall_is_infinite(lee1991: CoordinationCell) -> None:
    a, b = lee1991.fastest
    states = np.zeros((64, 64))
    states[30:34, :] = 2
    assert pair_bound(a, b, chart_of(states, lee1991.chart)).time == math.inf
    states[31, 50] = 1  # undecided: no proof
    states[30, 50] = states[32, 50] = states[33, 50] = 1
    assert pair_bound(a, b, chart_of(states, lee1991.chart)).time < 0.5
    falling = np.zeros((64, 64))
    for k in range(64):
        falling[k, 63 - k] = falling[min(k + 1, 63), 63 - k] = 2  # the other diagonal: no monotone way through
    assert pair_bound(a, b, chart_of(falling, lee1991.chart)).time == math.inf


def test_the_bound_knows_the_corner_it_must_go_round(lee1991: CoordinationCell) -> None:
    """A block from the middle on: one arm has to be through before the other enters; the answer is a sum of times."""
    states = np.zeros((256, 256))
    states[64:192, 64:192] = 2
    a, b = lee1991.fastest
    wanted = float(a.time_at(0.75 * a.lam[-1])) + b.duration - float(b.time_at(0.25 * b.lam[-1]))
    bound = pair_bound(a, b, chart_of(states, lee1991.chart)).time
    assert bound <= wanted
    assert bound == pytest.approx(wanted, rel=0.005)


def test_the_bound_is_below_every_plan_and_close(plans: dict[str, Schedule], lee1991: CoordinationCell) -> None:
    bound = lee1991.lower_bound
    assert all(bound <= plan.makespan for plan in plans.values())
    assert plans["delay"].gap_percent < 1.0
    assert bound > max(motion.duration for motion in lee1991.fastest)


def with_chart(cell: CoordinationCell, states: Floats) -> CoordinationCell:
    copy = dataclasses.replace(cell)
    copy.__dict__["_charts"] = {(0, 1, cell.planned_clearance, 0): chart_of(states, cell.chart)}
    copy.__dict__["_halvings"] = {(0, 1): 0}
    return copy


@pytest.mark.parametrize("method", ["delay", "constant-speed"])
def test_a_start_that_is_not_safe_to_wait_in(lee1991: CoordinationCell, method: str) -> None:
    states = np.zeros((128, 128))
    states[20:60, :10] = 2
    cell = with_chart(lee1991, states)
    with pytest.raises(InfeasibleError, match=r"'slave'") as refusal:
        schedule(cell, method, order="file")
    assert refusal.value.remedy
    assert schedule(cell, method).order == (1, 0)
    assert schedule(cell, "sequential").order == (1, 0)  # the other order
    plan = schedule(cell, "optimal")
    assert plan.order == (1, 0)
    assert plan.trajectories[1].time[1] < 0.01
    assert plan.certificate.certified_free


@pytest.mark.parametrize("method", ["delay", "constant-acceleration"])
def test_a_master_that_parks_in_the_way(lee1991: CoordinationCell, method: str) -> None:
    states = np.zeros((128, 128))
    states[100:, 60:90] = 2
    cell = with_chart(lee1991, states)
    with pytest.raises(InfeasibleError, match=r"'master'.*in the way") as refusal:
        schedule(cell, method, order="file")
    assert schedule(cell, method).order == (1, 0)
    assert "swap the order" in refusal.value.remedy
    assert schedule(cell, "optimal").order == schedule(cell, "sequential").order == (1, 0)


@pytest.mark.parametrize("region", [(20, 60, 0, 10), (100, 128, 60, 90)])
def test_velocity_control_passes_first_where_the_slave_has_to(
    lee1991: CoordinationCell, region: tuple[int, int, int, int]
) -> None:
    states = np.zeros((128, 128))
    states[region[0] : region[1], region[2] : region[3]] = 2
    plan = schedule(with_chart(lee1991, states), "vci")
    assert plan.certificate.certified_free
    assert plan.makespan == pytest.approx(max(motion.duration for motion in lee1991.fastest), rel=1e-3)


def test_where_neither_can_go_first_everywhere(lee1991: CoordinationCell) -> None:
    states = np.zeros((128, 128))
    states[100:, 60:90] = 2
    states[60:90, 100:] = 2
    cell = with_chart(lee1991, states)
    for order, name in (((0, 1), "master"), ((1, 0), "slave")):
        with pytest.raises(InfeasibleError, match=rf"arm '{name}' ends in the way"):
            schedule(cell, "delay", order=order)
    plan = schedule(cell, "optimal")  # each goes first where it has to
    assert plan.certificate.certified_free
    assert plan.certificate.torque_ratio_max < 1 + 1e-3


def test_several_regions_are_all_passed_behind(lee1991: CoordinationCell) -> None:
    states = np.zeros((128, 128))
    states[40:60, 30:50] = states[70:90, 60:80] = states[20:30, 100:110] = 2
    cell = with_chart(lee1991, states)
    for method in METHODS:
        plan = schedule(cell, method)
        assert plan.certificate.certified_free, method
        assert plan.certificate.torque_ratio_max < 1 + 1e-3, method


def test_one_arm_alone_takes_its_minimum_time(lee1991: CoordinationCell) -> None:
    alone = dataclasses.replace(
        lee1991,
        arms=lee1991.arms[:1],
        paths=lee1991.paths[:1],
        dynamics=lee1991.dynamics[:1],
        planes=lee1991.planes[:1],
    )
    for method in METHODS:
        plan = schedule(alone, method)
        if method in ("constant-speed", "constant-acceleration"):
            assert plan.makespan > lee1991.fastest[0].duration
            continue
        assert plan.makespan == lee1991.fastest[0].duration
        assert 0.0 <= plan.gap_percent < 0.1  # the bound rests on a finer grid
        assert plan.certificate.min_clearance == math.inf


def test_unknown_methods_are_named(lee1991: CoordinationCell) -> None:
    with pytest.raises(UnknownNameError, match=r"unknown method 'vcj'.*did you mean 'vci'.*sequential"):
        schedule(lee1991, "vcj")


@pytest.mark.parametrize("period", [0.0, -1.0, math.nan, math.inf])
def test_a_period_is_a_positive_number(lee1991: CoordinationCell, period: float) -> None:
    with pytest.raises(InputError, match=r"control period must be positive"):
        schedule(lee1991, "vci", period=period)


@pytest.mark.parametrize("order", [(0,), (0, 0), (1, 2), (0, 1, 2)])
def test_an_order_names_every_arm_once(lee1991: CoordinationCell, order: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="once"):
        schedule(lee1991, "delay", order=order)


def test_gap_and_time_limit_are_only_for_the_optimum(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match="'delay' has no gap"):
        schedule(lee1991, "delay", gap=0.01)
    with pytest.raises(InputError, match="gap -1"):
        schedule(lee1991, "optimal", gap=-1.0)
    assert schedule(lee1991, "optimal", gap=0.02, time_limit_s=5.0).gap_percent <= 2.0


def test_a_period_is_only_for_vci(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match="'delay' has no period"):
        schedule(lee1991, "delay", period=0.01)


@pytest.mark.parametrize("method", ["sequential", "delay", "offset", "interval", "vci"])
def test_either_order_can_be_asked_for(lee1991: CoordinationCell, method: str) -> None:
    for order in ((0, 1), (1, 0)):
        plan = schedule(lee1991, method, order=order)
        assert plan.order == order
        assert plan.trajectories[order[0]].duration == lee1991.fastest[order[0]].duration
        assert plan.fallback is None


def test_vci_falls_back_on_interval_and_says_so(lee1991: CoordinationCell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random charts on which velocity control fails and interval does not were looked for, and not found."""
    refusal = InfeasibleError("velocity control gives up", reason="parked in the way")

    def gives_up(*_: object) -> NoReturn:
        raise refusal

    monkeypatch.setattr("armtempo.planners.schedules._methods.plan_vci", gives_up)
    plan = schedule(lee1991, "vci")
    assert plan.fallback == "interval"
    assert plan.vci is None
    assert plan.certificate.certified_free
    assert plan.makespan == schedule(lee1991, "interval").makespan
    states = np.zeros((128, 128))
    states[100:, 60:] = 2  # the master parks there for good: the refusal is velocity control's own
    with pytest.raises(InfeasibleError, match="gives up"):
        schedule(with_chart(lee1991, states), "vci")


def test_the_class_of_the_papers_cell(lee1991: CoordinationCell) -> None:
    assert lee1991.priority_class == lee1991.bound.classes[0, 1] == "uniform"
    assert lee1991.holdable == (True, True)
    assert lee1991.bound.time == lee1991.lower_bound


def test_h_certified_infeasible_is_what_every_method_reports(lee1991: CoordinationCell) -> None:
    states = np.zeros((128, 128))
    states[30:34, :] = 2
    cell = with_chart(lee1991, states)
    cell.__dict__["_charts"][0, 1, cell.d_min, 0] = cell.chart
    assert cell.priority_class == "infeasible"
    assert cell.lower_bound == math.inf
    for method in METHODS:
        with pytest.raises(InfeasibleError):
            schedule(cell, method)
    with pytest.raises(InfeasibleError, match="certified") as refusal:
        schedule(cell, "optimal")
    assert refusal.value.data["reason"] == "certified infeasible"


@pytest.fixture(scope="module")
def mixed() -> CoordinationCell:
    return load_cell("mixed-priority")


def test_a_cell_where_each_arm_must_pass_first_somewhere(mixed: CoordinationCell) -> None:
    assert mixed.priority_class == "mixed"
    assert mixed.chart.regions >= 2
    for method in ("delay", "offset"):
        for order in ((0, 1), (1, 0)):
            with pytest.raises(InfeasibleError):
                schedule(mixed, method, order=order)
    for method in ("interval", "vci", "optimal"):
        plan = schedule(mixed, method)
        assert plan.fallback is None
        assert 0.0 <= plan.gap_percent < 0.5
        assert plan.certificate.certified_free
        assert plan.certificate.torque_ratio_max < 1 + 1e-3
        assert plan.certificate.min_clearance >= mixed.planned_clearance - 1e-9


def lines(*segments: tuple[float, ...]) -> list[dict[str, Any]]:
    def point(x: float, y: float) -> list[float]:
        return [x, y, 0.0]

    return [
        {"line": {"to_m": point(*s)}} if len(s) == 2 else {"arc": {"to_m": point(*s[:2]), "center_m": point(*s[2:])}}
        for s in segments
    ]


def test_where_both_have_to_yield(write_cell: Callable[..., Path]) -> None:
    """No method that leaves the first arm at full speed finds a way; with both free to yield there is one."""

    def change(data: dict[str, Any]) -> None:
        master, slave = data["arms"]
        slave["base"]["position_m"] = [0.7, 0, 0]
        master["path"] = {
            "start_m": [0.2, 0.35, 0],
            "segments": lines((0.2, 0.2), (0.3, 0.1, 0.3, 0.2), (0.4, 0.1), (0.45, 0.15, 0.4, 0.15), (0.45, 0.35)),
        }
        slave["path"] = {
            "start_m": [0.2, 0.3, 0],
            "segments": lines((0.35, 0.3), (0.5, 0.15, 0.35, 0.15), (0.5, 0.05)),
        }
        data["chart_tolerance_m"] = 0.0005

    cell = load_cell(write_cell(change))
    for method in ("delay", "offset", "interval"):
        for order in ((0, 1), (1, 0)):
            with pytest.raises(InfeasibleError):
                schedule(cell, method, order=order)
    plan = schedule(cell, "optimal")
    assert plan.gap_percent < 4.0
    assert plan.certificate.certified_free
    assert plan.certificate.torque_ratio_max < 1 + 1e-3
    assert plan.certificate.min_clearance >= cell.planned_clearance - 1e-9


def test_three_arms_by_every_method(write_cell: Callable[..., Path]) -> None:
    """A third arm, quicker than the paper's two, dives in between them from above."""

    def change(data: dict[str, Any]) -> None:
        third = copy.deepcopy(data["arms"][0]) | {"name": "third", "elbow": "positive"}
        third["base"] = {"position_m": [0.425, 0.75, 0], "rpy_rad": [0, 0, 0]}
        third["path"] = {"start_m": [0.425, 0.55, 0], "segments": lines((0.425, 0.2))}
        data["arms"][0]["limits"] = data["arms"][1]["limits"] = {"torque_nm": [5, 1.4]}
        data["arms"].append(third)
        data["chart_tolerance_m"] = 0.001

    cell = load_cell(write_cell(change))
    assert set(cell.bound.classes.values()) == {"uniform"}
    spans = {}
    for method in METHODS:
        if method == "vci":
            continue
        plan = schedule(cell, method)
        assert len(plan.trajectories) == 3
        assert sorted(plan.order) == [0, 1, 2]
        assert plan.certificate.certified_free, method
        assert plan.certificate.torque_ratio_max < 1 + 1e-3, method
        assert plan.certificate.min_clearance >= cell.planned_clearance - 1e-9, method
        assert plan.makespan >= cell.lower_bound
        spans[method] = plan.makespan
    assert spans["optimal"] <= min(spans.values())
    assert spans["sequential"] == pytest.approx(cell.sequential_makespan)
    assert spans["offset"] <= spans["delay"] < spans["sequential"]
