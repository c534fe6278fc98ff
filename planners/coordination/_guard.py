"""Commands that leave a way out: after one period, maximum braking must stay behind every limit.

A limit is a function of the other arms' places that never falls as they go on. They are assumed to brake as hard as
they can from now on: whatever they do, they are at least as far, so the limits are at least as wide.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.coordination._precedence import Precedence
from armtempo.planners.topp import Mode, PhasePlane
from armtempo.planners.topp.kernels import STATION, advance
from armtempo.robots import njit

LIMIT_MARGIN = 1e-7  # of lambda: how far behind a limit an arm is kept
COMMAND_BISECTIONS = 20


@njit
def step(
    steps: Floats,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Floats,
    at: int,
    scratch: Floats,
) -> tuple[float, float, float, bool]:
    """One step under one command; also the time used and whether it stays behind the limit all the while.

    ``steps``: of the edges of its phase plane. ``limit`` (K,): at the beginning of every check; step ``at`` has those
    from ``at checks`` on. The last one lasts. ``scratch`` (2, checks).
    """
    lam, mu, used = advance(steps, lam, mu, command, by_speed, dt / checks, checks, scratch[0], scratch[1], 1.0)
    safe = True
    for m in range(checks):
        safe = safe and scratch[0, m] <= limit[min(at * checks + m, limit.shape[0] - 1)]
    return lam, mu, used, safe


@njit
def stays_behind(
    steps: Floats,
    lam: float,
    mu: float,
    command: float,
    until: float,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Floats,
) -> bool:
    """Whether a command for one step, and on until the arm is past ``until``, then maximum braking, stays behind."""
    scratch = np.empty((2, checks))
    for at in range(100000):
        lam, mu, _, safe = step(steps, lam, mu, command, by_speed, dt, checks, limit, at, scratch)
        if not safe:
            return False
        if lam >= until:
            command = 0.0
        # At rest it stays there (or it is at its end); what blocks later is in a limit of now.
        if lam >= steps[-1, STATION] or (command == 0.0 and mu <= 0.0):
            return True
    return False


@njit
def places(
    steps: Floats,
    lam: float,
    mu: float,
    commands: Floats,
    by_speed: bool,
    dt: float,
    checks: int,
    out: Floats,
) -> None:
    """Fill ``out`` (K,) with the place at the beginning of every check; the last command lasts."""
    scratch = np.empty((2, checks))
    last = commands.shape[0] - 1
    resting = commands[last] == 0.0
    out[0] = lam
    for first in range(1, out.shape[0], checks):
        at = min((first - 1) // checks, last)
        if lam < steps[-1, STATION] and not (resting and at == last and mu <= 0.0):
            lam, mu, _ = advance(
                steps, lam, mu, commands[at], by_speed, dt / checks, checks, scratch[0], scratch[1], 1.0
            )
        else:
            scratch[0] = lam
        for m in range(min(checks, out.shape[0] - first)):
            out[first + m] = scratch[0, m]


@njit
def largest_behind(
    steps: Floats,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    dt: float,
    checks: int,
    limit: Floats,
) -> float:
    """The command, cut back by bisection until ``stays_behind``; 0 if nothing does."""
    if stays_behind(steps, lam, mu, command, -1.0, by_speed, dt, checks, limit):
        return command
    low, high = 0.0, command
    for _ in range(COMMAND_BISECTIONS):
        middle = 0.5 * (low + high)
        if stays_behind(steps, lam, mu, middle, -1.0, by_speed, dt, checks, limit):
            low = middle
        else:
            high = middle
    return low


def places_at_checks(
    plane: PhasePlane, lam: float, mu: float, commands: Floats, by_speed: bool, period: float, checks: int, count: int
) -> Floats:
    """(count,) where an arm is at the beginning of every check under commands (K,); the last one lasts."""
    out = np.empty(count)
    places(plane.edges.steps, lam, mu, commands, by_speed, period, checks, out)
    return out


def horizon(planes: Sequence[PhasePlane], period: float, checks: int) -> int:
    """Number of checks after which everybody who brakes is at rest: twice a minimum time is more than it takes.

    Of a path with stops it is that of the longest run between two of them.
    """
    longest = max(plane.fastest().longest_run for plane in planes)
    return checks * (math.ceil(2.0 * longest / period) + 2)


class BrakingGuard:
    """Guards the commands of all arms that obey a precedence.

    Args:
        planes: One phase plane per arm.
        precedence: How far each may go.
        period: Time for which a command holds [s].
        mode: What a command in [0, 1] means.
        checks: How often per period limits are asked.
    """

    def __init__(
        self, planes: Sequence[PhasePlane], precedence: Precedence, period: float, mode: Mode, checks: int
    ) -> None:
        self.planes = tuple(planes)
        self.precedence = precedence
        self.period, self.checks = period, checks
        self._by_speed = mode == "speed"
        self._checks_ahead = horizon(planes, period, checks)

    def braking(self, i: int, lam: float, mu: float) -> Floats:
        """(K,) where arm i is at the beginning of every check from now on if it brakes as hard as it can."""
        plane = self.planes[i]
        return places_at_checks(plane, lam, mu, np.zeros(1), True, self.period, self.checks, self._checks_ahead)

    def guarded(self, i: int, command: float, lam: float, mu: float, braking: Callable[[int], Floats]) -> float:
        """The command in [0, 1] of arm i, cut back until it could still brake behind all its limits.

        ``braking(j)``: the ``braking`` of arm j from its state now.
        """
        limit: Floats | None = None
        for j in range(len(self.planes)):
            if (i, j) in self.precedence.limits:
                own = self.precedence.farthest(i, j, braking(j))
                if own[0] < self.planes[i].length:  # else it is free already, and limits never fall
                    limit = own if limit is None else np.minimum(limit, own)
        if limit is None:
            return command
        plane = self.planes[i]
        return float(
            largest_behind(
                plane.edges.steps, lam, mu, command, self._by_speed, self.period, self.checks, limit - LIMIT_MARGIN
            )
        )
