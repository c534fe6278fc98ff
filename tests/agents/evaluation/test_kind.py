"""Options of a kind: what can be asked, what was asked, and what is refused before a cell is opened."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import pytest

from armtempo.agents.evaluation import asked_options, keywords_of, option_names, options_for
from armtempo.errors import InputError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Options:
    late_s: float = 0.0
    mode: str = "speed"
    reward: str = "time"


@dataclass(frozen=True, kw_only=True)
class Others:
    late_s: float = 0.0


TOY: Any = SimpleNamespace(name="toy", options_type=Options, settled=("reward",))


def test_what_policies_bring_themselves_cannot_be_asked_for() -> None:
    assert option_names(TOY) == ["late_s", "mode"]
    with pytest.raises(UnknownNameError, match="option of evaluations in toy cells 'reward'"):
        options_for(TOY, None, {"reward": "energy"})
    with pytest.raises(UnknownNameError, match="'reward'"):
        options_for(TOY, Options(reward="energy"), {})


def test_keywords_go_over_the_record_and_the_record_over_the_defaults() -> None:
    assert options_for(TOY, None, {}) == Options()
    assert options_for(TOY, Options(late_s=1.0, mode="acceleration"), {"late_s": 2.0}) == Options(
        late_s=2.0, mode="acceleration"
    )


def test_a_misspelt_option_is_told_the_nearest_name() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'late_s'"):
        options_for(TOY, None, {"lates": 1.0})


def test_the_record_of_another_kind_is_refused() -> None:
    other: Any = Others(late_s=1.0)
    with pytest.raises(InputError, match=r"options are Others, and the cell is of kind toy .*give Options"):
        options_for(TOY, other, {})


def test_asked_for_is_what_is_not_as_usual() -> None:
    assert asked_options(Options()) == {}
    assert asked_options(Options(mode="acceleration")) == {"mode": "acceleration"}
    assert keywords_of(Options(late_s=1.0)) == {"late_s": 1.0, "mode": "speed", "reward": "time"}
