"""Figures of results: what every kind says of its own, and how they are printed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from string import Formatter
from typing import Any

import pytest

from armtempo.agents import KINDS, Kind, figure, figures_of
from armtempo.agents.evaluation import numbers_of, option_names
from armtempo.commands.console import number, significant
from armtempo.commands.console._table import _text
from armtempo.commands.reports import REPORTS
from armtempo.planners.cells import CELLS


@pytest.fixture(params=sorted(KINDS))
def kind(request: pytest.FixtureRequest) -> Kind[Any, Any, Any, Any]:
    return KINDS[request.param]


def test_every_kind_of_cell_can_be_evaluated_and_reported() -> None:
    assert set(CELLS) == set(KINDS) == set(REPORTS)
    assert all(kind.name == name for name, kind in KINDS.items())


def test_what_a_kind_says_of_its_options_is_in_the_record(kind: Kind[Any, Any, Any, Any]) -> None:
    names = {one.name for one in fields(kind.options_type)}
    assert {*kind.settled, *kind.always_told} <= names
    assert set(option_names(kind)) == names - set(kind.settled)
    assert "random" in kind.policies


def test_figures_refer_to_what_there_is(kind: Kind[Any, Any, Any, Any]) -> None:
    figures = figures_of(kind.result_type)
    for name, one in figures.items():
        assert one.interval is None or one.interval in figures, name
        braces = {text for _, text, *_ in Formatter().parse(one.head or "") if text}
        assert braces <= {"best_online"}, name
    plain = [one.name for one in fields(kind.result_type) if one.name not in figures]
    assert set(plain) <= {"trace", "schedule"}
    shown = [one.head for one in figures.values() if one.head is not None]
    assert all(head.count("\n") <= 1 for head in shown)


def test_a_field_without_a_figure_is_in_no_json() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Result:
        time_s: float = figure("time\n[ms]", digits=1, scale=1e3)
        secret: str

    assert numbers_of(Result(time_s=0.5, secret="trace")) == {"time_s": 0.5}
    assert figures_of(Result)["time_s"].head == "time\n[ms]"


@pytest.mark.parametrize(
    ("settings", "value", "text"),
    [
        ({"digits": 1}, 0.25, "0.2"),
        ({}, None, "–"),
        ({"scale": 1e3, "form": "small"}, 4e-7, "4e-04"),
        ({"scale": 1e3, "form": "small"}, 5e-7, "0.001"),
        ({"scale": 1e3, "form": "small"}, 0.0, "0.000"),
        ({"scale": 1e3, "form": "small"}, 9e-11, "<1e-7"),
        ({"form": "small"}, None, "–"),
        ({"form": "significant"}, 12345.6, "1.23e+04"),
        ({"form": "significant"}, 9.94e-4, "9.9e-04"),
        ({"form": "interval", "digits": 2}, (0.123, 0.456), "0.12–\n0.46"),
        ({"form": "interval"}, None, "–"),
    ],
)
def test_forms(settings: Mapping[str, Any], value: Any, text: str) -> None:
    @dataclass(frozen=True, kw_only=True)
    class Result:
        it: Any = figure("it", **settings)

    one = figures_of(Result)["it"]
    assert _text(value, one, one.digits) == text


def test_zero_has_no_sign() -> None:
    assert number(-1e-9, 3) == "0.000"
    assert significant(0.0) == "0"
