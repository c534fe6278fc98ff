"""``armtempo train`` and ``armtempo evaluate`` with what it trained."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from armtempo.commands import main

pytestmark = [pytest.mark.rl, pytest.mark.filterwarnings("ignore::DeprecationWarning:tensorboard.*")]

TRAINING = """
name: small
algorithm: ppo
coordination: {cells: [lee1991]}
num_envs: 2
total_steps: 256
checkpoint_every_steps: 128
evaluation: {every_steps: 128, episodes: 1}
network: {sizes: [8]}
ppo: {rollout_steps: 64, batch_size: 64, epochs: 1, first_action: 1.0, log_std_start: -3.0}
"""


@pytest.fixture(autouse=True)
def _work_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    Path("small.yaml").write_text(TRAINING, encoding="utf-8")


def test_train_then_evaluate_in_one_table_with_planners(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("stable_baselines3")
    pytest.importorskip("tensorboard")
    assert main(["train", "small.yaml", "--seed", "2", "--json", "curve.json"]) == 0
    assert "ppo:results/train/small-2/agent.npz" in capsys.readouterr().out.replace("\n", "")
    told = json.loads(Path("curve.json").read_text())
    assert [row["steps"] for row in told["curve"]] == [0, 128, 256]
    assert main(["train", "small.yaml", "--seed", "2"]) == 2
    assert "holds a training already" in capsys.readouterr().err
    assert main(["train", "small.yaml", "--seed", "2", "--resume", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["curve"] == told["curve"]
    agent = "ppo:results/train/small-2/agent.npz"
    line = ["evaluate", "lee1991", "--policies", "vci", "delay", "optimal", agent, "--physics", "ideal"]
    assert main([*line, "--episodes", "3", "--master-late", "0.2", "--no-figures", "--json", "table.json"]) == 0
    out = capsys.readouterr().out
    assert "95 %" in out
    assert "3 episodes" in out
    table = json.loads(Path("table.json").read_text())
    assert table["best_online"] in ("vci", "delay")
    for name in ("vci", "delay", "optimal", agent):
        numbers = table["policies"][name]
        assert len(numbers["makespans_s"]) == 3
        assert numbers["makespan_interval_s"][0] <= numbers["makespan_s"] <= numbers["makespan_interval_s"][1]
        assert numbers["ratio_interval"][0] <= numbers["ratio_to_best_online"] <= numbers["ratio_interval"][1]
    assert table["policies"][table["best_online"]]["ratio_to_best_online"] == 1.0
    assert table["policies"]["optimal"]["interventions"] is None


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (["train", "smal"], "unknown training 'smal'"),
        (["train", "small.yaml", "--steps", "0"], "--steps must be at least 1"),
        (["train", "small.yaml", "--seed", "-1"], "--seed must not be negative"),
        (["train", "small.yaml", "--resume"], "no checkpoint"),
        (["evaluate", "lee1991", "--policies", "ppo:nobody"], "unknown agent 'ppo:nobody'"),
        (["evaluate", "lee1991", "--policies", "ppo:no.npz"], "no such agent file"),
        (["evaluate", "lee1991", "--start-phase", "0.5", "0.2"], "--start-phase must be"),
        (["evaluate", "lee1991", "--observation-noise", "-1"], "--observation-noise must be"),
        (["evaluate", "lee2006", "--shield"], "in blend cells '--shield'"),
    ],
)
def test_errors_are_one_line(line: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(line) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.startswith("armtempo: error: ")
    assert error.count("\n") == 1
