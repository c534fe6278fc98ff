"""The shield's compiled part: the largest commands for one control period under the orders that hold."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._kernels import (
    COMMANDED,
    NOBODY_WAITS,
    PARTS_PER_TICK,
    WAITING_ARM,
    Orders,
    ShieldTables,
    ShieldWork,
    fits,
)
from armtempo.envs.coordination.shield._turning import begin, put, take, turn_for
from armtempo.envs.coordination.world import World
from armtempo.robots import uncounted

COMMAND_STEPS = 1024  # commands that are cut are whole parts of this: exact in float32, and as actions
CUTTING_SWEEPS = 8  # after which arms that still do not fit brake


@uncounted
def _cut(
    world: World, tables: ShieldTables, orders: Orders, i: int, lam: Floats, mu: Floats, commands: Floats,
    unsure: Bools, parts: int, work: ShieldWork,
) -> None:  # fmt: skip
    """Lower the command of arm i, by bisection, until it stays behind all its limits."""
    low, high = 0, int(np.ceil(commands[i] * COMMAND_STEPS))
    first = mu[i] <= 0.0  # an arm that stands mostly waits: then not even the smallest command fits
    while high - low > 1:
        middle = 1 if first else (low + high) // 2
        first = False
        commands[i], work.length[COMMANDED, i] = middle / COMMAND_STEPS, 0
        fitting = True
        for r in range(orders.shape[0]):
            mine = orders[r] < NOBODY_WAITS and tables.region[r, orders[r], WAITING_ARM] == i
            if mine and not fits(world, tables, r, orders[r], orders, lam, mu, commands, unsure, parts, work):
                fitting = False
                break
        if fitting:
            low = middle
        else:
            high = middle
    commands[i], work.length[COMMANDED, i] = low / COMMAND_STEPS, 0


@uncounted
def admit(
    world: World,
    tables: ShieldTables,
    orders: Orders,
    wanted: Orders,
    lam: Floats,
    mu: Floats,
    commands: Floats,
    scripted: Bools,
    uncertain: Bools,
    ticks: int,
    admitted: Floats,
    work: ShieldWork,
) -> bool:
    """Fill ``admitted`` (A,) with the commands for one period of ``ticks`` that are let through; True if one is cut.

    Args:
        world: The cell.
        tables: Its regions.
        orders: (R,) who passes first; turned where that is wanted or, where nothing is, the commands ask for it, and
            leads on.
        wanted: (R,) who is to pass first, of those held; 2: either.
        lam: (A,) places.
        mu: (A,) path speeds.
        commands: (A,) as asked for, in [0, 1].
        scripted: (A,) arms whose command is not changed: they brake or not, as they please.
        uncertain: (A,) arms that may do less than they are told: anything from maximum braking to their command.
        ticks: Ticks of a control period.
        admitted: (A,) out. Given the orders it is the largest, arm by arm, up to the steps of a cut.
        work: Scratch.

    Arms are held back only by arms ahead of them: the limits of an arm rise with the commands of all others, so there
    is a largest set of commands, and lowering arm by arm whoever does not fit finds it. To brake is always let through:
    it is what was checked the last time.
    """
    put(commands, admitted)
    take(world, tables, orders, wanted, lam, mu, scripted, uncertain, ticks, work)
    begin(lam, mu, work)
    unsure, parts = work.unsure, PARTS_PER_TICK * ticks
    fitting, tried, changed = False, False, False
    sweep = 0
    while not fitting:
        fitting = True
        for r in range(orders.shape[0]):
            if orders[r] == NOBODY_WAITS or scripted[tables.region[r, orders[r], WAITING_ARM]]:
                continue
            if not fits(world, tables, r, orders[r], orders, lam, mu, admitted, unsure, parts, work):
                fitting = False
                if not tried:
                    tried = True
                    if turn_for(world, tables, orders, wanted, lam, mu, admitted, scripted, unsure, parts, work):
                        break
                i = tables.region[r, orders[r], WAITING_ARM]
                if sweep < CUTTING_SWEEPS:
                    _cut(world, tables, orders, i, lam, mu, admitted, unsure, parts, work)
                else:
                    admitted[i], work.length[COMMANDED, i] = 0.0, 0
                changed = True
        sweep += 1
    return changed
