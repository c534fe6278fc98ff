"""Training: what is left behind, exact resume after a kill, broken checkpoints."""

from __future__ import annotations

import csv
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

import torch

from armtempo.agents import Training, evaluate, find_agent, train
from armtempo.configs import TrainConfig, load_train_config
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, IKCell
from armtempo.planners.cells import draw_target

pytestmark = [pytest.mark.rl, pytest.mark.filterwarnings("ignore::DeprecationWarning:tensorboard.*")]

COMMON = """
name: small
num_envs: 2
seed: 3
network: {sizes: [16]}
"""
PPO = """
algorithm: ppo
total_steps: 1024
checkpoint_every_steps: 512
evaluation: {every_steps: 512, episodes: 2}
ppo: {rollout_steps: 64, batch_size: 64, epochs: 2, learning_rate_end: 0.0, gamma: 0.99}
"""
SAC = """
algorithm: sac
total_steps: 400
checkpoint_every_steps: 160
evaluation: {every_steps: 200, episodes: 1}
sac: {learning_starts: 40, batch_size: 32, buffer_size: 250}
"""
TQC = SAC.replace("sac", "tqc")
ALL, LAST = "coordination: {cells: [lee1991], learners: all}", "coordination: {cells: [lee1991]}"
ONE_ARM = "feedback_ik: {cell: chung, families: [smooth, near-singular], physics: bullet}"
GAINS = """
feedback_ik:
  {cell: chung, families: [smooth, near-singular], action_mode: gains, targets: 3, hold_periods: 5, reward_scale: 20}
"""
DRAWN = """
coordination:
  {cells: [lee1991], shield: true, start_phase: [0, 0.3], undisturbed_share: 0.5, undisturbed_until: 0.6,
   cut_penalty: 0.1}
"""
CASES = [
    pytest.param(PPO, DRAWN, 640, id="ppo, draws that widen"),
    pytest.param(PPO, ALL, 640, id="ppo, all arms"),
    pytest.param(SAC, LAST, 240, id="sac, last arm"),
    pytest.param(PPO, GAINS, 640, id="ppo, gains"),
    pytest.param(TQC, LAST, 240, id="tqc, last arm", marks=pytest.mark.slow),
    pytest.param(SAC, ONE_ARM, 240, id="sac, one arm in bullet", marks=pytest.mark.slow),
]
KILLED = """
import os, signal, sys
from armtempo.agents import train

def die(done, total):
    if done >= int(sys.argv[3]):
        os.kill(os.getpid(), signal.SIGKILL)

train(sys.argv[1], sys.argv[2], on_progress=die)
"""


@pytest.fixture(autouse=True, scope="module")
def _kept_charts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ARMTEMPO_CACHE", str(tmp_path_factory.mktemp("charts")))
        yield


def written(folder: Path, *texts: str) -> Path:
    path = folder / "small.yaml"
    path.write_text("\n".join((COMMON, *texts)), encoding="utf-8")
    return path


def config(folder: Path, *texts: str) -> TrainConfig:
    return load_train_config(written(folder, *texts))


def without_time(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in row.items() if key != "seconds"} for row in rows]


def weights(folder: Path) -> dict[str, Any]:
    content = torch.load(folder / "checkpoint.pt", weights_only=True)
    return {"parameters": content["parameters"]["policy"], "obs": content["last_obs"]["bytes"], **content["variables"]}


def assert_same(one: Any, other: Any) -> None:
    if isinstance(one, dict):
        assert set(one) == set(other)
        for key in one:
            assert_same(one[key], other[key])
    else:
        assert torch.equal(one, other)


@pytest.mark.parametrize(("algorithm", "where", "dies_at"), CASES)
def test_a_training_that_was_killed_ends_like_one_that_was_not(
    algorithm: str, where: str, dies_at: int, tmp_path: Path
) -> None:
    path = written(tmp_path, algorithm, where)
    whole = train(path, tmp_path / "whole")
    folder = tmp_path / "killed"
    run = subprocess.run([sys.executable, "-c", KILLED, path, folder, str(dies_at)], check=False)
    assert run.returncode == -9
    assert (folder / "checkpoint.pt").exists()
    assert not (folder / "agent.npz").exists()
    seen: list[int] = []
    resumed = train(path, folder, resume=True, on_progress=lambda done, total: seen.append(done))
    assert 0 < seen[0] < dies_at
    assert_same(weights(folder), weights(tmp_path / "whole"))
    for one, other in zip(resumed.agent.layers, whole.agent.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
    assert without_time(resumed.curve) == without_time(whole.curve)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Training:
    folder = tmp_path_factory.mktemp("train")
    return train(config(folder, PPO, LAST), folder / "out")


def test_a_training_leaves_curve_logs_checkpoint_and_agent(trained: Training, lee1991: CoordinationCell) -> None:
    with (trained.folder / "curve.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["steps"]) for row in rows] == [0, 512, 1024]
    assert [row["steps"] for row in trained.curve] == [0, 512, 1024]
    assert list((trained.folder / "tensorboard").glob("events*"))
    assert not [path for path in trained.folder.iterdir() if path.name.startswith(".")]  # no half files
    name = f"ppo:{trained.folder / 'agent.npz'}"
    header = find_agent(name).header
    assert (header.name, header.seed, header.steps, header.learners, header.cells) == (
        "small", 3, 1024, "last", ["lee1991"],
    )  # fmt: skip
    assert header.curve == trained.curve
    assert "total_steps: 1024" in header.config
    assert header.command == "armtempo train small.yaml --seed 3 --steps 1024"
    assert name in evaluate(lee1991, [name], physics="ideal").results


def test_the_weights_change_with_the_seed_alone(trained: Training, tmp_path: Path) -> None:
    again = train(trained.config, tmp_path / "again")
    other = train(trained.config, tmp_path / "other", seed=4)
    assert_same(weights(again.folder), weights(trained.folder))
    assert not torch.equal(
        weights(other.folder)["parameters"]["action_net.weight"],
        weights(trained.folder)["parameters"]["action_net.weight"],
    )


def test_environments_take_the_families_in_turn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = []

    def recorded(cell: IKCell, family: str, random: np.random.Generator) -> IKCell:
        drawn.append(family)
        return draw_target(cell, family, random)

    for module in ("_env", "_batch"):
        monkeypatch.setattr(f"armtempo.envs.ik.{module}.draw_target", recorded)
    one_update = """
algorithm: ppo
total_steps: 8
evaluation: {episodes: 0}
ppo: {rollout_steps: 4, batch_size: 8, epochs: 1}
"""
    train(config(tmp_path, one_update, ONE_ARM), tmp_path / "out")
    assert drawn[:2] == ["smooth", "near-singular"]
    drawn.clear()
    train(config(tmp_path, one_update, GAINS), tmp_path / "many")
    assert drawn == ["smooth", "near-singular", "smooth"]  # beforehand


def test_first_actions_are_those_of_the_file(tmp_path: Path) -> None:
    several = """
algorithm: ppo
total_steps: 8
evaluation: {episodes: 0}
ppo: {rollout_steps: 4, batch_size: 8, epochs: 1, learning_rate: 1.0e-9, first_action: [0.5, -0.25, 0.0, 1.0]}
"""
    trained = train(config(tmp_path, several, GAINS), tmp_path / "out")
    np.testing.assert_allclose(trained.agent.layers[-1][1], [0.5, -0.25, 0.0, 1.0], atol=1e-6)
    with pytest.raises(InputError, match="4 numbers, and an action has 1"):
        train(config(tmp_path, several, LAST), tmp_path / "other")


def test_a_folder_is_not_overwritten_nor_resumed_with_something_else(trained: Training) -> None:
    with pytest.raises(InputError, match="holds a training already"):
        train(trained.config, trained.folder)
    with pytest.raises(InputError, match="another configuration or seed"):
        train(trained.config, trained.folder, seed=8, resume=True)


@pytest.mark.parametrize("how", ["nothing", "empty", "text", "short", "foreign", "later", "emptied"])
def test_a_checkpoint_that_cannot_be_used_is_named(how: str, trained: Training, tmp_path: Path) -> None:
    whole, path = (trained.folder / "checkpoint.pt").read_bytes(), tmp_path / "checkpoint.pt"
    content = torch.load(trained.folder / "checkpoint.pt", weights_only=True)
    match how:
        case "empty":
            path.write_bytes(b"")
        case "text":
            path.write_text("checkpoint")
        case "short":
            path.write_bytes(whole[: len(whole) // 2])
        case "foreign":
            torch.save({"weights": torch.zeros(3)}, path)
        case "later":
            torch.save(content | {"version": 3}, path)
        case "emptied":
            torch.save(content | {"parameters": {}}, path)
    with pytest.raises(InputError, match="checkpoint") as caught:
        train(trained.config, tmp_path, resume=True)
    assert str(path) in str(caught.value)
    assert caught.value.remedy


def test_a_checkpoint_runs_no_code(trained: Training, tmp_path: Path) -> None:
    torch.save({"format": "armtempo checkpoint", "trap": Trap(tmp_path / "sprung")}, tmp_path / "checkpoint.pt")
    with pytest.raises(InputError, match="not a checkpoint"):
        train(trained.config, tmp_path, resume=True)
    assert not (tmp_path / "sprung").exists()


class Trap:
    """Unpickling it would write a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)
