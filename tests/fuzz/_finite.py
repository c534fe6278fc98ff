"""Whether what a reader accepted holds finite numbers alone, however deep they are."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

UNLIMITED = {"position_min", "position_max", "acceleration_max", "jerk_max", "speed_max", "lower_bound", "bound"}
"""Names under which infinity says that there is no limit. NaN says nothing anywhere."""


class NotFiniteError(AssertionError):
    """A model that was accepted holds NaN or infinity."""


def check_finite(value: object) -> None:
    """Raise NotFiniteError for the first number in a model that is not finite; names its place."""
    for place in _bad_places(value, "", set()):
        raise NotFiniteError(f"accepted, and {place}")


def _bad_places(value: object, place: str, seen: set[int]) -> Iterator[str]:
    if isinstance(value, float | np.floating | np.ndarray):
        yield from _bad_numbers(np.asarray(value), place)
    elif not isinstance(value, str | bytes | int | Path | None) and id(value) not in seen:
        seen.add(id(value))
        for name, inner in _inside(value):
            yield from _bad_places(inner, f"{place}.{name}", seen)


def _bad_numbers(array: np.ndarray[Any, Any], place: str) -> Iterator[str]:
    unlimited = place.rpartition(".")[2] in UNLIMITED or UNLIMITED & set(place.split("."))
    if array.dtype.kind in "fc" and (np.isnan(array).any() or not (unlimited or np.isfinite(array).all())):
        flat = array.reshape(-1)
        worst = flat[~np.isfinite(flat)][0]
        yield f"{place.lstrip('.')} is {worst}"


def _inside(value: object) -> Iterator[tuple[str, object]]:
    if isinstance(value, BaseModel):
        yield from ((name, getattr(value, name)) for name in type(value).model_fields)
    elif is_dataclass(value) and not isinstance(value, type):
        yield from ((one.name, getattr(value, one.name)) for one in fields(value))
    elif isinstance(value, Mapping):
        yield from ((str(key), inner) for key, inner in value.items())
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        yield from zip(getattr(value, "_fields"), value, strict=True)  # noqa: B009 (tuples have none)
    elif isinstance(value, tuple | list):
        yield from ((str(k), inner) for k, inner in enumerate(value))


def check_number(value: float, what: str) -> None:
    """Raise NotFiniteError unless it is finite."""
    if not math.isfinite(value):
        raise NotFiniteError(f"accepted, and {what} is {value}")
