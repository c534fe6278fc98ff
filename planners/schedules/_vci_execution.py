"""Velocity control on line: every arm but the first is planned anew whenever it sees what it did not expect."""

from __future__ import annotations

from collections import deque
from functools import cached_property
from itertools import combinations
from typing import final

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import Precedence, VelocityControl
from armtempo.planners.schedules._execution import Execution, ScheduleExecution, checks_per_period, foresee
from armtempo.planners.schedules._schedule import Schedule
from armtempo.planners.topp import Mode
from armtempo.state import Stateful

EXPECTED_WITHIN_SHARE = 1e-4  # of a path: a smaller surprise is no reason to plan anew


@final
class _Slave(Stateful):
    """One arm behind all those of higher priority."""

    changing = ("planned",)

    def __init__(self, cell: CoordinationCell, order: tuple[int, ...], place: int, mode: Mode) -> None:
        self.arm, self.before = order[place], order[:place]
        self.control = VelocityControl(
            slave=cell.planes[self.arm],
            masters=tuple(cell.planes[j] for j in self.before),
            charts=tuple(cell.chart_between(j, self.arm) for j in self.before),
            period=cell.control_period,
            mode=mode,
            checks=checks_per_period(cell),  # whole parts of its ticks
        )
        self.planned: deque[float] = deque()


@final
class VciExecution(Stateful):
    """The first arm in minimum time, the others by velocity control intervals behind all before them, on line.

    Each plans behind the motions that those before it are about to make (the first at full speed, the others by their
    own plans) and keeps to its plan as long as everybody is where it was expected; else it plans anew. Every command
    leaves a way out (see ``VelocityControl.guarded``): masters that are late, slow or stop cost time, never a
    collision; a slave that stands in the way where it starts has no such guarantee (``execution_of`` executes such
    plans by precedence instead).

    Args:
        cell: Where.
        mode: What a command in [0, 1] means.
        order: The arms, the highest priority first; None: as in the cell.
    """

    changing = ("_expected", "_slaves")

    def __init__(self, cell: CoordinationCell, mode: Mode = "speed", order: tuple[int, ...] | None = None) -> None:
        self.cell = cell
        self.mode: Mode = mode
        self.order = tuple(range(len(cell.arms))) if order is None else tuple(order)
        self._slaves = tuple(_Slave(cell, self.order, place, mode) for place in range(1, len(self.order)))
        self.reset()

    @cached_property
    def precedence(self) -> Precedence:
        """The arms before it pass first everywhere."""
        pairs = combinations(range(len(self.order)), 2)
        lengths = [path.length for path in self.cell.paths]
        return Precedence.of_order(lengths, self.order, {pair: self.cell.chart_between(*pair) for pair in pairs})

    def reset(self) -> None:
        """Forget the plans."""
        self._expected = np.full(len(self.order), -1.0)
        for slave in self._slaves:
            slave.planned.clear()

    def commands(self, lam: Floats, mu: Floats) -> Floats:
        """Full speed for the first arm; for the others their planned commands, guarded."""
        cell, lengths = self.cell, np.array([plane.length for plane in self.cell.planes])
        states = [(float(place), float(speed)) for place, speed in zip(lam, mu, strict=True)]
        out = np.ones(len(states))
        if (np.abs(lam - self._expected) > EXPECTED_WITHIN_SHARE * lengths).any():
            self._plan(states)
        for slave in self._slaves:
            i = slave.arm
            if lam[i] < lengths[i]:
                wanted = slave.planned.popleft() if slave.planned else 1.0
                out[i] = slave.control.guarded(wanted, *states[i], [states[j] for j in slave.before])
        for i, plane in enumerate(cell.planes):
            self._expected[i] = foresee(
                plane.edges.steps, *states[i], out[i], self.mode == "speed", cell.physics_tick,
                cell.ticks_per_period,
            )[0]  # fmt: skip
        return out

    def _plan(self, states: list[tuple[float, float]]) -> None:
        first = self.order[0]
        motions = {first: self.cell.planes[first].motion([1.0], [np.inf], *states[first])}
        for slave in self._slaves:
            i = slave.arm
            control = slave.control
            try:
                plan = control.commands([motions[j] for j in slave.before], *states[i])
                commands = np.append(plan, 1.0)
            except InfeasibleError:  # too late to stay behind: brake, and see
                plan, commands = np.zeros(1), np.zeros(1)
            slave.planned = deque(plan.tolist())
            if slave is not self._slaves[-1]:
                times = np.append(np.full(len(commands) - 1, control.period), np.inf)
                motions[i] = control.slave.motion(commands, times, *states[i], mode=self.mode)


def execution_of(plan: Schedule, mode: Mode = "speed") -> Execution:
    """How a schedule is run: velocity control on line, everything else by precedence.

    Velocity control is safe on line only where every arm passes behind those before it, because nobody waits for an
    arm that goes first out of its turn: other plans of it, and those that fell back on another method, are executed by
    precedence like the rest.

    Args:
        plan: The schedule.
        mode: What a command in [0, 1] means: a share of ``mu*`` (``speed``) or of the admissible ``mu_dot``.

    Raises:
        InfeasibleError: The schedule leads arms through cells of their charts that are not free.
    """
    if plan.method == "vci" and plan.fallback is None:
        limits = plan.precedence.limits
        ahead = (limits[pair] for pair in combinations(plan.order, 2) if pair in limits)
        if not any(np.isfinite(limit).any() for limit in ahead):
            return VciExecution(plan.cell, mode, plan.order)
    return ScheduleExecution(plan, mode)
