"""Train all arms of a cell with MAPPO: one shared actor, a critic that sees all arms (TorchRL).

    pip install "armtempo[torchrl]"    # 0.14 or newer; best in an environment of its own
    python docs/recipes/train_torchrl.py --iterations 100
    python docs/recipes/train_torchrl.py --graph --cell planar-four    # any number of arms; a search decides the orders

Arms end at different times. So the wrapper is told ``use_mask=True`` (who still moves) and ``done_on_any=False``:
without that, TorchRL ends the episode when the first arm arrives. Losses count the arms that still move alone.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import torch
from pettingzoo.utils import BaseParallelWrapper
from tensordict import TensorDict
from tensordict.nn import TensorDictModule, TensorDictSequential
from tensordict.nn.distributions import NormalParamExtractor
from torch import nn
from torchrl.collectors import Collector
from torchrl.data import Composite
from torchrl.envs import PettingZooWrapper, RewardSum, TransformedEnv
from torchrl.modules import MultiAgentMLP, ProbabilisticActor, TanhNormal
from torchrl.objectives import ClipPPOLoss, ValueEstimators

from armtempo.agents import GraphNetwork
from armtempo.envs import coordination_v0

GROUP = "arms"
GRAPH_OPTIONS = {"observation": "graph", "orders": "search+stop", "shield": True}


class WithoutInfos(BaseParallelWrapper[str, Any, Any]):
    """TorchRL takes every entry of an info for a number; nothing here learns from them."""

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Begin an episode."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return observations, {agent: {} for agent in infos}

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        """One control period, of the arms that have not ended: TorchRL gives actions for all."""
        *outcome, infos = self.env.step({agent: actions[agent] for agent in self.env.agents})
        return *outcome, {agent: {} for agent in infos}


def make_env(cell: str = "lee1991", *, graph: bool = False, physics: str = "ideal", seed: int = 0) -> TransformedEnv:
    """The parallel environment, its arms in one group, with the sums of rewards."""
    options = GRAPH_OPTIONS if graph else {}
    arms = WithoutInfos(coordination_v0.parallel_env(cell, physics=physics, **options))
    env = PettingZooWrapper(arms, group_map={GROUP: arms.possible_agents}, use_mask=True, done_on_any=False)
    env = TransformedEnv(env, RewardSum(in_keys=[(GROUP, "reward")], out_keys=[(GROUP, "episode_reward")]))
    env.set_seed(seed)
    return env


class OwnRow(nn.Module):
    """A network over all arms and pairs of arms, of which each arm takes the row that is its own."""

    def __init__(self, out: int) -> None:
        super().__init__()
        self.network = GraphNetwork((48, 48), out)

    def forward(self, nodes: torch.Tensor, edges: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
        """(..., A, out) of graphs (..., A, M, N), (..., A, M, M, K) and who sees them (..., A, M)."""
        batch = own.shape[:-1]
        rows = self.network(nodes.flatten(0, -3), edges.flatten(0, -4))
        return (rows * own.flatten(0, -2).unsqueeze(-1)).sum(dim=1).unflatten(0, batch)


class Mappo:
    """Actor, critic, loss and optimiser for an environment of ``make_env``."""

    def __init__(self, env: TransformedEnv, *, steps: int, learning_rate: float = 3e-4) -> None:
        seen, network, critic = _networks(env)
        params, of_actions = [(GROUP, "params")], [(GROUP, "loc"), (GROUP, "scale")]
        self.policy = ProbabilisticActor(
            TensorDictSequential(
                TensorDictModule(network, in_keys=seen, out_keys=params),
                TensorDictModule(NormalParamExtractor(), in_keys=params, out_keys=of_actions),
            ),
            spec=env.full_action_spec,
            in_keys=of_actions,
            out_keys=[(GROUP, "action")],
            distribution_class=TanhNormal,
            distribution_kwargs={"low": -1.0, "high": 1.0},
            return_log_prob=True,
        )
        self.critic = TensorDictModule(critic, in_keys=seen, out_keys=[(GROUP, "state_value")])
        self.loss = ClipPPOLoss(
            self.policy, self.critic, clip_epsilon=0.2, entropy_coeff=0.0, normalize_advantage=False, reduction="none"
        )
        self.loss.set_keys(
            reward=(GROUP, "reward"),
            action=(GROUP, "action"),
            value=(GROUP, "state_value"),
            done=(GROUP, "done"),
            terminated=(GROUP, "terminated"),
        )
        self.loss.make_value_estimator(ValueEstimators.GAE, gamma=1.0, lmbda=0.95)
        self.optimizer = torch.optim.Adam(self.loss.parameters(), lr=learning_rate)
        self.collector = Collector(
            env, self.policy, frames_per_batch=steps, total_frames=-1, auto_register_policy_transforms=False
        )
        self._batches = iter(self.collector)

    def iterate(self, *, epochs: int = 10, minibatch: int = 512) -> dict[str, float]:
        """Run the environment for a while and learn from it; what happened."""
        batch = next(self._batches)
        with torch.no_grad():
            self.loss.value_estimator(batch)
        data = batch.reshape(-1)
        moving = data[GROUP, "mask"].unsqueeze(-1)
        advantage = data["advantage"]
        mean, spread = advantage[moving].mean(), advantage[moving].std()
        data["advantage"] = (advantage - mean) / (spread + 1e-8)
        for _ in range(epochs):
            for rows in torch.randperm(len(data)).split(minibatch):
                self._learn(data[rows])
        over = batch["next", "done"].squeeze(-1)
        returns = batch["next", GROUP, "episode_reward"][over]
        return {
            "env_steps": float(len(data)),
            "moving_share": float(moving.float().mean()),
            "episodes": float(over.sum()),
            "return_mean": float(returns.sum(dim=-2).mean()) if len(returns) else float("nan"),  # sum over the arms
        }

    def _learn(self, rows: TensorDict) -> None:
        losses = self.loss(rows)
        moving = rows[GROUP, "mask"].unsqueeze(-1).float()
        total = sum(
            (losses[name].reshape(moving.shape) * moving).sum() / moving.sum()
            for name in ("loss_objective", "loss_critic")
        )
        self.optimizer.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(self.loss.parameters(), 0.5)
        self.optimizer.step()


def _networks(env: TransformedEnv) -> tuple[list[Any], nn.Module, nn.Module]:
    """The keys that actor and critic see, and both: over graphs, or over the arms' own observations."""
    spec = env.observation_spec[GROUP, "observation"]
    if isinstance(spec, Composite):  # a graph
        return [(GROUP, "observation", name) for name in ("nodes", "edges", "own")], OwnRow(2), OwnRow(1)
    arms, entries = spec.shape
    shared: dict[str, Any] = {
        "n_agents": arms, "share_params": True, "depth": 2, "num_cells": 64, "activation_class": nn.Tanh,
    }  # fmt: skip
    actor = MultiAgentMLP(entries, 2, centralised=False, **shared)
    return [(GROUP, "observation")], actor, MultiAgentMLP(entries, 1, centralised=True, **shared)


def main() -> None:
    """Read the command line and train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell", default="lee1991", help="bundled cell or cell file")
    parser.add_argument("--graph", action="store_true", help="arms see all arms and pairs; a search decides the orders")
    parser.add_argument("--physics", default="ideal", choices=["ideal", "bullet"])
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--steps", type=int, default=4096, help="environment steps per iteration")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--save", type=Path, help="file for the actor's weights")
    given = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(given.seed)
    mappo = Mappo(make_env(given.cell, graph=given.graph, physics=given.physics, seed=given.seed), steps=given.steps)
    for iteration in range(given.iterations):
        figures = mappo.iterate()
        print(iteration + 1, "  ".join(f"{name} {value:.4g}" for name, value in figures.items()), flush=True)
    mappo.collector.shutdown()
    if given.save:
        torch.save(mappo.policy.state_dict(), given.save)


if __name__ == "__main__":
    main()
