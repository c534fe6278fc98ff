"""Damaged inputs on everything that reads: none of them may end in anything but an answer or one of our errors.

``make fuzz`` tries many more, ``python -m tests.fuzz --help`` tells how.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from armtempo.errors import InputError
from tests.fuzz._finite import NotFiniteError, check_finite
from tests.fuzz._harness import fuzz
from tests.fuzz._mutations import Random

ROOT = Path(__file__).parents[2]
INPUTS = 3000
SEED = 1


@pytest.mark.slow
def test_no_damaged_input_is_a_fault(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "tests.fuzz", "--count", str(INPUTS), "--seed", str(SEED), "--kept", str(tmp_path)]
    environment = {key: value for key, value in os.environ.items() if key != "PYTEST_CURRENT_TEST"}
    run = subprocess.run(
        [*line, "--json", str(tmp_path / "out.json")],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, f"{run.stdout}\n{run.stderr[-2000:]}"
    outcomes = json.loads((tmp_path / "out.json").read_text(encoding="utf-8"))
    assert sum(one["inputs"] for one in outcomes) > 0.95 * INPUTS
    for one in outcomes:  # neither all refused nor all taken: damage goes deep enough, and not too deep
        assert one["refused"] > 0.1 * one["inputs"], one
        assert one["accepted"] > 0.02 * one["inputs"], one


class Planted:
    """Does wrong in every way that there is."""

    spent = False

    def make(self, random: Random) -> int:
        return int(random.integers(6))

    def run(self, given: int) -> bool:
        match given:
            case 0:
                raise InputError("refused")
            case 1:
                check_finite({"x": np.array([1.0, np.nan])})
            case 2:
                while True:
                    pass
            case 3:
                bytearray(2**31)
            case 4:
                os._exit(7)
            case _:
                return True
        return False

    def shown(self, given: int) -> bytes:
        return str(given).encode()


def test_the_harness_finds_every_kind_of_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tests.fuzz._harness.HANG_S", 0.5)
    outcome = fuzz("planted", lambda _: Planted(), range(30), 1, tmp_path / "kept", tmp_path)
    found = {kind.split()[0]: Path(outcome.files[kind]).read_text(encoding="utf-8") for kind in outcome.faults}
    assert found == {"NotFiniteError": "1", "Hang": "2", "MemoryError": "3", "the": "4"}
    assert outcome.inputs == 30 == outcome.refused + outcome.accepted + outcome.fault_count
    assert outcome.refused > 0
    assert outcome.accepted > 0


def test_the_same_seed_gives_the_same_inputs() -> None:
    from tests.fuzz._harness import random_of
    from tests.fuzz._mutations import damaged_text

    texts = [
        damaged_text(random_of("x", seed, number), b"a: 1\nb: [2, 3]\n") for seed, number in ((1, 5), (1, 5), (1, 6))
    ]
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize("value", [{"a": (1.0, np.inf)}, [np.array([np.nan])], np.float64("nan")])
def test_numbers_that_are_not_finite_are_found(value: object) -> None:
    with pytest.raises(NotFiniteError):
        check_finite(value)


def test_infinity_is_no_limit_where_it_says_so() -> None:
    check_finite({"position_max": np.array([np.inf])})
    with pytest.raises(NotFiniteError, match="position_max"):
        check_finite({"position_max": np.array([np.nan])})
