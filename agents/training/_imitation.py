"""What an agent learns from a teacher's decisions before it learns by itself: actor and critic of a graph policy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch

from armtempo.agents.policies import NODE_NUMBERS
from armtempo.configs import ImitationConfig
from armtempo.envs import GRAPH_ARMS, NODE_PLACES

AT_REST = NODE_PLACES["at_rest"]
RESTING_COUNTS_MORE = 3.0  # arms that move go on: it is those at rest that have to choose


def imitate(
    model: Any, shown: Any, config: ImitationConfig, seed: int, on_pass: Callable[[int, float], None] | None = None
) -> float:
    """Fit the actor to the teacher's actions, and the critic to what became of them; the last mean error of actions.

    Args:
        model: A PPO model with a ``GraphPolicy``.
        shown: ``rows`` (D, n), ``actions`` (D, arms), 0 where nobody acts, and ``returns`` (D,).
        config: How often, how fast.
        seed: Of the order in which it goes through them.
        on_pass: Called with the number of each pass, from 1, and its mean error.
    """
    policy, generator = model.policy, torch.Generator().manual_seed(seed)
    rows, wanted, returns = (torch.as_tensor(part) for part in (shown.rows, shown.actions, shown.returns))
    nodes = rows[:, :NODE_NUMBERS].reshape(len(rows), GRAPH_ARMS, -1)
    acts = (wanted != 0.0).to(wanted.dtype) * (1.0 + RESTING_COUNTS_MORE * nodes[..., AT_REST])
    optimizer = torch.optim.Adam(policy.parameters(), lr=config.learning_rate)
    error = 0.0
    for number in range(1, config.passes + 1):
        order, total = torch.randperm(len(rows), generator=generator), 0.0
        for group in optimizer.param_groups:  # down to a tenth, evenly
            group["lr"] = config.learning_rate * (1.0 - 0.9 * (number - 1) / max(config.passes - 1, 1))
        for batch in torch.split(order, config.batch_size):
            given = policy.get_distribution(rows[batch]).distribution.mean
            given = given.reshape(len(batch), wanted.shape[1], -1)[..., 0]
            missed = ((given - wanted[batch]) ** 2 * acts[batch]).sum() / acts[batch].sum().clamp(min=1.0)
            valued = torch.nn.functional.mse_loss(policy.predict_values(rows[batch])[:, 0], returns[batch])
            optimizer.zero_grad()
            (missed + valued).backward()
            optimizer.step()
            total += float(missed.detach()) * len(batch)
        error = total / len(rows)
        if on_pass is not None:
            on_pass(number, error)
    return error
