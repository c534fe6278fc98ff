"""Waypoints from CSV and JSON files, columns matched by the names of the joints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InputError, brief, closest
from armtempo.reading import MOST_MAGNITUDE, as_number, csv_rows, parse_json, read_text

LARGEST = 2**26  # bytes of a file
LONGEST_LINE = 100  # characters that are told


def read_waypoints(file: Path, joints: Sequence[str] | None = None) -> Floats:
    """Waypoints (K, n) [rad or m] of a ``.csv`` or ``.json`` file.

    Args:
        file: See ``JointPath.from_file`` for what it may hold.
        joints: Names of the joints wanted, in order; used where the file names its columns.

    Raises:
        InputError: Names file, line or row, and what to do.
    """
    suffix = file.suffix.lower()
    if suffix not in (".csv", ".json"):
        _fail(
            f"{file}", f"waypoints are read from .csv and .json, not {suffix or 'a file without suffix'}", "rename it"
        )
    names, rows, places = (_csv if suffix == ".csv" else _json)(file, read_text(file, LARGEST))
    width = len(names) if names is not None else len(rows[0]) if rows else 0
    for row, place in zip(rows, places, strict=True):
        if len(row) != width:
            _fail(
                place, f"has {len(row)} numbers", f"give {width} as {'the header' if names else 'the first row'} does"
            )
        if not all(abs(value) <= MOST_MAGNITUDE for value in row):  # nan, too; before a float is made of them
            _fail(place, f"{brief(row)} are no joint positions", f"give finite numbers, at most {MOST_MAGNITUDE:g}")
    if not rows:
        _fail(f"{file}", "holds no waypoints", "give one row per waypoint")
    table = np.array(rows, dtype=np.float64)
    if names is None or joints is None:
        return table
    return table[:, [_column(file, names, joint) for joint in joints]]


def _fail(place: str, problem: str, remedy: str) -> NoReturn:
    raise InputError(f"{place}: {problem}", remedy=remedy)


def _column(file: Path, names: list[str], joint: str) -> int:
    if names.count(joint) == 1:
        return names.index(joint)
    if joint in names:
        _fail(f"{file}", f"joint {brief(joint)} has {names.count(joint)} columns", "keep one")
    _fail(
        f"{file}",
        f"no column for joint {brief(joint)}",
        f"{closest(joint, names)}columns: {', '.join(names)}; or leave the names out",
    )


def _csv(file: Path, text: str) -> tuple[list[str] | None, list[list[float]], list[str]]:
    names: list[str] | None = None
    rows: list[list[float]] = []
    places = []
    for number, line in csv_rows(text, f"{file}"):
        cells = [cell.strip() for cell in line]
        if not any(cells) or cells[0].startswith("#"):
            continue
        place = f"{file}, line {number}"
        values = [as_number(cell) for cell in cells]
        if names is None and not rows and None in values:
            if any(value is not None for value in values):
                _fail(
                    place,
                    f"mixes names and numbers: {', '.join(cells)[:LONGEST_LINE]}",
                    "give a header of names, or numbers only",
                )
            names = cells
            continue
        row = [value for value in values if value is not None]
        if len(row) < len(values):
            bad = cells[values.index(None)]
            _fail(place, f"{brief(bad)} is no number", "give joint positions in rad (prismatic joints: m)")
        rows.append(row)
        places.append(place)
    return names, rows, places


def _json(file: Path, text: str) -> tuple[list[str] | None, list[list[float]], list[str]]:
    shape = '[[...], ...] or {"joints": [...], "waypoints_rad": [[...], ...]}'
    data = parse_json(text, f"{file}")
    names = None
    if isinstance(data, dict):
        unknown = sorted(set(data) - {"joints", "waypoints_rad"})
        if unknown or "waypoints_rad" not in data:
            _fail(f"{file}", f"unknown key {brief(unknown[0])}" if unknown else "no waypoints_rad", f"give {shape}")
        names, data = data.get("joints"), data["waypoints_rad"]
        if names is not None and not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            _fail(f"{file}", "joints is no list of names", f"give {shape}")
    if not isinstance(data, list):
        _fail(f"{file}", "holds no list of waypoints", f"give {shape}")
    places = [f"{file}, waypoint {k}" for k in range(len(data))]
    for row, place in zip(data, places, strict=True):
        numbers = isinstance(row, list) and all(isinstance(v, int | float) and not isinstance(v, bool) for v in row)
        if not numbers:
            _fail(place, f"is no list of numbers: {brief(row)}", f"give {shape}")
    return names, data, places
