"""The zoo itself (``make zoo`` has the robots): files that come, the stage they reach, the reason where they stop."""

from __future__ import annotations

from pathlib import Path

from armtempo.configs import data_path
from tests.robots.torso import write_torso
from tests.zoo import look, robot_files, told


def test_the_bundled_robots_are_loaded_and_planned_for() -> None:
    files, few = robot_files(data_path("robots/puma560.urdf").parent)
    assert few == 1  # the planar arm of the paper has two joints
    rows = [look(file) for file in files]
    assert [row["stage"] for row in rows] == ["planned"] * len(rows)
    assert all(row["duration_s"] > 0.0 for row in rows)


def test_what_has_to_be_told_and_why_files_stop_is_in_the_table(tmp_path: Path) -> None:
    urdf, _ = write_torso(tmp_path)
    row = look(urdf)
    assert row["stage"] == "loaded"  # its torso is too weak for what it carries
    assert row["told"].startswith("tip_link: left_")
    assert "| torso.urdf | loaded | 5 |" in told(row)
    assert "to hold still" in told(row)
    (tmp_path / "bad.urdf").write_text("<robot", encoding="utf-8")
    row = look(tmp_path / "bad.urdf")
    assert row["stage"] == ""
    assert "| bad.urdf | refused |" in told(row)
    assert "cannot be read as XML" in told(row)
    assert "raw" not in row
