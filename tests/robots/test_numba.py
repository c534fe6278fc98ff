"""Compiled functions on disk: a change of what they call counts, too."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import armtempo
from armtempo.arrays import Floats
from armtempo.robots._numba import kernel_digest, uncounted

numba: Any = importlib.import_module("numba")  # with untyped functions
CALLEE = "from armtempo.robots._numba import njit\n\n\n@njit\ndef callee(x):\n    return x + {}\n"
CALLER = (
    "from armtempo.robots._callee import callee\nfrom armtempo.robots._numba import njit\n\n\n"
    "@njit\ndef caller(x):\n    return callee(x)\n"
)
TAKER = "from armtempo.robots._numba import njit\n\n\n@njit\ndef caller(pair):\n    return pair.one + pair.other\n"
TYPES = (
    "from typing import NamedTuple\n\nfrom armtempo.robots._numba import njit\n\n\n"
    "class Pair(NamedTuple):\n    one: int\n    other: int\n\n\n"
    "@njit\ndef kernel(): ...\n"
)
RUN = """
from armtempo.robots._caller import caller
value = caller(1)
print(value, sum(caller.stats.cache_hits.values()))
"""


@uncounted
def _sums(rows: Floats, out: Floats) -> None:
    for i in range(rows.shape[0]):
        row = rows[i]
        out[i] = row[: row.shape[0]].sum()


@uncounted
def _makes_one(rows: Floats) -> float:
    return np.zeros(rows.shape[0]).sum()  # type: ignore[no-any-return]


def test_kernels_that_count_no_references_leave_them_as_they_were() -> None:
    rows, out = np.arange(12.0).reshape(3, 4), np.zeros(3)
    _sums(rows, out)
    before = sys.getrefcount(rows), sys.getrefcount(out)
    for _ in range(10):
        _sums(rows, out)
    assert (sys.getrefcount(rows), sys.getrefcount(out)) == before
    assert (out == rows.sum(axis=1)).all()
    if not numba.config.DISABLE_JIT:
        with pytest.raises(numba.core.errors.NumbaError, match="Only accept returning of array"):
            _makes_one(rows)


def test_an_edited_callee_is_seen_by_its_compiled_caller(tmp_path: Path) -> None:
    package = tmp_path / "armtempo"
    ignored = shutil.ignore_patterns("__pycache__", "benchmarks")
    shutil.copytree(Path(armtempo.__file__).parent, package, ignore=ignored)  # links are followed
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(tmp_path)

    def result(added: int) -> str:
        (package / "robots" / "_callee.py").write_text(CALLEE.format(added))
        (package / "robots" / "_caller.py").write_text(CALLER)
        run = subprocess.run(
            [sys.executable, "-c", RUN], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return run.stdout.strip()

    assert result(1) == "2 0"
    assert result(1) == "2 1"  # from disk
    assert result(2) == "3 0"
    kept = [file.name for file in (package / "robots" / "__pycache__").glob("_caller.caller-*.nb?")]
    assert len(kept) == 2  # what was compiled from the other callee is gone: an index and one compiled form are left


def test_compiled_functions_of_types_that_have_moved_are_compiled_anew(tmp_path: Path) -> None:
    package = tmp_path / "armtempo"
    ignored = shutil.ignore_patterns("__pycache__", "benchmarks")
    shutil.copytree(Path(armtempo.__file__).parent, package, ignore=ignored)
    environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    environment["PYTHONPATH"] = str(tmp_path)
    (package / "robots" / "_caller.py").write_text(TAKER)

    def result(module: str) -> str:
        file = package / "robots" / f"{module}.py"
        file.write_text(TYPES)
        run = (
            f"from armtempo.robots._caller import caller\nfrom armtempo.robots.{module} import Pair\n"
            "print(caller(Pair(1, 2)))"
        )
        done = subprocess.run(
            [sys.executable, "-c", run], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False
        )
        file.unlink()
        return done.stdout.strip() or done.stderr

    assert result("_old_place") == "3"
    assert result("_new_place") == "3"


def test_only_files_with_kernels_count(tmp_path: Path) -> None:
    (tmp_path / "one.py").write_text("@njit\ndef one(): ...\n")
    (tmp_path / "other.py").write_text("two = 2\n")
    before = kernel_digest([tmp_path])
    (tmp_path / "other.py").write_text("two = 3\n")
    assert kernel_digest([tmp_path]) == before
    (tmp_path / "one.py").write_text("@njit\ndef one(): pass\n")
    assert kernel_digest([tmp_path]) != before
