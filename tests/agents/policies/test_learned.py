"""Agents as policies: who they decide for, and where they do not fit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium.spaces import Box

from armtempo.agents.policies import Agent, AgentHeader, LearnedPolicy, learned_policy, save_agent
from armtempo.errors import InputError

ENTRIES = ["one", "two"]


def agent_of(**header: Any) -> Agent:
    """An actor that answers with the first entry."""
    values: dict[str, Any] = {
        "name": "small", "algorithm": "ppo", "activation": "tanh", "environment": "coordination", "settings": {},
        "learners": "last", "entries": ENTRIES, "cells": [], "steps": 0, "seed": 0, "command": "", "config": "",
        "curve": [], "armtempo": "0",
    }  # fmt: skip
    weight = np.zeros((1, len(header.get("entries", ENTRIES))), dtype=np.float32)
    weight[0, 0] = 1.0
    return Agent(header=AgentHeader(**(values | header)), layers=((weight, np.zeros(1, dtype=np.float32)),))


def env_of(seen: int = 2, actions: int = 1, mode: str = "speed", action: str = "speed") -> Any:
    return SimpleNamespace(
        possible_agents=["a", "b"],
        observation_space=lambda agent: Box(-1.0, 1.0, (seen,)),
        action_space=lambda agent: Box(-1.0, 1.0, (actions,)),
        options=SimpleNamespace(mode=mode, action=action, observation="local", orders="asked"),
    )


@pytest.fixture
def saved(tmp_path: Path) -> Callable[..., str]:
    """Writes an agent and tells its name."""

    def save(**header: Any) -> str:
        file = tmp_path / "agent.npz"
        save_agent(file, agent_of(**header))
        return f"ppo:{file}"

    return save


ROWS = {name: np.array([value, 0.0], dtype=np.float32) for name, value in (("a", 0.25), ("b", -0.5))}


def test_an_agent_of_the_last_arm_lets_the_others_run_at_full_speed() -> None:
    actions = LearnedPolicy(agent_of(learners="last")).act(ROWS, env_of())
    assert {name: float(action[0]) for name, action in actions.items()} == {"a": 1.0, "b": -0.5}


def test_an_agent_of_all_arms_decides_for_each() -> None:
    policy = LearnedPolicy(agent_of(learners="all"))
    assert {name: float(action[0]) for name, action in policy.act(ROWS, env_of()).items()} == {"a": 0.25, "b": -0.5}
    alone = policy.act({"a": ROWS["a"]}, env_of())  # the other has arrived
    assert list(alone) == ["a"]


def test_one_arm_gets_the_action_itself() -> None:
    env: Any = SimpleNamespace()
    assert LearnedPolicy(agent_of(learners=None)).act(ROWS["a"], env) == np.float32(0.25)


def test_an_agent_that_fits_is_the_policy_of_its_name(saved: Callable[..., str]) -> None:
    policy = learned_policy(saved(), env_of())
    assert policy.agent.header.name == "small"
    assert learned_policy(saved(settings={"mode": "acceleration"}), env_of(mode="acceleration"))


@pytest.mark.parametrize(
    ("header", "env", "message"),
    [
        ({"environment": "feedback-ik"}, env_of(), "is an agent of feedback-ik, not of coordination"),
        ({}, env_of(seen=3), "sees 2 numbers and gives 1; here there are 3 to see and 1 to give"),
        ({}, env_of(actions=2), "here there are 2 to see and 2 to give"),
        ({"settings": {"mode": "acceleration"}}, env_of(), "was trained with mode acceleration, and this is speed"),
        ({}, env_of(actions=2, action="speed+priority"), "was trained with action speed, and this is speed.priority"),
    ],
    ids=["kind", "observation", "action", "mode", "form"],
)
def test_an_agent_of_something_else_is_refused(
    saved: Callable[..., str], header: dict[str, Any], env: Any, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        learned_policy(saved(**header), env)
