"""Where commands are tested: an empty folder, and cells as a user's own files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from armtempo.configs import data_path


@pytest.fixture(autouse=True)
def _work_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


@pytest.fixture
def cell_file(tmp_path: Path) -> Callable[..., str]:
    """Writes the bundled cell, coarse and with replacements, as the user's own file."""

    def write(*replacements: tuple[str, str]) -> str:
        text = data_path("cells/lee1991.yaml").read_text(encoding="utf-8")
        for old, new in (("chart_tolerance_m: 0.0001", "chart_tolerance_m: 0.0004"), *replacements):
            assert old in text
            text = text.replace(old, new)
        file = tmp_path / "mine.yaml"
        file.write_text(text, encoding="utf-8")
        return str(file)

    return write


@pytest.fixture
def short_ik_cell(tmp_path: Path) -> str:
    """The bundled ik cell with the first 0.2 s of its target."""
    text = data_path("cells/chung.yaml").read_text(encoding="utf-8")
    assert "duration_s: 12.566370614359172" in text
    file = tmp_path / "short.yaml"
    file.write_text(text.replace("duration_s: 12.566370614359172", "duration_s: 0.2"), encoding="utf-8")
    return str(file)
