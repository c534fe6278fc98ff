"""Where files are: a bundled name or a path, and each wrong thing told apart."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from armtempo.configs.files._find import CELL_FILES, DATA, SWEEP_FILES, TRAINING_FILES, data_path
from armtempo.errors import ConfigError, InputError, UnknownNameError


@pytest.mark.parametrize("folder", [CELL_FILES, TRAINING_FILES, SWEEP_FILES], ids=lambda folder: folder.what)
def test_every_bundled_name_is_a_file_that_is_found_and_read(folder: Any) -> None:
    names = folder.bundled()
    assert list(names) == sorted(path.stem for path in (DATA / folder.name).iterdir())
    for name in names:
        text, path = folder.read(name)
        assert path.stem == name
        assert path.is_absolute()
        assert text == path.read_text(encoding="utf-8")


def test_a_path_object_is_never_a_bundled_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match="lee1991: no such file"):
        CELL_FILES.find(Path("lee1991"))
    Path("lee1991").write_text("own")
    assert CELL_FILES.find("lee1991") == DATA / "cells" / "lee1991.yaml"  # the word is the bundled one
    assert CELL_FILES.read(Path("lee1991")) == ("own", tmp_path.resolve() / "lee1991")


def test_a_home_is_expanded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "own.yaml").write_text("a: 1")
    assert CELL_FILES.find("~/own.yaml") == tmp_path / "own.yaml"


@pytest.mark.parametrize(
    ("given", "error", "message"),
    [
        ("lee1992", UnknownNameError, "did you mean 'lee"),
        ("nothing", UnknownNameError, "or give the path of a YAML file"),
        ("lee1992.yml", ConfigError, r"lee1992\.yml: no such file"),
        ("folder/lee1991", ConfigError, "folder/lee1991: no such file"),
        (3, InputError, "a cell is a name or a file, got int"),
    ],
)
def test_names_and_paths_that_lead_nowhere_are_told_apart(given: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        CELL_FILES.find(given)
    assert type(caught.value) is error
    assert "lee2006" in str(caught.value)  # all that there are


def test_a_folder_is_told_as_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cells").mkdir()
    with pytest.raises(ConfigError, match="cells: is a folder"):
        CELL_FILES.find("cells")


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    file.write_bytes(b"name: \xff")
    with pytest.raises(ConfigError, match=r"own\.yaml: cannot be read: not UTF-8 text"):
        CELL_FILES.read(file)


def test_data_is_found_by_its_path_and_code_is_no_data() -> None:
    assert data_path("robots/puma560.urdf").is_file()
    with pytest.raises(UnknownNameError, match=r"robots/puma560\.urdf") as caught:
        data_path("robots/puma561.urdf")
    assert ".py" not in str(caught.value)
