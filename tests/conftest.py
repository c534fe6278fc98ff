"""Fixtures that more than one folder of tests uses."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from armtempo.planners import Cell, JointPath, load_cell
from armtempo.robots import Arm

Floats = NDArray[np.float64]

os.environ["ARMTEMPO_CACHE"] = "off"  # tests find out for themselves


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


@pytest.fixture(scope="session")
def lee1991() -> Cell:
    """The bundled cell of the 1991 paper; immutable, so built once."""
    return load_cell("lee1991")


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
