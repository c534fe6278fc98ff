"""Errors of armtempo: one root, one class per cause, the data in attributes, the remedy in the message.

Every message is one line: what was wrong, where, and what to do. Commands print it and exit with status 2.
"""

from __future__ import annotations

import enum
import reprlib
from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from inspect import signature
from itertools import islice
from pathlib import PurePath
from typing import Any, Final, Self

import numpy as np

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
    "brief",
    "check_keywords",
    "closest",
    "printable",
]

LONGEST_LINE: Final = 3000  # characters of a message
BRIEF_LENGTH: Final = 60  # characters of a value in it
LONGEST_NAME: Final = 100  # characters of a name that others are compared with
PLAIN: Final = (bool, type(None), complex, float, bytes, range, enum.Enum, PurePath, np.bool_, np.number)


class _Brief(reprlib.Repr):
    """``repr`` that looks at no more of a value than it shows, and shows none that could be as long as it likes."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxother = 4, BRIEF_LENGTH, BRIEF_LENGTH
        self.maxlist = self.maxtuple = self.maxdict = 8

    def repr_int(self, x: int, level: int) -> str:
        """Long numbers by their size: to write down all digits takes time that grows with their square."""
        bits = x.bit_length()
        return repr(x) if bits < 200 else f"a whole number of about {int(bits * 0.30103) + 1} digits"  # log10(2)

    def repr_dict(self, x: Mapping[Any, Any], level: int) -> str:
        """The first entries, as they come: to sort them, all had to be looked at."""
        if level <= 0 and x:
            return "{...}"
        shown = [f"{self.repr1(k, level - 1)}: {self.repr1(v, level - 1)}" for k, v in islice(x.items(), self.maxdict)]
        return "{" + ", ".join(shown + ["..."] * (len(x) > self.maxdict)) + "}"

    def repr_set(self, x: Any, level: int) -> str:
        """Short ones alone; level: as for the others."""
        return super().repr_set(x, level) if len(x) <= self.maxset else f"a set of {len(x)}"

    def repr_frozenset(self, x: Any, level: int) -> str:
        """As sets."""
        return self.repr_set(set(x), level)

    def repr_ndarray(self, x: Any, level: int) -> str:
        """Short arrays of numbers; of others type and shape."""
        if x.size <= self.maxlist and x.dtype.kind in "biufc":
            return " ".join(repr(x).split())
        return f"array of shape {x.shape} and dtype {x.dtype}"

    def repr_instance(self, x: Any, level: int) -> str:
        """Plain values; of others the type: what they hold may be long."""
        if isinstance(x, type):
            return x.__name__
        return super().repr_instance(x, level) if isinstance(x, PLAIN) else f"<{type(x).__name__}>"


_BRIEF: Final = _Brief()


def brief(value: object) -> str:
    """A value for a message, in one line of at most 60 characters. What it costs does not depend on its size."""
    text = printable(" ".join(_BRIEF.repr(value).split()))
    return text if len(text) <= BRIEF_LENGTH else f"{text[: BRIEF_LENGTH - 3]}..."


def _one_line(text: str) -> str:
    if len(text) > LONGEST_LINE:
        text = f"{text[: LONGEST_LINE // 2]}...{text[-LONGEST_LINE // 3 :]}"  # begins with where, ends with what
    return text if text.isprintable() else printable(" ".join(text.split()))


def printable(text: str) -> str:
    """``text`` as a terminal may show it: control characters, and what is no character, as escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


class ArmtempoError(Exception):
    """Root of all errors raised on purpose by armtempo.

    Attributes:
        message: What was wrong, and where.
        remedy: What the user can do about it.
        data: The values that explain the error (names depend on the class), for programs.
    """

    def __init__(self, message: str, *, remedy: str = "", **data: Any) -> None:
        self.message = _one_line(message)
        self.remedy = _one_line(remedy)
        self.data = data
        super().__init__(f"{self.message} ({self.remedy})" if remedy else self.message)

    def at(self, place: str) -> Self:
        """The same error, its message headed by where in the user's input it comes from."""
        self.message = _one_line(f"{place}: {self.message}")
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

    def __init__(self, kind: str, name: object, known: Iterable[str], *, remedy: str = "") -> None:
        choices = sorted(known)
        remedy = remedy or f"{closest(name, choices)}known: {', '.join(choices)}"
        super().__init__(f"unknown {kind} {brief(name)}", remedy=remedy, kind=kind, name=name, known=choices)


def closest(name: object, known: Iterable[str]) -> str:
    """``did you mean ...? `` for a name much like a known one, else nothing."""
    close = get_close_matches(name, known, n=1) if isinstance(name, str) and len(name) <= LONGEST_NAME else []
    return f"did you mean {close[0]!r}? " if close else ""


def check_keywords(function: Callable[..., object], extra: Mapping[str, object], known: Iterable[str]) -> None:
    """Raise UnknownNameError for the first of a call's ``extra`` keywords (its ``**``) that is not ``known``.

    The message names the nearest one among all keywords of the function.
    """
    known = list(known)
    for name in extra:
        if name not in known:
            named = [p.name for p in signature(function).parameters.values() if p.kind is not p.VAR_KEYWORD]
            raise UnknownNameError("keyword", name, [*named, *known])
