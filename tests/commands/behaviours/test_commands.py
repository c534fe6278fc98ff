"""The command line: every command on the bundled cell, its JSON, its pictures, its errors."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import pytest

from armtempo.commands import main
from armtempo.configs import bundled_cells, data_path
from tests.agents.trained import trained

POLICY_KEYS = {
    "plan_makespan_s",
    "makespan_s",
    "saving_percent",
    "gap_percent",
    "plan_gap_percent",
    "min_clearance_m",
    "torque_ratio_max",
    "torque_demand_ratio_max",
    "torque_clipped_fraction",
    "path_error_max_m",
    "violations",
}


def load(file: str) -> Any:
    return json.loads(Path(file).read_text(encoding="utf-8"))


def size(file: Path) -> tuple[int, int]:
    """Width and height of a picture that is not of one colour."""
    picture = imageio.imread(file)
    assert picture.std() > 1.0, f"{file.name} is blank"
    return picture.shape[1], picture.shape[0]


@pytest.mark.parametrize("physics", ["ideal", "bullet"])
def test_evaluate(physics: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "lee1991", "--policies", "vci", "delay", "random", "--physics", physics]
    pictures_too = ["--out", "pictures"] if physics == "ideal" else ["--no-figures"]
    assert main([*line, "--json", "e.json", *pictures_too]) == 0
    captured = capsys.readouterr()
    data = load("e.json")
    assert data["cell"] == "lee1991"
    assert set(data["policies"]) == {"vci", "delay", "random"}
    assert all(set(entry) >= POLICY_KEYS for entry in data["policies"].values())
    vci = data["policies"]["vci"]
    assert vci["violations"] == 0
    assert vci["makespan_s"] == pytest.approx(0.336, abs=0.012)
    assert vci["saving_percent"] == pytest.approx(41.0, abs=2.5)
    assert vci["torque_ratio_max"] <= 1.0 + 1e-9
    assert data["policies"]["random"]["plan_makespan_s"] is None
    assert "vci saves 4" in captured.out
    if physics == "bullet":
        return
    assert "Pictures in pictures" in captured.out
    pictures = {file.name: size(file) for file in Path("pictures").glob("*.png")}
    assert pictures["overview.png"] == (1890, 1290)
    assert {"time_lines.png", "clearance.png", "torque.png", "relative_motion.png"} <= set(pictures)
    assert all(name in captured.out.replace("\n", " ") for name in pictures)


def test_evaluate_a_blend_cell(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "lee2006", "--policies", "limit-aware-smooth", "line-speed"]
    assert main([*line, "--json", "e.json"]) == 0
    data = load("e.json")
    assert list(data["policies"]) == line[3:]
    assert data["policies"]["line-speed"]["duration_s"] == pytest.approx(1.869, abs=0.002)
    out = capsys.readouterr().out
    assert "limit-aware-smooth keeps all limits" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 118
    assert {file.name for file in Path("results/lee2006").glob("*.png")} == {
        "workspace.png",
        "path.png",
        "line_speed.png",
        "accelerations.png",
        "torque.png",
    }
    line = ["evaluate", "lee2006", "--policies", "random", "--family", "zigzag", "--model-error", "0.05"]
    assert main([*line, "--no-figures", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["family"], data["model_error"], list(data["policies"])) == ("zigzag", 0.05, ["random"])


def test_evaluate_is_silent_but_for_json_on_stdout(capfd: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "lee1991", "--policies", "delay", "--physics", "ideal", "--no-figures", "--master-late", "0.03"]
    assert main([*line, "--seed", "3", "--episodes", "2", "--json", "-"]) == 0
    data = json.loads(capfd.readouterr().out)
    assert data["seed"] == 3
    assert data["episodes"] == 2
    assert data["policies"]["delay"]["violations"] == 0
    assert not Path("results").exists()


def test_reproduce_lists_the_paper_beside_ours(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "lee1991", "--json", "r.json"]) == 0
    rows = load("r.json")
    assert all(set(row) - {"note"} == {"quantity", "unit", "paper", "ours"} for row in rows)
    by_name = {row["quantity"]: row for row in rows}
    assert len(by_name) == len(rows)
    # The print's own digits: Table 1 and the appendix are met to them.
    for row in rows:
        if row["unit"] in ("m", "kg m^2", "N m") and row["paper"] is not None:
            assert row["ours"] == pytest.approx(row["paper"], abs=5e-5), row["quantity"]
    assert by_name["one arm after the other"]["paper"] == 0.59
    assert by_name["one arm after the other"]["ours"] == pytest.approx(0.572, abs=0.001)
    for step in ("0.5", "1", "2", "4", "5"):
        finish = by_name[f"slave's finish by VCI, step {step} ms"]
        assert finish["paper"] == 0.33
        assert 0.328 < finish["ours"] <= (0.345 if float(step) <= 2 else 0.352)
    assert by_name["certified lower bound"]["paper"] is None
    pictures = sorted(Path("results/lee1991/paper").glob("*.png"))
    assert [file.name[:4] for file in pictures if file.name.startswith("fig")] == [f"fig{k}" for k in range(1, 9)]
    assert all(min(size(file)) > 400 for file in pictures)
    assert "Pictures in results/lee1991/paper" in capsys.readouterr().out


def test_cells_lists_and_shows(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cells", "--json", "list.json"]) == 0
    assert [entry["cell"] for entry in load("list.json")] == list(bundled_cells())
    assert main(["cells", "lee1991", "--json", "cell.json"]) == 0
    facts = load("cell.json")
    assert [arm["minimum_time_s"] for arm in facts["arms"]] == pytest.approx([0.2862, 0.2862], abs=3e-4)
    assert facts["clearance_at_start_m"] == pytest.approx(0.04, abs=1e-6)
    out = capsys.readouterr().out
    assert "planar_two_link" in out
    assert "40.0 mm" in out
    assert {entry["kind"] for entry in load("list.json")} == {"coordination", "blend", "ik", "task"}


def test_evaluate_an_ik_cell(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "chung", "--policies", "feedback", "feedback-ff", "--physics", "ideal", "--json", "ik.json"]
    assert main(line) == 0
    out = capsys.readouterr().out
    assert "gain x period" in out
    assert "Feed-forward makes the rms position error" in out
    results = load("ik.json")["policies"]
    assert results["feedback"]["position_error_max_m"] == pytest.approx(6.72e-3, abs=2e-5)
    assert {file.name for file in Path("results/chung").glob("*.png")} == {
        "workspace.png", "path.png", "errors.png", "joint_speeds.png", "torque.png",
    }  # fmt: skip
    line = ["evaluate", "panda-poses", "--policies", "feedback-damped", "--family", "near-singular", "--no-figures"]
    assert main([*line, "--episodes", "2", "--model-error", "0.05"]) == 0
    out = capsys.readouterr().out
    assert "2 random targets (near-singular); bodies +5 % in mass" in " ".join(out.split())


def test_cells_shows_an_ik_cell(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cells", "panda-poses", "--json", "ik.json"]) == 0
    facts = load("ik.json")
    assert facts["joints"] == 7
    assert facts["position_error_max_m"] < 1e-4
    assert facts["shares"]["speed"] == 0.0
    assert "Looked at, not certified" in capsys.readouterr().out


def test_gains_too_high_for_the_control_period_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = data_path("cells/chung.yaml").read_text(encoding="utf-8").replace("duration_s: 12.566", "duration_s: 0.166")
    file = tmp_path / "mine.yaml"
    for gain, told in (("199", False), ("201", True)):
        file.write_text(text.replace("position_gain_1_s: 50.9", f"position_gain_1_s: {gain}"), encoding="utf-8")
        for line in (["cells"], ["evaluate", "--physics", "ideal", "--no-figures", "--policies", "feedback"]):
            assert main([line[0], str(file), *line[1:]]) == 0
            out = " ".join(capsys.readouterr().out.split())
            assert ("The largest gain x period is 2.01: above 2 a law that decides every 10 ms" in out) == told


def test_cells_shows_a_blend_cell(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["cells", "lee2006", "--json", "cell.json"]) == 0
    facts = load("cell.json")
    assert [piece["kind"] for piece in facts["pieces"]] == ["line", "blend", "line", "blend", "arc"]
    assert [piece["end_s"] for piece in facts["pieces"]] == pytest.approx(
        [0.35, 0.6203, 0.9722, 1.2419, 1.8688], abs=1e-4
    )
    assert facts["continuity"] == [2, 2, 1, 1]
    assert "The curvature jumps at 872.2, 1141.9 mm" in capsys.readouterr().out


def test_files_of_ones_own_work(cell_file: Callable[..., str]) -> None:
    file = cell_file(("name: lee1991", "name: mine"))
    assert main(["plan", file, "--methods", "delay", "--json", "deep/in/plan.json"]) == 0
    assert load("deep/in/plan.json")["cell"] == "mine"


# Errors: one line on stderr, status 2, no traceback.


def complaint(line: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(line) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith("armtempo: error: ")
    assert "Traceback" not in err
    return err


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (["plan", "lee1919"], ["unknown cell 'lee1919'", "did you mean 'lee1991'"]),
        (["plan", "nowhere.yaml"], ["nowhere.yaml", "no such file"]),
        (["plan", "lee1991", "--methods", "vcii"], ["unknown method 'vcii'", "did you mean 'vci'"]),
        (["plan", "lee2006", "--methods", "vci"], ["unknown method 'vci'", "limit-aware-smooth"]),
        (["plan", "chung", "--methods", "vci"], ["unknown method 'vci'", "feedback-ff"]),
        (
            ["plan", "lee2006", "--control-period", "0.01"],
            ["--control-period is for cells of several arms, and lee2006 is of kind blend"],
        ),
        (["plan", "lee1991", "--control-period", "-1"], ["--control-period", "positive"]),
        (["plan", "lee1991", "--export", "out", "--rate-hz", "0"], ["--rate-hz", "positive", "try 500"]),
        (["plan", "lee1991", "--control-period", "nan"], ["--control-period", "positive"]),
        (["evaluate", "lee1991", "--policies", "vcii"], ["unknown policy 'vcii'", "did you mean 'vci'"]),
        (["evaluate", "lee1991", "--episodes", "0"], ["--episodes", "at least 1"]),
        (["evaluate", "lee1991", "--seed", "-1"], ["--seed"]),
        (["evaluate", "lee1991", "--master-late", "nan"], ["--master-late"]),
        (["evaluate", "lee2006", "--policies", "vci"], ["unknown policy 'vci'", "limit-aware-smooth"]),
        (
            ["evaluate", "lee1991", "--master-late", "0.1", "0.2", "0.3"],
            ["--master-late must be one number or the ends"],
        ),
        (["evaluate", "lee1991", "--start-phase", "0.3", "0.1"], ["--start-phase must be a number or a range"]),
        (["evaluate", "lee1991", "--disturbance", "lat"], ["unknown disturbance 'lat'", "did you mean 'late'"]),
        (["evaluate", "lee1991", "--physics", "gazebo"], ["unknown physics 'gazebo'", "bullet, ideal, mujoco"]),
        (
            ["evaluate", "lee2006", "--mode", "acceleration"],
            ["unknown option of armtempo evaluate in blend cells '--mode'", "known: --audit, --episodes, --family"],
        ),
        (
            ["evaluate", "lee2006", "--model-error", "0.1", "--physics", "ideal"],
            ["--model-error is 0.1 and physics 'ideal', which has no bodies (take --physics='bullet' or 'mujoco', or"],
        ),
        (["evaluate", "lee2006", "--model-error", "-2"], ["--model-error must be a share above -1"]),
        (["evaluate", "lee1991", "--family", "zigzag"], ["in coordination cells '--family'"]),
        (["evaluate", "lee1991", "--sheild"], ["did you mean '--shield'?"]),
        (["evaluate", "chung", "--policies", "vci"], ["unknown policy 'vci'", "feedback-damped"]),
        (["evaluate", "chung", "--family", "zigzag"], ["unknown family of targets 'zigzag'", "near-singular"]),
        (["evaluate", "lee2006", "--family", "smooth"], ["unknown family of paths 'smooth'", "zigzag"]),
        (["evaluate", "chung", "--master-late", "1"], ["in ik cells '--master-late'"]),
        (["reproduce", "lee1990"], ["unknown paper 'lee1990'", "lee1991"]),
        (["plot", "lee1991", "--method", "fast"], ["unknown method 'fast'", "known:"]),
        (["plot", "lee2006", "--method", "vci"], ["unknown method 'vci'", "line-speed"]),
        (["plot", "chung", "--method", "vci"], ["unknown method 'vci'", "newton"]),
        (["record", "lee1991", "--out", "film.avi"], ["film format '.avi'", ".mp4 or .gif"]),
        (["record", "lee1991", "--slow", "0"], ["--slow"]),
        (["record", "lee1991", "--policy", "nobody"], ["unknown policy 'nobody'"]),
        (["record", "lee2006", "--policy", "vci"], ["unknown policy 'vci'", "limit-aware-smooth"]),
        (["record", "chung", "--policy", "vci"], ["unknown policy 'vci'", "feedback-damped"]),
        (["record", "lee2006", "--shield"], ["unknown option of armtempo record in blend cells '--shield'"]),
        (["record", "chung", "--master-late", "1"], ["in ik cells '--master-late'"]),
        (["record", "lee2006", "--policy", trained("lee1991")], ["an agent of coordination, not of blend-tracking"]),
        (["record", "lee1991", "--policy", trained("feedback-ik")], ["an agent of feedback-ik, not of coordination"]),
        (["record", "chung", "--policy", "ppo:nobody"], ["unknown agent 'ppo:nobody'"]),
    ],
)
def test_wrong_names_and_values_are_told(line: list[str], words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    err = complaint(line, capsys)
    for word in words:
        assert word in err
    assert not list(Path.cwd().iterdir()), "nothing is written"


def test_colliding_starts_are_told(cell_file: Callable[..., str], capsys: pytest.CaptureFixture[str]) -> None:
    err = complaint(["evaluate", cell_file(("d_min_m: 0.01 ", "d_min_m: 0.05 "))], capsys)
    assert "collide where they start" in err
    assert "d_min_m" in err


def test_yaml_slips_are_told(cell_file: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    err = complaint(["cells", cell_file(("d_min_m: 0.01 ", "d_mni_m: 0.01 "))], capsys)
    assert "d_mni_m" in err
    (tmp_path / "broken.yaml").write_text("arms: [1, 2\nname: x", encoding="utf-8")
    assert "broken.yaml" in complaint(["plan", "broken.yaml"], capsys)


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "taken").write_text("", encoding="utf-8")
    err = complaint(["cells", "--json", "taken/list.json"], capsys)
    assert "taken" in err


@pytest.mark.parametrize("line", [[], ["plann", "lee1991"], ["plan"], ["evaluate", "lee1991", "--episodes", "few"]])
def test_wrong_lines_are_status_2(line: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line) == 2
    assert "Traceback" not in capsys.readouterr().err


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path) -> None:
    from armtempo.files import whole_file

    target = tmp_path / "figures.json"
    target.write_text("old", encoding="utf-8")

    def write_half() -> None:
        with whole_file(target) as temporary:
            temporary.write_text("ne", encoding="utf-8")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_half()
    assert [file.name for file in tmp_path.iterdir()] == ["figures.json"]
    assert target.read_text(encoding="utf-8") == "old"


# Help


@pytest.mark.parametrize(
    ("command", "first_line", "words"),
    [
        ("plan", "Plan when every arm", ["--methods", "--control-period S", "seconds", "--json FILE"]),
        (
            "evaluate",
            "Run policies in the simulated cell",
            ["--episodes N", "--seed K", "--out DIR", '"armtempo evaluate CELL --help" lists them'],
        ),
        ("reproduce", "Compute every table value", ["PAPER", "--json FILE"]),
        ("plot", "Draw a cell and its plans", ["--method NAME", "(default: vci; of one arm all)"]),
        ("record", "Film one episode", ["--slow X", ".mp4", ".gif", "seven seconds"]),
        ("cells", "List the cells", ["[CELL]"]),
    ],
)
def test_help_explains(command: str, first_line: str, words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert first_line in out.split("\n\n")[1]
    for word in words:
        assert word in out


@pytest.mark.parametrize(
    ("cell", "own", "foreign"),
    [
        (
            "lee1991",
            ["--master-late S [S]", "--shield", "--disturbance NAME", "--mode {speed,acceleration}"],
            "--family",
        ),
        ("lee2006", ["--family {given,polyline,zigzag,line-arc}", "--model-error X", "limit-aware-smooth"], "--shield"),
        ("chung", ["--family {given,smooth,near-singular,partly-unreachable}", "feedback-damped"], "--profile"),
    ],
)
def test_help_of_evaluate_lists_the_options_of_the_cells_kind(
    cell: str, own: list[str], foreign: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", cell, "--help"]) == 0
    out = capsys.readouterr().out
    assert "Run policies in the simulated cell" in out
    assert all(word in out for word in (*own, "CELL", "--episodes N", "--physics {bullet,mujoco,ideal}"))
    assert foreign not in out


def test_flags_may_come_before_the_cell(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "--physics", "ideal", "--shield", "--no-figures", "lee1991", "--policies", "delay"]
    assert main([*line, "--master-late", "0.01", "0.02", "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert (data["physics"], data["shield"], data["master_late_s"]) == ("ideal", True, [0.01, 0.02])


def test_help_names_all_methods_and_policies(capsys: pytest.CaptureFixture[str]) -> None:
    from armtempo.agents import BLEND_POLICIES, COORDINATION_POLICIES, IK_POLICIES
    from armtempo.planners import METHODS
    from armtempo.planners.cells import PROFILES

    methods = (*METHODS, *PROFILES, "limit-aware-smooth", "law", "feedback", "feedback-ff", "newton")
    policies = (*COORDINATION_POLICIES, *BLEND_POLICIES, *IK_POLICIES)
    for command, names in (("plan", methods), ("plot", methods), ("evaluate", policies), ("record", policies)):
        assert main([command, "--help"]) == 0
        out = re.sub(r"[\s│]+", "", capsys.readouterr().out)  # names may be broken at their hyphens
        assert all(name in out for name in names), command


def test_help_needs_no_numerics() -> None:
    code = (
        "import sys; from armtempo.commands import main; status = main(['--help']); "
        "heavy = {'numba', 'pybullet', 'matplotlib', 'fcl', 'scipy'} & set(sys.modules); sys.exit(status or len(heavy))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env={**os.environ, "COLUMNS": "120"}
    )
    assert done.returncode == 0, done.stderr
    assert "armtempo evaluate lee1991" in done.stdout


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    import armtempo

    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"armtempo {armtempo.__version__}\n"
