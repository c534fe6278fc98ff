"""Evaluations that pages are made of, and a browser that reads them."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from armtempo.agents import Evaluation, evaluate
from armtempo.planners import BlendCell, CoordinationCell

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)


class Seen(NamedTuple):
    """What a browser made of a page."""

    dom: str
    console: list[str]

    def text(self, selector: str) -> str:
        """What stands in the element with this id or these classes, tags taken away."""
        kind, name = ("id", selector[1:]) if selector[0] == "#" else ("class", selector[1:])
        found = re.search(rf'<(\w+)[^>]* {kind}="{re.escape(name)}"[^>]*>(.*?)</\1>', self.dom, re.DOTALL)
        assert found is not None, selector
        return re.sub(r"<[^>]*>", "", found[2])


@pytest.fixture(scope="session")
def lee1991_runs(lee1991: CoordinationCell) -> Evaluation[Any, Any, Any]:
    """Two that arrive, one that comes too close."""
    return evaluate(lee1991, ["delay", "vci", "phase-plane"])


@pytest.fixture(scope="session")
def lee2006_runs(lee2006: BlendCell) -> Evaluation[Any, Any, Any]:
    """Two policies with different corners."""
    return evaluate(lee2006, ["line-speed", "limit-aware-smooth"], physics="ideal")


@pytest.fixture(scope="session")
def browse(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Seen]:
    """Opens an address in headless Chromium, without network, and returns what it shows; skips where there is none."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium here; test_page.py looks at pages without one")
    profile = tmp_path_factory.mktemp("chromium")

    def open_page(address: str) -> Seen:
        run = subprocess.run(
            [
                str(CHROMIUM), "--headless=new", "--no-sandbox", "--use-angle=swiftshader",
                "--enable-unsafe-swiftshader", "--window-size=1440,900", "--virtual-time-budget=3000",
                "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1", f"--user-data-dir={profile}",
                "--enable-logging=stderr", "--dump-dom", address,
            ],
            capture_output=True, text=True, timeout=120, check=True,
        )  # fmt: skip
        return Seen(run.stdout, [line for line in run.stderr.splitlines() if "CONSOLE" in line])

    return open_page


def address_of(file: Path, at: str = "") -> str:
    """Of a file, with what follows #."""
    return f"{file.resolve().as_uri()}#{at}"
