"""Rows of learners as SB3 sees them: the same episodes as one environment at a time, and exact continuation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from armtempo.agents import ParallelVecEnv, VectorVecEnv
from armtempo.envs import CoordinationEnv, CoordinationVectorEnv
from armtempo.planners import CoordinationCell

pytestmark = pytest.mark.rl
LATE: dict[str, Any] = {"master_late_s": 0.1}


def batch(cell: CoordinationCell, episodes: int, **options: Any) -> VectorVecEnv:
    return VectorVecEnv(CoordinationVectorEnv(cell, episodes, **LATE, **options))


def steps(env: Any, count: int, seed: int = 5) -> list[Any]:
    random = np.random.default_rng(seed)
    return [env.step(random.uniform(0.0, 1.0, (env.num_envs, 1)).astype(np.float32)) for _ in range(count)]


def same_as_one_at_a_time(cell: CoordinationCell, episodes: int) -> int:
    """Compares whole episodes with ``ParallelVecEnv``; returns how many ended."""
    ours = batch(cell, episodes)
    theirs = ParallelVecEnv(lambda: CoordinationEnv(cell, physics="ideal", **LATE), episodes)
    for env in (ours, theirs):
        env.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    ended = 0
    for one, other in zip(steps(ours, 300), steps(theirs, 300), strict=True):
        np.testing.assert_array_equal(one[2], other[2])
        np.testing.assert_allclose(one[1], other[1], atol=1e-6)
        waiting = ~np.asarray(other[0]).any(axis=1)  # arms that have arrived: the batch goes on to see for them
        np.testing.assert_array_equal(np.asarray(one[0])[~waiting], np.asarray(other[0])[~waiting])
        for row, (mine, yours) in enumerate(zip(one[3], other[3], strict=True)):
            if one[2][row]:
                ended += 1
                assert mine["episode"]["r"] == pytest.approx(yours["episode"]["r"], abs=1e-6)
                assert mine["TimeLimit.truncated"] == yours["TimeLimit.truncated"]
                assert mine["violation"] or yours["terminal_observation"].any() <= mine["terminal_observation"].any()
    return ended


def test_rows_are_the_agents_of_single_environments(lee1991: CoordinationCell) -> None:
    assert same_as_one_at_a_time(lee1991, 3) > 6


def test_only_the_learner_has_rows_and_obeys(lee1991: CoordinationCell) -> None:
    both, last = batch(lee1991, 2), batch(lee1991, 2, learners=(1,))
    assert (both.num_envs, last.num_envs) == (4, 2)
    for env in (both, last):
        env.seed(0)
    first = np.asarray(both.reset())
    np.testing.assert_array_equal(first[1::2], last.reset())
    for _ in range(20):
        seen, rewards, dones, _ = both.step(np.array([[1.0], [0.3], [1.0], [-0.5]], np.float32))
        alone = last.step(np.array([[0.3], [-0.5]], np.float32))
        np.testing.assert_array_equal(np.asarray(seen)[1::2], alone[0])
        np.testing.assert_array_equal(rewards[1::2], alone[1])
        np.testing.assert_array_equal(dones[1::2], alone[2])


def test_it_goes_on_from_its_state_to_the_last_bit(lee1991: CoordinationCell) -> None:
    env, other = batch(lee1991, 4), batch(lee1991, 4)
    env.seed(1)
    env.reset()
    steps(env, 40)
    state = env.get_state()
    assert state is not None
    after = steps(env, 90, 6)
    other.seed(9)
    other.reset()
    steps(other, 7)
    other.set_state(state)
    for one, two in zip(after, steps(other, 90, 6), strict=True):
        for a, b in zip(one[:3], two[:3], strict=True):
            np.testing.assert_array_equal(a, b)
    ends = [info["episode"]["r"] for step in after for info in step[3] if "episode" in info]
    assert ends


def test_a_time_limit_is_marked_and_vec_monitor_counts(lee1991: CoordinationCell) -> None:
    env = VecMonitor(batch(lee1991, 2, max_episode_s=0.04))
    env.reset()
    for _ in range(10):
        seen, _, dones, infos = env.step(np.full((4, 1), -1.0, np.float32))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] and not info["is_success"] for info in infos)
    assert all(info["terminal_observation"].shape == (np.asarray(seen).shape[1],) for info in infos)
    assert env.episode_count == 4
    assert env.env_is_wrapped(Monitor) == [False] * 4
    assert env.get_attr("arms") == [2] * 4


def test_ppo_learns_on_it(lee1991: CoordinationCell) -> None:
    env = batch(lee1991, 16, learners=(1,))
    model = PPO("MlpPolicy", env, n_steps=64, batch_size=256, n_epochs=1, seed=0, device="cpu")
    model.learn(4096)
    assert model.ep_info_buffer


def test_what_the_shield_cuts_costs(lee1991: CoordinationCell) -> None:
    plain, charged = (
        VectorVecEnv(CoordinationVectorEnv(lee1991, 4, shield=True, learners=(1,)), cut_penalty=penalty)
        for penalty in (0.0, 0.5)
    )
    for env in (plain, charged):
        env.seed(3)
        env.reset()
    cost = 0.0
    for one, other in zip(steps(plain, 120), steps(charged, 120), strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        difference = np.asarray(one[1]) - np.asarray(other[1])
        assert (difference >= 0.0).all()
        assert (difference <= 0.5).all()
        cost += float(difference.sum())
    assert cost > 0.5
