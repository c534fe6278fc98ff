"""A fuzzer of the journals of sweeps: those that are accepted go on for one more trial."""

from __future__ import annotations

import shutil
from pathlib import Path

from armtempo.agents import SweepTrial, sweep
from armtempo.agents.training._sweep import JOURNAL_FILE
from armtempo.configs import SweepConfig, TrainConfig, load_sweep_config
from tests.fuzz._finite import check_finite
from tests.fuzz._mutations import Random, damaged_bytes, damaged_json, pick, times

SWEEP = """
name: small
training: lee1991
total_steps: 64
sampler: random
space:
  ppo.learning_rate: {low: 1.0e-5, high: 1.0e-2, log: true}
  ppo.batch_size: {choices: [64, 128]}
"""
TRIALS = 3


def _objective(training: TrainConfig, folder: Path) -> float:
    assert training.ppo is not None
    return float(training.ppo.batch_size)


class JournalFuzzer:
    """Damaged bytes of a journal, and damaged lines."""

    spent = False

    def __init__(self, folder: Path) -> None:
        (folder / "sweep.yaml").write_text(SWEEP, encoding="utf-8")
        self._config: SweepConfig = load_sweep_config(folder / "sweep.yaml")
        self._storage = folder / "sweep"
        sweep(self._config, self._storage, TRIALS, objective=_objective, seed=1)
        self._seed = (self._storage / JOURNAL_FILE).read_bytes()
        assert self.run(self._seed)

    def make(self, random: Random) -> bytes:
        if random.random() < 0.4:
            return damaged_bytes(random, self._seed)
        lines = self._seed.splitlines(keepends=True)
        for _ in range(times(random)):
            k = int(random.integers(len(lines)))
            match int(random.integers(4)):
                case 0:
                    lines[k] = b""
                case 1:
                    lines[k] = pick(random, lines)
                case _:
                    lines[k] = damaged_json(random, lines[k]) + b"\n" if lines[k] else b""
        return b"".join(lines)

    def run(self, given: bytes) -> bool:
        shutil.rmtree(self._storage)
        self._storage.mkdir()
        (self._storage / JOURNAL_FILE).write_bytes(given)
        done: list[SweepTrial] = sweep(self._config, self._storage, TRIALS + 1, objective=_objective, seed=1)
        check_finite([(one.objective, one.values) for one in done])
        return True

    def shown(self, given: bytes) -> bytes:
        return given


def journal_files(folder: Path) -> JournalFuzzer:
    """The journal of a sweep of three trials."""
    return JournalFuzzer(folder)
