"""What cells with one arm have in common: the arm, and the times of their simulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Self, TypeVar

from armtempo.configs import OneArmCellConfig
from armtempo.robots import Arm, Shape

__all__ = ["OneArmCell"]

Config = TypeVar("Config", bound=OneArmCellConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class OneArmCell(Generic[Config]):
    """One arm and what it is to do.

    Attributes:
        name: The cell's name.
        config: What it was built from.
        arm: The arm.
    """

    name: str
    config: Config
    arm: Arm

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self  # nothing in it changes; gymnasium.make copies the arguments of environments

    @property
    def arms(self) -> tuple[Arm]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @property
    def obstacles(self) -> tuple[Shape, ...]:
        """None: these cells have no bodies but the arm."""
        return ()

    @property
    def physics_tick(self) -> float:
        """Step of the simulation and of the reference [s]."""
        return self.config.physics_tick_s

    @property
    def control_period(self) -> float:
        """Time between two decisions [s]."""
        return self.config.control_period_s

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return self.config.ticks_per_period
