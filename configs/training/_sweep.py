"""What a sweep file may say: which training, which of its numbers are searched, and how far one trial goes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, PrivateAttr, StrictBool, StringConstraints, model_validator

from armtempo.configs.schema import CellTitle, FileModel, Real
from armtempo.configs.training._base import Count, Few

SweepValue = float | int
NumberKey = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*$")]


class SearchedNumber(FileModel):
    """A number of the training file, searched between two others or among some."""

    low: Real | None = None
    """Lowest value."""
    high: Real | None = None
    """Highest value, included."""
    log: StrictBool = False
    """Search its logarithm."""
    integer: StrictBool = False
    """Whole numbers alone."""
    choices: Annotated[tuple[Real, ...], Field(min_length=2)] | None = None
    """These values instead of a range."""

    @model_validator(mode="after")
    def _range_or_choices(self) -> Self:
        if self.choices is not None:
            if self.model_fields_set != {"choices"}:
                raise ValueError("choices: give them alone, or low and high")
            return self
        if self.low is None or self.high is None:
            raise ValueError("low: give low and high, or choices")
        if not self.low < self.high:
            raise ValueError(f"high: must be above low, {self.low:g}, got {self.high:g}")
        if self.log and self.low <= 0.0:
            raise ValueError(f"low: must be above 0 to search the logarithm, got {self.low:g}")
        if self.integer and not (self.low.is_integer() and self.high.is_integer()):
            raise ValueError("low: both ends must be whole numbers with integer: true")
        return self


class SweepConfig(FileModel):
    """A search for better numbers of one training."""

    name: CellTitle
    """Of the sweep: what its trials are kept under."""
    training: Annotated[str, StringConstraints(min_length=1)]
    """Name of a bundled training, or the path of its file from here."""
    total_steps: Count
    """Agent steps of one trial."""
    sampler: Literal["tpe", "random"] = "tpe"
    """``tpe`` learns from the trials before, of all workers; ``random`` does not."""
    first_trials: Few = 10
    """Random ones before ``tpe`` begins."""
    space: Annotated[dict[NumberKey, SearchedNumber], Field(min_length=1)]
    """The numbers, by their keys in the training file joined with dots, such as ``ppo.learning_rate``."""

    _source: Path = PrivateAttr(default=Path())

    @property
    def source(self) -> Path:
        """The file it came from."""
        return self._source

    def read_from(self, source: Path) -> Self:
        """Remember the file."""
        self._source = source
        return self
