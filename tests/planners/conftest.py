"""Arms, paths and cell files that the planners' tests are made of."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from armtempo.configs import data_path
from armtempo.planners import JointPath, PathDynamics
from armtempo.robots import Arm

Floats = NDArray[np.float64]
ROOT = Path(__file__).parents[2]
VERTICAL = (0.0, -9.81, 0.0)  # gravity in the plane of motion


class SplinePath(JointPath):
    """A cubic spline through joint positions: M changes its sign where a joint turns back."""

    def __init__(self, knots: Floats) -> None:
        self._spline = CubicSpline(np.linspace(0.0, 1.0, len(knots)), knots, bc_type="natural")
        self.length = 1.0
        self.dof = knots.shape[1]
        self.breakpoints = np.linspace(0.0, 1.0, len(knots))

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        lam = np.asarray(lam, dtype=np.float64)
        return self._spline(lam), self._spline(lam, 1), self._spline(lam, 2)

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        low, high = np.asarray(low), np.asarray(high)
        lam = low[..., None] + np.linspace(0.0, 1.0, 9) * (high - low)[..., None]
        loose = 0.0625 * (high - low)[..., None] * np.abs(self._spline(np.linspace(0.0, 1.0, 2001), 2)).max(axis=0)
        bound: Floats = np.abs(self._spline(lam, 1)).max(axis=-2) + loose
        return bound


@pytest.fixture(scope="session")
def make_arm() -> Callable[..., Arm]:
    """The paper's arm; keyword arguments as of ``Arm.from_urdf``."""

    def make(**options: Any) -> Arm:
        options.setdefault("name", "planar")
        return Arm.from_urdf(data_path("robots/planar_two_link.urdf"), **options)

    return make


@pytest.fixture(scope="session")
def spline_dynamics(make_arm: Callable[..., Arm]) -> Callable[..., PathDynamics]:
    """Rows of a seeded random spline path of the paper's arm, with gravity in its plane or without."""

    def make(
        seed: int, *, gravity: bool = True, intervals: int = 400, limits: tuple[float, float] = (80.0, 20.0)
    ) -> PathDynamics:
        knots = np.random.default_rng(seed).uniform(-1.2, 1.2, (5, 2))
        arm = make_arm(gravity=VERTICAL if gravity else (0.0, 0.0, -9.81), torque_max=limits)
        return PathDynamics.from_path(arm, SplinePath(knots), intervals=intervals)

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
