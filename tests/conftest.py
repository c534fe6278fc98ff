"""Fixtures that more than one folder of tests uses."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from hypothesis import settings
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from armtempo.arrays import Floats
from armtempo.configs import CellConfig, data_path
from armtempo.planners import (
    AbstractJointPath,
    BlendCell,
    CoordinationCell,
    IKCell,
    JointPath,
    PathDynamics,
    build_cell,
    load_cell,
)
from armtempo.planners.joint_paths import Wait
from armtempo.planners.topp import refined_plane
from armtempo.robots import Arm

os.environ["ARMTEMPO_CACHE"] = "off"  # tests find out for themselves
settings.register_profile("untimed", parent=settings(), deadline=None)  # first examples compile, machines are busy
settings.load_profile("untimed")


class JointSpline(JointPath):
    """A natural cubic spline through joint positions, with closed bounds of its speed."""

    def __init__(self, knots: Floats) -> None:
        self.breakpoints = np.linspace(0.0, 1.0, len(knots))
        self.length = 1.0
        self.dof = knots.shape[1]
        self._spline = CubicSpline(self.breakpoints, knots, bc_type="natural")
        self._jerk = 6.0 * np.abs(self._spline.c[0]).max()

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        lam = np.asarray(lam, dtype=np.float64)
        return self._spline(lam), self._spline(lam, 1), self._spline(lam, 2)

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        half = 0.5 * (high - low)[..., None]
        bound: Floats = (
            np.abs(self._spline(0.5 * (low + high), 1))
            + half * np.abs(self._spline(0.5 * (low + high), 2))
            + half**2 * self._jerk
        )
        return bound


Pair = tuple[tuple[Arm, Arm], tuple[JointPath, JointPath]]

Point = tuple[float, float]


def ring_of_arms(radius: float, lines: list[tuple[Point, Point]], elbows: str, **options: object) -> CellConfig:
    """The paper's arms on a circle, on straight paths given in each one's frame: from its base, x to the centre."""
    arms = []
    for k, line in enumerate(lines):
        angle = 2.0 * math.pi * k / len(lines)
        c, s = math.cos(angle), math.sin(angle)
        base, start, end = ([c * (x - radius) - s * y, s * (x - radius) + c * y, 0.0] for x, y in ((0.0, 0.0), *line))
        arms.append(
            {
                "name": f"arm{k}",
                "urdf": str(data_path("robots/planar_two_link.urdf")),
                "elbow": "positive" if elbows[k] == "+" else "negative",
                "tip_link": "tool",
                "base": {"position_m": base, "rpy_rad": [0.0, 0.0, angle]},
                "limits": {"torque_nm": [25, 7]},
                "path": {"start_m": start, "segments": [{"line": {"to_m": end}}]},
            }
        )
    values = {
        "kind": "coordination", "name": f"planar_{len(lines)}", "d_min_m": 0.01, "physics_tick_s": 0.001,
        "control_period_s": 0.004, "stations": 500, "chart_tolerance_m": 0.002, "arms": arms,
    }  # fmt: skip
    return CellConfig.model_validate({**values, **options})


@pytest.fixture(scope="session")
def joint_spline() -> Callable[[Floats], JointPath]:
    """Makes a natural spline over equal shares of the path from joint positions (K, n)."""
    return JointSpline


@pytest.fixture(scope="session")
def lee1991() -> CoordinationCell:
    """The bundled cell of the 1991 paper; immutable, so built once."""
    return load_cell("lee1991")


def with_paths(cell: CoordinationCell, paths: Sequence[AbstractJointPath]) -> CoordinationCell:
    """The same arms on other paths, in charts of 1024 cells."""
    planes = tuple(
        refined_plane(
            PathDynamics.from_path(
                arm, path, intervals=cell.config.stations, torque_reserve=cell.torque_reserve
            ),
            tick=cell.physics_tick,
        )
        for arm, path in zip(cell.arms, paths, strict=True)
    )  # fmt: skip
    config = cell.config.model_copy(update={"chart_cells": 1024})
    return replace(
        cell, config=config, paths=tuple(paths), dynamics=tuple(plane.dynamics for plane in planes), planes=planes
    )


@pytest.fixture(scope="session")
def there_and_back(lee1991: CoordinationCell) -> CoordinationCell:
    """The arms of the 1991 paper go four fifths of their ways, stand for 0.1 and 0.15 s, and go back."""
    paths = []
    for path, dwell in zip(lee1991.paths, (0.1, 0.15), strict=True):
        q = path.evaluate(np.linspace(0.0, 0.8 * path.length, 9))[0]
        wait = Wait(lee1991.physics_tick)
        paths.append(JointPath.sequence([JointPath.through(q), wait, dwell, wait, JointPath.through(q[::-1])]))
    return with_paths(lee1991, paths)


@pytest.fixture(scope="session")
def lee2006() -> BlendCell:
    """The bundled cell of the 2006 paper; immutable, so built once."""
    return load_cell("lee2006", BlendCell)


@pytest.fixture(scope="session")
def chung() -> IKCell:
    """The bundled cell of the feedback paper; immutable, so built once."""
    return load_cell("chung", IKCell)


@pytest.fixture(scope="session")
def panda_pair() -> Callable[[int], Pair]:
    """Two Pandas that face each other, 0.85 m apart, on random spline paths over 60 % of their ranges; by seed."""
    urdf = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    there = np.diag([-1.0, -1.0, 1.0, 1.0])
    there[0, 3] = 0.85
    arms = tuple(
        Arm.from_urdf(urdf, name=name, T_world_base=T, tip_link="panda_hand")
        for name, T in (("one", np.eye(4)), ("two", there))
    )

    def make(seed: int) -> Pair:
        generator = np.random.default_rng(seed)
        middle = 0.5 * (arms[0].position_min + arms[0].position_max)
        range_ = 0.6 * (arms[0].position_max - middle)
        one, two = (JointSpline(generator.uniform(middle - range_, middle + range_, (5, 7))) for _ in arms)
        return (arms[0], arms[1]), (one, two)

    return make


@pytest.fixture(scope="session")
def three_arms() -> CoordinationCell:
    """Three planar arms; every two of them meet."""
    lines = [((0.35, -0.15), (0.54, 0.07)), ((0.49, -0.23), (0.52, 0.13)), ((0.45, -0.24), (0.31, 0.2))]
    return build_cell(ring_of_arms(0.5, lines, "-+-"))


@pytest.fixture(scope="session")
def four_arms() -> CoordinationCell:
    """Four planar arms; each meets its neighbours."""
    lines = [
        ((0.47, -0.23), (0.53, 0.2)),
        ((0.55, -0.12), (0.35, 0.14)),
        ((0.43, 0.15), (0.46, -0.2)),
        ((0.28, 0.38), (0.35, -0.16)),
    ]
    return build_cell(ring_of_arms(0.55, lines, "+-++"))


@pytest.fixture(scope="session")
def trio(lee1991: CoordinationCell) -> CoordinationCell:
    """The cell of the paper and a third arm, which can wait at its start for both; nobody parks in another's way."""
    config = lee1991.config
    third = config.arms[0].model_dump(exclude_none=True) | {
        "name": "third",
        "base": {"position_m": (0.21, 0.74, 0.0), "rpy_rad": (0.0, 0.0, 2.15)},
        "elbow": "positive",
        "path": {"start_m": (0.52, 0.39, 0.0), "segments": [{"line": {"to_m": (0.35, 0.21, 0.0)}}]},
    }
    arms = (*config.arms, type(config.arms[0]).model_validate(third))
    return build_cell(config.model_copy(update={"name": "trio", "arms": arms, "chart_tolerance_m": 0.001}))
