"""Compiled: path-velocity feedback. The time of the references goes slower where torques cannot follow them.

The places that arms pass together, and what the shield foresaw of them, do not change with how fast time goes: one
clock for all arms makes them late, never out of step. (Dahl and Nielsen, *Torque-limited path following by on-line
trajectory time scaling*, 1990, have one such clock for one arm.)
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.envs.bodies import clip_torques, joint_demand
from armtempo.envs.coordination.world._kernels import obeyed
from armtempo.envs.coordination.world._world import Episodes, World, length_of, model_of, steps_of, table_of
from armtempo.planners.joint_paths.kernels import path_point
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit

TRIALS = 8  # rates that are tried in one tick; two or three mostly do
PROBE = 1e-3  # of a rate: the step from which torques are known as functions of it
SLOWING_SHARE = 0.99  # of the torque that is used where time is slowed: later braking needs what is left
WITHIN = 1.0 - 1e-9  # of a torque limit is aimed at, so that rounding does not clip
SLOWEST = 0.05  # rate of the references' time
SLOWER_AT_ONCE = 0.9  # of the rate before, in one tick
FULL_SPEED_TICKS = 1_000_000

LAM, MU, ARRIVAL = range(3)  # rows of ``motion``


@njit
def obeyed_commands(world: World, episodes: Episodes, commands: Floats, out: Floats) -> None:
    """What the arms of the first episode make of ``commands`` (1, A) in the period that begins now: ``out`` (A,)."""
    for i in range(out.shape[0]):
        out[i] = obeyed(world, episodes, 0, i, commands[0, i])


@njit
def _try_rate(
    world: World, episodes: Episodes, commands: Floats, rate: float, gain: float, measured: Floats, reference: Floats,
    demand: Floats, motion: Floats,
) -> float:  # fmt: skip
    """Fill ``motion``, ``reference[2]`` and ``demand`` for one tick at this rate; the largest share of a limit."""
    tick, now, worst = world.tick, episodes.ticks[0] * world.tick, 0.0
    for i in range(commands.shape[0]):
        n, steps, part = world.size[i, 1], steps_of(world, i), min(tick, now + tick - episodes.late[0, i])
        motion[LAM, i], motion[MU, i], motion[ARRIVAL, i] = (
            episodes.lam[0, i],
            episodes.mu[0, i],
            episodes.arrival[0, i],
        )
        if motion[LAM, i] < length_of(world, i) and part > 1e-12:  # else it is there, or not yet gone
            place, one = np.empty((2, 1)), min(i, 0) + 1  # 1 as it is would compile a second copy
            lam, mu, used = phase_kernels.advance(
                steps, motion[LAM, i], motion[MU, i], commands[i], world.by_speed, rate * part, one, place[0], place[1],
                episodes.speed[0, i],
            )  # fmt: skip
            motion[LAM, i], motion[MU, i] = lam, mu
            if lam >= length_of(world, i):
                motion[ARRIVAL, i] = now + tick - part + used / rate
        path_point(table_of(world, i), motion[LAM, i], reference[2, i][:n])
        joint_demand(
            model_of(world, i), reference[0, i][:n], reference[1, i][:n], reference[2, i][:n], measured[0, i][:n],
            measured[1, i][:n], world.coulomb[i][:n], gain, tick, demand[i][:n],
        )  # fmt: skip
        for j in range(n):
            worst = max(worst, abs(demand[i, j]) / world.torque_max[i, j])
    return worst


@njit
def _rate_between(world: World, before: Floats, at_before: float, demand: Floats, at: float, clock: float) -> float:
    """The rate nearest to ``clock`` at which torques are within their limits, if they are linear between two rates.

    Where that is slower, with a share to spare; where no rate will do, in the middle of what asks for less and more.
    """
    low, high, easy = 0.0, 1.0, 1.0
    for i in range(demand.shape[0]):
        for j in range(world.size[i, 1]):
            limit, slope = world.torque_max[i, j], (demand[i, j] - before[i, j]) / (at - at_before)
            if abs(slope) > 1e-9 * limit:
                middle, half = at - demand[i, j] / slope, WITHIN * limit / abs(slope)
                low, high = max(low, middle - half), min(high, middle + half)
                easy = min(easy, middle + SLOWING_SHARE * half)
    if low > high:
        return min(0.5 * (low + high), 1.0)
    return min(max(min(clock, easy), low), high)


@njit
def pace(
    world: World, episodes: Episodes, commands: Floats, gain: float, measured: Floats, reference: Floats,
    demand: Floats, torque: Floats, motion: Floats,
) -> float:  # fmt: skip
    """The references' next tick, at the largest rate up to the clock's at which torques are within their limits.

    The clock of the episode is slowed to it and stays so: what was too heavy to speed up is too heavy to brake. Where
    only a faster rate will do, as in braking, that is taken, up to 1; where none will, the one that asks for least.

    Args:
        world: The cell.
        episodes: One, at the beginning of the tick; only its clock is changed.
        commands: (A,) that the arms obey.
        gain: Of the controllers [1/s].
        measured: (2, A, n) joint positions and speeds.
        reference: (3, A, n) before, now, and out: next.
        demand: (A, n) out.
        torque: (A, n) out.
        motion: (3, A) out: place, speed in the references' time, instant of arrival.

    Returns the rate.
    """
    clock = episodes.clock[0]
    rate, best, least, before = clock, clock, np.inf, np.empty_like(demand)
    at_before = clock
    slowest = max(SLOWEST, SLOWER_AT_ONCE * clock)
    for trial in range(TRIALS):
        worst = _try_rate(world, episodes, commands, rate, gain, measured, reference, demand, motion)
        if worst < least and trial != 1:
            best, least = rate, worst
        if (worst <= 1.0 and trial != 1) or trial == TRIALS - 1:
            break
        if trial == 0:
            following = rate * (1.0 - PROBE)
        else:
            following = max(_rate_between(world, before, at_before, demand, rate, clock), slowest)
        if abs(following - rate) < 1e-12:
            break
        before[:], at_before, rate = demand, rate, following
    if rate != best:
        _try_rate(world, episodes, commands, best, gain, measured, reference, demand, motion)
    for i in range(demand.shape[0]):
        n = world.size[i, 1]
        clip_torques(demand[i][:n], world.torque_max[i][:n], torque[i][:n])
    if least <= 1.0:
        episodes.clock[0] = min(clock, best)
    return best  # type: ignore[no-any-return]


@njit
def hardest_tick(world: World, i: int, rate: float) -> float:
    """The largest share of a torque limit that arm i alone needs in ticks, at full speed and this rate of time."""
    n, steps, end, model = world.size[i, 1], steps_of(world, i), length_of(world, i), model_of(world, i)
    joints, speed, demand, place = np.zeros((3, n)), np.zeros(n), np.zeros(n), np.zeros((2, 1))
    lam, mu, standing, worst, one = 0.0, 0.0, 0, 0.0, min(i, 0) + 1
    path_point(table_of(world, i), lam, joints[2])
    joints[1] = joints[2]
    for _ in range(FULL_SPEED_TICKS):
        if lam < end:
            lam, mu, _used = phase_kernels.advance(
                steps, lam, mu, 1.0, world.by_speed, rate * world.tick, one, place[0], place[1], 1.0
            )
        else:
            standing += 1
        joints[0], joints[1] = joints[1], joints[2]
        path_point(table_of(world, i), lam, joints[2])
        for j in range(n):
            speed[j] = (joints[1, j] - joints[0, j]) / world.tick
        joint_demand(
            model, joints[0], joints[1], joints[2], joints[1], speed, world.coulomb[i][:n], 0.0, world.tick, demand
        )
        for j in range(n):
            worst = max(worst, abs(demand[j]) / world.torque_max[i, j])
        if standing == 2:
            break
    return worst
