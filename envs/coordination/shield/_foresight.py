"""The shield's compiled part: what comes of orders if all arms go on at full speed, without physics."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._admission import admit
from armtempo.envs.coordination.shield._kernels import Orders, ShieldTables, ShieldWork
from armtempo.envs.coordination.world import World, length_of, steps_of
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit


@njit
def run_ahead(
    world: World, tables: ShieldTables, orders: Orders, lam: Floats, mu: Floats, stands: Floats, scripted: Bools,
    uncertain: Bools, ticks: int, horizon: float, arrival: Floats, work: ShieldWork,
) -> None:  # fmt: skip
    """When the arms arrive under the orders (R,), kept to the end.

    Nothing is watched: the shield lets through only what is safe. ``lam`` and ``mu`` (A,) move on in place.

    Args:
        world: The cell.
        tables: Its regions.
        orders: (R,) who passes first; obeyed by arms that brake from here on.
        lam: (A,) places.
        mu: (A,) path speeds.
        stands: (A,) until when each arm brakes and stands instead [s from now].
        scripted: (A,) as for ``admit``.
        uncertain: (A,) as for ``admit``.
        ticks: Ticks of a control period.
        horizon: Nobody is waited for longer [s].
        arrival: (A,) out, when each arm arrives [s from now]; inf: not before ``horizon``.
        work: Scratch.
    """
    arms, now, period = lam.shape[0], 0.0, ticks * world.tick
    places, speeds = np.empty(ticks), np.empty(ticks)
    commands, admitted, wanted = np.empty(arms), np.empty(arms), orders.copy()
    for i in range(arms):
        arrival[i] = np.inf if lam[i] < length_of(world, i) else 0.0
    while now < horizon:
        if arrival.max() < np.inf:
            break
        for i in range(arms):
            commands[i] = 0.0 if now < stands[i] else 1.0
        admit(world, tables, orders, wanted, lam, mu, commands, scripted, uncertain, ticks, admitted, work)
        for i in range(arms):
            if lam[i] < length_of(world, i):
                lam[i], mu[i], used = phase_kernels.advance(
                    steps_of(world, i), lam[i], mu[i], admitted[i], world.by_speed, world.tick, ticks, places, speeds,
                    1.0,
                )  # fmt: skip
                if lam[i] >= length_of(world, i):
                    arrival[i] = now + used
        now += period
