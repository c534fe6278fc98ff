"""Messages are one line that a terminal may show, whatever the value that they tell of costs to write down."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from armtempo.errors import ArmtempoError, InputError, UnknownNameError, brief, closest, printable


def nested(depth: int) -> list[Any]:
    """Lists in lists that stand for 10 ** depth items."""
    value: list[Any] = [1]
    for _ in range(depth):
        value = [value] * 10
    return value


class Sulky:
    def __repr__(self) -> str:
        raise RuntimeError("never asked")


@pytest.mark.parametrize(
    "value",
    [
        10**60, 10**100_000, -(16**50_000), nested(40), {"a": nested(40)}, (nested(40),), dict.fromkeys(range(10**6)),
        set(range(10**6)), frozenset(range(10**6)), "x" * 10**7, np.zeros((3000, 3000)),
        np.array([nested(2), None], dtype=object), Sulky(), [Sulky()], object(), lambda: 0, b"\0" * 10**6,
    ],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_no_value_costs_more_than_a_glance(value: Any) -> None:
    begin = time.perf_counter()
    text = brief(value)
    assert time.perf_counter() - begin < 0.5
    assert 0 < len(text) <= 60
    assert text.isprintable()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "None"),
        (-3, "-3"),
        (0.25, "0.25"),
        ("a\n\x1b[31m", r"'a\n\x1b[31m'"),
        ([1, "a"], "[1, 'a']"),
        ({"b": 1, "a": [2]}, "{'b': 1, 'a': [2]}"),
        (np.array([0.5, np.nan]), "array([0.5, nan])"),
        (np.float32(0.5), "np.float32(0.5)"),
        (10**60, "a whole number of about 61 digits"),
        (np.zeros((20, 30)), "array of shape (20, 30) and dtype float64"),
        (dict, "dict"),
    ],
)
def test_short_values_are_told_as_they_are(value: Any, text: str) -> None:
    assert brief(value) == text


def test_a_message_is_one_printable_line_of_bounded_length() -> None:
    error = ArmtempoError("first\nsecond \x1b[2J \ud800 \u202e", remedy="x" * 10**6)
    assert error.message == r"first second \x1b[2J \ud800 \u202e"
    assert len(str(error)) < 7000
    assert str(error).isprintable()
    assert error.at("file\n").message.startswith("file : first")
    assert printable("Ångström – 3°") == "Ångström – 3°"


def test_unknown_names_may_be_anything() -> None:
    begin = time.perf_counter()
    for name in (nested(40), "x" * 10**7, None, 3):
        error = UnknownNameError("physics", name, ("bullet", "ideal"))
        assert "known: bullet, ideal" in str(error)
    assert time.perf_counter() - begin < 2.0
    assert closest("bulet", ("bullet", "ideal")) == "did you mean 'bullet'? "
    assert closest([1], ("bullet",)) == closest("x" * 10**6, ("bullet",)) == ""
    assert issubclass(InputError, ValueError)
