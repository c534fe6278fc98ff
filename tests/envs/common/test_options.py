"""Records of options: keywords become one, misspelt ones are told the nearest name, and numbers are numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from armtempo.envs.common._options import check_bodies, check_names, check_time_limit, is_number, options_of
from armtempo.errors import InputError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Options:
    speed_m_s: float = 1.0
    noise: bool = False


def taker(cell: str, render_mode: str | None = None, **options: Any) -> None:
    """Something that takes options beside arguments of its own."""


def test_keywords_are_fields_and_the_rest_stays_as_it_is() -> None:
    assert options_of(Options, {"speed_m_s": 2.0}) == Options(speed_m_s=2.0)
    assert options_of(Options, {}) == Options()


def test_a_misspelt_option_is_told_the_nearest_name() -> None:
    with pytest.raises(UnknownNameError, match=r"'sped_m_s'.*speed_m_s"):
        options_of(Options, {"sped_m_s": 2.0})


def test_arguments_of_who_takes_them_are_named_too_where_one_is_misspelt() -> None:
    with pytest.raises(UnknownNameError, match="rendermode") as error:
        options_of(Options, {"rendermode": "human"}, taker)
    assert "did you mean 'render_mode'" in str(error.value)
    with pytest.raises(UnknownNameError) as error:
        options_of(Options, {"rendermode": "human"})
    assert "render_mode" not in str(error.value)


def test_the_first_name_that_is_unknown_is_told() -> None:
    check_names(("colour", "red", ["red", "blue"]), ("form", "round", ["round"]))
    with pytest.raises(UnknownNameError, match="form 'flat'"):
        check_names(("colour", "red", ["red"]), ("form", "flat", ["round"]), ("size", "big", ["small"]))


def test_numbers_are_finite_and_no_truth_values() -> None:
    assert all(is_number(value) for value in (0, -1.5, np.float32(2.0), np.int64(3)))
    assert not any(is_number(value) for value in (True, np.bool_(True), math.nan, -math.inf, "1", None, [1.0], 1j))


@pytest.mark.parametrize("bad", [0.0, -1.0, math.inf, math.nan, True, "3"])
def test_a_time_limit_is_positive_or_none(bad: Any) -> None:
    check_time_limit(None)
    check_time_limit(0.1)
    with pytest.raises(InputError, match="max_episode_s must be positive"):
        check_time_limit(bad)


def test_bodies_are_off_by_shares_above_minus_one_and_only_where_there_are_bodies() -> None:
    check_bodies("bullet", mass_error=-0.99, friction_error=3.0)
    check_bodies("ideal", mass_error=0.0)
    with pytest.raises(InputError, match="mass_error must be a share above -1, got -1"):
        check_bodies("bullet", mass_error=-1.0)
    with pytest.raises(InputError, match=r"mass_error is 0.1 and physics 'ideal', which has no bodies"):
        check_bodies("ideal", mass_error=0.1)
    with pytest.raises(UnknownNameError, match=r"physics 'bulet'.*bullet"):
        check_bodies("bulet")
