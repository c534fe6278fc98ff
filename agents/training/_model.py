"""The algorithm of a training, made from its configuration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from armtempo.agents.training._graph_policy import GraphPolicy
from armtempo.configs import PPOConfig, SACConfig, TQCConfig, TrainConfig
from armtempo.errors import InputError


def training_model(config: TrainConfig, env: Any) -> Any:
    """A model of stable-baselines3 (TQC: of sb3-contrib) that has not learnt anything yet."""
    activation = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}[config.network.activation]
    graphs, sizes = config.network.kind == "graph", list(config.network.sizes)
    policy: dict[str, Any] = {"activation_fn": activation, ("sizes" if graphs else "net_arch"): sizes}
    common: dict[str, Any] = {"env": env, "seed": config.seed, "device": "cpu", "policy_kwargs": policy}
    match config.algorithm:
        case "ppo":
            return _ppo(config.ppo, policy, common, GraphPolicy if graphs else "MlpPolicy")
        case "sac":
            from stable_baselines3 import SAC

            return SAC("MlpPolicy", **_off_policy(config.sac, env), **common)
        case "tqc":
            from sb3_contrib import TQC

            h: TQCConfig = config.tqc
            policy |= {"n_quantiles": h.quantiles, "n_critics": h.critics}
            return TQC("MlpPolicy", top_quantiles_to_drop_per_net=h.dropped_per_critic, **_off_policy(h, env), **common)


def _ppo(h: PPOConfig, policy: dict[str, Any], common: dict[str, Any], kind: Any) -> Any:
    from stable_baselines3 import PPO

    policy["log_std_init"] = h.log_std_start
    model: Any = PPO(
        kind,
        learning_rate=_schedule(h.learning_rate, h.learning_rate_end),
        n_steps=h.rollout_steps,
        batch_size=h.batch_size,
        n_epochs=h.epochs,
        gamma=h.gamma,
        gae_lambda=h.gae_lambda,
        clip_range=h.clip_range,
        ent_coef=h.entropy,
        vf_coef=h.value_weight,
        max_grad_norm=h.max_gradient,
        target_kl=h.target_kl,
        **common,
    )
    actor = model.policy.actor.layers[-1] if kind is GraphPolicy else model.policy.action_net
    bias = actor.bias
    if len(h.first_action) not in (1, len(bias)):
        raise InputError(
            f"ppo.first_action has {len(h.first_action)} numbers, and an action has {len(bias)}",
            remedy="give one for each, or a single number",
        )
    with torch.no_grad():
        bias.copy_(torch.tensor(h.first_action))
    return model


def _off_policy(h: SACConfig, env: Any) -> dict[str, Any]:
    return {
        "learning_rate": _schedule(h.learning_rate, h.learning_rate_end),
        "buffer_size": max(h.buffer_size, env.num_envs),
        "learning_starts": h.learning_starts,
        "batch_size": h.batch_size,
        "tau": h.tau,
        "gamma": h.gamma,
        "train_freq": h.train_every,
        "gradient_steps": h.gradient_steps,
        "ent_coef": "auto" if h.entropy is None else h.entropy,
    }


def _schedule(start: float, end: float | None) -> float | Callable[[float], float]:
    """A learning rate, or one that goes from ``start`` to ``end`` as what is left of the training goes from 1 to 0."""
    return start if end is None else lambda left: end + (start - end) * left
