"""Policies compared over many cells: on-line ones against the best classical one of each cell, under one shield."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from typing import Any, Self

import numpy as np

from armtempo.agents.coordination._baselines import FULL_SPEED, make_policy
from armtempo.agents.coordination._kind import ONLINE, CoordinationRunner, clairvoyant_makespans, limit_of, quickest
from armtempo.agents.coordination._result import safe_makespan
from armtempo.agents.evaluation import Interval, keywords_of, ratio_interval, run_episodes
from armtempo.agents.policies import Actions, Observations, Policy, is_agent_name, learned_policy, options_of_agent
from armtempo.arrays import Floats
from armtempo.envs import CoordinationEnv, CoordinationOptions, Physics
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.planners import METHODS, CoordinationCell, schedule

OPTIMAL = "optimal"
SPLIT_POLICIES = (*ONLINE, OPTIMAL)
"""Classical on-line policies; the plan that knew the undisturbed cell."""
AGAINST = {"best_online": "best_online", "full_speed": FULL_SPEED, "clairvoyant": "clairvoyant"}
"""What ratios are told to, by their keys in JSON."""
Times = tuple[float | None, ...]


@dataclass(frozen=True, kw_only=True)
class CellComparison:
    """One cell.

    Attributes:
        cell: Its name.
        priority_class: ``uniform``, ``mixed``...
        arms: How many.
        makespans_s: By policy, the makespan of every episode [s]; None where an arm did not arrive or two came too
            close. Policies without a plan here are left out.
        violations: By policy, ticks below ``d_min``.
        clairvoyant_s: Makespans of who knows each disturbance beforehand [s]; undisturbed: of ``optimal`` as planned.
            None where none was found.
        time_limit_s: When episodes are cut off [s]: what was not finished counts so much in means and ratios.
    """

    cell: str
    priority_class: str
    arms: int
    makespans_s: dict[str, Times]
    violations: dict[str, int]
    clairvoyant_s: tuple[float, ...] | None
    time_limit_s: float

    @property
    def best_online(self) -> str | None:
        """The classical on-line policy with the smallest mean makespan of those that finished every episode."""
        return quickest({name: mean for name, mean in self._means().items() if name in ONLINE})

    @property
    def best(self) -> str | None:
        """The policy with the smallest mean makespan of all that finished every episode; classical ones first."""
        return quickest(self._means())

    def mean_of(self, name: str | None) -> float | None:
        """Mean makespan of a policy that finished every episode [s]."""
        return None if name is None else self._means().get(name)

    def counted(self, name: str) -> list[float] | None:
        """The makespans of a policy [s], the time limit where it did not finish; None: it has no plan here."""
        times = self.makespans_s.get(name)
        return None if times is None else [self.time_limit_s if time is None else time for time in times]

    def record(self) -> dict[str, Any]:
        """As JSON can hold it, units in the keys."""
        return {
            "cell": self.cell,
            "class": self.priority_class,
            "arms": self.arms,
            "best_online": self.best_online,
            "best": self.best,
            "time_limit_s": self.time_limit_s,
            "makespans_s": self.makespans_s,
            "violations": self.violations,
            "clairvoyant_s": self.clairvoyant_s,
        }

    @classmethod
    def from_record(cls, record: Mapping[str, Any]) -> Self:
        """Back from ``record``."""
        known = record["clairvoyant_s"]
        return cls(
            cell=record["cell"],
            priority_class=record["class"],
            arms=record["arms"],
            makespans_s={name: tuple(times) for name, times in record["makespans_s"].items()},
            violations=dict(record["violations"]),
            clairvoyant_s=None if known is None else tuple(known),
            time_limit_s=record["time_limit_s"],
        )

    def _means(self) -> dict[str, float]:
        """Of those that finished every episode [s]."""
        times = {name: [time for time in own if time is not None] for name, own in self.makespans_s.items()}
        return {name: float(np.mean(own)) for name, own in times.items() if len(own) == len(self.makespans_s[name])}


@dataclass(frozen=True, kw_only=True)
class SplitComparison:
    """Many cells.

    Attributes:
        cells: One comparison per cell.
        seed: Of the first episode, and of the bootstrap.
    """

    cells: tuple[CellComparison, ...]
    seed: int

    def by_arms(self) -> dict[int, SplitComparison]:
        """The cells of two arms, of three, ..."""
        sizes = sorted({one.arms for one in self.cells})
        return {
            size: SplitComparison(cells=tuple(one for one in self.cells if one.arms == size), seed=self.seed)
            for size in sizes
        }

    def pairs(self, name: str, against: str) -> tuple[Floats, Floats]:
        """Makespans (C, n) [s] of a policy and of another (``best_online``, ``clairvoyant``, or a policy).

        From the C cells where both are there, n episodes of each; what was not finished took until the time limit.
        """
        found = []
        for one in self.cells:
            other: Sequence[float] | None
            if against == "clairvoyant":
                other = one.clairvoyant_s
            else:
                key = one.best_online if against == "best_online" else against
                other = None if key is None else one.counted(key)
            own = one.counted(name)
            if own is not None and other is not None:
                found.append((own, other))
        return np.array([own for own, _ in found]), np.array([other for _, other in found])

    def ratio(self, name: str, against: str) -> tuple[float, Interval] | None:
        """Mean makespan over the mean of the other's, with its 95 % bootstrap interval; None without such episodes.

        Drawn are cells, and then episodes of each.
        """
        own, other = self.pairs(name, against)
        if not own.size or not self._finishes(name) or not self._finishes(against):
            return None
        return float(own.mean() / other.mean()), ratio_interval(own, other, self.seed)

    def _finishes(self, name: str) -> bool:
        """Whether any episode was finished; always where that is not a policy's name."""
        times = [time for one in self.cells for time in one.makespans_s.get(name, ())]
        return not times or any(time is not None for time in times)

    def figures(self, name: str) -> dict[str, Any]:
        """A policy's row: cells with a plan, those where it is best, episodes, those finished or not, mean, ratios."""
        there = [one for one in self.cells if name in one.makespans_s]
        times = [time for one in there for time in one.makespans_s[name]]
        done = sum(time is not None for time in times)
        makespans = [time for one in there for time in one.counted(name) or ()] if done else []
        ratios = {f"ratio_to_{key}": self.ratio(name, what) for key, what in AGAINST.items()}
        return {
            "cells": len(there),
            "best_in_cells": sum(one.best == name for one in there),
            "best_online_in_cells": sum(one.best_online == name for one in there),
            "episodes": len(times),
            "finished": done,
            "unfinished": len(times) - done,
            "violations": sum(one.violations[name] for one in there),
            "makespan_s": float(np.mean(makespans)) if makespans else None,
            **ratios,
        }


def compare_on(
    cells: Iterable[CoordinationCell],
    policies: Sequence[str],
    *,
    episodes: int = 1,
    seed: int = 0,
    disturbance: str | None = None,
    physics: Physics = "ideal",
    on_cell: Callable[[str], None] | None = None,
) -> SplitComparison:
    """Run policies in many cells, all of them under the shield, with the same disturbances.

    Args:
        cells: Where.
        policies: Out of ``SPLIT_POLICIES``, or learned agents (``ppo:FILE.npz``). Those that plan by
            priority get the order of the arms with the better plan. Agents act in the form that they were trained with
            (``action="speed+priority"``, say), beside the others.
        episodes: Per cell and policy; without a disturbance one says it all.
        seed: Of the first episode.
        disturbance: By name, see ``DISTURBANCES``.
        physics: ``ideal`` or ``bullet``.
        on_cell: Called with the name of each cell when it is done.

    Raises:
        UnknownNameError: No such policy.
        InputError: Less than one episode.
    """
    for name in policies:
        if name not in SPLIT_POLICIES and not is_agent_name(name):
            raise UnknownNameError("policy", name, SPLIT_POLICIES)
    if episodes < 1:
        raise InputError(f"episodes must be at least 1, got {episodes}")
    usual = CoordinationOptions(physics=physics, shield=True, disturbance=disturbance)
    compared = []
    for cell in cells:
        with ExitStack() as opened:

            def env_of(
                options: CoordinationOptions, cell: CoordinationCell = cell, opened: ExitStack = opened
            ) -> CoordinationEnv:
                env = CoordinationEnv(cell, record=True, **keywords_of(options))
                opened.callback(env.close)
                return env

            compared.append(_compare(cache(env_of), usual, policies, episodes, seed))
        if on_cell is not None:
            on_cell(cell.name)
    return SplitComparison(cells=tuple(compared), seed=seed)


def _compare(
    env_of: Callable[[CoordinationOptions], CoordinationEnv],
    usual: CoordinationOptions,
    policies: Sequence[str],
    episodes: int,
    seed: int,
) -> CellComparison:
    """``env_of``: the environment of the cell with these options."""
    cell = env_of(usual).cell
    makespans: dict[str, Times] = {}
    violations: dict[str, int] = {}
    for name in policies:
        env = env_of(options_of_agent(name, usual) if is_agent_name(name) else usual)
        policy = _policy(name, env)
        if policy is None:
            continue
        runs = run_episodes(CoordinationRunner(env=env, policy=policy), name, episodes, seed)
        violations[name] = sum(run.trace.violations for run in runs)
        makespans[name] = tuple(safe_makespan(run.trace) for run in runs)
    return CellComparison(
        cell=cell.name,
        priority_class=cell.priority_class,
        arms=len(cell.arms),
        makespans_s=makespans,
        violations=violations,
        clairvoyant_s=_known(env_of(usual), episodes, seed),
        time_limit_s=limit_of(cell, usual),
    )


def _policy(name: str, env: CoordinationEnv) -> Policy[Observations, Actions] | None:
    """A policy for a cell; None where it has no plan."""
    if is_agent_name(name):
        return learned_policy(name, env)
    try:
        plan = schedule(env.cell, name, order="best") if name in METHODS else None
    except InfeasibleError:
        return None
    return make_policy(name, env.cell, plan)


def _known(env: CoordinationEnv, episodes: int, seed: int) -> tuple[float, ...] | None:
    """Makespans of who knows what will happen; the first arm, where it alone is disturbed, does not yield."""
    if env.options.disturbance is not None:
        return clairvoyant_makespans(env, episodes, seed) if env.options.first_alone else None
    try:
        return (schedule(env.cell, OPTIMAL).makespan,) * episodes
    except InfeasibleError:
        return None
