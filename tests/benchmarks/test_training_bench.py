"""The training side: what the adapter to stable-baselines3 adds to a step, how soon the bundled training is there."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from armtempo.agents import ParallelVecEnv, train
from armtempo.envs import CoordinationEnv
from armtempo.planners import CoordinationCell

ADAPTER_US = 15.0
MINUTES = 3.0
ACTION = np.array([0.2], dtype=np.float32)
STEPS = 20_000


def _bare(env: CoordinationEnv, steps: int) -> float:
    env.reset(seed=0)
    began = time.perf_counter()
    for _ in range(steps):
        env.step({agent: ACTION for agent in env.agents})  # noqa: C420 - as anyone writes it
        if not env.agents:
            env.reset()
    return (time.perf_counter() - began) / steps


def _adapted(env: ParallelVecEnv, steps: int) -> float:
    env.seed(0)
    env.reset()
    actions = np.stack([ACTION, ACTION])
    began = time.perf_counter()
    for _ in range(steps):
        env.step(actions)
    return (time.perf_counter() - began) / steps


def test_the_adapter_costs_little(lee1991: CoordinationCell) -> None:
    def make() -> CoordinationEnv:
        return CoordinationEnv(lee1991, physics="ideal", master_late_s=0.1)

    bare, adapted = make(), ParallelVecEnv(make, 1)
    _bare(bare, 500)
    _adapted(adapted, 500)
    pairs = [(_bare(bare, STEPS // 5), _adapted(adapted, STEPS // 5)) for _ in range(5)]
    without, with_it = 1e6 * np.min(pairs, axis=0)
    print(f"\nbare step {without:.1f} us, adapted {with_it:.1f} us: + {with_it - without:.1f} us for two agents")  # noqa: T201
    assert with_it - without <= ADAPTER_US


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
