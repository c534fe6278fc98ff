"""What a result's fields are in tables and JSON: said where the field is, read by whoever prints it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, Literal

METADATA_KEY = "armtempo figure"

Form = Literal["fixed", "small", "significant", "interval", "episodes", "mishaps"]
"""How a table prints a figure.

``fixed``: with ``digits`` after the point. ``small``: likewise, but what would be zero says how small it is.
``significant``: ``digits`` that count. ``interval``: both ends. ``episodes``: how many of all, red where some are
missing. ``mishaps``: a count, red unless 0.
"""


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A number of a result.

    Attributes:
        head: Of its column, with the unit, two lines at most; facts of the evaluation by name in braces. None: no
            column, the number is in JSON alone.
        digits: See ``Form``; narrow tables keep three.
        scale: What it is multiplied with: the column's unit in the field's.
        limit: Red where it is above this, by more than ticks resolve.
        least: Red where it is below the fact of that name.
        form: How it is printed.
        interval: The field with its confidence interval, printed below it.
        known: Whether its column is left out where no policy has the number.
        several: Whether its column is for several episodes (True) or for one alone (False); None: for both.
        roomy: Whether its column is for wide tables alone.
    """

    head: str | None = None
    digits: int = 3
    scale: float = 1.0
    limit: float | None = None
    least: str | None = None
    form: Form = "fixed"
    interval: str | None = None
    known: bool = False
    several: bool | None = None
    roomy: bool = False


def figure(
    head: str | None = None,
    *,
    digits: int = 3,
    scale: float = 1.0,
    limit: float | None = None,
    form: Form = "fixed",
    default: Any = MISSING,
    **more: Any,
) -> Any:
    """A field of a result's dataclass that is a ``Figure``, in JSON and where it has a head in tables.

    Fields without one (traces, plans) are in neither. ``default`` is the field's. ``more`` are the attributes of
    ``Figure`` that few have.
    """
    told = Figure(head=head, digits=digits, scale=scale, limit=limit, form=form, **more)
    return field(default=default, metadata={METADATA_KEY: told})


def figures_of(result: type[Any]) -> dict[str, Figure]:
    """The figures of a result's dataclass, in the order of its fields."""
    return {one.name: one.metadata[METADATA_KEY] for one in fields(result) if METADATA_KEY in one.metadata}


def numbers_of(result: Any) -> dict[str, Any]:
    """The numbers of a result, by name."""
    return {name: getattr(result, name) for name in figures_of(type(result))}


def with_numbers(result: Any, numbers: Mapping[str, Any]) -> Any:
    """The same result with other numbers, which JSON may have held."""
    return replace(result, **{name: _tuples(value) for name, value in numbers.items()})


def result_of(result: type[Any], numbers: Mapping[str, Any]) -> Any:
    """A result of numbers alone: no traces, no plans."""
    others = {one.name: None for one in fields(result) if one.name not in numbers}
    return result(**others, **{name: _tuples(value) for name, value in numbers.items()})


def _tuples(value: Any) -> Any:
    """What JSON has as lists are tuples in results."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
