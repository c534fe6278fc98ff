"""Parallel environments as SB3 sees them: rows, ends, time-outs, seeds, statistics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv

from armtempo.arrays import Floats32

pytest.importorskip("stable_baselines3")

from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecMonitor

from armtempo.agents import ParallelVecEnv
from armtempo.envs import CoordinationEnv
from armtempo.errors import InputError
from armtempo.planners import CoordinationCell

pytestmark = pytest.mark.rl


class Countdown(ParallelEnv[str, Any, Any]):  # type: ignore[misc]
    """Agent i ends by itself after ``lengths[i]`` steps; all are cut at ``limit``. Observed: agent, step, seed."""

    metadata = {"name": "countdown"}  # noqa: RUF012
    render_mode = None

    def __init__(self, lengths: tuple[int, ...], limit: int = 99, width: int | None = None) -> None:
        self.possible_agents = [f"a{i}" for i in range(len(lengths))]
        self.agents: list[str] = []
        self.lengths, self.limit, self.width = lengths, limit, width
        self.seeds: list[int | None] = []
        self.taken: list[dict[str, float]] = []

    def observation_space(self, agent: str) -> Box:
        return Box(-99.0, 99.0, (3 if agent == "a0" or not self.width else self.width,))

    def action_space(self, agent: str) -> Box:
        return Box(-1.0, 1.0, (1,))

    def _seen(self) -> dict[str, Floats32]:
        return {a: np.array([int(a[1:]), self.step_number, self.seeds[-1] or 0], np.float32) for a in self.agents}

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        self.seeds.append(seed)
        self.agents, self.step_number = self.possible_agents[:], 0
        return self._seen(), {a: {"options": options} for a in self.agents}

    def step(self, actions: dict[str, Floats32]) -> tuple[Any, ...]:
        assert set(actions) == set(self.agents)
        self.taken.append({a: float(action[0]) for a, action in actions.items()})
        self.step_number += 1
        ended = {a: self.step_number >= self.lengths[int(a[1:])] for a in self.agents}
        cut = {a: self.step_number >= self.limit and not ended[a] for a in self.agents}
        rewards = {a: 1.0 + int(a[1:]) for a in self.agents}
        infos = {a: {"is_success": ended[a]} if ended[a] or cut[a] else {} for a in self.agents}
        result = self._seen(), rewards, ended, cut, infos
        self.agents = [a for a in self.agents if not (ended[a] or cut[a])]
        return result

    def render(self) -> None: ...

    def close(self) -> None: ...


def actions(env: ParallelVecEnv) -> Floats32:
    return np.linspace(-1.0, 1.0, env.num_envs, dtype=np.float32)[:, None]


def test_an_agent_that_ends_early_waits_with_zeros_and_all_rows_end_together() -> None:
    env = ParallelVecEnv(lambda: Countdown((2, 4)), 1)
    env.reset()
    steps: list[Any] = [env.step(actions(env)) for _ in range(5)]
    np.testing.assert_array_equal([s[1] for s in steps], [[1, 2], [1, 2], [0, 2], [0, 2], [1, 2]])
    np.testing.assert_array_equal([s[2] for s in steps], [[0, 0], [0, 0], [0, 0], [1, 1], [0, 0]])
    assert not steps[1][0][0].any()  # the first has ended
    assert not steps[2][0][0].any()
    np.testing.assert_array_equal(steps[3][0], [[0, 0, 0], [1, 0, 0]])  # of the next episode
    first, second = steps[3][3]
    assert not first["terminal_observation"].any()
    np.testing.assert_array_equal(second["terminal_observation"], [1, 4, 0])
    assert [info["TimeLimit.truncated"] for info in (first, second)] == [False, False]
    assert [(info["episode"]["r"], info["episode"]["l"]) for info in (first, second)] == [(2.0, 2), (8.0, 4)]
    assert first["is_success"]
    assert steps[4][3] == [{}, {}]
    inner = env.envs[0]
    assert isinstance(inner, Countdown)
    assert [set(t) for t in inner.taken] == [{"a0", "a1"}] * 2 + [{"a1"}] * 2 + [{"a0", "a1"}]


def test_only_those_cut_off_are_marked_as_timed_out() -> None:
    env = ParallelVecEnv(lambda: Countdown((2, 9), limit=3), 1)
    env.reset()
    for _ in range(2):
        env.step(actions(env))
    _, _, dones, infos = env.step(actions(env))
    assert dones.all()
    assert [info["TimeLimit.truncated"] for info in infos] == [False, True]
    assert [info["is_success"] for info in infos] == [True, False]


def test_copies_get_their_own_seed_and_rows_their_own_action() -> None:
    env = ParallelVecEnv(lambda: Countdown((2, 2)), 3)
    assert list(env.seed(7)) == [7, 7, 8, 8, 9, 9]
    first = env.reset()
    np.testing.assert_array_equal(first[:, 2], [7, 7, 8, 8, 9, 9])
    np.testing.assert_array_equal(first[:, 0], [0, 1] * 3)
    env.step(actions(env))
    inner: list[Any] = env.envs
    taken = [value for one in inner for value in one.taken[0].values()]
    np.testing.assert_allclose(taken, actions(env)[:, 0])
    env.reset()
    assert [one.seeds for one in inner] == [[7, None], [8, None], [9, None]]


def test_results_are_not_overwritten_by_the_next_step() -> None:
    env = ParallelVecEnv(lambda: Countdown((5, 5)), 1)
    first = env.reset()
    kept = first.copy()
    second, rewards, dones, _ = env.step(actions(env))
    assert isinstance(second, np.ndarray)
    before = second.copy(), rewards.copy(), dones.copy()
    env.step(actions(env))
    np.testing.assert_array_equal(first, kept)
    for now, then in zip((second, rewards, dones), before, strict=True):
        np.testing.assert_array_equal(now, then)


def test_attributes_and_methods_of_rows() -> None:
    env = ParallelVecEnv(lambda: Countdown((2, 2)), 2)
    assert env.get_attr("limit", [0, 3]) == [99, 99]
    env.set_attr("limit", 5, indices=2)
    assert env.get_attr("limit") == [99, 99, 5, 5]
    env.env_method("reset", seed=3, indices=[0, 1])  # the same copy: once
    assert env.get_attr("seeds") == [[3], [3], [], []]
    assert env.env_is_wrapped(Monitor) == [False] * 4
    assert not env.has_attr("nothing_of_this_name")


def test_agents_of_different_spaces_are_refused() -> None:
    with pytest.raises(InputError, match="share a policy"):
        ParallelVecEnv(lambda: Countdown((2, 2), width=4))
    with pytest.raises(InputError, match="at least one"):
        ParallelVecEnv(lambda: Countdown((2, 2)), 0)


def test_vec_monitor_counts_the_same_episodes() -> None:
    env = VecMonitor(ParallelVecEnv(lambda: Countdown((2, 4)), 1))
    env.reset()
    for _ in range(4):
        _, _, _, infos = env.step(np.zeros((2, 1), np.float32))
    assert [info["episode"]["r"] for info in infos] == [2.0, 8.0]
    assert env.episode_count == 2


def test_episodes_of_a_cell_are_those_of_the_bare_environment(lee1991: CoordinationCell) -> None:
    def make() -> CoordinationEnv:
        return CoordinationEnv(lee1991, physics="ideal", master_late_s=0.1)

    env = ParallelVecEnv(make, 1)
    env.seed(3)
    bare = make()
    rows: Any = env.reset()
    seen, _ = bare.reset(seed=3)
    policy: Callable[[int], float] = lambda step: float(np.sin(0.3 * step))  # noqa: E731
    totals, step = dict.fromkeys(bare.agents, 0.0), 0
    dones = np.zeros(2, bool)
    while bare.agents:
        for i, agent in enumerate(bare.possible_agents):
            if agent in bare.agents:
                np.testing.assert_array_equal(rows[i], seen[agent])
        assert not dones.any()
        action = np.array([policy(step)], np.float32)
        seen, rewards, _, _, _ = bare.step(dict.fromkeys(bare.agents, action))
        rows, _, dones, infos = env.step(np.stack([action, action]))
        for agent, reward in rewards.items():
            totals[agent] += reward
        step += 1
    assert dones.all()
    assert [info["episode"]["r"] for info in infos] == pytest.approx(list(totals.values()))
    env.close()
    bare.close()


def test_ppo_learns_on_it_and_logs_returns(lee1991: CoordinationCell) -> None:
    env = ParallelVecEnv(lambda: CoordinationEnv(lee1991, physics="ideal"), 2)
    model = PPO("MlpPolicy", env, n_steps=128, batch_size=128, n_epochs=1, seed=0, device="cpu")
    model.learn(512)
    assert model.ep_info_buffer
    assert {"r", "l", "t"} <= set(model.ep_info_buffer[0])
    env.close()
