"""Every plan of the benchmark set's planar cells, executed: on time, and with the first arm late."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from armtempo.agents import make_policy, run_episode
from armtempo.envs import CoordinationEnv
from armtempo.errors import InfeasibleError
from armtempo.planners import benchmark_instances, schedule

METHODS = ("delay", "offset", "interval", "optimal", "vci")


@pytest.mark.parametrize("split", ["test", "validation", "train"])
def test_no_execution_violates_or_sticks(split: str, capsys: pytest.CaptureFixture[str]) -> None:
    episodes: Counter[str] = Counter()
    wrong = []
    for instance in benchmark_instances(split, family="planar"):
        if instance.labels.status != "feasible":
            continue
        cell = instance.build()
        for method in METHODS:
            try:
                plan = schedule(cell, method)
            except InfeasibleError:
                continue  # counted by what is printed
            for late in (0.0, 0.03, 0.1):
                env = CoordinationEnv(cell, physics="ideal", master_late_s=late, record=True)
                trace, _ = run_episode(env, make_policy(method, cell, plan))
                env.close()
                episodes[method] += 1
                if trace.violations or not np.isfinite(trace.makespan):
                    wrong.append((cell.name, method, late))
    with capsys.disabled():
        print(f"\n{split}: episodes {dict(episodes)}, wrong: {wrong or 'none'}")  # noqa: T201
    assert min(episodes[method] for method in METHODS) >= 6
    assert not wrong
