"""Arms, paths and cell files that the planners' tests are made of."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from armtempo.arrays import Floats
from armtempo.configs import data_path
from armtempo.planners import CoordinationChart, JointPath, PathDynamics, PhasePlane
from armtempo.planners.coordination import TimingProblem
from armtempo.robots import Arm

ROOT = Path(__file__).parents[2]
VERTICAL = (0.0, -9.81, 0.0)  # gravity in the plane of motion


@pytest.fixture(scope="session")
def make_arm() -> Callable[..., Arm]:
    """The paper's arm; keyword arguments as of ``Arm.from_urdf``."""

    def make(**options: Any) -> Arm:
        options.setdefault("name", "planar")
        return Arm.from_urdf(data_path("robots/planar_two_link.urdf"), **options)

    return make


@pytest.fixture(scope="session")
def spline_dynamics(
    make_arm: Callable[..., Arm], joint_spline: Callable[[Floats], JointPath]
) -> Callable[..., PathDynamics]:
    """Rows of a seeded random spline path of the paper's arm, with gravity in its plane or without."""

    def make(
        seed: int, *, gravity: bool = True, intervals: int = 400, limits: tuple[float, float] = (80.0, 20.0)
    ) -> PathDynamics:
        knots = np.random.default_rng(seed).uniform(-1.2, 1.2, (5, 2))
        arm = make_arm(gravity=VERTICAL if gravity else (0.0, 0.0, -9.81), torque_max=limits)
        return PathDynamics.from_path(arm, joint_spline(knots), intervals=intervals)

    return make


def double_integrator(stations: int = 400, limit: float = 1.0) -> PhasePlane:
    """A path of length 1 with |mu_dot| <= limit: what is optimal on it is known in closed form."""
    grid, one, zero = np.linspace(0.0, 1.0, stations + 1), np.ones((stations + 1, 1)), np.zeros((stations + 1, 1))
    return PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-limit], [limit]))


def chart_of(states: NDArray[np.uint8]) -> CoordinationChart:
    return CoordinationChart(states=states, length_a=1.0, length_b=1.0, d_min=0.01)


@pytest.fixture(scope="session")
def make_problem() -> Callable[..., TimingProblem]:
    """Double integrators with charts by hand: per pair (i, j), i < j, rectangles (a0, a1, b0, b1) that are blocked.

    Or whole arrays of states in their place; ``planes`` in place of equal double integrators.
    """

    def make(
        pairs: dict[tuple[int, int], Any], arms: int = 2, resolution: int = 256, planes: Any = None
    ) -> TimingProblem:
        charts = {}
        for i in range(arms):
            for j in range(i + 1, arms):
                blocked = pairs.get((i, j), [])
                states = np.zeros((resolution, resolution), dtype=np.uint8)
                if isinstance(blocked, np.ndarray):
                    states = blocked
                else:
                    for a0, a1, b0, b1 in blocked:
                        rows, columns = (
                            slice(round(x * resolution), round(y * resolution)) for x, y in ((a0, a1), (b0, b1))
                        )
                        states[rows, columns] = 2
                charts[i, j] = chart_of(states)

        def between(i: int, j: int) -> CoordinationChart:
            return charts[i, j] if i < j else charts[j, i].swapped

        return TimingProblem(
            names=tuple("abcdef"[:arms]),
            planes=planes or tuple(double_integrator() for _ in range(arms)),
            chart_between=between,
            bound_chart_between=between,
        )

    return make


@pytest.fixture
def write_cell(tmp_path: Path) -> Callable[..., Path]:
    """A copy of the bundled lee1991 file in ``tmp_path``, changed by a function."""
    data = yaml.safe_load((ROOT / "configs" / "cells" / "lee1991.yaml").read_text())

    def write(change: Callable[[dict[str, Any]], object] = lambda _: None, name: str = "cell.yaml") -> Path:
        own = copy.deepcopy(data)
        change(own)
        file = tmp_path / name
        file.write_text(yaml.safe_dump(own))
        return file

    return write
