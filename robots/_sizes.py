"""What size a number of a robot may have: far beyond every robot, far below where products overflow."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import RobotError

__all__ = [
    "ANGLE_MAX",
    "FORCE_MAX",
    "GRAVITY_MAX",
    "INERTIA_MAX",
    "LENGTH_MAX",
    "LIMIT_MAX",
    "MASS_MAX",
    "UNLIMITED",
    "read_array",
    "read_number",
]

LENGTH_MAX: Final = 1e4
"""[m]: of bodies, and of a frame from the one before."""
ANGLE_MAX: Final = 1e4
"""[rad] of a fixed rotation."""
MASS_MAX: Final = 1e9
"""[kg]."""
INERTIA_MAX: Final = 1e15
"""[kg m^2]."""
FORCE_MAX: Final = 1e12
"""Of friction, per speed or not [N m, N]."""
UNLIMITED: Final = 1e12
"""Torque limit [N m] or force limit [N] of a joint of which none is known."""
LIMIT_MAX: Final = 1e16
"""Of limits of positions, speeds, torques and accelerations: what exporters write for "none"."""
GRAVITY_MAX: Final = 1e6
"""[m/s^2]."""


def read_array(values: Any, shape: tuple[int | None, ...], most: float, what: str, unit: str = "") -> Floats:
    """``values`` as an array of a shape (None: any length) of finite numbers up to ``most``. Raises RobotError."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        array = np.full((), math.nan)
    fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
    if not fits or not (np.abs(array) <= most).all():
        asked = f"({', '.join('any' if n is None else str(n) for n in shape)}{',' * (len(shape) == 1)})"
        raise RobotError(
            f"{what} is not {asked} finite numbers up to {most:g}{unit and ' '}{unit}",
            remedy="give finite numbers, and of that shape",
            element=what,
        )
    return array


def read_number(value: Any) -> float:
    """``value`` as a float; NaN, which no comparison lets through, where it is none."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan
