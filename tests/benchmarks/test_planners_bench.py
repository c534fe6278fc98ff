"""Times of the planners against their peers, in the same run. ``make bench``; not part of the default run."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.planners import (
    METHODS,
    CoordinationCell,
    CoordinationChart,
    JointPath,
    PathDynamics,
    PhasePlane,
    minimum_time,
    schedule,
)
from armtempo.robots import Arm


def best(function: Callable[[], object], repeat: int = 7) -> float:
    """Smallest time of a call [s]: the machine is shared."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def toppra_solver(dynamics: PathDynamics) -> Callable[[], float]:
    """toppra on the same rows (their evaluation is not counted), the same grid, seidel."""
    ta: Any = importlib.import_module("toppra")
    from toppra.constraint import DiscretizationType, SecondOrderConstraint  # type: ignore[import-untyped, unused-ignore]

    path, arm = dynamics.path, dynamics.arm
    assert path is not None
    assert arm is not None
    evaluate = path.evaluate

    class Geometry(ta.interpolator.AbstractGeometricPath):  # type: ignore[misc]
        dof = dynamics.M.shape[1]
        path_interval = np.array([0.0, dynamics.length])
        waypoints = None

        def __call__(self, s: Floats, order: int = 0) -> Floats:
            return evaluate(s)[order]

    limits = np.concatenate([dynamics.torque_max[0], -dynamics.torque_min[0]])
    torque = SecondOrderConstraint(
        arm.inverse_dynamics,
        lambda q: np.vstack([np.eye(path.dof), -np.eye(path.dof)]),
        lambda q: limits,
        path.dof,
        discretization_scheme=DiscretizationType.Interpolation,  # pyright: ignore[reportArgumentType]
    )
    solver = ta.algorithm.TOPPRA(
        [torque], Geometry(), gridpoints=dynamics.grid, solver_wrapper="seidel", parametrizer="ParametrizeConstAccel"
    )

    def solve() -> float:
        _, speed, _ = solver.compute_parameterization(0.0, 0.0)
        return float(np.sum(2.0 * np.diff(dynamics.grid) / (speed[1:] + speed[:-1])))

    return solve


def say(capsys: pytest.CaptureFixture[str], text: str) -> None:
    with capsys.disabled():
        print(f"\n{text}")  # noqa: T201


def test_minimum_time_against_toppra(
    benchmark: Any, lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]
) -> None:
    dynamics = lee1991.dynamics[0]
    solve = toppra_solver(dynamics)
    assert minimum_time(dynamics).duration == pytest.approx(solve(), abs=1e-4)
    theirs = best(solve, 3)
    ours = best(lambda: PhasePlane(dynamics).fastest(), 20)
    checked = best(lambda: minimum_time(dynamics), 10)
    benchmark.extra_info.update(toppra_ms=1e3 * theirs, ours_ms=1e3 * ours, ratio=theirs / ours)
    benchmark(lambda: PhasePlane(dynamics).fastest())
    say(
        capsys,
        f"minimum time {1e3 * ours:.2f} ms ({1e3 * checked:.1f} ms with its check between stations), "
        f"toppra {1e3 * theirs:.1f} ms, {theirs / ours:.0f} times slower",
    )
    assert theirs / ours >= 10.0


@pytest.mark.parametrize("viscous", [0.3, 1.0, 4.0])
def test_minimum_time_with_friction_against_toppra_without(
    benchmark: Any, viscous: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """A vertical two-link arm on spline paths; toppra has no friction, and solves the frictionless problem."""
    arm, free = (
        Arm.from_urdf(
            data_path("robots/planar_two_link.urdf"), gravity=(0.0, -9.81, 0.0), torque_max=(80.0, 20.0),
            damping=(friction, friction),
        )
        for friction in (viscous, 0.0)
    )  # fmt: skip
    ratios = []
    for seed in range(5):
        path = JointPath.through(np.random.default_rng(seed).uniform(-1.2, 1.2, (5, 2)))
        path.breakpoints = path.breakpoints[[0, -1]]  # toppra refuses stations that appear twice
        dynamics = PathDynamics.from_path(arm, path)
        theirs = best(toppra_solver(PathDynamics.from_path(free, path)), 2)
        ours = best(lambda dynamics=dynamics: PhasePlane(dynamics).fastest(), 10)  # type: ignore[misc]
        ratios.append((theirs / ours, 1e3 * ours, 1e3 * theirs))
    ratio, ours_ms, theirs_ms = np.median(ratios, axis=0)
    benchmark.extra_info.update(toppra_ms=theirs_ms, ours_ms=ours_ms, ratio=ratio)
    benchmark(lambda: PhasePlane(dynamics).fastest())
    say(
        capsys,
        f"F_v = {viscous}: {ours_ms:.2f} ms, toppra without friction {theirs_ms:.1f} ms, {ratio:.0f} times slower",
    )
    assert ratio >= 10.0


def test_path_coefficients(benchmark: Any, lee1991: CoordinationCell) -> None:
    """1000 intervals: path, inverse kinematics, dynamics."""
    arm, path = lee1991.arms[0], lee1991.paths[0]
    benchmark(PathDynamics.from_path, arm, path, intervals=1000)
    loop = (
        best(
            lambda: [
                arm.inverse_dynamics(*(row for row in path.evaluate(lam))) for lam in np.linspace(0, path.length, 101)
            ],
            3,
        )
        * 10
    )
    ratio = loop / benchmark.stats.stats.min
    benchmark.extra_info["ratio_to_a_python_loop"] = ratio
    assert ratio > 5.0


def test_chart_against_brute_force(
    benchmark: Any, lee1991: CoordinationCell, capsys: pytest.CaptureFixture[str]
) -> None:
    """Certified cells against FCL at the corners of the same grid, which proves nothing between them (extrapolated)."""
    arms, paths = lee1991.arms, lee1991.paths
    arguments = (arms[0], paths[0], arms[1], paths[1], lee1991.planned_clearance, lee1991.config.chart_tolerance_m)
    chart = benchmark.pedantic(CoordinationChart.build, arguments, rounds=5, warmup_rounds=1)
    lam = np.random.default_rng(0).uniform(0.0, chart.length_a, (2000, 2))
    q = [path.evaluate(column)[0] for path, column in zip(paths, lam.T, strict=True)]

    def asked() -> None:
        for one, other in zip(*q, strict=True):
            lee1991.clearance.between(0, 1, one, other)

    brute = best(asked, 3) / len(lam) * chart.resolution**2
    queries = 4 * chart.resolution**2 / chart.pair_queries
    benchmark.extra_info.update(brute_s=brute, ratio=brute / benchmark.stats.stats.min, pair_queries_ratio=queries)
    quicker = brute / benchmark.stats.stats.min
    say(
        capsys,
        f"chart: {quicker:.0f} times quicker than brute force (extrapolated), {queries:.0f} times fewer pair queries",
    )
    assert quicker >= 100.0
    assert queries >= 100.0


def test_one_tick_of_a_motion(benchmark: Any, lee1991: CoordinationCell) -> None:
    plane = lee1991.planes[0]
    lam, mu, used = benchmark(plane.advance, 0.1, 1.0, 0.7, 0.001)
    assert (used, lam > 0.1, mu <= plane.edge_speed(lam)) == (0.001, True, True)


def test_controllable_sets(benchmark: Any, lee1991: CoordinationCell) -> None:
    plane = benchmark(PhasePlane, lee1991.dynamics[0])
    assert plane.holdable.all()


@pytest.mark.parametrize("method", METHODS)
def test_schedules(benchmark: Any, lee1991: CoordinationCell, method: str) -> None:
    schedule(lee1991, method)  # charts and minimum times are made once per cell
    plan = benchmark.pedantic(schedule, (lee1991, method), rounds=5)
    assert plan.makespan >= lee1991.lower_bound


def test_lower_bound(benchmark: Any, lee1991: CoordinationCell) -> None:
    bound = benchmark.pedantic(lee1991.timing.bounded, rounds=5, warmup_rounds=1).time
    assert max(motion.duration for motion in lee1991.fastest) <= bound <= schedule(lee1991, "delay").makespan
