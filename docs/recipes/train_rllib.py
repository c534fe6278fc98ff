"""Train all arms of a cell with one shared policy, on one machine or on a Ray cluster.

    pip install "armtempo[rllib]"      # in an environment of its own: RLlib pins Gymnasium
    python docs/recipes/train_rllib.py --workers 2 --iterations 100
    python docs/recipes/train_rllib.py --address auto    # on the cluster that this machine belongs to
    python docs/recipes/train_rllib.py --graph --cell planar-four    # any number of arms; a search decides the orders

PPO on RLlib's new API stack. ``--checkpoint DIR`` keeps the last state; ``--resume DIR`` goes on from there. On a
cluster armtempo must be installed on every machine, and DIR be a folder that all of them see.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import ray
import torch
from ray.rllib.algorithms.ppo import PPO, PPOConfig
from ray.rllib.core.columns import Columns
from ray.rllib.core.rl_module.apis import ValueFunctionAPI
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.core.rl_module.torch import TorchRLModule
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

from armtempo.agents import GraphNetwork
from armtempo.envs import coordination_v0

POLICY = "every-arm"
GRAPH_OPTIONS = {"observation": "graph", "orders": "search+stop", "shield": True}


class ArmsEnv(ParallelPettingZooEnv):  # type: ignore[misc]  # untyped library
    """Over when no arm is left, also when one of them arrives in the very step in which the others run out of time."""

    def step(self, action_dict: dict[str, Any]) -> tuple[dict[str, Any], ...]:
        """One control period."""
        observations, rewards, terminated, truncated, infos = super().step(action_dict)
        over = not self.par_env.agents
        cut = over and any(value for agent, value in truncated.items() if agent != "__all__")
        terminated["__all__"], truncated["__all__"] = over and not cut, cut
        return observations, rewards, terminated, truncated, infos


class GraphModule(TorchRLModule, ValueFunctionAPI):  # type: ignore[misc]  # untyped library
    """Actor and critic over all arms and pairs of arms; each arm takes the row that is its own."""

    def setup(self) -> None:
        """Make the networks."""
        super().setup()
        self.size = self.action_space.shape[0]
        self.actor, self.critic = GraphNetwork((48, 48), self.size), GraphNetwork((48, 48), 1)
        self.log_std = torch.nn.Parameter(torch.full((self.size,), -1.0))

    def _forward(self, batch: dict[str, Any], **_: Any) -> dict[str, Any]:
        mean = own_row(self.actor, batch[Columns.OBS])
        return {Columns.ACTION_DIST_INPUTS: torch.cat([mean, self.log_std.expand_as(mean)], dim=-1)}

    def compute_values(self, batch: dict[str, Any], embeddings: Any = None) -> torch.Tensor:
        """(B,)."""
        return own_row(self.critic, batch[Columns.OBS]).squeeze(-1)


def own_row(network: GraphNetwork, seen: dict[str, torch.Tensor]) -> torch.Tensor:
    """(B, out): what the network gives for the arm that sees the graph."""
    return (network(seen["nodes"], seen["edges"]) * seen["own"].unsqueeze(-1)).sum(dim=1)


def make_config(
    cell: str = "lee1991",
    *,
    graph: bool = False,
    workers: int = 2,
    steps: int = 8192,
    physics: str = "ideal",
    seed: int = 0,
) -> PPOConfig:
    """PPO for all arms of ``cell``; ``steps``: those of the environment in an iteration, over all workers."""
    options = GRAPH_OPTIONS if graph else {}
    register_env("coordination", lambda _: ArmsEnv(coordination_v0.parallel_env(cell, physics=physics, **options)))
    plain = DefaultModelConfig(fcnet_hiddens=[64, 64], fcnet_activation="tanh")
    return (
        PPOConfig()
        .environment("coordination")
        .env_runners(num_env_runners=workers)
        .learners(num_learners=0)  # in this process: the networks are small
        .training(
            lr=3e-4,
            gamma=1.0,  # the sum of rewards is what counts, and episodes are short
            lambda_=0.95,
            train_batch_size_per_learner=steps,
            minibatch_size=512,
            num_epochs=10,
            entropy_coeff=0.0,
            use_kl_loss=False,
            clip_param=0.2,
            vf_clip_param=float("inf"),
        )
        .rl_module(
            model_config=plain,  # of which GraphModule takes nothing
            rl_module_spec=RLModuleSpec(module_class=GraphModule) if graph else None,
        )
        .multi_agent(policies={POLICY}, policy_mapping_fn=lambda agent, episode, **_: POLICY)
        .debugging(seed=seed)
    )


def train(algorithm: PPO, iterations: int) -> list[dict[str, float]]:
    """So many iterations; the figures of each."""
    rows = []
    for _ in range(iterations):
        result = algorithm.train()
        runners = result["env_runners"]
        rows.append(
            {
                "iteration": result["training_iteration"],
                "env_steps": result["num_env_steps_sampled_lifetime"],
                "return_mean": runners.get("episode_return_mean", float("nan")),  # sum over the arms
                "episode_steps_mean": runners.get("episode_len_mean", float("nan")),
                "workers": algorithm.env_runner_group.num_healthy_remote_workers(),
            }
        )
        print("  ".join(f"{name} {value:.4g}" for name, value in rows[-1].items()), flush=True)
    return rows


def main() -> None:
    """Read the command line and train."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cell", default="lee1991", help="bundled cell or cell file")
    parser.add_argument("--graph", action="store_true", help="arms see all arms and pairs; a search decides the orders")
    parser.add_argument("--physics", default="ideal", choices=["ideal", "bullet"])
    parser.add_argument("--workers", type=int, default=2, help="processes that run environments")
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--steps", type=int, default=8192, help="environment steps per iteration, over all workers")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--address", help="of a Ray cluster, or auto; without it Ray starts on this machine")
    parser.add_argument("--checkpoint", type=Path, help="folder for the last state")
    parser.add_argument("--resume", type=Path, help="folder of a state to go on from; only one that you trust")
    given = parser.parse_args()
    if given.address:
        ray.init(address=given.address)
    else:
        ray.init(num_cpus=given.workers + 1, include_dashboard=False)
    config = make_config(
        given.cell, graph=given.graph, workers=given.workers, steps=given.steps, physics=given.physics, seed=given.seed
    )
    algorithm = config.build_algo()
    if given.resume:
        algorithm.restore_from_path(str(given.resume.resolve()))
    try:
        train(algorithm, given.iterations)
        if given.checkpoint:
            algorithm.save_to_path(str(given.checkpoint.resolve()))
    finally:
        algorithm.stop()
        ray.shutdown()


if __name__ == "__main__":
    main()
