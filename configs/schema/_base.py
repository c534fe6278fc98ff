"""Numbers and names of cell and training files, and what every mapping in them has in common.

One model per mapping of a file, attribute names equal to the keys. Keys carry their unit (``_m``, ``_rad``, ``_s``,
``_nm`` = N m). Every number must be finite, unknown keys are refused, and a loaded model cannot be changed.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
)
from pydantic_core import PydanticCustomError


def _only_numbers(value: Any) -> Any:
    """Refuse what pydantic would turn into a number: ``"1.0"`` and ``true`` in a YAML file are slips."""
    if isinstance(value, bool | str):
        raise PydanticCustomError("float_type", "must be a number")
    return value


Real = Annotated[float, BeforeValidator(_only_numbers), Field(allow_inf_nan=False)]


Positive = Annotated[Real, Field(gt=0)]


NonNegative = Annotated[Real, Field(ge=0)]


Point = tuple[Real, Real, Real]


Name = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_]*$")]


CellTitle = Annotated[str, StringConstraints(pattern=r"^[a-z][a-z0-9_-]*$")]


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
