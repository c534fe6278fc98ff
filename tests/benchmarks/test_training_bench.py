"""Cost of the training side: what the adapter to stable-baselines3 adds to a step of the environment."""

from __future__ import annotations

import time

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from armtempo.agents import ParallelVecEnv
from armtempo.envs import CoordinationEnv
from armtempo.planners import Cell

ADAPTER_US = 15.0
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


def test_the_adapter_costs_little(lee1991: Cell) -> None:
    def make() -> CoordinationEnv:
        return CoordinationEnv(lee1991, physics="ideal", master_late_s=0.1)

    bare, adapted = make(), ParallelVecEnv(make, 1)
    _bare(bare, 500)
    _adapted(adapted, 500)
    pairs = [(_bare(bare, STEPS // 5), _adapted(adapted, STEPS // 5)) for _ in range(5)]
    without, with_it = 1e6 * np.min(pairs, axis=0)
    print(f"\nbare step {without:.1f} us, adapted {with_it:.1f} us: + {with_it - without:.1f} us for two agents")  # noqa: T201
    assert with_it - without <= ADAPTER_US
