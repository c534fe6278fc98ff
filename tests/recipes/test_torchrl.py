"""The TorchRL recipe: one iteration of MAPPO, and what a finished arm counts for; ``make torchrl`` runs this."""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType

import pytest

pytest.importorskip("torchrl", reason="TorchRL has an environment of its own: make torchrl")
pytestmark = pytest.mark.filterwarnings("default")  # TorchRL's own affairs

RECIPE = Path(__file__).parents[2] / "docs" / "recipes" / "train_torchrl.py"


@pytest.fixture(scope="module")
def recipe() -> ModuleType:
    spec = importlib.util.spec_from_file_location("train_torchrl", RECIPE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["train_torchrl"] = module
    spec.loader.exec_module(module)
    return module


def test_an_episode_goes_on_after_the_first_arrival(recipe: ModuleType) -> None:
    import torch

    env = recipe.make_env()
    data = env.reset(seed=0)
    alone = 0  # steps after the first arm has arrived
    for step in range(200):
        action = torch.ones(2, 1)
        if step < 12:
            action[1] = -1.0  # the second arm lets the first one pass
        data["arms", "action"] = action
        outcome = env.step(data)
        over = bool(outcome["next", "done"])
        moving = outcome["next", "arms", "mask"]
        alone += not over and not bool(moving[0]) and bool(moving[1])
        assert over == (not moving.any())
        if over:
            break
        data = outcome["next"].exclude("reward")
    assert over
    assert alone >= 5
    assert torch.isclose(outcome["next", "arms", "episode_reward"], torch.tensor(0.0), atol=1.0).all()  # no collision
    env.close()


@pytest.mark.parametrize(("cell", "graph"), [("lee1991", False), ("planar-four", True)])
def test_one_iteration_changes_actor_and_critic(recipe: ModuleType, cell: str, graph: bool) -> None:
    import torch

    torch.manual_seed(0)
    torch.set_num_threads(1)
    mappo = recipe.Mappo(recipe.make_env(cell, graph=graph), steps=512)
    before = [value.detach().clone() for value in mappo.loss.parameters()]
    figures = mappo.iterate(epochs=2)
    mappo.collector.shutdown()
    assert figures["env_steps"] == 512
    assert figures["episodes"] > 0
    assert math.isfinite(figures["return_mean"])
    changed = [bool((old != new).any()) for old, new in zip(before, mappo.loss.parameters(), strict=True)]
    assert all(changed)
