"""Execution of schedules by precedence: from where all arms are to one command for each."""

from __future__ import annotations

from functools import cache
from typing import Protocol, final

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import BrakingGuard, Precedence
from armtempo.planners.schedules._schedule import Schedule
from armtempo.planners.topp import Mode
from armtempo.planners.topp.kernels import STATION, advance
from armtempo.robots import njit
from armtempo.state import Stateful

PLACE_ROUNDING_SHARE = 1e-6  # of a path: places are known to this (observations are float32)
CATCH_UP_PERIODS = 0.5  # of a period: an arm that lags more than this stops its clock
LONGEST_CHECK = 0.001  # [s] limits are asked at least about this often
COMMAND_BISECTIONS = 30


class Execution(Protocol):
    """Decides for all arms of a cell from where they are.

    One that obeys a ``Precedence`` has it as an attribute ``precedence``: so the shield knows whom its arms wait for.
    """

    def reset(self) -> None:
        """Forget the last episode."""
        ...

    def commands(self, lam: Floats, mu: Floats) -> Floats:
        """(A,) commands in [0, 1] for one control period, from places and path speeds (A,)."""
        ...


def checks_per_period(cell: CoordinationCell) -> int:
    """How often per control period limits are asked: whole parts of its ticks."""
    return cell.ticks_per_period * max(round(cell.physics_tick / LONGEST_CHECK), 1)


@njit
def foresee(
    steps: Floats, lam: float, mu: float, command: float, by_speed: bool, tick: float, ticks: int
) -> tuple[float, float, float]:
    """Place and speed after ``ticks`` under one command, as in the environments, and the time used until arrival."""
    none = np.empty(0)
    lam, mu, used = advance(steps, lam, mu, command, by_speed, tick, ticks, none, none, 1.0)
    return lam, mu, used


@njit
def _command_to(
    steps: Floats,
    lam: float,
    mu: float,
    by_speed: bool,
    tick: float,
    ticks: int,
    target: float,
    earliest: float,
    near: float,
) -> float:
    """The largest command that leads neither past ``target`` nor to the end before ``earliest`` [s] have passed."""
    reached, _, used = foresee(steps, lam, mu, 1.0, by_speed, tick, ticks)
    if reached <= target and (reached < steps[-1, STATION] or used >= earliest):
        return 1.0
    if mu <= 0.0 and target <= lam + 2.0 * near:
        return 0.0
    low, high = 0.0, 1.0
    for _ in range(COMMAND_BISECTIONS):
        middle = 0.5 * (low + high)
        reached, _, used = foresee(steps, lam, mu, middle, by_speed, tick, ticks)
        if reached <= target and (reached < steps[-1, STATION] or used >= earliest):
            low = middle
        else:
            high = middle
    return low


@final
class ScheduleExecution(Stateful):
    """Executes any schedule by precedence: mixed passing orders, any number of arms.

    Every arm has a clock of its own on which it follows its planned motion. It does not run ahead of an arm that has
    still to pass somewhere first: an arm is released by where the others *are*. The clock of an arm that waits for
    nobody runs on through small lags, so that they are caught up, and waits for its arm when that is held up.

    Every command is cut back until its arm could still brake behind its limits (see ``Precedence``) while the others
    brake as hard as they can. Arms that are late, slow, or stop and go cost time; they cause neither a collision nor a
    deadlock.

    Raises:
        InfeasibleError: The schedule leads arms through cells of their charts that are not free.
    """

    changing = ("_clock",)

    def __init__(self, plan: Schedule, mode: Mode = "speed") -> None:
        cell = plan.cell
        self.plan = plan
        self.mode: Mode = mode
        self.precedence = plan.precedence
        self._period, self._ticks, self._tick = cell.control_period, cell.ticks_per_period, cell.physics_tick
        self._guard = BrakingGuard(cell.planes, self.precedence, self._period, mode, checks_per_period(cell))
        limits = self.precedence.limits
        self._led = [any(i == k and np.isfinite(limits[k, j]).any() for k, j in limits) for i in range(len(cell.arms))]
        self._near = [PLACE_ROUNDING_SHARE * plane.length for plane in cell.planes]
        self.reset()

    def reset(self) -> None:
        """Set the clocks of the plan back."""
        self._clock: list[float] | None = None

    def commands(self, lam: Floats, mu: Floats) -> Floats:
        """For every arm the largest command that leads it to, not past, its planned place at the end of the period."""
        clock = self._clocks(lam)
        planes = self.plan.cell.planes
        braking = cache(lambda j: self._guard.braking(j, float(lam[j]), float(mu[j])))
        out = np.ones(len(planes))
        for i, (plane, motion) in enumerate(zip(planes, self.plan.trajectories, strict=True)):
            if lam[i] >= plane.length:
                continue
            target = float(motion.at(clock[i] + self._period)[0]) + self._near[i]
            earliest = motion.duration - clock[i] - 1e-6 * motion.duration
            command = _command_to(
                plane.edges.steps, lam[i], mu[i], self.mode == "speed", self._tick, self._ticks, target, earliest,
                self._near[i],
            )  # fmt: skip
            out[i] = self._guard.guarded(i, command, float(lam[i]), float(mu[i]), braking)
        return out

    def _clocks(self, lam: Floats) -> list[float]:
        """The instants of the plan that the arms are to be at now."""
        motions = self.plan.trajectories
        ahead = [0.0] * len(motions) if self._clock is None else [clock + self._period for clock in self._clock]
        # When the plan has an arm where it is; where it dwells, the end of that.
        planned = [
            min(float(motion.time_at(min(float(lam[i]) + self._near[i], motion.lam[-1]))), motion.duration)
            for i, motion in enumerate(motions)
        ]
        own = [min(ahead[i], planned[i] + CATCH_UP_PERIODS * self._period) for i in range(len(motions))]
        waits = [self.precedence.waits_for(i, lam) for i in range(len(motions))]
        # In a ring of arms that wait for each other small lags are not passed on: they would go round and grow.
        seen = [
            [own[j] if i in _reachable(j, waits) else min(own[j], planned[j]) for j in waits[i]]
            for i in range(len(motions))
        ]
        # Who goes second somewhere was held up by others, and catches up; who never does stays on its own clock.
        self._clock = [min([ahead[i] if self._led[i] else own[i], *seen[i]]) for i in range(len(motions))]
        return self._clock


@final
class PrecedenceExecution:
    """Every arm at full speed, as far as a precedence lets it go: without a plan, from wherever the arms are.

    Commands are cut back as those of a ``ScheduleExecution``.

    Args:
        cell: Where.
        precedence: Who passes first, and leads on.
        mode: What a command in [0, 1] means.
    """

    def __init__(self, cell: CoordinationCell, precedence: Precedence, mode: Mode = "speed") -> None:
        self.precedence = precedence
        self._guard = BrakingGuard(cell.planes, precedence, cell.control_period, mode, checks_per_period(cell))

    def reset(self) -> None:
        """Nothing to forget."""

    def commands(self, lam: Floats, mu: Floats) -> Floats:
        """(A,) the largest commands with which all arms can still brake behind their limits."""
        guard = self._guard
        braking = cache(lambda j: guard.braking(j, float(lam[j]), float(mu[j])))
        return np.array([guard.guarded(i, 1.0, float(lam[i]), float(mu[i]), braking) for i in range(len(lam))])


def _reachable(start: int, waits: list[tuple[int, ...]]) -> set[int]:
    """The arms that ``start`` waits for, directly or through others."""
    found: set[int] = set()
    ahead = list(waits[start])
    while ahead:
        j = ahead.pop()
        if j not in found:
            found.add(j)
            ahead += waits[j]
    return found
