"""What policies have in common: random actions by seed, commands as actions, and who can be chosen."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box

from armtempo.agents import RandomPolicy
from armtempo.agents.policies import chosen_policies, to_action
from armtempo.errors import InputError, UnknownNameError
from tests.agents.trained import trained

ONE: Any = SimpleNamespace(action_space=Box(-1.0, 1.0, (3,)))
SEVERAL: Any = SimpleNamespace(action_space=lambda agent: Box(-1.0, 1.0, (1 if agent == "a" else 2,)))
SEEN = np.zeros(4, dtype=np.float32)


def test_random_actions_are_of_the_space_and_the_same_for_the_same_seed() -> None:
    policy, drawn = RandomPolicy(), []
    for seed in (3, 3, 4):
        policy.reset(seed)
        drawn.append([policy.act(SEEN, ONE) for _ in range(200)])
    assert all(ONE.action_space.contains(action) for action in drawn[0])
    np.testing.assert_array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])
    assert np.abs(np.mean(drawn[0])) < 0.1
    assert np.std(drawn[0]) == pytest.approx(1.0 / np.sqrt(3.0), abs=0.05)  # uniform


def test_every_agent_that_is_seen_gets_an_action_of_its_own() -> None:
    policy = RandomPolicy()
    policy.reset(0)
    actions = policy.act({"b": SEEN, "a": SEEN}, SEVERAL)
    assert {agent: action.shape for agent, action in actions.items()} == {"b": (2,), "a": (1,)}
    assert actions["a"][0] not in actions["b"]


def test_commands_are_actions_from_end_to_end() -> None:
    np.testing.assert_array_equal([to_action(command)[0] for command in (0.0, 0.5, 1.0)], [-1.0, 0.0, 1.0])
    assert to_action(0.3).dtype == np.float32


def test_policies_are_all_one_or_a_list_of_known_ones_and_agents() -> None:
    known = ("delay", "vci")
    assert chosen_policies(None, known, 1) == known
    assert chosen_policies("vci", known, 1) == ("vci",)
    assert chosen_policies(["vci", "delay"], known, 1) == ("vci", "delay")
    with pytest.raises(UnknownNameError, match=r"policy 'vcy'.*did you mean 'vci'"):
        chosen_policies(["delay", "vcy"], known, 1)
    with pytest.raises(InputError, match="unknown agent 'ppo:nobody'"):
        chosen_policies("ppo:nobody", known, 1)
    with pytest.raises(InputError, match="episodes must be at least 1, got 0"):
        chosen_policies(None, known, 0)
    agent = trained("lee1991")
    assert chosen_policies([agent, "vci"], known, 1) == (agent, "vci")
