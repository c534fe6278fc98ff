"""Robot files by name, beside the cell first, and what data sheets say of them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from armtempo.configs.files._data_sheets import _datasheets, resolve_file, robot_config
from armtempo.configs.files._find import DATA
from armtempo.errors import ConfigError


def cell_in(folder: Path) -> Any:
    return SimpleNamespace(source=folder / "cell.yaml")


def test_a_file_beside_the_cell_goes_before_a_bundled_one(tmp_path: Path) -> None:
    cell, name = cell_in(tmp_path), "puma560.urdf"
    assert resolve_file(cell, name) == (DATA / "robots" / name).resolve()
    (tmp_path / name).write_text("own")
    assert resolve_file(cell, name) == (tmp_path / name).resolve()


def test_absolute_paths_and_paths_upwards_are_taken_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text("own")
    cell = cell_in(tmp_path / "cells")
    (tmp_path / "cells").mkdir()
    for name in ("../arm.urdf", str(tmp_path / "arm.urdf")):
        assert resolve_file(cell, name) == (tmp_path / "arm.urdf").resolve()


def test_every_data_sheet_is_of_a_robot_that_can_be_found(tmp_path: Path) -> None:
    assert _datasheets()
    for name in _datasheets():
        assert resolve_file(cell_in(tmp_path), name).is_file()
        assert robot_config(name) is _datasheets()[name]
    assert robot_config("nobody.urdf") is None


def test_what_is_nowhere_is_told_where_it_was_looked_for_and_the_nearest_robot(tmp_path: Path) -> None:
    with pytest.raises(ConfigError) as caught:
        resolve_file(cell_in(tmp_path), "puma56.urdf")
    message = str(caught.value)
    assert f"looked for {tmp_path / 'puma56.urdf'}" in message
    assert "did you mean 'puma560.urdf'?" in message
    assert "pybullet_data/franka_panda/panda.urdf" in message
    assert caught.value.data["value"] == "puma56.urdf"
    with pytest.raises(ConfigError, match=r"no file 'pybullet_data/nobody\.urdf'"):
        resolve_file(cell_in(tmp_path), "pybullet_data/nobody.urdf")
