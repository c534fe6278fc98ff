"""The bundled training of lee1991, seed after seed: how near the optimum, in how many minutes."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from armtempo.agents import train

MINUTES = 3.0


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_lee1991_is_learnt_in_three_minutes(seed: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    began = time.perf_counter()
    training = train("lee1991", tmp_path / "out", seed=seed)
    minutes = (time.perf_counter() - began) / 60.0
    last = training.curve[-1]
    with capsys.disabled():
        print(  # noqa: T201
            f"\nseed {seed}: {last['optimum_percent']:.2f} % above the optimum after {last['steps']} steps, "
            f"{minutes:.1f} minutes; {last['finished']} of {last['episodes']} drawn episodes finished, "
            f"{last['violations']} violations"
        )
    assert last["optimum_percent"] < 1.0
    assert last["violations"] == 0
    assert minutes < MINUTES
