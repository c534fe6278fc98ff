"""What shaping the speed along the paths gains over full speed with waiting where somebody must."""

from __future__ import annotations

import math

import numpy as np

from armtempo.errors import InfeasibleError
from armtempo.planners.cells import CoordinationCell
from armtempo.planners.coordination import OrderSearch, Precedence
from armtempo.planners.schedules import PrecedenceExecution, schedule
from armtempo.planners.topp.kernels import advance

PAYS_SHARE = 0.97  # of the makespan at full speed: an optimum below it is worth shaping for


def shaping_pays(cell: CoordinationCell) -> bool:
    """Whether the optimum is below ``PAYS_SHARE`` of full speed in the best of the orders that a search finds."""
    regions = cell.passing_orders()
    search = OrderSearch(regions, cell.planes)
    start = np.zeros(len(cell.arms))
    best, _ = search.best(start, search.times_to_go(start, start))
    full = min((full_speed_makespan(cell, regions.precedence(orders)) for orders in best), default=math.inf)
    try:
        return math.isfinite(full) and schedule(cell, "optimal").makespan < PAYS_SHARE * full
    except InfeasibleError:
        return False


def full_speed_makespan(cell: CoordinationCell, precedence: Precedence) -> float:
    """Makespan [s] of all arms at full speed, cut back only where a precedence says to wait.

    Infinite where the arms come to rest before their ends: it does not lead on.
    """
    execution = PrecedenceExecution(cell, precedence)
    lam, mu, arrival = (np.zeros(len(cell.arms)) for _ in range(3))
    none, now = np.empty(0), 0.0
    while True:
        commands = execution.commands(lam, mu)
        before = lam.copy()
        for i, plane in enumerate(cell.planes):
            if lam[i] < plane.length:
                steps, tick, ticks = plane.edges.steps, cell.physics_tick, cell.ticks_per_period
                lam[i], mu[i], used = advance(steps, lam[i], mu[i], commands[i], True, tick, ticks, none, none, 1.0)
                arrival[i] = now + used
        now += cell.control_period
        if all(place >= plane.length for place, plane in zip(lam, cell.planes, strict=True)):
            return float(arrival.max())
        if (lam == before).all():
            return math.inf
