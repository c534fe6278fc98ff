"""Results that are kept as they come: taken over by the same line, however the one before ended."""

from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from armtempo.commands.console import file_digests, kept_results
from armtempo.commands.console._kept import PARTIAL
from armtempo.errors import InputError
from armtempo.files import locked

VALUES: dict[str, Any] = {
    "one": {"bound": math.inf, "third": 1 / 3, "none": None, "text": "ß\n", "many": [1, 2.5]},
    "two": [],
}


def interrupted(values: dict[str, Any], arguments: dict[str, Any]) -> str:
    """A command that is interrupted behind these results; the note of its end."""
    try:
        with kept_results("bench it", arguments) as kept:
            for unit, value in values.items():
                kept.put(unit, value)
            raise KeyboardInterrupt
    except KeyboardInterrupt as stop:
        return "".join(getattr(stop, "__notes__", []))


def no_more() -> None:
    raise AssertionError("it is computed once more")


def test_results_are_taken_over_and_gone_at_the_end() -> None:
    note = interrupted(VALUES, {"seed": 1})
    (file,) = PARTIAL.iterdir()
    assert note == f"2 results are kept in {file}; the same line goes on with them"
    assert file.name.startswith("bench-it-")
    with kept_results("bench it", {"seed": 2}) as kept:  # other arguments: nothing of this
        assert (kept.found, kept.get("one")) == (0, None)
    with kept_results("bench it", {"seed": 1}) as kept:
        assert kept.found == 2
        assert {unit: kept.result(unit, no_more) for unit in VALUES} == VALUES
        assert kept.result("three", lambda: (np.float64(0.1), np.arange(2))) == [0.1, [0, 1]]
        assert kept.get("three") == [0.1, [0, 1]]
        assert kept.put("odd", {1j}) == {1j}  # JSON has no such thing
        assert file.read_bytes().count(b"\n") == 4
    assert not Path("results").exists()
    assert interrupted({}, {"seed": 1}) == ""
    assert not Path("results").exists()


def test_a_process_that_is_killed_leaves_its_results() -> None:
    code = """
import os, signal
from armtempo.commands.console import kept_results
with kept_results("bench it", {}) as kept:
    kept.put("one", 1)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -signal.SIGKILL
    with kept_results("bench it", {}) as kept:
        assert kept.result("one", no_more) == 1


def test_a_line_that_was_cut_off_is_taken_away_and_one_that_was_changed_refused(
    caplog: pytest.LogCaptureFixture,
) -> None:
    interrupted(VALUES, {})
    (file,) = PARTIAL.iterdir()
    whole = file.read_bytes()
    first, second = whole.index(b"\n") + 1, whole.index(b"\n", whole.index(b"\n") + 1) + 1
    for length in (1, first - 1, first, first + 1, second - 1, second, len(whole) - 1):
        file.write_bytes(whole[:length])
        caplog.clear()
        found = max(whole[:length].count(b"\n") - 1, 0)
        with suppress(ZeroDivisionError), kept_results("bench it", {}) as kept:
            assert kept.found == found
            assert {unit: kept.result(unit, partial(VALUES.get, unit)) for unit in VALUES} == VALUES
            _ = 1 // 0  # whatever ends it, the file is whole again
        assert file.read_bytes() == whole
        cut = not whole[:length].endswith(b"\n")
        assert [record.message for record in caplog.records] == (
            [f"{file}: its last line was cut off and is taken away"] if cut else []
        )
    for place in range(0, len(whole) - 1, 7):
        if whole[place : place + 1] != b"\n":
            file.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
            number = whole[:place].count(b"\n") + 1
            with pytest.raises(InputError, match=rf"jsonl: line {number} has been changed \(delete it"):
                interrupted({}, {})
    head, rest = whole[:first], whole[first:]
    file.write_bytes(head.replace(b"bench it", b"bench me") + rest)
    with pytest.raises(InputError, match="line 1 has been changed"):
        interrupted({}, {})


def test_a_file_that_cannot_be_kept_stops_nobody(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted({"one": 1}, {})
    (file,) = PARTIAL.iterdir()
    with locked(file), kept_results("bench it", {}) as kept:
        assert kept.result("one", lambda: 2) == 2
    assert "another process's" in caplog.text
    assert file.exists()
    monkeypatch.chdir(tmp_path)
    Path("elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    Path("results").write_text("taken")
    with kept_results("bench it", {}) as kept:
        assert kept.result("one", lambda: 2) == 2
    assert "results are not kept" in caplog.text


def test_agent_files_count_by_what_is_in_them(tmp_path: Path) -> None:
    file = tmp_path / "mine.npz"
    file.write_bytes(b"1")
    name = f"ppo:{file}"
    before = file_digests(["vci", "ppo:nobody", name, "ppo:missing.npz"])
    assert list(before) == [name]
    file.write_bytes(b"2")
    assert file_digests([name]) != before
    assert json.dumps(before)
