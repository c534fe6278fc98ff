"""``armtempo view`` and ``armtempo evaluate --html``."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from http.client import HTTPConnection
from pathlib import Path

import pytest

from armtempo.commands import main
from tests.commands.viewer.test_page import data_of


def test_view_writes_a_page(cell_file: Callable[..., str], capsys: pytest.CaptureFixture[str]) -> None:
    line = ["view", cell_file(), "--policies", "delay", "vci", "--physics", "ideal", "--html", "pages/mine.html"]
    assert main(line) == 0
    data = data_of(Path("pages/mine.html").read_text(encoding="utf-8"))
    assert [run["policy"] for run in data["runs"]] == ["delay", "vci"]
    assert "mine.html" in capsys.readouterr().out
    assert not list(Path("pages").glob(".*"))


def test_evaluate_writes_the_page_of_its_episodes(cell_file: Callable[..., str]) -> None:
    line = ["evaluate", cell_file(), "--policies", "delay", "--physics", "ideal", "--no-figures", "--json", "e.json"]
    assert main([*line, "--html", "e.html"]) == 0
    (run,) = data_of(Path("e.html").read_text(encoding="utf-8"))["runs"]
    assert run["arrived"] == json.loads(Path("e.json").read_text())["policies"]["delay"]["makespan_s"]


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (["--port", "70000"], "--port must be 0 to 65535"),
        (["--html", "."], "it is a folder"),
        (["--policies", "nobody"], "nobody"),
        (["--seed", "-1"], "--seed must not be negative"),
    ],
)
def test_lines_that_cannot_be_meant_are_told(
    flags: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", "lee1991", *flags]) == 2
    assert complaint in capsys.readouterr().err


def test_the_live_page_is_there_until_it_is_interrupted(cell_file: Callable[..., str]) -> None:
    code = (  # shells let background jobs ignore Ctrl-C
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "from armtempo.commands import main; sys.exit(main(sys.argv[1:]))"
    )
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    with subprocess.Popen(
        [sys.executable, "-c", code, "view", cell_file(), "--physics", "ideal"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:(\d+)/", process.stdout.readline())
        assert found is not None
        connection = HTTPConnection("127.0.0.1", int(found[1]), timeout=60)
        connection.request("GET", "/")
        page = connection.getresponse().read().decode()
        connection.close()
        process.send_signal(signal.SIGINT)
        try:
            assert process.wait(60) == 0
        finally:
            process.kill()
    data = data_of(page)
    assert [run["policy"] for run in data["runs"]] == ["vci"]
    assert "delay" in [one["policy"] for one in data["waiting"]]
