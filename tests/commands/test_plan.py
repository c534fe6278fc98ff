"""``armtempo plan`` in cells of every kind: figures, refusals, and motions that are what they claim to be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from armtempo.commands import main
from armtempo.commands.console import find_bound
from armtempo.planners import BlendCell, CoordinationCell, IKCell, load_cell, read_trajectory
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm


def load(file: str) -> Any:
    return json.loads(Path(file).read_text(encoding="utf-8"))


def test_plan_compares_all_methods(capsys: pytest.CaptureFixture[str]) -> None:
    from armtempo.planners import METHODS

    assert main(["plan", "lee1991", "--json", "plan.json"]) == 0
    out = capsys.readouterr().out
    assert "certified lower bound 0.327" in out
    data = load("plan.json")
    assert tuple(data["methods"]) == METHODS
    assert all(name in out for name in METHODS)
    vci = data["methods"]["vci"]
    assert 0.328 < vci["makespan_s"] < 0.345
    assert vci["torque_ratio_max"] < 1.001
    assert vci["min_clearance_m"] > data["d_min_m"]
    assert vci["certified_free"] is True
    assert 0.32 < data["lower_bound_s"] < data["methods"]["delay"]["makespan_s"]


def test_the_search_for_the_bound_tells_how_far_it_is() -> None:
    cell, told = load_cell("planar-four"), list[str]()
    assert isinstance(cell, CoordinationCell)
    find_bound(cell, told.append)
    assert told[0] == "Bounding the makespan"
    assert "at least" in told[-1]
    assert "open" in told[-1]


def test_plan_takes_methods_and_a_control_period(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["plan", "lee1991", "--methods", "vci", "delay", "--control-period", "0.001", "--json", "-"]
    assert main(line) == 0
    data = json.loads(capsys.readouterr().out)
    assert list(data["methods"]) == ["vci", "delay"]
    assert data["control_period_s"] == 0.001
    assert data["methods"]["vci"]["makespan_s"] == pytest.approx(0.342, abs=0.003)


def test_every_order_of_the_arms_or_the_best_or_that_of_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    found = {}
    for orders in ("all", "best", "file"):
        line = ["plan", "planar-four", "--methods", "delay", "sequential", "--orders", orders, "--json", "-"]
        assert main(line) == 0
        found[orders] = json.loads(capsys.readouterr().out)["methods"]
    assert len(found["all"]) == 1 + 24
    times = {name: entry.get("makespan_s", float("inf")) for name, entry in found["all"].items()}
    best, own = found["best"]["delay"], found["file"]["delay"]
    assert best["makespan_s"] == pytest.approx(min(times.values()), rel=2e-6)
    assert times[f"delay {','.join(best['order'])}"] == best["makespan_s"]
    assert own.get("makespan_s", float("inf")) == next(iter(times.values()))


@pytest.mark.parametrize("form", ["csv", "json"])
def test_plan_exports_the_motion_of_every_arm(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    from armtempo.planners import read_trajectory

    line = ["plan", "lee1991", "--methods", "delay", "sequential", "--export", "out", "--format", form]
    assert main([*line, "--rate-hz", "500", "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert sorted(path.name for path in Path("out").iterdir()) == [
        f"{method}-{arm}.{form}" for method in ("delay", "sequential") for arm in ("master", "slave")
    ]
    assert sorted(facts["exported"]) == sorted(str(path) for path in Path("out").iterdir())
    for path in Path("out").iterdir():
        method, arm = path.stem.split("-")
        motion = read_trajectory(path)
        assert motion.joint_names == ("joint_1", "joint_2")
        assert motion.time[-1] == pytest.approx(facts["methods"][method]["arrival_s"][arm], rel=1e-12)
        assert motion.time[1] == 0.002


def test_plan_says_which_method_has_no_plan(cell_file: Callable[..., str], capsys: pytest.CaptureFixture[str]) -> None:
    # At 0.03 m between surfaces the slave may not wait at its start.
    file = cell_file(("d_min_m: 0.01 ", "d_min_m: 0.03 "))
    status = main(["plan", file, "--json", "plan.json"])
    captured = capsys.readouterr()
    if status == 0:
        refused = [name for name, entry in load("plan.json")["methods"].items() if "error" in entry]
        assert refused
        assert all(f"{name} has no plan" in captured.out for name in refused)
    else:
        assert status == 2
        assert captured.err.count("\n") == 1


def test_plans_of_a_blend_cell_are_its_profiles_and_corners(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "lee2006", "--json", "plan.json"]) == 0
    out = capsys.readouterr().out
    assert "Plans for lee2006" in out
    assert "Corners" in out
    data = load("plan.json")
    assert list(data["methods"]) == ["line-speed", "limit-aware", "limit-aware-smooth"]
    paper, aware, smooth = data["methods"].values()
    assert paper["duration_s"] == pytest.approx(1.8688, abs=1e-4)
    assert paper["blend_speed_min_m_s"] == pytest.approx(data["line_speed_m_s"])
    assert paper["normal_ratio_max"] > 5.0
    for entry in (aware, smooth):
        assert entry["certificate"]["jerk_ratio_max"] <= 1.0 + 1e-6
        assert max(entry["normal_ratio_max"], entry["jerk_ratio_max"], entry["torque_ratio_max"]) <= 1.0 + 1e-6
    assert aware["blend_speed_min_m_s"] == pytest.approx(0.0, abs=1e-6)  # it stops where the curvature jumps
    assert smooth["blend_speed_min_m_s"] > 0.6
    assert [[corner["continuity_before"] for corner in entry["corners"]] for entry in (aware, smooth)] == [
        [2, 1], [2, 2],
    ]  # fmt: skip
    assert [corner["remaining_before_m"] for corner in aware["corners"]] == [0.15, 0.15]


def test_plans_of_an_ik_cell_are_runs_of_its_law_and_of_others(
    short_ik_cell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", short_ik_cell, "--json", "plan.json"]) == 0
    assert "inverse kinematics at ticks of 1 ms over 0.2 s" in " ".join(capsys.readouterr().out.split())
    data = load("plan.json")
    law, feedback, fed, newton = data["methods"].values()
    assert list(data["methods"]) == ["law", "feedback", "feedback-ff", "newton"]
    assert feedback["position_error_max_m"] > 100.0 * fed["position_error_max_m"]
    for entry in (law, feedback, fed):
        assert all(entry["bounds_held"].values())
        assert entry["position_error_max_m"] <= entry["position_bound_max_m"] * (1.0 + 1e-9) + 1e-12
    assert newton["bounds_held"] is newton["position_bound_max_m"] is None
    assert 0.0 < law["joint_speed_ratio_max"] < 1.0
    assert law["singular_value_min"] == pytest.approx(0.19, abs=0.01)


def exported(line: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, JointTrajectory]:
    """The motions that a line exports, by method."""
    assert main([*line, "--export", "out", "--json", "-"]) == 0
    facts = json.loads(capsys.readouterr().out)
    files = [Path(file) for file in facts["exported"]]
    assert sorted(files) == sorted(Path("out").iterdir())
    return {file.stem.rpartition("-")[0]: read_trajectory(file) for file in files}


def check_dynamics(motion: JointTrajectory, arm: Arm) -> None:
    assert motion.joint_names == arm.joint_names
    assert motion.torque == pytest.approx(arm.inverse_dynamics(motion.q, motion.qd, motion.qdd), abs=1e-9)


def test_exported_profiles_follow_the_path_within_the_limits(
    lee2006: BlendCell, capsys: pytest.CaptureFixture[str]
) -> None:
    motions = exported(["plan", "lee2006", "--rate-hz", "2000"], capsys)
    for name, motion in motions.items():
        cell = lee2006.variant(curve="quintic") if name == "limit-aware-smooth" else lee2006
        profile = cell.profile(name.removesuffix("-smooth"))
        check_dynamics(motion, cell.arm)
        assert motion.time[-1] == profile.duration
        assert motion.qd[[0, -1]] == pytest.approx(0.0, abs=1e-6)
        steps = np.diff(motion.time)[:, None]
        moved = 0.5 * steps * (motion.qd[1:] + motion.qd[:-1])
        assert np.diff(motion.q, axis=0) == pytest.approx(moved, abs=2e-6)
        tip = cell.arm.tip_pose(motion.q)[:, :3, 3]
        assert np.abs(tip - cell.blended.position(profile.at(motion.time)[0])).max() < 1e-9
        assert (np.linalg.norm(np.diff(tip, axis=0), axis=1) / steps[:, 0]).max() < cell.limits.speed * (1.0 + 1e-6)
        assert (np.abs(motion.torque) / cell.arm.torque_max).max() < 1.0
        assert (np.abs(motion.qd) / cell.arm.speed_max).max() < 1.0


def test_exported_runs_stay_within_the_bounds_that_the_law_states(
    short_ik_cell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = load_cell(short_ik_cell, IKCell)
    motions = exported(["plan", short_ik_cell], capsys)
    assert list(motions) == ["law", "feedback", "feedback-ff", "newton"]
    for motion in motions.values():
        check_dynamics(motion, cell.arm)
        assert motion.time == pytest.approx(cell.physics_tick * np.arange(cell.ticks + 1))
        assert np.diff(motion.qd, axis=0) == pytest.approx(cell.physics_tick * motion.qdd[:-1], abs=1e-12)
    law = motions["law"]
    off = np.linalg.norm(cell.arm.tip_pose(law.q)[:, :3, 3] - cell.target.position[::2], axis=1)
    bounds = cell.nominal.bounds
    assert (off <= bounds.position * (1.0 + 1e-9) + bounds.rounding + 1e-12).all()
    assert (np.abs(law.qd) <= bounds.joint_speed).all()
    moved = 0.5 * cell.physics_tick * (law.qd[1:] + law.qd[:-1])
    assert np.diff(law.q, axis=0) == pytest.approx(moved, abs=1e-8)


def test_runs_are_thinned_by_whole_ticks(short_ik_cell: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["plan", short_ik_cell, "--methods", "law"]
    (motion,) = exported([*line, "--rate-hz", "33.33333333333"], capsys).values()
    assert motion.time == pytest.approx([0.0, 0.03, 0.06, 0.09, 0.12, 0.15, 0.18, 0.2])
    assert main([*line, "--export", "out", "--rate-hz", "700"]) == 2
    assert "--rate-hz 700 is not one row every so many ticks of 0.001 s" in capsys.readouterr().err


def test_smooth_plans_keep_jerk_limits_and_tell_what_they_cost(
    cell_file: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    file = cell_file(("torque_nm: [25, 7]", "torque_nm: [25, 7], jerk_rad_s3: [4000, 8000]"))
    line = ["plan", file, "--smooth", "--methods", "delay", "constant-speed", "--export", "out"]
    assert main([*line, "--json", "plan.json"]) == 0
    out = capsys.readouterr().out
    assert "jerk" in out
    assert "constant-speed has no plan" in out
    data = load("plan.json")["methods"]
    assert 0.95 < data["delay"]["jerk_ratio_max"] <= 1.001
    assert 0.0 < data["delay"]["smoothing_price_percent"] < 30.0
    assert data["delay"]["certified_free"] is True
    for file in ("out/delay-master.csv", "out/delay-slave.csv"):
        motion = read_trajectory(file)
        jerk = np.abs(np.diff(motion.qdd[:-1], axis=0)) / 0.001
        assert (jerk <= np.array([4000.0, 8000.0]) * 1.001).all()
        assert (np.abs(motion.torque) <= np.array([25.0, 7.0]) * 1.001).all()


def test_smooth_is_for_arms_with_jerk_limits_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "lee1991", "--smooth", "--methods", "delay"]) != 0
    assert "has no jerk limits" in capsys.readouterr().err
    assert main(["plan", "chung", "--smooth", "--methods", "feedback"]) != 0
    assert "--smooth is for cells of several arms" in capsys.readouterr().err


def test_plans_go_to_robots_and_the_table_says_what_their_controllers_make_of_them(
    capsys: pytest.CaptureFixture[str],
) -> None:
    line = ["plan", "lee1991", "--methods", "delay", "--export", "out/motion.yaml", "--rate-hz", "250"]
    assert main([*line, "--json", "plan.json"]) == 0
    assert "What a controller makes of the points" in capsys.readouterr().out
    data = load("plan.json")
    assert data["exported"] == ["out/motion.yaml"]
    made = data["interpolation"]["delay"]
    assert list(made) == ["master", "slave"]
    assert 0.0 < made["master"]["quintic"]["position_error"] < made["master"]["cubic"]["position_error"] < 1e-4
    document = yaml.safe_load(Path("out/motion.yaml").read_text(encoding="utf-8"))
    slave = document["joint_trajectories"]["slave"]
    assert slave["joint_names"] == ["joint_1", "joint_2"]
    arrival = data["methods"]["delay"]["makespan_s"]
    last = slave["points"][-1]["time_from_start"]
    assert arrival <= last["sec"] + 1e-9 * last["nanosec"] < arrival + 0.004
    assert document["events"] == []


def test_a_folder_takes_every_method_of_every_kind(short_ik_cell: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["plan", "lee2006", "--format", "robot-trajectory", "--export", "out", "--json", "-"]
    assert main(line) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [Path(file).name for file in facts["exported"]] == [
        "line-speed.json", "limit-aware.json", "limit-aware-smooth.json",
    ]  # fmt: skip
    for made in facts["interpolation"].values():
        assert made["scara"]["cubic"]["position_error"] < 1e-5
    # The first 0.2 s of a target end on the move.
    assert main(["plan", short_ik_cell, "--methods", "law", "--export", "a.json"]) == 2
    assert "arm 'puma' moves where the motion ends" in capsys.readouterr().err
    assert main(["plan", short_ik_cell, "--methods", "law", "--export", "a.csv", "--rate-hz", "500"]) == 0
    assert read_trajectory("a.csv").time[1] == 0.002


def test_runs_of_inverse_kinematics_go_to_robots_tick_by_tick(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["plan", "chung", "--methods", "law", "--export", "a.json", "--json", "-"]
    assert main([*line, "--rate-hz", "200"]) == 0
    facts = json.loads(capsys.readouterr().out)
    message = load("a.json")["joint_trajectories"]["puma"]
    last = message["points"][-1]["time_from_start"]
    assert (last["sec"], last["nanosec"]) == (12, 570_000_000)  # 12.57 s, the first whole period behind the end
    assert facts["interpolation"]["law"]["puma"]["cubic"]["position_error"] < 1e-4
    assert main([*line, "--rate-hz", "1000"]) == 0
    every_tick = json.loads(capsys.readouterr().out)["interpolation"]["law"]["puma"]["cubic"]
    assert every_tick["position_error"] is None  # nothing more is known


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--export", "a.json"], "--export a.json: a file holds one plan (name its method"),
        (["--methods", "delay", "--export", "a.json", "--format", "mcap"], "mcap is not kept in .json"),
        (["--methods", "delay", "--export", "out", "--format", "urscript"], "URScript drives six revolute joints"),
        (["--methods", "delay", "--export", "a.mcap", "--rate-hz", "1e9"], "give a lower rate"),
    ],
)
def test_what_cannot_be_exported_is_said_with_the_remedy(
    options: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", "lee1991", *options]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not list(Path().glob("*.json"))
