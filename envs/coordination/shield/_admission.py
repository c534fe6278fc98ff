"""The shield's compiled part: the largest commands for one control period under the orders that hold."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.coordination.shield._kernels import (
    BRAKING,
    COMMANDED,
    LEADING_ARM,
    NOBODY_WAITS,
    PARTS_PER_TICK,
    UNTIL_REST,
    WAITING_ARM,
    Orders,
    ShieldTables,
    ShieldWork,
    aim_behind,
    fill_limits,
    first_past,
    fits,
    speed_to_stop,
)
from armtempo.envs.coordination.shield._turning import begin, take, turn_for
from armtempo.envs.coordination.world import World, steps_of
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import uncounted

COMMAND_STEPS = 1024  # commands that are cut are whole parts of this: exact in float32, and as actions
MOST_GUESSES = 8  # of one command, then the rest is halved
FIRST_STRIDE, STRIDE_GROWTH = 8, 4  # away from where a command is too large, in steps of commands
FEW_PERIODS = 2  # in which an arm that stands and goes on as little as can be is at rest again
CUTTING_SWEEPS = 8  # after which arms that still do not fit brake


@uncounted
def _guess(
    own: Floats, by_speed: bool, tick: float, ticks: int, lam: float, mu: float, low: int, high: int, braked: Floats,
    before: Ints, limit: float, aim: float, none: Floats,
) -> int:  # fmt: skip
    """About the largest step of a command between two with which an arm gets to ``aim`` and can stop before a limit."""
    least, step = low + 1, FIRST_STRIDE
    while high - low > 1:
        middle = max(high - step, low + 1) if step > 0 else (low + high) // 2
        there, fast, _ = phase_kernels.advance(
            own, lam, mu, middle / COMMAND_STEPS, by_speed, tick, ticks, none, none, 1.0
        )  # fmt: skip
        if there <= aim and (limit == np.inf or fast * fast <= speed_to_stop(own, braked, before, there, limit)):
            low, step = middle, 0
        else:
            high, step = middle, STRIDE_GROWTH * step
    return max(low, least)


@uncounted
def _cut(
    world: World, tables: ShieldTables, orders: Orders, i: int, lam: Floats, mu: Floats, commands: Floats,
    unsure: Bools, parts: int, work: ShieldWork,
) -> None:  # fmt: skip
    """Lower the command of arm i until it stays behind all its limits, as little as can be.

    It is guessed, from where the arm would have to stop and where the last command was too large; guesses are tried,
    and what is above one that fits.
    """
    low, high, holdable = 0, int(np.ceil(commands[i] * COMMAND_STEPS)), tables.holdable[i]
    own, braked, before = steps_of(world, i), tables.braked[i], tables.before[i]
    far, far_speed = work.places[COMMANDED, i], work.speed[COMMANDED, i]
    back, back_speed = work.places[BRAKING, i], work.speed[BRAKING, i]
    by_speed, tick, ticks, limits = world.by_speed, world.tick, parts // PARTS_PER_TICK, work.limits
    length, rest, speeds = work.length, work.rest, work.speeds
    standing = mu[i] <= 0.0 and holdable  # mostly it waits: then not even the smallest command fits
    until = FEW_PERIODS * parts if standing else UNTIL_REST
    known = fill_limits(world, tables, orders, i, lam, mu, commands, unsure, parts, until, work)
    middle, past, stride, aim, missed = 1, 0, 1, np.inf, False
    if not standing:
        middle = _guess(
            own, by_speed, tick, ticks, lam[i], mu[i], low, high, braked, before, limits[known], aim, far[:0]
        )
        if middle == high - 1:  # it would stop in time, but is too early somewhere
            for k in range(1, length[COMMANDED, i] + 1):
                if far[k] > limits[min(k - 1, known)]:
                    past = k
                    break
    tries, under = 0, 1 if past > 0 else 0
    while high - low > 1:
        if past > 0 and tries < MOST_GUESSES:
            aim = aim_behind(
                own, by_speed, holdable, tick, parts, i, past, limits[min(past - 1, known)], far, back, back_speed,
                length, rest, speeds,
            )  # fmt: skip
            middle = _guess(
                own, by_speed, tick, ticks, lam[i], mu[i], low, high, braked, before, limits[known], aim, far[:0]
            )
            middle, under = max(middle - under, low + 1), 2 * under + 1  # such guesses are mostly too large
        elif tries > 0 and (low > 0 or tries >= MOST_GUESSES):
            middle = (low + high) // 2 if missed or tries >= MOST_GUESSES else min(low + stride, high - 1)
            stride *= STRIDE_GROWTH
        length[COMMANDED, i] = 0
        past = first_past(
            own, by_speed, holdable, tick, middle / COMMAND_STEPS, parts, i, limits, known, braked, before, far,
            far_speed, back, back_speed, length, rest, speeds,
        )  # fmt: skip
        tries += 1
        if past > 0:
            high, missed = middle, True
            past = 0 if low > 0 else past  # one below it fits: what is between is halved
            continue
        low = middle
        if standing:
            standing, tries = False, 0
            known = fill_limits(world, tables, orders, i, lam, mu, commands, unsure, parts, UNTIL_REST, work)
            middle = _guess(
                own, by_speed, tick, ticks, lam[i], mu[i], low, high, braked, before, limits[known], aim, far[:0]
            )
    commands[i], length[COMMANDED, i] = low / COMMAND_STEPS, 0


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
    for i in range(lam.shape[0]):
        admitted[i], work.unsure[i] = commands[i], scripted[i] or uncertain[i]
    take(world, tables, orders, wanted, lam, mu, scripted, uncertain, ticks, work)
    begin(lam, mu, work)
    unsure, parts, settled = work.unsure, PARTS_PER_TICK * ticks, work.fitting
    settled[:] = False
    fitting, tried, changed = False, False, False
    sweep = 0
    while not fitting:
        fitting = True
        for r in range(orders.shape[0]):
            if settled[r] or orders[r] == NOBODY_WAITS or scripted[tables.region[r, orders[r], WAITING_ARM]]:
                continue
            settled[r] = fits(world, tables, r, orders[r], orders, lam, mu, admitted, unsure, parts, work)
            if settled[r]:
                continue
            fitting = False
            if not tried:
                tried = True
                if turn_for(world, tables, orders, wanted, lam, mu, admitted, scripted, unsure, parts, work):
                    settled[:] = False
                    break
            i = tables.region[r, orders[r], WAITING_ARM]
            if sweep < CUTTING_SWEEPS:
                _cut(world, tables, orders, i, lam, mu, admitted, unsure, parts, work)
            else:
                admitted[i], work.length[COMMANDED, i] = 0.0, 0
            changed = True
            for other in range(orders.shape[0]):  # what the arm waits for has been looked at, not who waits for it
                if orders[other] < NOBODY_WAITS:
                    if tables.region[other, orders[other], WAITING_ARM] == i:
                        settled[other] = True
                    elif tables.region[other, orders[other], LEADING_ARM] == i:
                        settled[other] = False
        sweep += 1
    return changed
