"""Files of others cost no more than they are long, whatever they declare; every fault is an InputError."""

from __future__ import annotations

import io
import json
import os
import struct
import time
import tracemalloc
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.lib import format as npy

from armtempo.errors import InputError
from armtempo.reading import (
    as_number,
    csv_rows,
    parse_json,
    read_bytes,
    read_text,
    unpacked_arrays,
    user_path,
    why_unreadable,
)

LARGEST = 2**20


@contextmanager
def within(seconds: float, megabytes: float) -> Iterator[None]:
    """Fails if the block takes longer, or more memory."""
    tracemalloc.start()
    begin = time.perf_counter()
    try:
        yield
        assert time.perf_counter() - begin < seconds
        assert tracemalloc.get_traced_memory()[1] < megabytes * 1e6
    finally:
        tracemalloc.stop()


def test_homes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert user_path("~/a.yaml") == tmp_path / "a.yaml"
    with pytest.raises(InputError, match=r"~nosuchuser/a.yaml: no home of '~nosuchuser' is known"):
        user_path("~nosuchuser/a.yaml")


def test_what_is_no_file_is_told_without_opening_it(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "endless").symlink_to("/dev/zero")
    for name, why in {
        "none": "no such file", "": "is a folder", "pipe": "no regular file", "endless": "no regular file",
        "loop": "links", "x" * 5000: "too long", "a\0b": "no name of a file",
    }.items():  # fmt: skip
        assert why in (why_unreadable(tmp_path / name) or "")
        with within(1.0, 10), pytest.raises(InputError, match=why):
            read_text(tmp_path / name, LARGEST)


def test_texts_are_utf8_and_bounded(tmp_path: Path) -> None:
    file = tmp_path / "a"
    file.write_bytes("\ufeffå".encode())
    assert read_text(file, LARGEST) == "å"
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_text(file, LARGEST)
    file.write_bytes(bytes(LARGEST))
    assert len(read_bytes(file, LARGEST)) == LARGEST
    with pytest.raises(InputError, match=r"larger than 1\.04858 MB"):
        read_bytes(_longer(file), LARGEST)


def _longer(file: Path) -> Path:
    with file.open("ab") as stream:
        stream.write(b"x")
    return file


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "too deep"),
        ('{"a":' * 100_000, "too deep"),
        ("[NaN]", "NaN is no number"),
        ("[-Infinity]", "-Infinity is no number"),
        ("9" * 100_000, "a whole number of 100000 digits"),
        ('{"a": 1, "a": 2}', "the key 'a' is given twice"),
        ("[1,\n]", "here, line 2, column 1: not JSON"),
        ("", "line 1, column 1"),
    ],
)
def test_json_that_is_none_of_ours(text: str, message: str) -> None:
    with within(2.0, 100), pytest.raises(InputError, match=message):
        parse_json(text, "here")


def test_json_is_read_as_usual_else() -> None:
    data = {"a": [1, -2.5, None, True, "é"], "b": {"c": 10**60}}
    assert parse_json(json.dumps(data), "here") == data


def test_cells_of_csv() -> None:
    assert [as_number(cell) for cell in ("1", "-.5e3", "0x1", "1_0", "\u0661", "one", "")] == [
        1.0, -500.0, None, None, None, None, None,
    ]  # fmt: skip
    assert list(csv_rows("a,b\n1,2", "here")) == [(1, ["a", "b"]), (2, ["1", "2"])]
    with pytest.raises(InputError, match="here, line 2: field larger"):
        list(csv_rows("a\n" + "1" * 200_000, "here"))


def packed(compression: int = zipfile.ZIP_DEFLATED, **members: bytes) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return stream.getvalue()


def array(values: Any, **options: Any) -> bytes:
    stream = io.BytesIO()
    np.save(stream, values, **options)
    return stream.getvalue()


def header(shape: tuple[int, ...], descr: str = "<f4") -> bytes:
    stream = io.BytesIO()
    npy.write_array_header_1_0(stream, {"descr": descr, "fortran_order": False, "shape": shape})
    return stream.getvalue()


def known(name: str) -> bool:
    return name in ("a", "b")


@pytest.mark.parametrize("compression", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_arrays_come_back(compression: int) -> None:
    values = {"a": np.arange(6.0).reshape(2, 3), "b": np.asfortranarray(np.arange(6, dtype=np.int8).reshape(3, 2))}
    read = unpacked_arrays(packed(compression, **{k: array(v) for k, v in values.items()}), LARGEST, known)
    assert read.keys() == values.keys()
    for name, value in values.items():
        np.testing.assert_array_equal(read[name], value)
        assert read[name].dtype == value.dtype
        assert read[name].flags.writeable


def lying(offset: int, value: int) -> Callable[[], bytes]:
    """An archive whose table says something else of its one array than there is."""

    def made() -> bytes:
        content = bytearray(packed(a=header((32,)) + bytes(2**25)))
        struct.pack_into("<I", content, content.index(b"PK\x01\x02") + offset, value)
        return bytes(content)

    return made


ARCHIVES: dict[str, tuple[Callable[[], bytes], str]] = {
    "nothing": (lambda: b"", "not a zip file"),
    "bare array": (lambda: array(np.zeros(3)), "not a zip file"),
    "stranger": (lambda: packed(c=array(np.zeros(3))), "unknown array 'c'"),
    "bomb": (lambda: packed(a=header((2**25,), "|u1") + bytes(2**25)), "declares"),
    "lying bomb": (lying(24, 256), "CRC|bytes"),
    "lying the other way": (lying(24, 2**31), "declares 2147"),
    "nowhere": (lambda: packed(a=array(np.zeros(4))).replace(b"PK\x03\x04", b"PK\x03\x05"), "header"),
    "terabytes": (lambda: packed(a=header((2**40,))), "4398046511104 bytes in 0"),
    "overflowing": (lambda: packed(a=header((2**40, 2**40, 2**40))), "bytes in 0"),
    "negative": (lambda: packed(a=header((-1,))), "bytes in"),
    "cut": (lambda: packed(a=array(np.zeros(4))[:-1]), "bytes in"),
    "more": (lambda: packed(a=array(np.zeros(4)) + b"x"), "bytes in"),
    "objects": (lambda: packed(a=array(np.array([{}], dtype=object), allow_pickle=True)), "type 'O'"),
    "records": (lambda: packed(a=array(np.zeros(2, dtype=[("x", "f4")]))), "type 'V'"),
    "texts": (lambda: packed(a=array(np.array(["x"]))), "type 'U'"),
    "no header": (lambda: packed(a=b"x" * 100), "magic"),
    "brackets": (lambda: packed(a=b"\x93NUMPY\x01\x00\xff\x0f" + b"(" * 4095), "."),
    "zeros": (lambda: packed(a=b"\x93NUMPY\x01\x00\x10\x00" + bytes(16)), "header"),
    "packed otherwise": (lambda: packed(zipfile.ZIP_LZMA, a=array(np.zeros(3))), "packed in another way"),
}  # fmt: skip


@pytest.mark.parametrize("case", ARCHIVES)
def test_archives_are_refused_for_what_they_declare(case: str) -> None:
    make, message = ARCHIVES[case]
    content = make()
    with within(2.0, 10), pytest.raises(InputError, match=message):
        unpacked_arrays(content, LARGEST, known)


def test_flipped_bits_of_archives_are_told_or_harmless() -> None:
    values = np.arange(60, dtype=np.float32)
    content = packed(a=array(values), b=array(values))
    random = np.random.default_rng(5)
    refused = 0
    for bit in random.choice(8 * len(content), 1500, replace=False).tolist():
        flipped = bytearray(content)
        flipped[bit // 8] ^= 1 << (bit % 8)
        try:
            read = unpacked_arrays(bytes(flipped), LARGEST, known)
        except InputError:
            refused += 1
        else:
            assert all(value.tobytes() == values.tobytes() for value in read.values())
    assert refused > 1000
