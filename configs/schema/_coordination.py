"""Cells of kind coordination."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    BeforeValidator,
    Field,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError, PydanticKnownError

from armtempo.configs.schema._arm import ArmConfig, MountedArmConfig
from armtempo.configs.schema._base import (
    NonNegative,
    Positive,
    Real,
)
from armtempo.configs.schema._cell import CellFileConfig
from armtempo.configs.schema._obstacles import ObstacleConfig

_Named = TypeVar("_Named", MountedArmConfig, ObstacleConfig)


RESERVE_MAX = 0.9


def _reserve(value: Any) -> Any:
    """A share, or ``auto``; numbers are checked here, so that messages do not speak of alternatives."""
    if value == "auto":
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise PydanticCustomError("float_type", "must be a number or auto")
    if not math.isfinite(value):
        raise PydanticKnownError("finite_number")
    if value < 0.0:
        raise PydanticKnownError("greater_than_equal", {"ge": 0.0})
    if value > RESERVE_MAX:
        raise PydanticKnownError("less_than_equal", {"le": RESERVE_MAX})
    return value


class SharedSpaceConfig(CellFileConfig):
    """What cells of several arms say, whatever their paths come from: how closely they may pass, and how to plan."""

    d_min_m: NonNegative
    """Smallest distance allowed between the surfaces of two arms, or of an arm and an obstacle [m].

    Boxes, cylinders and hulls that overlap are 0 apart however deep they are in each other: at ``d_min_m`` 0 they break
    no rule, and charts cannot call a cell of theirs blocked, only undecided. Give such arms more than 0.
    """
    clearance_reserve_m: NonNegative = 0.0005
    """Planned on top of ``d_min_m``, for what the execution will deviate [m]."""
    torque_reserve: Annotated[Real | Literal["auto"], BeforeValidator(_reserve)] = 0.0
    """Share of each torque limit that plans leave to the controller, 0 to 0.9.

    auto: 0.01, and in environments what their ``model_error`` and ``friction_error`` need.
    """
    control_period_s: Positive = 0.004
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    stations: Annotated[int, Field(ge=50, le=16000, strict=True)] = 1000
    """Intervals of the phase-plane grid along each path; doubled until sampled torques exceed no limit by 0.1 %."""
    chart_tolerance_m: Annotated[Real, Field(ge=1e-6)] = 0.0004
    """Side of the smallest cell of a coordination chart [m]; a chart has at most 8192 cells along each side.

    Where cells that are neither certified free nor blocked would cost more than 0.3 % of the makespan (of N arms, an
    (N-1)th of that), the charts of the pairs that it hangs on get cells of a half or a quarter of that by themselves,
    and of an eighth where arms would not get through else.
    """
    chart_cells: Annotated[int, Field(ge=16, le=4096, strict=True)] | None = None
    """Instead: cells along each side, a power of two; null: 1024 where a path goes through joint waypoints.

    Likewise the least that a chart has: two or four times as many where undecided cells would cost time, and eight
    times where they would shut a way.
    """
    arms: Annotated[tuple[MountedArmConfig, ...], Field(min_length=1)]
    """The arms in priority order: the first is the master."""
    obstacles: tuple[ObstacleConfig, ...] = ()
    """Bodies that stand still."""

    def chart_tolerance(self, longest: float) -> float:
        """Side of the smallest cell of a chart [lambda], the longer of its two paths being ``longest``."""
        cells = self.chart_cells
        if cells is None and not self.measured_in_metres:
            cells = 1024
        if cells is not None:
            return longest / cells * (1.0 + 1e-9)  # so that rounding does not double the cells
        return self.chart_tolerance_m

    @property
    def measured_in_metres(self) -> bool:
        """Whether lambda is the length of all paths [m]."""
        return False

    @field_validator("arms", "obstacles")
    @classmethod
    def _names_differ(cls, bodies: tuple[_Named, ...]) -> tuple[_Named, ...]:
        names = [body.name for body in bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"each needs a name of its own; used twice: {', '.join(twice)}")
        return bodies

    @model_validator(mode="after")
    def _one_chart_size(self) -> Self:
        if self.chart_cells is not None and self.chart_cells & (self.chart_cells - 1):
            raise ValueError(f"chart_cells: must be a power of two, got {self.chart_cells}")
        if "chart_tolerance_m" in self.model_fields_set:
            if self.chart_cells is not None:
                raise ValueError("chart_cells: give it or chart_tolerance_m, not both")
            if not self.measured_in_metres:
                raise ValueError(
                    "chart_tolerance_m: paths through joint waypoints are not measured in metres; give chart_cells"
                )
        return self


class CellConfig(SharedSpaceConfig):
    """Arms that share a space, each on its own given path, and how closely they may pass."""

    kind: Literal["coordination"]
    """What the cell is for."""
    arms: Annotated[tuple[ArmConfig, ...], Field(min_length=1)]
    """The arms in priority order: the first is the master."""

    @property
    def measured_in_metres(self) -> bool:
        """Whether lambda is the length of all paths [m]."""
        return all(arm.path.start_m is not None for arm in self.arms)
