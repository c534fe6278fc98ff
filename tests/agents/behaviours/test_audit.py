"""Executed schedules audited between samples by an engine that nothing here plans or simulates with (coal)."""

from __future__ import annotations

from functools import partial
from importlib import import_module
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from armtempo.agents import Actions, ExecutionPolicy, Observations, Policy, make_policy, run_episode
from armtempo.envs import CoordinationEnv
from armtempo.planners import METHODS, CoordinationCell, Schedule
from armtempo.planners.coordination import plan_vci
from armtempo.planners.schedules import ScheduleExecution, VciExecution

coal: Any = import_module("coal")  # it tells type checkers nothing


def least_distance(cell: CoordinationCell, q: list[np.ndarray], rows: np.ndarray) -> float:
    """Smallest distance of two arms by coal, pair by pair of capsules, at ``rows`` of joint positions (T, n)."""
    bodies = []
    for arm, positions in zip(cell.arms, q, strict=True):
        poses = arm.link_poses(positions[rows])
        own = []
        for shape in arm.shapes:
            assert shape.kind == "capsule"
            own.append((coal.Capsule(*shape.size), poses[:, shape.link] @ shape.T_link_shape))
        bodies.append(own)
    least = np.inf
    for first, second in combinations(bodies, 2):
        for (shape_a, T_a), (shape_b, T_b) in ((a, b) for a in first for b in second):
            for A, B in zip(T_a, T_b, strict=True):
                result = coal.DistanceResult()  # a used one would keep the last answer
                places = (coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (A, B))
                place_a, place_b = places
                coal.distance(shape_a, place_a, shape_b, place_b, coal.DistanceRequest(), result)
                least = min(least, result.min_distance)
    return float(least)


def audit(cell: CoordinationCell, policy: Policy[Observations, Actions], late: float) -> float:
    """The least distance of an executed episode, at ten times the control rate or oftener."""
    env = CoordinationEnv(cell, physics="bullet", master_late_s=late, record=True)
    trace, _ = run_episode(env, policy, 0)
    env.close()
    assert trace.violations == 0
    step = cell.control_period / 10.0
    instants = np.arange(0.0, trace.time[-1], min(step, cell.physics_tick))
    q = [np.stack([np.interp(instants, trace.time, column) for column in rows.T], axis=1) for rows in trace.q]
    near = np.flatnonzero(np.interp(instants, trace.time, trace.clearance) < cell.d_min + 0.03)
    return least_distance(cell, q, near if len(near) else np.arange(1))


@pytest.mark.parametrize("late", [0.0, 0.1])
@pytest.mark.parametrize("name", [name for name in METHODS if name != "sequential"])
def test_schedules_of_the_paper(lee1991: CoordinationCell, name: str, late: float) -> None:
    assert audit(lee1991, make_policy(name, lee1991), late) >= lee1991.d_min


def test_three_arms_in_two_ways(trio: CoordinationCell) -> None:
    motions, _ = plan_vci(trio.planes, trio.chart_between, (0, 1, 2), trio.control_period)
    plan = Schedule(method="vci", cell=trio, trajectories=motions, order=(0, 1, 2))
    for policy in (ExecutionPolicy(partial(ScheduleExecution, plan)), ExecutionPolicy(partial(VciExecution, trio))):
        assert audit(trio, policy, 0.05) >= trio.d_min


def test_the_audit_finds_a_collision(lee1991: CoordinationCell) -> None:
    """Both arms where the chart is blocked."""
    chart = lee1991.chart
    a, b = np.argwhere(chart.states == 2)[len(np.argwhere(chart.states == 2)) // 2]
    places = ((a + 0.5) * chart.step_a, (b + 0.5) * chart.step_b)
    q = [path.evaluate(np.array([lam]))[0] for path, lam in zip(lee1991.paths, places, strict=True)]
    assert least_distance(lee1991, q, np.arange(1)) < lee1991.planned_clearance
