"""YAML as it is taken here: numbers with exponents, no key twice, and only mappings."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.configs.files._find import CELL_FILES
from armtempo.configs.files._yaml import as_mapping, parse_mapping, parse_yaml
from armtempo.errors import ConfigError

FILE = Path("cell.yaml")


@given(st.integers(-999, 999), st.integers(-12, 12), st.sampled_from(["e", "E"]), st.sampled_from(["", "+"]))
def test_numbers_with_an_exponent_are_numbers_with_a_point_or_without(
    mantissa: int, exponent: int, letter: str, plus: str
) -> None:
    sign = plus if exponent >= 0 else ""
    for text in (f"{mantissa}{letter}{sign}{exponent}", f"{mantissa}.0{letter}{sign}{exponent}"):
        value = parse_yaml(f"a: {text}", FILE)
        assert value == {"a": float(text)}


@pytest.mark.parametrize("text", ["e3", "1e", "1e-3x", "0x1e-3", "1.e.3"])
def test_words_that_look_like_numbers_stay_words(text: str) -> None:
    assert parse_yaml(f"a: {text}", FILE) == {"a": text}


def test_a_key_twice_is_refused_at_any_depth_with_its_line_and_two_merges_are_not() -> None:
    with pytest.raises(ConfigError, match=r"cell.yaml: line 4, column 3: the key 'b' is given twice"):
        parse_yaml("a:\n  b: 1\n  c: 2\n  b: 3\n", FILE)
    merged = parse_yaml("x: &x {a: 1}\ny: &y {b: 2}\nz:\n  <<: *x\n  b: 3\n", FILE)
    assert merged == {"x": {"a": 1}, "y": {"b": 2}, "z": {"a": 1, "b": 3}}


def test_nothing_in_a_file_is_executed() -> None:
    with pytest.raises(ConfigError, match="line 1"):
        parse_yaml("a: !!python/object/apply:os.getcwd []", FILE)


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "is empty"),
        ("[1, 2]", r"is no mapping of keys to values but \[1, 2\]"),
        ("3", "is no mapping of keys to values but 3"),
    ],
)
def test_what_is_no_mapping_is_told_where_to_start(text: str, what: str) -> None:
    with pytest.raises(ConfigError, match=rf"cell\.yaml: {what}.*start from a bundled cell"):
        parse_mapping(text, FILE, CELL_FILES)


def test_a_mapping_is_itself() -> None:
    data = {"a": 1}
    assert as_mapping(data, FILE, CELL_FILES) is data


def test_a_stray_tab_and_nesting_without_end_are_told_as_faults_of_the_file() -> None:
    with pytest.raises(ConfigError, match="line 2, column 1"):
        parse_yaml("a:\n\tb: 1\n", FILE)
    with pytest.raises(ConfigError, match=r"cell\.yaml"):
        parse_yaml("[" * 5000, FILE)
