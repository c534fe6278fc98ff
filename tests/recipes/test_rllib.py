"""The RLlib recipe: one iteration of one shared policy, with two workers; ``make rllib`` runs this."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

pytest.importorskip("ray", reason="RLlib has an environment of its own: make rllib")
pytestmark = pytest.mark.filterwarnings("default")  # RLlib's own affairs

RECIPE = Path(__file__).parents[2] / "docs" / "recipes" / "train_rllib.py"


@pytest.fixture(scope="module")
def recipe() -> ModuleType:
    from ray import cloudpickle

    spec = importlib.util.spec_from_file_location("train_rllib", RECIPE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["train_rllib"] = module
    spec.loader.exec_module(module)
    cloudpickle.register_pickle_by_value(module)  # workers cannot import it, as little as a script's __main__
    return module


@pytest.fixture
def local_ray() -> Iterator[None]:
    import ray

    ray.init(num_cpus=3, include_dashboard=False)
    yield
    ray.shutdown()


def test_over_for_all_when_one_arrives_as_time_runs_out(recipe: ModuleType) -> None:
    """Whatever mixture of arrivals and time-outs ends an episode, RLlib is told that it is over."""
    from armtempo.envs import CoordinationEnv

    env = recipe.ArmsEnv(CoordinationEnv("lee1991", physics="ideal"))
    ones = np.ones(1, dtype=np.float32)
    for crawl in (False, True):  # the second arm stands still: it is cut off long after the first has arrived
        env.reset(seed=0)
        outcomes: list[Any] = []
        while env.par_env.agents:
            actions = {agent: -ones if crawl and agent == "arm_1" else ones for agent in env.par_env.agents}
            outcomes.append(env.step(actions))
            over = outcomes[-1][2]["__all__"] or outcomes[-1][3]["__all__"]
            assert over == (not env.par_env.agents)
        assert outcomes[-1][3]["__all__"] == crawl

    class Mixed:
        agents: tuple[str, ...] = ()

        def step(self, actions: object) -> tuple[dict[str, Any], ...]:
            return {}, {}, {"arm_0": True, "arm_1": False}, {"arm_0": False, "arm_1": True}, {}

    env.par_env = Mixed()
    _, _, terminated, truncated, _ = env.step({})
    assert (terminated["__all__"], truncated["__all__"]) == (False, True)


@pytest.mark.usefixtures("local_ray")
@pytest.mark.parametrize(("cell", "graph"), [("lee1991", False), ("planar-four", True)])
def test_two_workers_train_one_policy_and_go_on(recipe: ModuleType, cell: str, graph: bool, tmp_path: Path) -> None:
    algorithm = recipe.make_config(cell, graph=graph, workers=2, steps=1024).build_algo()
    module = algorithm.get_module(recipe.POLICY)
    before = [value.detach().clone() for value in module.parameters()]
    try:
        rows = recipe.train(algorithm, 1)
        assert rows[0]["workers"] == 2
        assert rows[0]["env_steps"] >= 1024
        assert np.isfinite(rows[0]["return_mean"])
        after = [value.detach().clone() for value in algorithm.get_module(recipe.POLICY).parameters()]
        assert any((old != new).any() for old, new in zip(before, after, strict=True))
        algorithm.save_to_path(str(tmp_path / "state"))
    finally:
        algorithm.stop()
    again = recipe.make_config(cell, graph=graph, workers=0, steps=1024).build_algo()
    try:
        again.restore_from_path(str(tmp_path / "state"))
        kept = list(again.get_module(recipe.POLICY).parameters())
        assert all((old == new).all() for old, new in zip(after, kept, strict=True))
    finally:
        again.stop()
