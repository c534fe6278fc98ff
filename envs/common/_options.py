"""Options of episodes: one record per kind of cell, checked where it is made and nowhere else."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from inspect import Parameter, signature
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar

import numpy as np

from armtempo.envs.bodies import PHYSICS
from armtempo.errors import InputError, UnknownNameError, brief
from armtempo.reading import MOST_MAGNITUDE

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
        if not isinstance(name, str) or name not in known:
            raise UnknownNameError(kind, name, known)


def is_number(value: object) -> TypeGuard[float]:
    """Whether it is one finite number of a sane size; True and False are none."""
    return (
        isinstance(value, int | float | np.integer | np.floating)
        and not isinstance(value, bool)
        and bool(-MOST_MAGNITUDE <= value <= MOST_MAGNITUDE)  # not nan, either; and no float is made of 400 digits
    )


def check_flags(**flags: object) -> None:
    """Raise InputError for the first that is neither True nor False: ``"no"`` would count as yes."""
    for name, value in flags.items():
        if not isinstance(value, bool | np.bool_):
            raise InputError(f"{name} must be True or False, got {brief(value)}", remedy="give one of them")


def read_seed(seed: object, what: str = "seed") -> int | None:
    """A seed, None if there is none.

    Raises:
        InputError: It is no whole number, or below 0.
    """
    if seed is None:
        return None
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0:
        raise InputError(f"{what} must be a whole number, 0 or more, got {brief(seed)}", remedy="give one, or None")
    return int(seed)


def check_time_limit(max_episode_s: float | None) -> None:
    """Raise InputError unless it is a time [s], or None."""
    if max_episode_s is not None and not (is_number(max_episode_s) and max_episode_s > 0.0):
        what = f"max_episode_s must be positive, got {brief(max_episode_s)}"
        raise InputError(what, remedy=f"give seconds, {MOST_MAGNITUDE:g} at most, or None")


def check_bodies(physics: str, **errors: float) -> None:
    """Raise unless ``physics`` exists and its bodies can be off by these shares.

    Raises:
        UnknownNameError: No such physics.
        InputError: A share that no body can have, or one in ``ideal``, which has no bodies.
    """
    check_names(("physics", physics, PHYSICS))
    for name, value in errors.items():
        if not (is_number(value) and value > -1.0):
            raise InputError(f"{name} must be a share above -1, got {brief(value)}", remedy="give 0.1 for 10 % more")
        if value and physics == "ideal":
            raise InputError(
                f"{name} is {value:g} and physics {brief(physics)}, which has no bodies",
                remedy=f"take physics='bullet' or 'mujoco', or leave {name} out",
            )
