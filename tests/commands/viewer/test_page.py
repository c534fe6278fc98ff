"""Pages: one file that reaches nothing else, whose numbers are the traces'."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from armtempo.agents import Evaluation, evaluate
from armtempo.arrays import Floats
from armtempo.commands.viewer import page_data, view_page, write_view
from armtempo.commands.viewer._packing import packed, unpacked
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, IKCell, build_cell

LARGEST = 2_000_000  # bytes


def data_of(page: str) -> Any:
    """What a page shows."""
    found = re.search(r'<script id="data" type="application/json">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def row_numbers(run: Any, time: Floats) -> NDArray[np.int64]:
    """Which rows of its trace a run keeps."""
    rows = np.searchsorted(time.astype(np.float32), unpacked(run["columns"]["time"])[:, 0])
    assert rows[0] == 0
    assert rows[-1] == len(time) - 1
    return np.asarray(rows)


def place(arm: Any, q: Floats) -> Floats:
    """(3,) where the tip is for a reader of the page: the forward kinematics that the page does."""
    T = np.vstack([np.reshape(arm["base"], (3, 4)), [0, 0, 0, 1]])
    for joint, angle in zip(arm["joints"], q, strict=True):
        axis = np.array(joint["axis"])
        move = np.eye(4)
        if joint["slides"]:
            move[:3, 3] = angle * axis
        else:
            K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
            move[:3, :3] += math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K
        T = T @ np.vstack([np.reshape(joint["placement"], (3, 4)), [0, 0, 0, 1]]) @ move
    return np.asarray((T @ np.append(arm["tip"], 1.0))[:3])


def test_arrays_survive_their_way_into_the_page() -> None:
    for values in (np.arange(6.0).reshape(2, 3), np.array([[1, 2, 3]]), np.zeros((0, 4))):
        back = unpacked(json.loads(json.dumps(packed(values))))
        np.testing.assert_array_equal(back, values)


def test_a_page_needs_nothing_else(lee1991_runs: Evaluation[Any, Any, Any], tmp_path: Path) -> None:
    file = tmp_path / "page.html"
    write_view(lee1991_runs, file)
    page = file.read_text(encoding="utf-8")
    assert file.stat().st_size < LARGEST
    assert "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:\"" in page
    assert not re.search(r'(?:src|href|action)\s*=\s*"(?!data:)', page.partition("<script")[0])
    assert "The MIT License" in page  # of three.js, as it asks
    assert page.count("</script") == 3  # no text of ours or of the library ends one early
    assert "/*{" not in page


def test_the_library_is_the_version_that_make_viewer_builds() -> None:
    folder = files("armtempo.commands.viewer")
    wanted = json.loads((folder / "library" / "package.json").read_text(encoding="utf-8"))["dependencies"]["three"]
    head = (folder / "page" / "three.js").read_text(encoding="utf-8")[:400]
    assert head.startswith(f"/*! three.js {wanted}\n\nThe MIT License")


def test_the_numbers_of_a_page_are_those_of_the_traces(lee1991_runs: Evaluation[Any, Any, Any]) -> None:
    cell, data = lee1991_runs.cell, page_data(lee1991_runs)
    assert [run["policy"] for run in data["runs"]] == ["delay", "vci", "phase-plane"]
    for run, result in zip(data["runs"], lee1991_runs.results.values(), strict=True):
        trace, columns = result.trace, {name: unpacked(one) for name, one in run["columns"].items()}
        rows = row_numbers(run, trace.time)
        np.testing.assert_array_equal(rows, np.arange(len(trace.time)))  # a short episode is there whole
        for i in range(2):
            np.testing.assert_array_equal(columns[f"q{i}"], trace.q[i].astype(np.float32))
            share = trace.torque[i] / trace.torque_max[i]
            np.testing.assert_array_equal(columns[f"torque{i}"], share.astype(np.float32))
            tip = place(data["scene"]["arms"][i], trace.q[i][-1])
            np.testing.assert_allclose(tip, cell.arms[i].tip_pose(trace.q[i][-1])[:3, 3], atol=1e-12)
        for name in ("lam", "mu", "clearance"):
            np.testing.assert_array_equal(
                columns[name].reshape(len(rows), -1), getattr(trace, name).reshape(len(rows), -1).astype(np.float32)
            )
    assert data["runs"][0]["arrived"] == lee1991_runs.results["delay"].trace.makespan
    assert data["runs"][2]["arrived"] is None
    assert data["runs"][2]["mishap"] == "too close at 0.061 s"
    assert data["first"] == "delay"


def test_paths_end_where_arms_do(lee1991_runs: Evaluation[Any, Any, Any]) -> None:
    cell, data = lee1991_runs.cell, page_data(lee1991_runs)
    for run in data["runs"]:
        for i, number in enumerate(run["paths"]):
            way = unpacked(data["paths"][number])
            q = cell.paths[i].evaluate(cell.paths[i].length)[0]
            np.testing.assert_allclose(way[-1], cell.arms[i].tip_pose(q)[:3, 3], atol=1e-6)
    assert len(data["paths"]) == 2  # all policies go along the same ones
    progress = unpacked(data["runs"][0]["columns"]["progress"])
    assert progress[0].tolist() == [0.0, 0.0]
    np.testing.assert_allclose(progress[-1], 1.0)


def test_a_blend_cell_shows_its_speeds_and_every_policys_own_path(lee2006_runs: Evaluation[Any, Any, Any]) -> None:
    data = page_data(lee2006_runs)
    assert [panel["title"] for panel in data["panels"]] == [
        "Line speed along the path", "Line speed of the tip", "Accelerations and jerk", "Distance from the path",
        "Torques",
    ]  # fmt: skip
    assert data["runs"][0]["paths"] != data["runs"][1]["paths"]
    for run, result in zip(data["runs"], lee2006_runs.results.values(), strict=True):
        trace = result.trace
        rows = row_numbers(run, trace.time)
        np.testing.assert_array_equal(unpacked(run["columns"]["v"])[:, 0], trace.v[rows].astype(np.float32))
        shares = unpacked(run["columns"]["shares"])
        assert shares[:, 1].max() == pytest.approx(result.normal_acceleration_ratio_max, rel=1e-2)
        (limit,) = run["curves"]["Line speed along the path"]
        assert unpacked(limit["points"])[:, 1].max() == pytest.approx(1000.0)


def test_an_ik_cell_shows_its_target(chung: IKCell) -> None:
    runs = evaluate(chung, ["feedback"], physics="ideal")
    data, trace = page_data(runs), runs.results["feedback"].trace
    (run,) = data["runs"]
    rows = row_numbers(run, trace.time)
    assert len(rows) < len(trace.time)  # twelve seconds in milliseconds are thinned
    pose = unpacked(run["columns"]["target"]).reshape(-1, 3, 4)
    np.testing.assert_array_equal(pose[:, :, 3], trace.target[rows].astype(np.float32))
    error = unpacked(run["columns"]["position_error"])[:, 0]
    assert error.max() == np.float32(trace.position_error.max())  # the worst is kept
    assert data["scene"]["follows"]
    assert "Distance from the target" in [panel["title"] for panel in data["panels"]]


def test_an_obstacle_is_drawn_and_seen(lee1991: CoordinationCell) -> None:
    box = {"name": "post", "box": {"size_m": [0.1, 0.1, 0.1]}, "pose": {"position_m": [0.0, -0.6, 0.0]}}
    config = type(lee1991.config).model_validate({**lee1991.config.model_dump(exclude_none=True), "obstacles": [box]})
    data = page_data(evaluate(build_cell(config), ["delay"], physics="ideal"))
    (drawn,) = data["scene"]["obstacles"]
    assert drawn["kind"] == "box"
    assert drawn["size"] == [0.1, 0.1, 0.1]
    assert data["scene"]["low"][1] < -0.64


def test_no_name_can_break_the_page(lee1991_runs: Evaluation[Any, Any, Any]) -> None:
    name = "</script><script>alert(1)//<!--"
    facts = {**lee1991_runs.facts, "best": name, "best_online": name}
    page = view_page(replace(lee1991_runs, results={name: lee1991_runs.results["vci"]}, facts=facts))
    assert page.count("</script") == 3
    assert [run["policy"] for run in data_of(page)["runs"]] == [name]


def test_nothing_to_see_is_told(lee1991_runs: Evaluation[Any, Any, Any]) -> None:
    with pytest.raises(InputError, match="nothing to be seen"):
        view_page(replace(lee1991_runs, results={}))
