"""``armtempo plot`` in cells of every kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import imageio.v3 as imageio
import pytest

from armtempo.commands import main


def size(file: Path) -> tuple[int, int]:
    """Width and height of a picture that is not of one colour."""
    picture = imageio.imread(file)
    assert picture.std() > 1.0, f"{file.name} is blank"
    return picture.shape[1], picture.shape[0]


def test_plot_draws_the_plans(cell_file: Callable[..., str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", cell_file(), "--method", "delay"]) == 0
    pictures = {file.name for file in Path("results/lee1991/plans").glob("*.png")}
    assert {"workspace.png", "coordination_chart.png", "phase_plane.png", "running_time.png", "torque.png"} <= pictures
    assert not list(Path("results/lee1991/plans").glob(".*")), "a temporary file was left behind"
    assert all(size(Path("results/lee1991/plans") / name) for name in pictures)
    assert "Pictures in" in capsys.readouterr().out


def test_plot_draws_the_profiles_of_a_blend_cell() -> None:
    assert main(["plot", "lee2006", "--out", "pictures"]) == 0
    assert {file.stem for file in Path("pictures").iterdir() if size(file)} == {
        "workspace", "path", "line_speed", "accelerations", "joint_speeds", "torque",
    }  # fmt: skip


def test_plot_draws_the_runs_of_an_ik_cell(short_ik_cell: str) -> None:
    assert main(["plot", short_ik_cell, "--method", "feedback", "--out", "pictures"]) == 0
    assert {file.stem for file in Path("pictures").iterdir() if size(file)} == {
        "workspace", "path", "errors", "joint_speeds", "torque",
    }  # fmt: skip
