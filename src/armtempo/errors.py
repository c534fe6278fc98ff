"""Errors of armtempo: one root, one class per cause, the data in attributes, the remedy in the message.

Every message is one line: what was wrong, where, and what to do. Commands print it and exit with status 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from inspect import signature
from typing import Any, Self

__all__ = [
    "ActionError",
    "ArmtempoError",
    "CollisionError",
    "ConfigError",
    "InfeasibleError",
    "InputError",
    "PathError",
    "RenderError",
    "RobotError",
    "UnknownNameError",
    "check_keywords",
]


class ArmtempoError(Exception):
    """Root of all errors raised on purpose by armtempo.

    Attributes:
        message: What was wrong, and where.
        remedy: What the user can do about it.
        data: The values that explain the error (names depend on the class), for programs.
    """

    def __init__(self, message: str, *, remedy: str = "", **data: Any) -> None:
        self.message = message
        self.remedy = remedy
        self.data = data
        super().__init__(f"{message} ({remedy})" if remedy else message)

    def at(self, place: str) -> Self:
        """The same error, its message headed by where in the user's input it comes from."""
        self.message = f"{place}: {self.message}"
        self.args = (f"{self.message} ({self.remedy})" if self.remedy else self.message,)
        return self


class ConfigError(ArmtempoError, ValueError):
    """A cell file cannot be used. ``data``: ``file``, ``key``, ``value``."""


class RobotError(ArmtempoError, ValueError):
    """A robot description cannot be used. ``data``: ``file``, ``element``."""


class PathError(ArmtempoError, ValueError):
    """A path cannot be followed by its arm. ``data``: ``arm``, ``station`` [m], and what was exceeded."""


class InfeasibleError(ArmtempoError, ValueError):
    """No timing keeps the limits. ``data``: ``station``, ``joint``, ``reason``, or the methods tried."""


class InputError(ArmtempoError, ValueError):
    """An argument of the Python interface cannot be used: wrong shape, not finite, out of range."""


class CollisionError(ArmtempoError, ValueError):
    """Two bodies come closer than allowed. ``data``: ``bodies``, ``clearance_m``, ``required_m``, stations."""


class ActionError(ArmtempoError, ValueError):
    """An action cannot be executed (NaN, wrong shape, wrong agent). ``data``: ``agent``, ``action``."""


class RenderError(ArmtempoError, RuntimeError):
    """A picture or a window cannot be made. ``data``: ``mode``."""


class UnknownNameError(ArmtempoError, LookupError):
    """A name that armtempo does not have. ``data``: ``name``, ``known``."""

    def __init__(self, kind: str, name: str, known: Iterable[str], *, remedy: str = "") -> None:
        choices = sorted(known)
        close = get_close_matches(name, choices, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        remedy = remedy or f"{hint}known: {', '.join(choices)}"
        super().__init__(f"unknown {kind} {name!r}", remedy=remedy, kind=kind, name=name, known=choices)


def check_keywords(function: Callable[..., object], extra: Mapping[str, object], known: Iterable[str]) -> None:
    """Raise UnknownNameError for the first of a call's ``extra`` keywords (its ``**``) that is not ``known``.

    The message names the nearest one among all keywords of the function.
    """
    known = list(known)
    for name in extra:
        if name not in known:
            named = [p.name for p in signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
            raise UnknownNameError("keyword", name, [*named, *known])
