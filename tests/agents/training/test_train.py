"""Training: what is left behind, exact resume after a kill or a signal, longer trainings, broken checkpoints."""

from __future__ import annotations

import csv
import errno
import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
pytest.importorskip("sb3_contrib")
pytest.importorskip("tensorboard")

import torch

from armtempo.agents import Training, evaluate, find_agent, train
from armtempo.agents.training._checkpoint import _pack, _unpack, read_checkpoint, save_checkpoint
from armtempo.agents.training._logs import open_logs
from armtempo.agents.training._signals import HeldSignals
from armtempo.agents.training._train import EvaluationCallback
from armtempo.commands import main
from armtempo.configs import TrainConfig, load_train_config
from armtempo.errors import InputError
from armtempo.files import locked, write_sealed
from armtempo.planners import CoordinationCell, IKCell
from armtempo.planners.cells import draw_target
from tests.fuzz._mutations import damaged_copies

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
evaluation: {every_steps: 120, episodes: 1}
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
TERMINATED = """
import os, signal, sys
from armtempo.agents.training._train import EvaluationCallback
from armtempo.commands import main

def on_step(self):
    if self.num_timesteps == int(sys.argv[1]):  # between the two ends of a rollout
        os.kill(os.getpid(), signal.SIGTERM)
    return True

EvaluationCallback._on_step = on_step
sys.exit(main(sys.argv[2:]))
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


def logged(folder: Path) -> dict[str, list[int]]:
    """The steps at which TensorBoard was told of each figure, over all logs of a training, as they are on the disk."""
    from tensorboard.backend.event_processing.event_file_loader import EventFileLoader  # type: ignore[import-untyped]

    steps: dict[str, list[int]] = {}
    for file in sorted((folder / "tensorboard").iterdir(), key=lambda file: file.stat().st_mtime_ns):
        for event in EventFileLoader(str(file)).Load():
            for value in event.summary.value:
                steps.setdefault(value.tag, []).append(event.step)
    return steps


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


def interrupted_by_ctrl_c(folder: Path, line: list[str]) -> tuple[int, str]:
    """Exit status and stderr of a command that gets Ctrl-C in a rollout, in this process."""
    stderr = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stderr(stderr):
        patch.chdir(folder)

        def on_step(callback: EvaluationCallback) -> bool:
            if callback.num_timesteps == 600:
                signal.raise_signal(signal.SIGINT)
            return True

        patch.setattr(EvaluationCallback, "_on_step", on_step)
        before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells let background jobs ignore it
        try:
            return main(line), stderr.getvalue()
        finally:
            signal.signal(signal.SIGINT, before)


def terminated(folder: Path, line: list[str]) -> tuple[int, str]:
    """The same of one that gets SIGTERM, in a process of its own."""
    run = subprocess.run(
        [sys.executable, "-c", TERMINATED, "600", *line], cwd=folder, capture_output=True, text=True, check=False
    )
    return run.returncode, run.stderr


@pytest.mark.parametrize(("told", "status"), [(interrupted_by_ctrl_c, 130), (terminated, 143)])
def test_a_training_that_is_told_to_end_saves_first_and_goes_on(
    told: Callable[[Path, list[str]], tuple[int, str]], status: int, trained: Training, tmp_path: Path
) -> None:
    written(tmp_path, PPO, LAST)
    assert told(tmp_path, ["train", "small.yaml", "--output", "out"]) == (
        status,
        "armtempo: interrupted: saved at 640 of 1024 steps in out; --resume (in Python resume=True) goes on\n",
    )
    assert not (tmp_path / "out" / "agent.npz").exists()
    resumed = train(tmp_path / "small.yaml", tmp_path / "out", resume=True)
    assert_same(weights(resumed.folder), weights(trained.folder))
    assert without_time(resumed.curve) == without_time(trained.curve)
    assert logged(resumed.folder) == logged(trained.folder)


def test_a_second_signal_ends_a_training_at_once_and_a_handler_gets_what_was_held(tmp_path: Path) -> None:
    got: list[int] = []
    ctrl_c = signal.getsignal(signal.SIGINT)
    before = signal.signal(signal.SIGTERM, lambda number, _: got.append(number))
    try:
        with HeldSignals() as signals:
            signal.raise_signal(signal.SIGTERM)
            assert (signals.received, got) == (signal.SIGTERM, [])
            signal.raise_signal(signal.SIGTERM)
            assert got == [signal.SIGTERM]
            with pytest.raises(KeyboardInterrupt) as caught:  # a handler that does not end anything
                signals.pass_on("saved")
            assert got == [signal.SIGTERM] * 2
            assert caught.value.__notes__ == ["saved"]
        assert signal.getsignal(signal.SIGINT) is ctrl_c
    finally:
        signal.signal(signal.SIGTERM, before)


HALF_AS_LONG = PPO.replace("learning_rate_end: 0.0, ", "").replace("512", "256").replace("1024", "512")


@pytest.mark.parametrize("algorithm", [HALF_AS_LONG, SAC.replace("400", "240")], ids=["ppo", "sac"])
def test_a_training_that_is_made_longer_is_one_that_was_long_from_the_start(algorithm: str, tmp_path: Path) -> None:
    long = config(tmp_path, algorithm, LAST)  # without a learning rate that ends with the training
    whole = train(long, tmp_path / "whole")
    short = train(long, tmp_path / "out", steps=long.total_steps // 2)
    longer = train(long, tmp_path / "out", resume=True)
    assert short.curve[-1]["steps"] == long.total_steps // 2
    assert_same(weights(longer.folder), weights(whole.folder))
    for one, other in zip(longer.agent.layers, whole.agent.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
    assert without_time(longer.curve) == without_time(whole.curve)
    assert longer.agent.header.steps == long.total_steps
    assert logged(longer.folder) == logged(whole.folder)
    with pytest.raises(InputError, match=rf"trained for {long.total_steps} steps already, and {long.total_steps - 1} "):
        train(long, tmp_path / "out", resume=True, steps=long.total_steps - 1)


BULLET = """
algorithm: ppo
total_steps: 96
checkpoint_every_steps: 64
evaluation: {every_steps: 96, episodes: 1}
coordination: {cells: [lee1991], physics: bullet}
ppo: {rollout_steps: 8, batch_size: 16, epochs: 1}
"""


@pytest.mark.parametrize("texts", [(PPO, LAST), (BULLET,)], ids=["with a state", "without"])
def test_checkpoints_that_come_with_time_change_nothing(
    texts: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, saved = written(tmp_path, *texts), []

    def counted(path: Path, *given: Any, **how: Any) -> None:
        saved.append(how["cut"])
        save_checkpoint(path, *given, **how)

    monkeypatch.setattr("armtempo.agents.training._train.save_checkpoint", counted)
    usual = train(path, tmp_path / "usual")
    seldom = len(saved)
    monkeypatch.setattr("armtempo.agents.training._train.SAVE_EVERY_S", 0.0)
    monkeypatch.setattr("armtempo.agents.training._train.SAVE_SPARSENESS", 0.0)
    often = train(path, tmp_path / "often")
    assert (seldom, len(saved) - seldom) == ((2, 9) if texts[0] == PPO else (2, 7))  # also at 0 and at the end
    assert_same(weights(often.folder), weights(usual.folder))
    assert without_time(often.curve) == without_time(usual.curve)


def test_one_process_trains_in_a_folder(tmp_path: Path) -> None:
    path, folder = written(tmp_path, PPO, LAST), tmp_path / "out"
    folder.mkdir()
    with locked(folder / "lock") as alone:
        assert alone
        with pytest.raises(InputError, match="out: another process trains there"):
            train(path, folder)
    assert [file.name for file in folder.iterdir()] == ["lock"]


def test_a_full_disk_leaves_the_checkpoint_before(
    trained: Training, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, folder, calls = written(tmp_path, PPO, LAST), tmp_path / "out", []

    def full(file: Path, content: memoryview) -> None:
        calls.append(file)
        write_sealed(file, content[: len(content) // len(calls)])
        if len(calls) > 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("armtempo.agents.training._checkpoint.write_sealed", full)
        with pytest.raises(OSError, match=r"No space left on device: .*checkpoint\.pt"):
            train(path, folder)
    assert {file.name for file in folder.iterdir()} == {"checkpoint.pt", "curve.csv", "lock", "tensorboard"}
    resumed = train(path, folder, resume=True)
    assert_same(weights(folder), weights(trained.folder))
    assert logged(resumed.folder) == logged(trained.folder)


def test_logs_on_a_full_disk_are_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(writer: object, data: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def log_much() -> None:
        with open_logs(tmp_path, {}) as logger:
            logger.record("before", 1.0)
            logger.dump(0)
            monkeypatch.setattr("tensorboard.summary.writer.record_writer.RecordWriter.write", full)
            while True:  # TensorBoard's thread dies; the next dump tells
                logger.record("after", 1.0)
                logger.dump(1)

    hook = threading.excepthook
    with pytest.raises(OSError, match="No space left on device") as caught:
        log_much()
    assert caught.value.filename == str(tmp_path)
    assert threading.excepthook is hook
    assert capfd.readouterr().err == ""  # no traceback of the thread


def test_no_damaged_checkpoint_is_taken(trained: Training, tmp_path: Path) -> None:
    whole, path = (trained.folder / "checkpoint.pt").read_bytes(), tmp_path / "checkpoint.pt"
    for damaged in damaged_copies(whole, np.random.default_rng(6), 240):
        path.write_bytes(damaged)
        with pytest.raises(InputError, match=r"checkpoint\.pt: ") as caught:
            read_checkpoint(path)
        assert "copy it again" in caught.value.remedy
    path.write_bytes(whole)
    assert read_checkpoint(path)["counters"]["num_timesteps"] == 1024


def reseal(content: dict[str, Any], path: Path) -> None:
    """As whoever means harm would."""
    packed = io.BytesIO()
    torch.save(content, packed)
    write_sealed(path, packed.getvalue())


@pytest.mark.parametrize("how", ["nothing", "empty", "text", "short", "foreign", "later", "emptied", "nan"])
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
            reseal(content | {"parameters": {}}, path)
        case "nan":
            content["parameters"]["policy"]["action_net.bias"].fill_(float("nan"))
            reseal(content, path)
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


@pytest.mark.parametrize("kind", ["|O8", "O", "<U3", "|V4", "i08,04", "<f8,", ""])
def test_an_array_of_anything_but_numbers_is_not_unpacked(kind: str) -> None:
    """Of a type of objects bytes would be taken for pointers: the process would die."""
    packed = {**_pack(np.arange(2.0)), "type": kind}
    with pytest.raises(ValueError, match="something else than numbers"):
        _unpack(packed)
    np.testing.assert_array_equal(_unpack({**packed, "type": "<f8"}), [0.0, 1.0])
