"""Waypoint files: columns found by name, every digit kept, and faults named with their line."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.geometry import read_waypoints

NAMES = ("one", "two", "three")


def written(folder: Path, name: str, text: str) -> Path:
    file = folder / name
    file.write_text(text)
    return file


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    arrays(np.float64, st.tuples(st.integers(1, 4), st.just(3)), elements=st.floats(-1e3, 1e3)),
    st.permutations(range(3)),
    st.sampled_from([".csv", ".json"]),
)
def test_columns_come_in_the_order_asked_for_with_every_digit(
    tmp_path: Path, table: Floats, order: list[int], suffix: str
) -> None:
    names, columns = [NAMES[k] for k in order], table[:, order]
    file = tmp_path / f"waypoints{suffix}"
    if suffix == ".csv":
        with file.open("w", newline="") as out:
            csv.writer(out).writerows([names, *columns.tolist()])
    else:
        file.write_text(json.dumps({"joints": names, "waypoints_rad": columns.tolist()}))
    np.testing.assert_array_equal(read_waypoints(file, NAMES), table)
    np.testing.assert_array_equal(read_waypoints(file), columns)  # nobody asked for an order
    np.testing.assert_array_equal(read_waypoints(file, NAMES[1:2]), table[:, 1:2])  # others are left out


def test_blank_lines_comments_spaces_and_a_mark_of_byte_order_are_skipped(tmp_path: Path) -> None:
    text = "\ufeff# from the pendant\n\n one , two \n 0.5 ,1\n\n# half way\n2,3e-1\n"
    table = read_waypoints(written(tmp_path, "pendant.CSV", text), ["two", "one"])
    np.testing.assert_array_equal(table, [[1.0, 0.5], [0.3, 2.0]])


FAULTS = {
    "suffix": ("a.txt", "1,2", "read from .csv and .json, not .txt"),
    "no suffix": ("a", "1,2", "not a file without suffix"),
    "ragged": ("a.csv", "1,2\n3\n", "a.csv, line 2: has 1 numbers (give 2 as the first row does)"),
    "ragged under names": ("a.csv", "one,two\n1,2,3\n", "a.csv, line 2: has 3 numbers (give 2 as the header does)"),
    "a word": ("a.csv", "1,2\n3,left\n", "a.csv, line 2: 'left' is no number"),
    "mixed": ("a.csv", "one,2\n", "a.csv, line 1: mixes names and numbers: one, 2"),
    "twice": ("a.csv", "one,one,two\n1,2,3\n", "joint 'one' has 2 columns"),
    "a slip": ("a.csv", "one,tow\n1,2\n", "no column for joint 'two' (did you mean 'tow'?"),
    "nothing": ("a.csv", "one,two\n", "holds no waypoints"),
    "no json": ("a.json", "[[1, 2],\n[3,, 4]]", "a.json, line 2, column 4: not JSON"),
    "other key": ("a.json", '{"waypoints": [[1, 2]]}', "unknown key 'waypoints'"),
    "no key": ("a.json", '{"joints": ["one", "two"]}', "no waypoints_rad"),
    "names": ("a.json", '{"joints": "one", "waypoints_rad": [[1]]}', "joints is no list of names"),
    "number": ("a.json", "3", "holds no list of waypoints"),
    "truth": ("a.json", "[[1, 2], [true, 2]]", "a.json, waypoint 1: is no list of numbers: [True, 2]"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named_with_their_place(tmp_path: Path, fault: str) -> None:
    name, text, message = FAULTS[fault]
    with pytest.raises(InputError) as caught:
        read_waypoints(written(tmp_path, name, text), ["one", "two"])
    assert message in str(caught.value)
