"""Baseline policies: the planners of the field, acting through the same door as learned agents.

``phase-plane``  every arm runs its path in minimum time, whatever the others do
``vci``          velocity control intervals (Lee1991 section 2.4), on line: planned anew whenever something else is seen
than was expected
``random``       uniform actions
and the schedules (``sequential``, ``constant-speed``, ``constant-acceleration``, ``delay``, ``offset``, ``interval``,
``optimal``), executed by precedence: whoever goes second somewhere is released by how far the first *is*, not by the
clock. So is a plan of ``vci`` in which somebody passes first out of turn.

What an agent sees tells where its own arm is, so in ``CoordinationEnv`` the observations of all agents are enough. Who
acts for some agents only takes the other arm of a cell of two from their entries for it; of more arms the entries do
not tell which is which, and their places are taken from the environment's simulation.
"""

from __future__ import annotations

from itertools import combinations
from typing import final

import numpy as np
from numpy.typing import NDArray

from armtempo.agents._policy import Actions, Observations, Policy, to_action
from armtempo.envs import OTHER, OWN, CoordinationEnv, share
from armtempo.errors import UnknownNameError
from armtempo.planners import METHODS, Cell, Execution, Schedule, ScheduleExecution, VciExecution, precedence, schedule

_OWN = {entry.name: k for k, entry in enumerate(OWN)}
_OTHER = {entry.name: len(OWN) + k for k, entry in enumerate(OTHER)}


def _position(cell: Cell, arm: int, progress: float, speed: float) -> tuple[float, float]:
    """``lam`` and ``mu`` of an arm from its entries of an observation."""
    plane = cell.planes[arm]
    lam = share(progress) * plane.length
    return lam, share(speed) * plane.edge_speed(lam)


def _states(observations: Observations, env: CoordinationEnv) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """``lam``, ``mu`` (A,) of all arms as the agents see them; an arm whose agent has left is at its end."""
    cell = env.cell
    lam = np.array([plane.length for plane in cell.planes])
    mu = np.zeros(len(lam))
    seen = {int(agent.rsplit("_", 1)[1]): row for agent, row in observations.items()}
    for arm, row in seen.items():
        lam[arm], mu[arm] = _position(cell, arm, float(row[_OWN["progress"]]), float(row[_OWN["speed"]]))
    for arm in set(range(len(lam))) - set(seen):
        if len(lam) > 2:
            lam[arm], mu[arm] = env.simulation.lam[arm], env.simulation.mu[arm]
        elif seen and seen[1 - arm][_OTHER["present"]] > 0.5:
            row = seen[1 - arm]
            lam[arm], mu[arm] = _position(cell, arm, float(row[_OTHER["progress"]]), float(row[_OTHER["speed"]]))
    return lam, mu


def _act(execution: Execution, observations: Observations, env: CoordinationEnv) -> Actions:
    commands = execution.commands(*_states(observations, env))
    return {agent: to_action(float(commands[int(agent.rsplit("_", 1)[1])])) for agent in observations}


@final
class PhasePlanePolicy:
    """Every arm in minimum time (Lee1991 section 2.2): the master's policy. For all arms at once it collides."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed."""
        return {agent: to_action(1.0) for agent in observations}


@final
class RandomPolicy:
    """Uniform actions."""

    def __init__(self) -> None:
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Start the random numbers again."""
        self._random = np.random.default_rng(seed)

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Draw one action for every agent."""
        return {agent: self._random.uniform(-1.0, 1.0, 1).astype(np.float32) for agent in observations}


@final
class VciPolicy:
    """The first arm in minimum time, the others by velocity control intervals, on line (see ``VciExecution``)."""

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._execution: VciExecution | None = None

    def reset(self, seed: int | None = None) -> None:
        """Forget the plans."""
        if self._execution is not None:
            self._execution.reset()

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed for the first arm; for the others their planned commands, guarded."""
        if self._execution is None or self._execution.mode != env.mode:
            self._execution = VciExecution(self._cell, env.mode)
        return _act(self._execution, observations, env)


@final
class SchedulePolicy:
    """Executes a schedule by precedence (see ``ScheduleExecution``)."""

    def __init__(self, plan: Schedule) -> None:
        self.plan = plan
        self._execution: ScheduleExecution | None = None

    def reset(self, seed: int | None = None) -> None:
        """Set the clocks of the plan back."""
        if self._execution is not None:
            self._execution.reset()

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """For every arm the command that brings it to, not past, its planned place at the end of the period."""
        if self._execution is None or self._execution.mode != env.mode:
            self._execution = ScheduleExecution(self.plan, env.mode)
        return _act(self._execution, observations, env)


POLICIES = ("phase-plane", *METHODS, "random")


def _yields_only(plan: Schedule) -> bool:
    """Whether every arm of a plan of velocity control passes behind those before it.

    Elsewhere velocity control is not safe on line, where nobody waits for an arm that goes first out of its turn: such
    a plan, and one that fell back on another method, is executed by precedence.
    """
    limits = precedence(plan).limits
    ahead = combinations(plan.order, 2)
    return plan.fallback is None and not any(np.isfinite(limits[i, j]).any() for i, j in ahead if (i, j) in limits)


def make_policy(name: str, cell: Cell, plan: Schedule | None = None) -> Policy:
    """A baseline by name.

    Args:
        name: One of ``POLICIES``.
        cell: What it acts in.
        plan: Its schedule, where it is known already.

    Raises:
        UnknownNameError: No such policy.
        InfeasibleError: Its schedule does not exist in this cell.
    """
    if name == "phase-plane":
        return PhasePlanePolicy()
    if name == "random":
        return RandomPolicy()
    if name in METHODS:
        plan = plan if plan is not None else schedule(cell, name)
        return VciPolicy(cell) if name == "vci" and _yields_only(plan) else SchedulePolicy(plan)
    raise UnknownNameError("policy", name, POLICIES)
