"""What cells of every kind are: arms and what they are to do, built from a file and certified."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, Self, TypeVar, runtime_checkable

import numpy as np

from armtempo.arrays import Floats
from armtempo.configs import CellFileConfig
from armtempo.planners.joint_paths import AbstractJointPath
from armtempo.robots import Arm, Shape

__all__ = ["Cell", "CellBase", "OneArmCell", "Sweep", "sweeps_along"]

ConfigT = TypeVar("ConfigT", bound=CellFileConfig)


class Sweep(NamedTuple):
    """What an arm is to come by."""

    q: Floats
    """(K, n) joint positions [rad, m]."""
    tip: Floats
    """(K, 3) points for its tip [m]."""


@runtime_checkable
class Cell(Protocol):
    """Arms and what they are to do, built from a file and certified; nothing in it changes."""

    @property
    def name(self) -> str:
        """The cell's name."""

    @property
    def kind(self) -> str:
        """What it is for: ``kind`` of its file."""

    @property
    def config(self) -> CellFileConfig:
        """What it was built from."""

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms in priority order."""

    @property
    def obstacles(self) -> tuple[Shape, ...]:
        """Static bodies."""

    @property
    def physics_tick(self) -> float:
        """Step of the simulation [s]."""

    @property
    def control_period(self) -> float:
        """Time between two decisions [s]."""

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""

    @property
    def gravity(self) -> tuple[float, float, float]:
        """[m/s^2] in world axes."""

    @property
    def follows_poses(self) -> bool:
        """Whether tips have to point somewhere, too, not only to be there."""

    def sweeps(self, count: int) -> tuple[Sweep, ...]:
        """So many postures of every arm along its way, for pictures."""

    def certify(self) -> None:
        """Check what can be checked before anything moves; raises PathError, InfeasibleError or CollisionError."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CellBase(Generic[ConfigT]):
    """What every kind of cell has in common; a kind adds its arms, what they are to do, and ``certify``.

    Attributes:
        name: The cell's name.
        config: What it was built from.
    """

    config_type: ClassVar[type[Any]]  # of its file

    name: str
    config: ConfigT

    @classmethod
    @abstractmethod
    def from_config(cls, config: ConfigT) -> Self:
        """Build and certify it.

        Raises:
            ConfigError: A file that it names cannot be used.
            PathError: A path is out of reach, breaks a limit or has a corner.
            InfeasibleError: Torque limits are too small.
            CollisionError: A path hits something.
        """

    @abstractmethod
    def certify(self) -> None:
        """Check what can be checked before anything moves; raises PathError, InfeasibleError or CollisionError."""

    @abstractmethod
    def sweeps(self, count: int) -> tuple[Sweep, ...]:
        """So many postures of every arm along its way, for pictures."""

    @property
    def follows_poses(self) -> bool:
        """Whether tips have to point somewhere, too, not only to be there."""
        return False

    def __deepcopy__(self, memo: dict[int, object]) -> Self:
        return self  # nothing in it changes; gymnasium.make copies the arguments of environments

    @property
    def kind(self) -> str:
        """What it is for: ``kind`` of its file."""
        return self.config.kind

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

    @property
    def gravity(self) -> tuple[float, float, float]:
        """[m/s^2] in world axes."""
        return self.config.gravity_m_s2


@dataclass(frozen=True, kw_only=True, eq=False)
class OneArmCell(CellBase[ConfigT]):
    """One arm and what it is to do.

    Attributes:
        name: The cell's name.
        config: What it was built from.
        arm: The arm.
    """

    arm: Arm

    @property
    def arms(self) -> tuple[Arm]:
        """The arm, as cells of several have theirs."""
        return (self.arm,)

    @property
    def obstacles(self) -> tuple[Shape, ...]:
        """None: these cells have no bodies but the arm."""
        return ()


def sweeps_along(arms: Sequence[Arm], paths: Sequence[AbstractJointPath], count: int) -> tuple[Sweep, ...]:
    """Of arms on joint paths, at equal shares of them."""
    postures = [path.evaluate(np.linspace(0.0, path.length, count))[0] for path in paths]
    return tuple(Sweep(q, arm.tip_pose(q)[:, :3, 3]) for arm, q in zip(arms, postures, strict=True))
