"""Baseline policies: the planners of the field, acting through the same door as learned agents.

``phase-plane``  every arm runs its path in minimum time, whatever the others do
``vci``          velocity control intervals (Lee1991 section 2.4), on line: planned anew whenever something else is seen
than was expected
``random``       uniform actions
and the schedules (``sequential``, ``constant-speed``, ``constant-acceleration``, ``delay``, ``offset``, ``interval``,
``optimal``), executed by precedence: whoever goes second somewhere is released by how far the first *is*, not by the
clock. So is a plan of ``vci`` in which somebody passes first out of turn. Under a shield, besides, those that decide
who passes first on the way (see ``_order_policies``).

What an agent sees tells where its own arm is, so in ``CoordinationEnv`` the observations of all agents are enough. Who
acts for some agents only takes the other arm of a cell of two from their entries for it; of more arms the entries do
not tell which is which, and their places are taken from the environment's simulation.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import final

import numpy as np

from armtempo.agents.coordination._order_policies import ORDER_POLICIES, OrderPolicy
from armtempo.agents.policies import Actions, Observations, Policy, RandomPolicy, action_size, to_action
from armtempo.arrays import Floats
from armtempo.envs import OTHER, OWN, CoordinationEnv, EpisodeShield, share
from armtempo.errors import InfeasibleError, UnknownNameError
from armtempo.planners import METHODS, CoordinationCell, Execution, Precedence, Schedule, execution_of, schedule
from armtempo.planners.schedules import PrecedenceExecution
from armtempo.planners.topp import Mode

_OWN = {entry.name: k for k, entry in enumerate(OWN)}
_OTHER = {entry.name: len(OWN) + k for k, entry in enumerate(OTHER)}


def _position(cell: CoordinationCell, arm: int, progress: float, speed: float) -> tuple[float, float]:
    """``lam`` and ``mu`` of an arm from its entries of an observation."""
    plane = cell.planes[arm]
    lam = share(progress) * plane.length
    return lam, share(speed) * plane.edge_speed(lam)


def _states(observations: Observations, env: CoordinationEnv) -> tuple[Floats, Floats]:
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


@final
class PhasePlanePolicy:
    """Every arm in minimum time (Lee1991 section 2.2): the master's policy. For all arms at once it collides."""

    def reset(self, seed: int | None = None) -> None:
        """Nothing to forget."""

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """Full speed."""
        return {agent: to_action(1.0, action_size(env, agent)) for agent in observations}


def _under(shield: EpisodeShield, execution: Execution, env: CoordinationEnv, lam: Floats) -> Execution:
    """An execution that goes on within the order that a shield keeps when it is handed the execution's own.

    Where the one would make arms wait that the other lets pass, and the other way round, they would wait for ever:
    then what was planned is given up, and every arm goes as far as the shield's order lets it.
    """
    own = getattr(execution, "precedence", None)
    if not isinstance(own, Precedence):
        return execution
    shield.ask(own)
    kept = shield.precedence
    try:
        own.together(kept).check_deadlock_free(lam)
    except InfeasibleError:
        return PrecedenceExecution(env.cell, kept, env.options.mode)
    return execution


@final
class ExecutionPolicy:
    """Acts by an execution of the planners, made anew where the meaning of a command changes.

    Under a shield (``env.shield``) it hands over who passes first in it, and keeps to what the shield makes of that.

    Args:
        make: Gives it for a mode: ``partial(execution_of, plan)``, ``partial(VciExecution, cell)``.
    """

    def __init__(self, make: Callable[[Mode], Execution]) -> None:
        self._make = make
        self._mode: Mode | None = None

    def reset(self, seed: int | None = None) -> None:
        """Forget the episode."""
        self._mode = None

    def act(self, observations: Observations, env: CoordinationEnv) -> Actions:
        """The execution's commands, for those who act."""
        lam, mu = _states(observations, env)
        if self._mode != env.options.mode:
            self._execution, self._mode = self._make(env.options.mode), env.options.mode
            shield = getattr(env, "shield", None)
            if shield is not None:
                self._execution = _under(shield, self._execution, env, lam)
        commands = self._execution.commands(lam, mu)
        return {
            agent: to_action(float(commands[int(agent.rsplit("_", 1)[1])]), action_size(env, agent))
            for agent in observations
        }


FULL_SPEED = "phase-plane"
COORDINATION_POLICIES = (FULL_SPEED, *METHODS, *ORDER_POLICIES, "random")


def make_policy(name: str, cell: CoordinationCell, plan: Schedule | None = None) -> Policy[Observations, Actions]:
    """A baseline by name.

    Args:
        name: One of ``COORDINATION_POLICIES``.
        cell: What it acts in.
        plan: Its schedule, where it is known already.

    Raises:
        UnknownNameError: No such policy.
        InfeasibleError: Its schedule does not exist in this cell.
    """
    if name == FULL_SPEED:
        return PhasePlanePolicy()
    if name == "random":
        return RandomPolicy()
    if name in ORDER_POLICIES:
        return OrderPolicy(name, cell)
    if name in METHODS:
        plan = plan if plan is not None else schedule(cell, name)
        return ExecutionPolicy(partial(execution_of, plan))
    raise UnknownNameError("policy", name, COORDINATION_POLICIES)
