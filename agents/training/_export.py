"""From a trained model of stable-baselines3 to an agent file's actor."""

from __future__ import annotations

from typing import Any

import numpy as np

from armtempo.agents.policies import Agent, AgentHeader


def agent_of(model: Any, header: AgentHeader) -> Agent:
    """The actor of a PPO, SAC or TQC model with a policy of plain layers (``MlpPolicy``), or of graphs."""
    policy = model.policy
    if header.network == "graph":
        modules = list(policy.actor.layers)
    elif header.algorithm == "ppo":
        modules = [*policy.mlp_extractor.policy_net, policy.action_net]
    else:
        modules = [*policy.actor.latent_pi, policy.actor.mu]
    linear = [module for module in modules if hasattr(module, "weight")]  # the others are the activations
    layers = tuple(
        (_numbers(module.weight), _numbers(module.bias)) for module in linear
    )  # fmt: skip
    return Agent(header=header, layers=layers)


def _numbers(parameter: Any) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.array(parameter.detach().cpu().numpy(), dtype=np.float32)
