"""A thousand episodes of the agent that comes for lee1991, a hundred of them in PyBullet, wherever and however late."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.agents import learned_policy, run_episode
from armtempo.envs import CoordinationEnv, Physics


@pytest.mark.parametrize(("physics", "episodes"), [("ideal", 1000), ("bullet", 100)])
def test_lee1991_collides_with_nobody(physics: Physics, episodes: int, capsys: pytest.CaptureFixture[str]) -> None:
    env = CoordinationEnv(
        "lee1991", physics=physics, shield=True, record=True, start_phase=(0.0, 0.3), master_late_s=(0.0, 0.15),
        observation_noise=0.01,
    )  # fmt: skip
    policy = learned_policy("ppo:lee1991", env)
    makespans = []
    for seed in range(episodes):
        trace, _ = run_episode(env, policy, seed)
        assert trace.violations == 0
        makespans.append(trace.makespan)
    env.close()
    arrived = [time for time in makespans if math.isfinite(time)]
    with capsys.disabled():
        print(  # noqa: T201
            f"\n{physics}: {episodes} episodes, no violation, {len(arrived)} arrived, mean {np.mean(arrived):.4f} s"
        )
    assert len(arrived) > 0.95 * episodes
