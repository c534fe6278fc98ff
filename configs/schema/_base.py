"""Numbers and names of cell and training files, and what every mapping in them has in common.

One model per mapping of a file, attribute names equal to the keys. Keys carry their unit (``_m``, ``_rad``, ``_s``,
``_nm`` = N m). Every number must be finite, unknown keys are refused, and a loaded model cannot be changed.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Final

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    StringConstraints,
    Tag,
)
from pydantic_core import PydanticCustomError

from armtempo.reading import MOST_MAGNITUDE

SMALLEST_POSITIVE: Final = 1e-12
LONGEST_NAME: Final = 100  # characters: names become those of files


def _only_numbers(value: Any) -> Any:
    """Refuse what pydantic would turn into a number: ``"1.0"`` and ``true`` in a YAML file are slips."""
    if isinstance(value, bool | str | bytes):
        raise PydanticCustomError("float_type", "must be a number")
    if isinstance(value, int):  # one that no float holds raises there
        _of_a_size(value)
    return value


def _of_a_size(value: float) -> float:
    if value in (math.inf, -math.inf) or not abs(value) > MOST_MAGNITUDE:  # the field itself refuses what is not finite
        return value
    raise PydanticCustomError("float_size", "must be at most {most} in size", {"most": f"{MOST_MAGNITUDE:g}"})


def _not_tiny(value: float) -> float:
    if value < SMALLEST_POSITIVE:
        raise PydanticCustomError("float_size", "must be at least {least}", {"least": f"{SMALLEST_POSITIVE:g}"})
    return value


Real = Annotated[float, BeforeValidator(_only_numbers), Field(allow_inf_nan=False), AfterValidator(_of_a_size)]


Positive = Annotated[Real, Field(gt=0), AfterValidator(_not_tiny)]


NonNegative = Annotated[Real, Field(ge=0)]


CHOICE: Final = (
    "<"  # begins what pydantic calls the choices of a key that takes either of two kinds; no key is so named
)


def _one_or_each(value: Any) -> str:
    return "<each>" if isinstance(value, list | tuple) else "<one>"


PerJoint = Annotated[
    Annotated[Positive, Tag("<one>")] | Annotated[tuple[NonNegative, ...], Tag("<each>")],
    Discriminator(_one_or_each),
]


Point = tuple[Real, Real, Real]


Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$", max_length=LONGEST_NAME)]


CellTitle = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_-]*$", max_length=LONGEST_NAME)]


ZERO: Point = (0.0, 0.0, 0.0)


class FileModel(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


def exactly_one(model: BaseModel, what: str, among: tuple[str, ...] = ()) -> str:
    """Name of the one field of ``model`` that is set, of these, or of those that default to None."""
    choices = among or [name for name, field in type(model).model_fields.items() if field.default is None]
    given = [name for name in choices if getattr(model, name) is not None]
    if len(given) != 1:
        raise ValueError(f"{what} needs exactly one of {', '.join(choices)}; got {', '.join(given) or 'none'}")
    return given[0]
