"""What the files of cells of every kind say."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import (
    Field,
    PrivateAttr,
    model_validator,
)

from armtempo.configs.schema._base import (
    CellTitle,
    FileModel,
    Point,
    Positive,
    Real,
)


class CellFileConfig(FileModel):
    """What the files of all kinds of cells say."""

    kind: str
    """What the cell is for."""
    name: CellTitle
    """Name of the cell."""
    description: str = ""
    """What the cell shows, for `armtempo cells`."""
    physics_tick_s: Annotated[Real, Field(ge=1e-5, le=0.02)] = 0.001
    """Step of the simulation and of the reference [s]; clearance is watched at every tick, so it may not be long."""
    control_period_s: Positive = 0.02
    """Time between two decisions [s], a whole multiple of ``physics_tick_s``."""
    gravity_m_s2: Point = (0.0, 0.0, -9.81)
    """Acceleration of free fall [m/s^2], world frame."""

    _source: Path = PrivateAttr(default=Path("cell.yaml"))

    def model_post_init(self, context: Any, /) -> None:
        """Take the file from the validation context; it is no key that a file could set."""
        if context and "source" in context:
            self._source = context["source"]

    @property
    def source(self) -> Path:
        """The file this came from; file names in the cell are relative to its folder."""
        return self._source

    @property
    def built_as(self) -> str:
        """The kind of cell that it becomes: which environments, policies and reports are for it."""
        return self.kind

    @property
    def ticks_per_period(self) -> int:
        """Simulation steps between two decisions."""
        return round(self.control_period_s / self.physics_tick_s)

    @model_validator(mode="after")
    def _period_is_whole_ticks(self) -> Self:
        ticks = self.control_period_s / self.physics_tick_s
        if round(ticks) < 1 or abs(ticks - round(ticks)) > 1e-9 * round(ticks):
            raise ValueError(
                f"control_period_s: must be a whole multiple of physics_tick_s = {self.physics_tick_s:g}, "
                f"got {ticks:.6g} ticks; nearest: {max(1, round(ticks)) * self.physics_tick_s:g}"
            )
        return self
