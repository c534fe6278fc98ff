"""Files that others made, read within bounds: what they declare is looked at before anything is made of it.

No file costs more than its size and the limits here, whatever it says; each fault is told in one line.
"""

from __future__ import annotations

import csv
import io
import json
import os
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from armtempo.errors import InputError, brief, printable

__all__ = [
    "MOST_MAGNITUDE",
    "as_number",
    "csv_rows",
    "parse_json",
    "read_bytes",
    "read_text",
    "unpacked_arrays",
    "user_path",
    "why_unreadable",
]

MOST_MAGNITUDE: Final = 1e9
"""Largest number of a cell, a path or a time, in SI units: beyond it sums and squares lose all sense."""

LONGEST_INTEGER: Final = 300  # characters of a whole number in JSON; floats have as many digits before the point
MOST_ARRAYS: Final = 1000  # of an archive
LONGEST_ARRAY_HEADER: Final = 4096  # bytes
COMPRESSIONS: Final = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # those of numpy
ENCRYPTED: Final = 0x1  # flag of an archive's member
UNPACKING_ERRORS: Final = (  # of damaged archives, and of headers that numpy takes for Python's words
    zipfile.BadZipFile, zlib.error, tokenize.TokenError, EOFError, KeyError, MemoryError, NotImplementedError, OSError,
    OverflowError, RecursionError, SyntaxError, TypeError, ValueError, struct.error,
)  # fmt: skip
HEADER_READERS: Final[dict[tuple[int, int], Callable[..., Any]]] = {
    (1, 0): npy.read_array_header_1_0,
    (2, 0): npy.read_array_header_2_0,
}


def user_path(name: str | Path) -> Path:
    """A path as a user gives it: ``~`` is their home, ``~name`` another's.

    Raises:
        InputError: There is no such user, or the home is not known.
    """
    try:
        return Path(name).expanduser()
    except RuntimeError:
        user = Path(name).parts[0]
        raise InputError(f"{name}: no home of {brief(user)} is known", remedy="give the path in full") from None


def why_unreadable(path: Path) -> str | None:
    """Why this is no file that can be opened; None: it may be."""
    try:
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return "no such file"
    except OSError as error:
        return str(error.strerror)
    except ValueError:  # a zero in its name
        return "no name of a file"
    if stat.S_ISDIR(mode):
        return "is a folder"
    return None if stat.S_ISREG(mode) else "is no regular file"  # pipes and devices may never end


def read_bytes(path: Path, largest: int) -> bytes:
    """What is in a file of at most so many bytes.

    Raises:
        InputError: There is no such file, it is larger, or it cannot be read.
    """
    why = why_unreadable(path)
    if why is None:
        try:
            with path.open("rb") as file:
                size = min(os.fstat(file.fileno()).st_size, largest)
                content = file.read(size + 1)  # as much is allocated, whatever the file holds
            if len(content) <= largest:
                return content
            why = f"larger than {largest / 1e6:g} MB"
        except OSError as error:
            why = str(error.strerror)
    raise InputError(f"{path}: cannot be read: {why}", remedy="check the path and the file")


def read_text(path: Path, largest: int) -> str:
    """The UTF-8 text of a file of at most so many bytes, without a mark of byte order.

    Raises:
        InputError: It is no such text; and as ``read_bytes``.
    """
    try:
        return read_bytes(path, largest).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: cannot be read: not UTF-8 text", remedy="save it as UTF-8") from None


def csv_rows(text: str, place: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV text, each with the number of its line.

    Raises:
        InputError: One cannot be split into cells; ``place``: where the text is from.
    """
    reader = csv.reader(text.splitlines())
    try:
        for cells in reader:
            yield reader.line_num, cells
    except csv.Error as error:
        raise InputError(f"{place}, line {reader.line_num}: {error}", remedy="mend it") from None


def as_number(cell: str) -> float | None:
    """What a cell says in digits, None if it is no number; ``1_000`` is none."""
    try:
        return float(cell) if cell.isascii() and "_" not in cell else None
    except ValueError:
        return None


def parse_json(text: str, place: str) -> Any:
    """What a JSON text says: no key twice, no NaN, no number beyond those of a double.

    Args:
        text: JSON.
        place: Where it is from; messages begin with it.

    Raises:
        InputError: It is not JSON, or says such a thing.
    """

    def fail(problem: str, where: str = "") -> NoReturn:
        raise InputError(f"{place}{where}: {problem}", remedy="mend it")

    def pairs(given: list[tuple[str, Any]]) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in given:
            if key in found:
                fail(f"the key {brief(key)} is given twice")
            found[key] = value
        return found

    def whole(digits: str) -> int:
        if len(digits) > LONGEST_INTEGER:
            fail(f"a whole number of {len(digits)} digits")
        return int(digits)

    try:
        return json.loads(
            text, object_pairs_hook=pairs, parse_int=whole, parse_constant=lambda name: fail(f"{name} is no number")
        )
    except json.JSONDecodeError as error:
        fail(f"not JSON: {error.msg}", f", line {error.lineno}, column {error.colno}")
    except RecursionError:
        fail("lists or mappings too deep in each other")


def unpacked_arrays(content: bytes, largest: int, known: Callable[[str], bool]) -> dict[str, NDArray[Any]]:
    """The arrays of a ``.npz`` archive, none of which holds objects.

    What its entries declare is added up before any of them is unpacked; and no more is unpacked than was declared.

    Args:
        content: Of the file.
        largest: Bytes that all arrays together may take.
        known: Whether an array may have this name.

    Raises:
        InputError: It is no such archive, has an array with another name, or is too large.
    """

    def fail(problem: str) -> NoReturn:
        raise InputError(problem, remedy="copy the file again; archives are written by armtempo alone")

    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            if len(members) > MOST_ARRAYS:
                fail(f"{len(members)} arrays")
            names = [member.filename.removesuffix(".npy") for member in members]
            if len(set(names)) < len(names):
                fail("an array is given twice")
            for name, member in zip(names, members, strict=True):
                if not member.filename.endswith(".npy") or not known(name):
                    fail(f"unknown array {brief(name)}")
                if member.compress_type not in COMPRESSIONS or member.flag_bits & ENCRYPTED:
                    fail(f"array {brief(name)} is packed in another way than numpy's")
            declared = sum(member.file_size for member in members)
            if declared > largest:
                fail(f"declares {declared / 1e6:.4g} MB of arrays, and {largest / 1e6:g} MB is the most")
            return {name: _array(archive, member) for name, member in zip(names, members, strict=True)}
    except InputError:
        raise
    except UNPACKING_ERRORS as error:
        fail(printable(" ".join(str(error).split()))[:80] or "its arrays cannot be read")


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """One array, if it is as long as its header and its entry say."""
    with archive.open(member) as file:
        reader = HEADER_READERS.get(npy.read_magic(file))
        if reader is None:
            raise ValueError("its arrays are of another version")
        shape, fortran, dtype = reader(file, max_header_size=LONGEST_ARRAY_HEADER)
        if dtype.kind not in "biuf" or dtype.subdtype is not None:
            raise ValueError(f"an array of type {dtype.kind!r}")
        size = int(dtype.itemsize)
        for length in shape:
            size *= max(int(length), 0)
        left = member.file_size - file.tell()
        if size != left or min(shape, default=0) < 0:
            raise ValueError(f"an array of {size} bytes in {left}")
        data = file.read(size)
        if len(data) != size or file.read(1):
            raise ValueError("an array is cut short")
    array = np.frombuffer(data, dtype=dtype).copy()
    return array.reshape(shape, order="F" if fortran else "C")
