"""Options of episodes: one record per kind of cell, checked where it is made and nowhere else."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar

import numpy as np

from armtempo.envs.bodies import PHYSICS
from armtempo.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    OptionsT = TypeVar("OptionsT", bound=DataclassInstance)
else:
    OptionsT = TypeVar("OptionsT")


def options_of(
    kind: type[OptionsT], keywords: Mapping[str, Any], taker: Callable[..., object] | None = None
) -> OptionsT:
    """The options that keywords mean.

    Args:
        kind: The record of options.
        keywords: Some of its fields.
        taker: What was called with them, beside arguments of its own: these are named to who misspells one, too.

    Raises:
        UnknownNameError: There is no such option; the message names the nearest one.
        InputError: A value that an episode cannot have.
    """
    known = [field.name for field in fields(kind)]
    if taker is not None and not set(keywords) <= set(known):
        own = signature(taker).parameters.values()
        known += [parameter.name for parameter in own if parameter.kind is not Parameter.VAR_KEYWORD]
    check_names(*(("option", name, known) for name in keywords))
    return kind(**keywords)


def check_names(*choices: tuple[str, object, Sequence[str]]) -> None:
    """Raise UnknownNameError for the first (kind, name, known names) whose name is not known."""
    for kind, name, known in choices:
        if name not in known:
            raise UnknownNameError(kind, str(name), known)


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is one finite number; True and False are none."""
    return (
        isinstance(value, int | float | np.integer | np.floating)
        and not isinstance(value, bool)
        and math.isfinite(value)
    )


def check_time_limit(max_episode_s: float | None) -> None:
    """Raise InputError unless it is a time [s], or None."""
    if max_episode_s is not None and not (is_number(max_episode_s) and max_episode_s > 0.0):
        raise InputError(f"max_episode_s must be positive, got {max_episode_s!r}", remedy="give seconds, or None")


def check_bodies(physics: str, **errors: float) -> None:
    """Raise unless ``physics`` exists and its bodies can be off by these shares.

    Raises:
        UnknownNameError: No such physics.
        InputError: A share that no body can have, or one in ``ideal``, which has no bodies.
    """
    check_names(("physics", physics, PHYSICS))
    for name, value in errors.items():
        if not (is_number(value) and value > -1.0):
            raise InputError(f"{name} must be a share above -1, got {value!r}", remedy="give 0.1 for 10 % more")
        if value and physics != "bullet":
            raise InputError(
                f"{name} is {value:g} and physics {physics!r}, which has no bodies",
                remedy=f"take physics='bullet', or leave {name} out",
            )
