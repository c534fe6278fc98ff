"""Minimum time with jerk limits: how long a solve takes, what jerk costs, and the same paths by COPP's TOPP3.

``ARMTEMPO_BENCH_PATHS`` sets how many random paths are tried (90), ``ARMTEMPO_BENCH_PEER`` on how many of them COPP is
asked, four rounds each (12; none if ``copp-py`` is not installed: it is no dependency). COPP knows no friction, and
torques through a call of Python per station only: it is compared where neither has a say.
"""

from __future__ import annotations

import os
import time
from typing import Any, NamedTuple

import numpy as np
import pytest
from rich.console import Console
from rich.table import Table

from armtempo import load_cell
from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.errors import ArmtempoError
from armtempo.planners import CoordinationCell, JointPath, PathDynamics, minimum_time
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm

PATHS = int(os.environ.get("ARMTEMPO_BENCH_PATHS", "90"))
PEER_PATHS = int(os.environ.get("ARMTEMPO_BENCH_PEER", "12"))
ROUNDS = 4  # of the peer's linearisations
RAMPS = {"hardly": 0.002, "in ramps": 0.03, "everywhere": 0.2}  # s: jerk limits by the time to the largest acceleration
STRONG = 1e6


class Draw(NamedTuple):
    name: str
    binds: str
    arm: Arm
    path: AbstractJointPath
    jerk: Floats
    second: float


def arms() -> dict[str, Arm]:
    """With torques, friction where the arm has some."""
    return {
        "planar": Arm.from_urdf(data_path("robots/planar_two_link.urdf"), torque_max=[25.0, 7.0], damping=[0.5, 0.2]),
        "ur5e_like": Arm.from_urdf(data_path("robots/ur5e_like.urdf"), acceleration_max=[20.0] * 6),
        "panda": load_cell("panda-pair", CoordinationCell).arms[0],
    }


def kinematic_arms() -> dict[str, Arm]:
    """Speed and acceleration alone."""
    made = {}
    for name, arm in arms().items():
        finite = np.where(np.isfinite(arm.acceleration_max), arm.acceleration_max, 15.0)
        none = [0.0] * arm.dof
        made[name] = Arm.from_urdf(
            arm.urdf, torque_max=[STRONG] * arm.dof, speed_max=np.minimum(arm.speed_max, 4.0), acceleration_max=finite,
            damping=none, coulomb=none, tip_link=arm.tip_link,
        )  # fmt: skip
    return made


def draws(known: dict[str, Arm], count: int, seed: int) -> list[Draw]:
    """Natural splines through 3 to 6 points; jerk limits from the largest acceleration of the fastest motion."""
    rng = np.random.default_rng(seed)
    found: list[Draw] = []
    while len(found) < count:
        name, binds = list(known)[len(found) % 3], list(RAMPS)[len(found) // 3 % 3]
        arm = known[name]
        low, high = np.maximum(arm.position_min, -3.0), np.minimum(arm.position_max, 3.0)
        points = 0.5 * (low + high) + rng.uniform(-0.3, 0.3, (rng.integers(3, 7), arm.dof)) * (high - low)
        try:
            path = JointPath.through(points, arm=arm)
            fastest = minimum_time(PathDynamics.from_path(arm, path))
        except ArmtempoError:
            continue  # a path that this arm cannot follow at all
        lam, mu, mu_dot = fastest.at(np.linspace(0.0, fastest.duration, 500))
        _, dq, ddq = path.evaluate(lam)
        jerk = np.abs(dq * mu_dot[:, None] + ddq * mu[:, None] ** 2).max(axis=0) / RAMPS[binds]
        found.append(Draw(name, binds, arm, path, jerk, fastest.duration))
    return found


def test_solves_are_quick_and_keep_every_limit(capsys: pytest.CaptureFixture[str]) -> None:
    drawn = draws(arms(), PATHS, 0)
    minimum_time(PathDynamics.from_path(drawn[0].arm, drawn[0].path), jerk=drawn[0].jerk)  # compiles
    times: dict[tuple[str, str], list[tuple[float, float, float, float]]] = {}
    for one in drawn:
        start = time.perf_counter()
        motion = minimum_time(PathDynamics.from_path(one.arm, one.path), jerk=one.jerk)
        took = 1e3 * (time.perf_counter() - start)
        figures = (took, motion.duration / one.second - 1.0, motion.certificate.excess, float(len(motion.lam)))
        times.setdefault((one.name, one.binds), []).append(figures)
        assert motion.certificate.excess <= 1e-3
    table = Table(title=f"jerk-limited minimum time, {PATHS} paths, 1000 intervals, set-up and certificate included")
    for column in ("arm", "jerk binds", "paths", "median [ms]", "p90 [ms]", "price [%]", "excess [%]", "rows"):
        table.add_column(column, justify="left" if column in ("arm", "jerk binds") else "right")
    times["all", ""] = [row for rows in times.values() for row in rows]
    for (name, binds), rows in times.items():
        took, price, excess, stations = np.array(rows).T
        table.add_row(
            name, binds, f"{len(rows)}", f"{np.median(took):.1f}", f"{np.percentile(took, 90):.1f}",
            f"{1e2 * np.median(price):.2f}", f"{1e2 * excess.max():.3f}", f"{np.median(stations):.0f}",
        )  # fmt: skip
    with capsys.disabled():
        Console(width=120).print(table)


def peers_motion(copp: Any, one: Draw, intervals: int = 1000) -> tuple[list[float], float]:
    """COPP's times after each round, and how long the first one took, set-up included [s]."""
    start = time.perf_counter()
    s = np.linspace(0.0, one.path.length, intervals + 1)
    q, dq, ddq = one.path.evaluate(s)
    robot = copp.Robot(one.arm.dof, capacity=len(s))
    robot.append_s(s)
    robot.set_q(q, dq, ddq, 0, dddq=one.path.third(s))
    for add, limit in (
        (robot.add_velocity_limits, one.arm.speed_max),
        (robot.add_acceleration_limits, one.arm.acceleration_max),
    ):
        add(limit, -limit, start_idx_s=0, length=len(s))
    second = copp.solver.topp2_ra
    problem = second.Problem(robot.constraints, idx_s_interval=(0, intervals), a_boundary=(0.0, 0.0))
    a, b = second.solve(problem, second.Options()), None
    robot.add_jerk_limits(one.jerk, -one.jerk, start_idx_s=0, length=len(s))
    durations, first = [], 0.0
    for _ in range(ROUNDS):
        third = copp.solver.topp3_lp
        more: dict[str, Floats] = {} if b is None else {"b_linearization": b}
        problem = third.Problem(
            robot.constraints, a, idx_s_start=0, a_boundary=(0.0, 0.0), b_boundary=(0.0, 0.0), num_stationary_max=1,
            **more,
        )  # fmt: skip
        profile = third.solve(problem, third.Options())
        first = first or time.perf_counter() - start
        a, b = np.array(profile.a), np.array(profile.b)
        durations.append(float(copp.interpolation.s_to_t_topp3(s, profile)[0]))
    return durations, first


def test_coppy_is_neither_shorter_nor_quicker(capsys: pytest.CaptureFixture[str]) -> None:
    copp = pytest.importorskip("copp_py")
    drawn = draws(kinematic_arms(), PEER_PATHS, 1)
    minimum_time(PathDynamics.from_path(drawn[0].arm, drawn[0].path), jerk=drawn[0].jerk)
    table = Table(title="against COPP's TOPP3 (LP) of 1000 intervals; ours keeps the limits between stations, too")
    for column in (
        "arm",
        "jerk binds",
        "ours [s]",
        "COPP, 1 round [s]",
        "best of 4 [s]",
        "ratio",
        "ours [ms]",
        "COPP [ms]",
    ):
        table.add_column(column, justify="left" if column in ("arm", "jerk binds") else "right")
    ratios, quicker = [], []
    for one in drawn:
        start = time.perf_counter()
        ours = minimum_time(PathDynamics.from_path(one.arm, one.path), jerk=one.jerk).duration
        took = time.perf_counter() - start
        theirs, first = peers_motion(copp, one)
        ratios.append(ours / min(theirs))
        quicker.append(first / took)
        table.add_row(
            one.name, one.binds, f"{ours:.4f}", f"{theirs[0]:.4f}", f"{min(theirs):.4f}", f"{ratios[-1]:.5f}",
            f"{1e3 * took:.0f}", f"{1e3 * first:.0f}",
        )  # fmt: skip
    with capsys.disabled():
        Console(width=120).print(table)
        Console().print(f"ratio at most {max(ratios):.5f}; {np.median(quicker):.0f} x quicker than one round (median)")
    assert max(ratios) <= 1.0001
