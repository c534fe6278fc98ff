"""Sweeps: the file, the journal that workers share, and what happens when one of them dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from armtempo.agents import SweepTrial, sweep
from armtempo.agents.training._sweep_objective import gap_of
from armtempo.configs import SweepConfig, TrainConfig, load_sweep_config, trial_training
from armtempo.errors import ConfigError, InputError, UnknownNameError

TRAINING = """
name: small
algorithm: ppo
coordination: {cells: [lee1991]}
ppo: {learning_rate: 1.0e-3}
"""
SWEEP = """
name: bowl
training: training.yaml
total_steps: 1000
space:
  ppo.learning_rate: {low: 1.0e-4, high: 1.0e-2, log: true}
  ppo.epochs: {low: 2, high: 20, integer: true}
  num_envs: {choices: [8, 16]}
"""


def _written(folder: Path, text: str = SWEEP, training: str = TRAINING) -> Path:
    (folder / "training.yaml").write_text(training)
    path = folder / "sweep.yaml"
    path.write_text(text)
    return path


@pytest.fixture
def bowl(tmp_path: Path) -> SweepConfig:
    return load_sweep_config(_written(tmp_path))


def _objective(training: TrainConfig, folder: Path) -> float:
    assert folder.is_dir()
    assert not any(folder.iterdir())
    return abs(training.ppo.epochs - 7) + training.num_envs


def test_bundled_sweep_and_its_ends() -> None:
    config = load_sweep_config("lee1991")
    training = trial_training(config, {"ppo.learning_rate": 2e-3, "ppo.epochs": 5})
    assert (training.ppo.learning_rate, training.ppo.epochs) == (2e-3, 5)
    assert training.total_steps == config.total_steps
    assert "2" in training.text  # an agent's file tells what it was trained with
    with pytest.raises(UnknownNameError, match="lee1991"):
        load_sweep_config("lee1992")


def test_what_a_trial_changes(bowl: SweepConfig) -> None:
    changed = trial_training(bowl, {"ppo.epochs": 5, "num_envs": 16})
    plain = trial_training(bowl, {})
    assert changed.ppo == plain.ppo.model_copy(update={"epochs": 5})
    back = changed.model_copy(update={"ppo": plain.ppo, "num_envs": plain.num_envs})
    assert back.model_dump() == plain.model_dump()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("low: 2, high: 20", "low: 20, high: 2", "high"),
        ("low: 2, high: 20", "low: 2.5, high: 20", "whole"),
        ("low: 1.0e-4", "low: 0.0", "logarithm"),
        ("low: 1.0e-4", "low: -1.0", "logarithm"),
        ("choices: [8, 16]", "choices: [8, 16], low: 1.0", "choices"),
        ("choices: [8, 16]", "choices: [0, 16]", "num_envs"),
        ("ppo.epochs", "ppo.epoch", "epoch"),
        ("ppo.epochs", "sac.tau", "sac"),
        ("low: 2, high: 20, integer: true", "high: 20", "low"),
        ("total_steps: 1000", "total_steps: 0", "total_steps"),
        ("training: training.yaml", "training: other.yaml", "other.yaml"),
        (SWEEP, "[]", "mapping"),
    ],
)
def test_errors_name_the_key(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in SWEEP
    with pytest.raises((ConfigError, UnknownNameError), match=said):
        load_sweep_config(_written(tmp_path, SWEEP.replace(old, new)))


def test_a_sweep_goes_on_where_it_was(bowl: SweepConfig, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    seen: list[SweepTrial] = []
    first = sweep(bowl, tmp_path / "s", 3, objective=_objective, seed=1, on_trial=lambda trial, _: seen.append(trial))
    assert [trial.number for trial in seen] == [0, 1, 2]
    assert first == sorted(seen, key=lambda trial: (trial.objective, trial.number))
    for trial in seen:
        assert trial.objective == abs(trial.values["ppo.epochs"] - 7) + trial.values["num_envs"]
        assert 1e-4 <= trial.values["ppo.learning_rate"] <= 1e-2
        assert trial.values["num_envs"] in (8, 16)
        assert isinstance(trial.values["ppo.epochs"], int)
    assert sweep(bowl, tmp_path / "s", 3, objective=_objective) == first  # nothing left to do
    more = sweep(bowl, tmp_path / "s", 20, objective=_objective, seed=2)
    assert [trial.number for trial in more if trial.number < 3] == [trial.number for trial in first]
    assert len(more) == 20
    assert more[0].objective <= 10.0  # of 8 to 29


def test_a_sweep_over_something_else_is_refused(bowl: SweepConfig, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    sweep(bowl, tmp_path / "s", 1, objective=_objective)
    other = load_sweep_config(_written(tmp_path, SWEEP.replace("high: 20", "high: 21")))
    with pytest.raises(InputError, match="something else"):
        sweep(other, tmp_path / "s", 1, objective=_objective)


@pytest.mark.parametrize("kind", ["error", "nan"])
def test_a_trial_that_fails_does_not_count(bowl: SweepConfig, tmp_path: Path, kind: str) -> None:
    pytest.importorskip("optuna")

    def broken(training: TrainConfig, folder: Path) -> float:
        if kind == "error":
            raise ConfigError("no such cell")
        return float("nan")

    with pytest.raises(ConfigError if kind == "error" else InputError, match=r"no such cell|no number"):
        sweep(bowl, tmp_path / "s", 2, objective=broken)
    assert [trial.number for trial in sweep(bowl, tmp_path / "s", 2, objective=_objective)] != [0, 1]


@pytest.mark.parametrize("share", [0.05, 0.3, 0.55, 0.8, 0.97])
def test_a_journal_that_was_cut_in_a_line_goes_on(
    bowl: SweepConfig, tmp_path: Path, share: float, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("optuna")

    def leaves_a_file(training: TrainConfig, folder: Path) -> float:
        reached = _objective(training, folder)
        (folder / "agent.npz").write_text(str(reached))
        return reached

    journal = tmp_path / "s" / "journal.log"
    whole = sweep(bowl, tmp_path / "s", 4, objective=leaves_a_file, seed=1)
    data = journal.read_bytes()
    place = int(share * len(data))
    end = data.rfind(b"\n", 0, place) + 1
    journal.write_bytes(data[: place + (place == end)])
    again = sweep(bowl, tmp_path / "s", 6, objective=leaves_a_file, seed=2)
    assert len(again) == 6
    assert [record.message for record in caplog.records if "journal.log" in record.message] == [
        f"{journal}: its last line was cut off and is taken away"
    ]
    for trial in again:
        assert float((trial.folder / "agent.npz").read_text()) == trial.objective  # of this trial, not of a lost one
    everything = [float(file.read_text()) for file in (tmp_path / "s" / "bowl").glob("trial-*/agent.npz")]
    assert all(trial.objective in everything for trial in whole)  # nothing is written over
    assert sweep(bowl, tmp_path / "s", 6, objective=leaves_a_file) == again


def test_a_journal_with_a_damaged_line_is_named(bowl: SweepConfig, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    journal = tmp_path / "s" / "journal.log"
    sweep(bowl, tmp_path / "s", 2, objective=_objective)
    lines = journal.read_bytes().splitlines(keepends=True)
    for damaged in (b"\xff\xfe" + lines[2][2:], lines[2][: len(lines[2]) // 2] + b"\n", b"[]\n", b"{}\n"):
        journal.write_bytes(b"".join([*lines[:2], damaged, *lines[3:]]))
        with pytest.raises(InputError, match=r"journal\.log: a damaged journal") as caught:
            sweep(bowl, tmp_path / "s", 3, objective=_objective)
        assert "--storage" in caught.value.remedy


WORKER = """
import os, sys, time
from pathlib import Path
from armtempo.agents import sweep
from armtempo.configs import load_sweep_config

def objective(training, folder):
    (folder / "began").write_text(str(os.getpid()))
    time.sleep(float(sys.argv[3]))
    return training.ppo.epochs

sweep(load_sweep_config(sys.argv[1]), Path(sys.argv[2]), 6, objective=objective)
"""


def _worker(config: SweepConfig, storage: Path, sleep: float) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-c", WORKER, str(config.source), str(storage), str(sleep)])


def _began(storage: Path) -> dict[int, str]:
    """By trial of a worker, that worker."""
    files = storage.glob("bowl/trial-*/began")
    return {int(file.parent.name.removeprefix("trial-")): file.read_text() for file in files}


def test_two_workers_and_one_that_is_killed(bowl: SweepConfig, tmp_path: Path) -> None:
    pytest.importorskip("optuna")
    storage = tmp_path / "shared"
    victim, other = _worker(bowl, storage, 600.0), _worker(bowl, storage, 0.2)
    while not {str(victim.pid), str(other.pid)} <= set(_began(storage).values()):  # until both are at work
        assert victim.poll() is None
    os.kill(victim.pid, signal.SIGKILL)
    victim.wait()
    mine: list[SweepTrial] = []

    def objective(training: TrainConfig, folder: Path) -> float:
        time.sleep(0.2)
        return training.ppo.epochs

    sweep(bowl, storage, 6, objective=objective, on_trial=lambda trial, _: mine.append(trial))
    assert other.wait(timeout=60) == 0
    done = sweep(bowl, storage, 1, objective=_objective)
    assert 6 <= len(done) <= 7  # one of the two may have been at another
    theirs = set(_began(storage))
    assert len(theirs - {trial.number for trial in done}) == 1  # the killed one's
    assert not theirs & {trial.number for trial in mine}  # nothing twice


def test_what_a_trial_comes_to() -> None:
    row = {"gap_percent": 2.0, "episodes": 20, "finished": 20, "reward": -0.5}
    assert gap_of(row, several=True) == 2.0
    assert gap_of(row | {"finished": 19}, several=True) == 52.0
    assert gap_of(row | {"gap_percent": None}, several=True) == float("inf")
    assert gap_of(row, several=False) == 50.0
