"""YAML as it is taken here: numbers with exponents, no key twice, and only mappings."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.configs.files._find import CELL_FILES
from armtempo.configs.files._yaml import as_mapping, dump_yaml, parse_mapping, parse_yaml
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


CORE = {  # YAML 1.2's core schema
    "025": 25, "0o17": 15, "0x1F": 31, "-7": -7, "+7": 7, "16:40": "16:40", "1_000": "1_000", "0b11": "0b11",
    "0o8": "0o8", ".5": 0.5, "1.": 1.0, "1e3": 1000.0, ".inf": math.inf, "-.INF": -math.inf, "yes": "yes", "no": "no",
    "on": "on", "Off": "Off", "y": "y", "true": True, "FALSE": False, "null": None, "~": None, "": None, "NaN": "NaN",
    "2020-01-01": "2020-01-01", "12:30:45": "12:30:45", "=": "=", "1e400": math.inf,
}  # fmt: skip


@pytest.mark.parametrize("text", CORE)
def test_plain_values_are_those_of_yaml_1_2(text: str) -> None:
    value: Any = parse_yaml(f"a: {text}", FILE)
    assert value == {"a": CORE[text]}
    assert type(value["a"]) is type(CORE[text])


def test_what_is_written_is_read_back_whatever_it_looks_like() -> None:
    odd = [*CORE, "", " x", "a: b", "- a", "é\n", "1.0", "#", "'", '"', "<<", "!!int 3", "&a", "*a"]
    data = {"words": odd, "numbers": [1, -2.5, 1e-300, 1e16, math.inf, True, None], "inner": {"a": {}, "b": []}}
    assert parse_yaml(dump_yaml(data), FILE) == data


TAGGED = [
    '!!timestamp "9999999-99-99"', '!!bool "abc"', '!!int ""', '!!int "0b1"', '!!float ""', '!!float "1_0"',
    '!!null "x"',
    '!!binary "AAAA"', "!!set {a}", "!!omap [a: 1]", "!!pairs [a: 1]", "!!python/name:os.system", "!!python/tuple [1]",
    "!mine x", "!!str [a]", "!!map x", "!!seq {}", "!!int {a: 1}", f"!{'x' * 10_000} a",
]  # fmt: skip


@pytest.mark.parametrize("text", TAGGED)
def test_tags_say_what_the_core_schema_has_or_are_refused(text: str) -> None:
    with pytest.raises(ConfigError, match=r"cell\.yaml: line 1, column \d+: ") as caught:
        parse_yaml(text, FILE)
    assert len(str(caught.value)) < 500


def _laughs(levels: int, kind: str) -> str:
    """Each level names the one below ten times."""
    lines = ["a0: &a0 {x: 1}" if kind == "merge" else f"a0: &a0 [{', '.join('1' * 10)}]"]
    for k in range(1, levels):
        ten = ", ".join([f"*a{k - 1}"] * 10)
        body = {"list": f"[{ten}]", "merge": f"{{<<: [{ten}]}}"}.get(kind) or _keyed(k)
        lines.append(f"a{k}: &a{k} {body}")
    return "\n".join(lines)


def _keyed(k: int) -> str:
    return "{" + ", ".join(f"k{j}: *a{k - 1}" for j in range(10)) + "}"


HOSTILE = {
    "lists": (_laughs(9, "list"), "more than 100000 values"),
    "mappings": (_laughs(9, "mapping"), "more than 100000 values"),
    "merges": (_laughs(9, "merge"), "more than 100000 values"),
    "texts": (f"a: &a {'x' * 50_000}\nb: [{', '.join(['*a'] * 100)}]", "more than 100000 values"),
    "itself": ("&a [*a]", "inside of what it names"),
    "itself as a value": ("a: &a {b: [1, *a]}", "inside of what it names"),
    "itself merged": ("a: &a {<<: *a}", "inside of what it names"),
    "deep": ("[" * 100_000, "more than 50 lists"),
    "deep lists": ("- " * 100_000, "more than 50 lists"),
    "deep mappings": ("{a: " * 30_000, "more than 50 lists"),
    "digits": (f"a: {'9' * 100_000}", "a whole number of 100000 characters"),
    "sixty digits": (f"a: {'9' * 60}", "a whole number of 60 characters"),
    "hex": (f"a: 0x{'f' * 100_000}", "a whole number of 100002 characters"),
    "documents": ("a: 1\n---\nb: 2", "another document"),
    "unknown alias": (f"*{'x' * 100_000}", "undefined alias"),
    "list as a key": ("? [a]\n: b", "unhashable key"),
    "twice, quoted": ("a: 1\n'a': 2", "the key 'a' is given twice"),
    "control": ("a: \x1b", "unacceptable character"),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_what_a_text_stands_for_is_bounded_while_it_is_read(case: str) -> None:
    text, message = HOSTILE[case]
    begin = time.perf_counter()
    with pytest.raises(ConfigError, match=message) as caught:
        parse_yaml(text, FILE)
    assert time.perf_counter() - begin < 10.0
    assert len(str(caught.value)) < 500


def test_aliases_and_marks_of_byte_order_are_taken() -> None:
    assert parse_yaml("\ufeffa: &a [1, 2]\nb: *a\nc: [*a, *a]", FILE) == {"a": [1, 2], "b": [1, 2], "c": [[1, 2]] * 2}
