"""The network over arms and pairs as an actor and a critic of stable-baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, final

import numpy as np
import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from torch import Tensor, nn

from armtempo.agents.policies import NODE_NUMBERS
from armtempo.agents.training._graph_module import NODES, PRESENT, GraphNetwork, bias_of, to_graph, weight_of
from armtempo.envs import GRAPH_ARMS, NODE_PLACES

ARRIVED = NODE_PLACES["arrived"]


@final
class MaskedGaussian(DiagGaussianDistribution):
    """Independent normal actions of which only those in ``mask`` (B, n) count."""

    def __init__(self, action_dim: int) -> None:
        super().__init__(action_dim)
        self.mask: Tensor = torch.ones(1)

    @property
    def _normal(self) -> Any:
        return self.distribution

    def log_prob(self, actions: Tensor) -> Tensor:
        """(B,)."""
        logs: Tensor = (self._normal.log_prob(actions) * self.mask).sum(dim=1)
        return logs

    def entropy(self) -> Tensor:
        """(B,)."""
        entropies: Tensor = (self._normal.entropy() * self.mask).sum(dim=1)
        return entropies


@final
class GraphPolicy(ActorCriticPolicy):
    """Actor and critic over rows of graphs (B, FLAT_SIZE); actions (B, GRAPH_ARMS size), arm by arm.

    Arms that are absent or have arrived do nothing that counts.

    Args:
        sizes: Widths of the rounds of messages.
    """

    def __init__(self, *args: Any, sizes: Sequence[int] = (48, 48), **kwargs: Any) -> None:
        self._sizes = tuple(sizes)
        super().__init__(*args, **kwargs)

    def _build(self, lr_schedule: Any) -> None:
        assert self.action_space.shape is not None
        self._size = self.action_space.shape[0] // GRAPH_ARMS
        self.actor = GraphNetwork(self._sizes, self._size, self.activation_fn)
        self.critic = GraphNetwork(self._sizes, 1, self.activation_fn)
        self.log_std = nn.Parameter(torch.full((self._size,), float(self.log_std_init)))
        for network, gain in ((self.actor, 0.01), (self.critic, 1.0)):
            for layer in network.layers:
                nn.init.orthogonal_(weight_of(layer), gain=float(np.sqrt(2.0)))
                nn.init.zeros_(bias_of(layer))
            nn.init.orthogonal_(weight_of(network.layers[-1]), gain=gain)
        kind: Any = self.optimizer_class
        self.optimizer = kind(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def get_distribution(self, obs: Any) -> MaskedGaussian:
        """Of the actions of all arms."""
        nodes, edges = to_graph(obs)
        found = self.actor(nodes, edges)
        batch, arms = found.shape[:2]
        mean = torch.zeros((batch, GRAPH_ARMS, self._size), dtype=found.dtype)
        mean[:, :arms] = found
        acts = obs[:, :NODE_NUMBERS].reshape(-1, GRAPH_ARMS, NODES)
        mask = (acts[..., PRESENT] * (1.0 - acts[..., ARRIVED])).repeat_interleave(self._size, dim=1)
        distribution = MaskedGaussian(GRAPH_ARMS * self._size)
        distribution.proba_distribution(mean.flatten(1), self.log_std.repeat(GRAPH_ARMS))
        distribution.mask = mask
        return distribution

    def predict_values(self, obs: Any) -> Tensor:
        """(B, 1)."""
        nodes, edges = to_graph(obs)
        present = nodes[..., PRESENT : PRESENT + 1]
        values: Tensor = (self.critic(nodes, edges) * present).sum(dim=1) / present.sum(dim=1).clamp(min=1.0)
        return values

    def forward(self, obs: Any, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Actions, values, and the logarithms of the probabilities of the actions."""
        distribution = self.get_distribution(obs)
        actions = distribution.get_actions(deterministic=deterministic)
        return actions, self.predict_values(obs), distribution.log_prob(actions)

    def evaluate_actions(self, obs: Any, actions: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Values, logarithms of the probabilities of the actions, entropies."""
        distribution = self.get_distribution(obs)
        return self.predict_values(obs), distribution.log_prob(actions), distribution.entropy()
