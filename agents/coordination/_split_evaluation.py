"""Policies compared over many cells: on-line ones against the best classical one of each cell, under one shield."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from armtempo.agents.coordination._baselines import FULL_SPEED, make_policy
from armtempo.agents.coordination._kind import ONLINE, CoordinationRunner, clairvoyant_makespans
from armtempo.agents.coordination._result import safe_makespan
from armtempo.agents.evaluation import Interval, ratio_interval, run_episodes
from armtempo.agents.policies import Actions, Observations, Policy, is_agent_name, learned_policy
from armtempo.envs import CoordinationEnv, Physics
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
    """

    cell: str
    priority_class: str
    arms: int
    makespans_s: dict[str, Times]
    violations: dict[str, int]
    clairvoyant_s: tuple[float, ...] | None

    @property
    def best_online(self) -> str | None:
        """The classical on-line policy with the smallest mean makespan of those that finished every episode."""
        means = [(float(np.mean(times)), name) for name, times in self._finished() if name in ONLINE]
        return min(means)[1] if means else None

    def record(self) -> dict[str, Any]:
        """As JSON can hold it, units in the keys."""
        return {
            "cell": self.cell,
            "class": self.priority_class,
            "arms": self.arms,
            "best_online": self.best_online,
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
        )

    def _finished(self) -> list[tuple[str, list[float]]]:
        found = []
        for name, times in self.makespans_s.items():
            there = [time for time in times if time is not None]
            if len(there) == len(times):
                found.append((name, there))
        return found


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

    def pairs(self, name: str, against: str) -> list[tuple[float, float]]:
        """Makespans of a policy and of another (``best_online``, ``clairvoyant``, or a policy), episode by episode.

        From cells where both are there; episodes that the first did not finish are left out.
        """
        found = []
        for one in self.cells:
            other: Sequence[float | None] | None
            if against == "clairvoyant":
                other = one.clairvoyant_s
            else:
                key = one.best_online if against == "best_online" else against
                other = None if key is None else one.makespans_s.get(key)
            own = one.makespans_s.get(name)
            if own is not None and other is not None:
                found += [(a, b) for a, b in zip(own, other, strict=True) if a is not None and b is not None]
        return found

    def ratio(self, name: str, against: str) -> tuple[float, Interval] | None:
        """Mean makespan over the mean of the other's, with its 95 % bootstrap interval; None without such episodes."""
        pairs = self.pairs(name, against)
        if not pairs:
            return None
        own, other = np.array(pairs).T
        return float(own.mean() / other.mean()), ratio_interval(own, other, self.seed)

    def figures(self, name: str) -> dict[str, Any]:
        """A policy's row: cells with a plan, episodes, those finished, violations, mean makespan, ratios."""
        there = [one for one in self.cells if name in one.makespans_s]
        times = [time for one in there for time in one.makespans_s[name]]
        done = [time for time in times if time is not None]
        ratios = {f"ratio_to_{key}": self.ratio(name, what) for key, what in AGAINST.items()}
        return {
            "cells": len(there),
            "episodes": len(times),
            "finished": len(done),
            "violations": sum(one.violations[name] for one in there),
            "makespan_s": float(np.mean(done)) if done else None,
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
        policies: Out of ``SPLIT_POLICIES``, or learned agents (``ppo:NAME``, ``ppo:FILE.npz``). Those that plan by
            priority get the order of the arms with the better plan.
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
    compared = []
    for cell in cells:
        env = CoordinationEnv(cell, physics=physics, shield=True, disturbance=disturbance, record=True)
        try:
            compared.append(_compare(env, policies, episodes, seed))
        finally:
            env.close()
        if on_cell is not None:
            on_cell(cell.name)
    return SplitComparison(cells=tuple(compared), seed=seed)


def _compare(env: CoordinationEnv, policies: Sequence[str], episodes: int, seed: int) -> CellComparison:
    cell = env.cell
    makespans: dict[str, Times] = {}
    violations: dict[str, int] = {}
    for name in policies:
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
        clairvoyant_s=_known(env, episodes, seed),
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
