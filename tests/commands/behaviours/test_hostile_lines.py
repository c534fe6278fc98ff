"""Lines and files that are meant ill, or a terminal that shows ASCII alone: one line and status 2, or the answer."""

from __future__ import annotations

import io
import json
import re
import sys
import time
from pathlib import Path

import pytest

from armtempo.commands import main
from armtempo.configs import data_path

LAUGHS = "kind: [&a [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]" + "".join(
    f", &{b} [{', '.join([f'*{a}'] * 10)}]" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
CELL = data_path("cells/lee1991.yaml").read_text(encoding="utf-8")


def cell(old: str, new: str) -> str:
    assert old in CELL
    return CELL.replace(old, new, 1)


FILES = {
    "laughs": (f"{LAUGHS}]", "more than 100000 values"),
    "hex": (f"kind: coordination\nd_min_m: 0x{'f' * 100_000}\n", "a whole number of 100002 characters"),
    "timestamp": ('!!timestamp "9999999-99-99"', "timestamp"),
    "bool": ('!!bool "abc"', "'abc' is neither true nor false"),
    "int": ('!!int ""', "'' is no whole number"),
    "home": (cell("urdf: ", "urdf: ~nosuchuser/"), "no home of '~nosuchuser' is known"),
    "sexagesimal": (cell("stations: 1000", "stations: 16:40"), "stations: must be a valid integer, got '16:40'"),
    "underscore": (cell("stations: 1000", "stations: 1_000"), "got '1_000'"),
    "large": (cell("[25, 7]", "[1e308, 7]"), "torque_nm[0]: must be at most 1e+09 in size, got 1e+308"),
    "tiny": (cell("[25, 7]", "[25, 1e-300]"), "torque_nm[1]: must be at least 1e-12, got 1e-300"),
    "nan": (cell("[25, 7]", "[25, .nan]"), "torque_nm[1]: must be a finite number, got nan"),
    "reserve": (re.sub("torque_reserve: .*", "torque_reserve: 1e308", CELL), "torque_reserve: must be"),
    "name": (cell("name: lee1991", f"name: {'a' * 10_000}"), "name: String should have at most 100 characters"),
    "surrogate": (cell("name: lee1991", 'name: "\\ud800"'), "name: must be a valid string"),
    "key": (f"{CELL}{'x' * 900}: 1\n", "unknown key"),
    "control in a key": (f'{CELL}"\\e[2J": 1\n', "x1b[2J: unknown key"),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_meant_ill_is_told_in_one_line(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, message = FILES[case]
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")
    begin = time.perf_counter()
    assert main(["cells", str(tmp_path / "a.yaml")]) == 2
    assert time.perf_counter() - begin < 10.0
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.count("\n") == 1
    assert message in told.err
    assert len(told.err) < 2000


SIXTY = "9" * 60


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["cells", "~nosuchuser/x.yaml"], "no home of '~nosuchuser' is known"),
        (["train", "~nosuchuser/x.yaml"], "no home of"),
        (["sweep", "~nosuchuser/x.yaml"], "no home of"),
        (["evaluate", "lee1991", "--policies", "ppo:~nosuchuser/a.npz"], "no home of"),
        (["cells", "\x1b[2J.yaml"], r"\x1b[2J.yaml: no such file"),
        (["cells", "x" * 100_000], "too long"),
        (["cells", "a\0b.yaml"], "no name of a file"),
        (["train", "lee1991", "--steps", SIXTY], "--steps must be at most"),
        (["train", "lee1991", "--seed", SIXTY], "--seed must be at most"),
        (["sweep", "lee1991", "--trials", SIXTY], "--trials must be at most"),
        (["evaluate", "lee1991", "--episodes", SIXTY], "--episodes must be at most"),
        (["evaluate", "lee1991", "--seed", SIXTY], "--seed must be at most"),
        (["evaluate", "lee1991", "--master-late", "1e308"], "--master-late must be"),
    ],
)
def test_a_line_that_is_meant_ill_is_told_in_one_line(
    line: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(line) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert told.err.rstrip("\n").isprintable()
    assert message in told.err


@pytest.mark.parametrize("encoding", ["ascii", "iso-8859-1", "utf-8"])
def test_what_a_terminal_cannot_show_is_replaced_and_json_loses_nothing(
    encoding: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = "Zelle \u2013 Ångström \x1b[2J \u202e"
    text = cell("description: ", f"description: {json.dumps(said)} # ")
    (tmp_path / "a.yaml").write_text(text, encoding="utf-8")

    def shown(*more: str) -> str:
        screen = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(screen, encoding=encoding, errors="strict"))
        assert main(["cells", str(tmp_path / "a.yaml"), *more]) == 0
        sys.stdout.flush()
        return screen.getvalue().decode(encoding)

    table = shown()
    assert "Zelle" in table
    assert r"\x1b[2J \u202e" in table
    assert "\x1b[2J" not in table
    assert json.loads(shown("--json", "-"))["description"] == said
    screen = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(screen, encoding=encoding, errors="strict"))
    assert main(["cells"]) == 0
    assert (
        main(["evaluate", "lee1991", "--policies", "phase-plane", "delay", "--physics", "ideal", "--no-figures"]) == 0
    )
