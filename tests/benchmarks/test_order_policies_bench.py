"""Policies that decide who passes first on the way, on rings where all arms stop and go. ``make bench``.

``ARMTEMPO_BENCH_ORDERS`` is how many feasible rings of each number of arms, and how many episodes in each (3,4).
"""

from __future__ import annotations

import itertools
import os
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from armtempo.agents import Actions, Observations, Policy, make_policy
from armtempo.agents.evaluation import play, ratio_interval
from armtempo.envs import CoordinationEnv
from armtempo.planners import CoordinationCell, generate_cell

CELLS, EPISODES = (int(part) for part in os.environ.get("ARMTEMPO_BENCH_ORDERS", "3,4").split(","))
ARMS = (3, 4, 5, 6)
POLICIES = ("phase-plane", "longest-path", "reorder", "search", "search+stop", "search+hold", "rollout")
SEED = 777  # of the rings; episodes are 1000, 1001, ...


def rings(arms: int) -> list[CoordinationCell]:
    drawn = (generate_cell("ring", SEED, index, arms=arms) for index in itertools.count())
    return [one.cell for one in itertools.islice((d for d in drawn if d.labels.status == "feasible"), CELLS)]


class Timed:
    """A policy, and how long it takes."""

    def __init__(self, policy: Policy[Observations, Actions], spent: list[float]) -> None:
        self.policy, self.spent = policy, spent

    def reset(self, seed: int | None = None) -> None:
        self.policy.reset(seed)

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        began = time.process_time()
        actions = self.policy.act(observations, env)
        self.spent.append(1e3 * (time.process_time() - began))
        return actions


def makespans(cell: CoordinationCell, name: str, spent: dict[str, list[float]]) -> list[float]:
    """Of every episode [s]; the processor time of every action [ms] is added to what was ``spent``."""
    env = CoordinationEnv(cell, physics="ideal", shield=True, disturbance="all-stop-and-go")
    policy, found = make_policy(name, cell), []
    timed = Timed(policy, spent[name])
    for episode in range(EPISODES):
        play(env, timed, 1000 + episode)
        assert not env.simulation.violated
        found.append(float(env.simulation.arrival.max()))
    env.close()
    return found


def test_deciding_on_the_way_is_quicker_than_full_speed() -> None:
    table = Table("arms", "episodes", *POLICIES, title="makespan over that of search+stop, 95 % interval")
    every: dict[str, list[float]] = {name: [] for name in POLICIES}
    spent: dict[str, list[float]] = {name: [] for name in POLICIES}

    def row(label: str, found: dict[str, list[float]]) -> None:
        base = np.array(found["search+stop"]).reshape(-1, EPISODES)  # cells are drawn, and then episodes of each
        cells = []
        for name in POLICIES:
            own = np.array(found[name]).reshape(-1, EPISODES)
            low, high = ratio_interval(own, base, 0)
            cells.append(f"{own.mean() / base.mean():.3f} ({low:.3f}-{high:.3f})")
        table.add_row(label, str(base.size), *cells)

    for arms in ARMS:
        found: dict[str, list[float]] = {name: [] for name in POLICIES}
        for cell in rings(arms):
            for name in POLICIES:
                found[name] += makespans(cell, name, spent)
        row(str(arms), found)
        for name in POLICIES:
            every[name] += found[name]
    row("all", every)
    for words, figure in (("an action, mean", np.mean), ("99th of 100", lambda times: np.percentile(times, 99.0))):
        table.add_row("", words, *(f"{figure(spent[name]):.2f} ms" for name in POLICIES))
    Console(width=140).print(table)
    assert all(np.isfinite(times).all() for times in every.values())  # all arrive
    assert np.mean(every["search+stop"]) < np.mean(every["phase-plane"])
