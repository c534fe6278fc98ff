"""``armtempo bench`` and ``armtempo cells generate``: tiny runs, their files and their errors."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import get_args, get_type_hints

import imageio.v3 as imageio
import pytest

from armtempo.commands import main
from armtempo.commands._generate import generate
from armtempo.commands.bench._coordination import Family
from armtempo.planners import benchmark_instances, load_cell
from armtempo.planners.instances import FAMILIES, SET_FAMILIES, load_instance


@pytest.fixture(autouse=True)
def _work_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")


def test_cells_are_generated_once(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["cells", "generate", "--family", "planar", "--count", "1", "--first", "1", "--out", "cells"]
    assert main([*line, "--json", "cells.json"]) == 0
    assert "Rejected draws: 3 x the arms do not meet" in capsys.readouterr().out
    data = json.loads(Path("cells.json").read_text(encoding="utf-8"))
    assert data["drawn"] == 1
    (entry,) = data["cells"]
    cell = load_cell("cells/planar-1-0001.yaml")
    instance = load_instance("cells/planar-1-0001.npz")
    assert entry["lower_bound_s"] == instance.labels.lower_bound == cell.lower_bound
    assert (instance.timing.chart_between(0, 1).states == cell.chart.states).all()
    before = {file: file.stat().st_mtime_ns for file in Path("cells").iterdir()}
    assert len(before) == 3
    assert main(line) == 0
    assert "0 drawn, 1 were there already" in capsys.readouterr().out
    assert before == {file: file.stat().st_mtime_ns for file in Path("cells").iterdir()}
    Path("cells/planar-1-0001.npz").unlink()  # half an instance is drawn again
    assert main(line) == 0
    assert load_instance("cells/planar-1-0001.npz").labels == instance.labels


def test_cells_still_lists(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cells"]) == 0
    assert "lee1991" in capsys.readouterr().out


def test_bench_coordination(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["bench", "coordination", "--families", "planar", "--limit", "6", "--methods", "delay", "optimal"]
    assert main([*line, "--json", "bench.json"]) == 0
    out = capsys.readouterr().out
    assert "audited by coal at 10 x the control rate" in out
    assert "broken" not in out
    data = json.loads(Path("bench.json").read_text(encoding="utf-8"))
    assert data["cells"] == 6
    assert len(data["results"]) == 12
    assert data["methods"]["optimal"]["all"]["violations"] == 0
    assert data["other_bounds"] == []
    solved = [one for one in data["results"] if one["solved"]]
    assert len(solved) >= 6
    assert all(one["min_clearance_m"] > 0.0 and one["gap_percent"] > -0.1 for one in solved)
    assert all(one["reason"] for one in data["results"] if not one["solved"])


def test_bench_tells_other_bounds(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    one = next(one for one in benchmark_instances("test", family="planar") if one.labels.status == "feasible")
    other = replace(one, labels=replace(one.labels, lower_bound=math.inf))
    monkeypatch.setattr("armtempo.planners.benchmark_instances", lambda *_, **__: (one, other))
    assert main(["bench", "coordination", "--methods", "sequential", "--audit", "none", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["other_bounds"] == [other.name]


def test_bench_errors(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["bench", "errors", "--cells", "lee1991", "--rings", "0", "--errors", "0.05", "--reserves", "0", "0.1"]
    assert main([*line, "--episodes", "2", "--json", "errors.json"]) == 0
    assert "Bodies heavier than planned, under the shield (2 episodes each)" in capsys.readouterr().out
    runs = json.loads(Path("errors.json").read_text(encoding="utf-8"))["runs"]
    assert [(run["torque_reserve"], run["model_error"]) for run in runs[::2]] == [
        (0, 0),
        (0, 0.05),
        (0.1, 0),
        (0.1, 0.05),
    ]
    for run in runs:
        assert run["violations"] == run["not_arrived"] == 0
        assert max(run["off_path_m"], run["along_path_m"]) < 1e-4
        assert run["needed_torque_reserve"] == pytest.approx(1.0 - 0.99 / (1.0 + 1.31 * run["model_error"]))
    assert runs[0]["off_path_m"] < 1e-7 < runs[2]["off_path_m"]
    assert runs[0]["lost_share"] < runs[2]["lost_share"]


def test_families_on_the_command_line_are_those_there_are() -> None:
    assert set(get_args(Family)) == set(SET_FAMILIES)
    assert get_args(get_type_hints(generate)["family"]) == FAMILIES


def test_bench_arms() -> None:
    line = ["bench", "arms", "--arms", "2", "3", "4", "--families", "ring", "rows", "--count", "1", "--tries", "5"]
    assert main([*line, "--out", "arms.png", "--json", "arms.json"]) == 0
    found = json.loads(Path("arms.json").read_text(encoding="utf-8"))
    sizes = [("ring", 2), ("ring", 3), ("ring", 4), ("rows", 4)]
    assert [(cell["family"], cell["arms"]) for cell in found["cells"]] == sizes
    assert [(one["family"], one["arms"]) for one in found["drawn"]] == sizes
    assert all(one["drawn"] >= one["feasible"] == 1 for one in found["drawn"])
    assert all(cell["makespan_s"]["optimal"] >= cell["lower_bound_s"] for cell in found["cells"])
    assert imageio.imread("arms.png").std() > 1.0


def test_sizes_of_which_nothing_is_feasible_say_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "arms", "--arms", "6", "--count", "1", "--tries", "1"]) != 0
    assert "none of 1 cells is feasible" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (["bench", "coordination", "--methods", "magic"], "unknown method 'magic'"),
        (["bench", "coordination", "--families", "scara"], "planar"),
        (["bench", "coordination", "--limit", "0"], "--limit must be at least 1"),
        (["bench", "arms", "--arms", "17"], "no family of ring has 17 arms"),
        (["bench", "arms", "--arms", "4", "5", "--families", "rows"], "no family of rows has 5 arms"),
        (["bench", "arms", "--tries", "0"], "--count and --tries must be positive"),
        (["cells", "generate", "--out", "cells", "--count", "0"], "--count must be at least 1"),
        (["cells", "generate", "--out", "cells", "--family", "panda", "--arms", "6"], "give one of 2, 3, 4"),
    ],
)
def test_wrong_lines(line: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line) == 2
    assert words in capsys.readouterr().err
