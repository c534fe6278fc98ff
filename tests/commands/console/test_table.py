"""Cells of the table of an evaluation: what is red, what stands below, and digits that count."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.agents import Figure
from armtempo.commands.console._table import _beyond, _cell, significant

LIMITED = Figure(head="torque", limit=1.0)
EVALUATION: Any = SimpleNamespace(episodes=4, facts={"d_min_m": 0.01})


def cell(value: Any, figure: Figure, **more: Any) -> str:
    return _cell(EVALUATION, SimpleNamespace(it=value, **more), "it", figure, True)


def test_a_limit_is_passed_by_more_than_ticks_resolve() -> None:
    assert cell(1.0009, LIMITED) == "1.001"
    assert cell(1.0011, LIMITED) == "[red]1.001[/]"
    assert cell(None, LIMITED) == "–"


def test_a_least_value_is_a_fact_of_the_evaluation() -> None:
    figure = Figure(head="clearance\n[mm]", least="d_min_m", scale=1e3, digits=1)
    assert cell(0.01, figure) == "10.0"
    assert cell(0.0099, figure) == "[red]9.9[/]"
    assert not _beyond(None, figure, EVALUATION.facts)


def test_episodes_that_were_not_finished_and_mishaps_stand_out() -> None:
    assert cell(4, Figure(head="done", form="episodes")) == "4/4"
    assert cell(3, Figure(head="done", form="episodes")) == "[bold red]3/4[/]"
    assert cell(0, Figure(head="hits", form="mishaps")) == "0"
    assert cell(2, Figure(head="hits", form="mishaps")) == "[bold red]2[/]"


def test_an_interval_stands_below_its_number_and_not_below_a_dash() -> None:
    figure = Figure(head="time", digits=2, interval="ends")
    assert cell(0.5, figure, ends=(0.4, 0.6)) == "0.50\n(0.40–\n0.60)"
    assert cell(None, figure, ends=None) == "–"


@pytest.mark.parametrize("digits", [2, 3, 5])
@given(value=st.floats(1e-3, 1e9))
def test_significant_digits_are_enough_to_come_back_to_the_value(digits: int, value: float) -> None:
    assert float(significant(value, digits)) == pytest.approx(value, rel=0.51 * 10.0 ** (1 - digits))
