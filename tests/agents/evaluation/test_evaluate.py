"""Episodes as evaluations run them: seeds that count up, rewards summed, every decision of every agent asked for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo.agents.evaluation import play, run_episode, run_episodes


class Single:
    """Pays 1, 2, 3, ... and ends, or is cut, after ``steps`` steps."""

    def __init__(self, steps: int, *, cut: bool) -> None:
        self.steps, self.cut = steps, cut
        self.resets: list[tuple[Any, Any]] = []

    def reset(self, *, seed: int | None, options: Any) -> tuple[int, dict[str, Any]]:
        self.resets.append((seed, options))
        self.count = 0
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        assert action == 10 * self.count  # about what was seen last
        self.count += 1
        over = self.count == self.steps
        return self.count, float(self.count), over and not self.cut, over and self.cut, {"count": self.count}

    @property
    def trace(self) -> list[int]:
        return list(range(self.count))


class Several:
    """Agent k leaves after k + 1 steps."""

    possible_agents = ("a", "b", "c")

    def reset(self, *, seed: int | None, options: Any) -> tuple[dict[str, int], dict[str, Any]]:
        self.agents, self.count = list(self.possible_agents), 0
        return dict.fromkeys(self.agents, 0), {}

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        assert list(actions) == self.agents
        self.count += 1
        stepped, self.agents = self.agents, self.agents[1:]
        seen = dict.fromkeys(stepped, self.count)
        ended = {agent: agent not in self.agents for agent in stepped}
        rewards = dict.fromkeys(stepped, 1.0)
        return seen, rewards, ended, dict.fromkeys(stepped, False), {agent: {"at": self.count} for agent in stepped}


class Tenfold:
    """Answers with ten times what it sees."""

    def __init__(self) -> None:
        self.seeds: list[int | None] = []

    def reset(self, seed: int | None = None) -> None:
        self.seeds.append(seed)

    def act(self, observation: Any, env: Any) -> Any:
        if isinstance(observation, dict):
            assert set(observation) == set(env.agents)  # who has left is not asked
            return {agent: 10 * seen for agent, seen in observation.items()}
        return 10 * observation


@pytest.mark.parametrize("cut", [False, True])
def test_an_episode_goes_on_until_it_ends_or_is_cut_and_its_rewards_add_up(cut: bool) -> None:
    env, policy, looks = Single(4, cut=cut), Tenfold(), []
    total, info = play(env, policy, 7, {"late": 1.0}, on_step=lambda: looks.append(env.count))
    assert total == 1.0 + 2.0 + 3.0 + 4.0
    assert info == {"count": 4}
    assert looks == [0, 1, 2, 3, 4]  # after the reset and after every step
    assert env.resets == [(7, {"late": 1.0})]
    assert policy.seeds == [7]


def test_of_several_agents_all_rewards_count_and_the_last_info_of_each_is_kept() -> None:
    looks: list[int] = []
    env = Several()
    total, infos = play(env, Tenfold(), on_step=lambda: looks.append(env.count))
    assert total == 3.0 + 2.0 + 1.0
    assert infos == {"a": {"at": 1}, "b": {"at": 2}, "c": {"at": 3}}
    assert looks == [0, 1, 2, 3]


def test_a_recorded_episode_comes_with_its_trace() -> None:
    trace, total = run_episode(Single(3, cut=False), Tenfold(), 0)
    assert trace == [0, 1, 2]
    assert total == 6.0


def test_seeds_count_up_and_each_episode_is_told() -> None:
    class Runner:
        env = policy = None

        def run(self, seed: int, on_step: Any = None) -> int:
            return seed**2

        def close(self) -> None:
            raise AssertionError("not its business")

    told: list[tuple[str, int]] = []
    runs = run_episodes(Runner(), "vci", 3, 5, lambda name, episode: told.append((name, episode)))
    assert runs == [25, 36, 49]
    assert told == [("vci", 0), ("vci", 1), ("vci", 2)]
    assert np.array_equal(runs, run_episodes(Runner(), "vci", 3, 5))
