"""Limits of the motion along a path, and how fast they let it pass a bend."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError, brief
from armtempo.planners.geometry import number


@dataclass(frozen=True, kw_only=True, slots=True)
class LineSpeedLimits:
    """Limits of the motion along a path.

    Args:
        speed: Largest line speed [m/s].
        acceleration: Largest tangential acceleration [m/s^2].
        jerk: Largest jerk [m/s^3]: tangential, or of the whole vector where a path is known.
        normal_acceleration: Largest normal acceleration [m/s^2]; that of ``acceleration`` unless given.

    Raises:
        InputError: A limit that is not a positive finite number.
    """

    speed: float
    acceleration: float
    jerk: float
    normal_acceleration: float | None = None

    def __post_init__(self) -> None:
        if self.normal_acceleration is None:
            object.__setattr__(self, "normal_acceleration", self.acceleration)
        for name in self.__slots__:
            value = getattr(self, name)
            real = isinstance(value, int | float | np.number)
            if not (real and 0.0 < number(value, f"limit {name}") < math.inf):
                raise InputError(f"limit {name} must be a positive finite number, got {brief(value)}")
            object.__setattr__(self, name, float(value))

    @property
    def normal(self) -> float:
        """The limit of the normal acceleration as a plain number [m/s^2]."""
        return self.acceleration if self.normal_acceleration is None else self.normal_acceleration


def square_caps(limits: LineSpeedLimits, bend: Floats) -> Floats:
    """The largest v^2 by speed and normal acceleration, at curvatures [1/m] of any shape."""
    return np.asarray(np.minimum(limits.speed**2, limits.normal / np.maximum(bend, 1e-300)))
