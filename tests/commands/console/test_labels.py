"""Short names of policies."""

from __future__ import annotations

from armtempo.commands.console import policy_label, policy_labels


def test_trained_agents_are_called_after_their_trainings() -> None:
    assert policy_label("vci") == "vci"
    assert policy_label("ppo:results/train/lee1991-0/agent.npz") == "ppo-lee1991-0"
    assert policy_label("ppo:agent.npz") == "ppo-agent"
    assert policy_label("sac:mine/best.npz") == "sac-best"


def test_agents_that_would_be_called_alike_keep_their_names() -> None:
    names = ["delay", "ppo:one/lee1991/agent.npz", "ppo:other/lee1991/agent.npz", "ppo:third/agent.npz"]
    assert policy_labels(names) == dict(zip(names, ["delay", *names[1:3], "ppo-third"], strict=True))
