"""Compiled loops of the environments: arms along their paths period by period, their references, the observation.

Arrays have one row per arm, padded to the largest number of joints; before it comes the episode, where many run at
once. One environment is a batch of one: it runs the same functions, so it has the same bits. They go over the episodes
of one arm or pair in their inner loops: cutting an arm's arrays out costs more than moving it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Floats32
from armtempo.envs.bodies import tip_of
from armtempo.envs.common import NOISE, normal
from armtempo.envs.coordination.world._world import (
    CELLS_PER_BLOCK,
    Episodes,
    World,
    breaks_rule,
    clearance_of,
    last_in_block,
    last_occupied,
    length_of,
    model_of,
    steps_of,
    table_of,
    to_go_of,
    waits_of,
)
from armtempo.planners.charts import tabulated_clearance
from armtempo.planners.joint_paths.kernels import path_point
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import inlined, njit, uncounted

EPISODES_AT_ONCE = 64  # episodes in one go: what they need stays in the cache


class Scratch(NamedTuple):
    """Work space of one thread for B episodes, T ticks a period."""

    places: Floats  # (B, A, T) at the end of every tick
    speeds: Floats  # (B, A, T)
    clearance: Floats  # (B, T)
    own: Floats  # (B, A, 6) entries of an arm's own observation in their order, then its time to go [s]
    pair: Floats  # (B, A, A, 3) [i, j]: way to the next region, what j has still to go there, what i would wait


def scratch_for(episodes: int, arms: int, ticks: int) -> Scratch:
    """Work space for so many episodes, SPAN at most."""
    B = min(episodes, EPISODES_AT_ONCE)
    return Scratch(
        np.zeros((B, arms, ticks)),
        np.zeros((B, arms, ticks)),
        np.zeros((B, ticks)),
        np.zeros((B, arms, 6)),
        np.zeros((B, arms, arms, 3)),
    )


@inlined
def obeyed(world: World, episodes: Episodes, e: int, i: int, command: float) -> float:
    """What arm i makes of its command in the control period that begins now; how slow it is comes on top."""
    obeyed, now = command, episodes.ticks[e] * world.tick
    for s in range(episodes.stops.shape[2]):
        if episodes.stops[e, i, s, 0] <= now < episodes.stops[e, i, s, 1]:
            obeyed = 0.0
    return obeyed


@uncounted
def move(
    world: World, episodes: Episodes, first: int, last: int, active: Bools, commands: Floats, scratch: Scratch
) -> None:
    """One control period of the references of episodes first..last - 1: commands (E, A) as far as arms obey them.

    Their time goes as fast as the episode's clock.
    """
    tick, ticks = world.tick, scratch.places.shape[2]
    for i in range(commands.shape[1]):
        steps = steps_of(world, i)
        end = steps[steps.shape[0] - 1, phase_kernels.STATION]
        for e in range(first, last):
            if not active[e]:
                continue
            places, speeds = scratch.places[e - first, i], scratch.speeds[e - first, i]
            lam, mu, now, rate = episodes.lam[e, i], episodes.mu[e, i], episodes.ticks[e], episodes.clock[e]
            command, late = obeyed(world, episodes, e, i, commands[e, i]), episodes.late[e, i]
            share = episodes.speed[e, i]
            k = 0
            while k < ticks and (lam >= end or (now + k) * tick + tick - late <= 1e-12):  # there, or not yet gone
                places[k], speeds[k] = lam, mu
                k += 1
            if k < ticks and (now + k) * tick < late:  # it goes in the middle of this tick
                part, one = (now + k) * tick + tick - late, min(ticks, 1)  # 1 as it is would compile a second copy
                lam, mu, used = phase_kernels.advance(
                    steps,
                    lam,
                    mu,
                    command,
                    world.by_speed,
                    rate * part,
                    one,
                    places[k : k + 1],
                    speeds[k : k + 1],
                    share,
                )
                if lam >= end:
                    episodes.arrival[e, i] = late + used / rate
                k += 1
            if k < ticks:
                began, there = (now + k) * tick, lam >= end
                lam, mu, used = phase_kernels.advance(
                    steps, lam, mu, command, world.by_speed, rate * tick, ticks - k, places[k:], speeds[k:], share
                )
                if lam >= end and not there:
                    episodes.arrival[e, i] = began + used / rate
            episodes.lam[e, i], episodes.mu[e, i] = lam, mu


@uncounted
def watch(
    world: World, episodes: Episodes, first: int, last: int, active: Bools, d_min: float, scratch: Scratch
) -> None:
    """Clearance at every tick of the period that has been run.

    An episode ends at the first tick below ``d_min``, or at which arms break a rule.
    """
    clearance, ticks = scratch.clearance, scratch.places.shape[2]
    for e in range(first, last):
        clearance[e - first] = np.inf
    for p in range(world.clearance.shape[0]):
        table, i, j = clearance_of(world, p), world.clearance[p, 0], world.clearance[p, 1]
        for e in range(first, last):
            if active[e]:
                b = e - first
                for k in range(ticks):
                    found = tabulated_clearance(table, scratch.places[b, i, k], scratch.places[b, j, k])
                    if found < clearance[b, k] or math.isnan(found):
                        clearance[b, k] = found
    for e in range(first, last):
        if not active[e]:
            continue
        ran = ticks
        for k in range(ticks):
            episodes.smallest[e] = min(episodes.smallest[e], clearance[e - first, k])
            if not clearance[e - first, k] >= d_min or breaks_rule(world, scratch.places[e - first, :, k]):
                # it ends here: back to where the arms were
                ran = k + 1
                episodes.violated[e] = True
                for i in range(episodes.lam.shape[1]):
                    episodes.lam[e, i] = scratch.places[e - first, i, k]
                    episodes.mu[e, i] = scratch.speeds[e - first, i, k]
                    if episodes.arrival[e, i] > (episodes.ticks[e] + ran) * world.tick:
                        episodes.arrival[e, i] = np.nan
                break
        episodes.ticks[e] += ran


@njit
def reference_joints(world: World, places: Floats, joints: Floats) -> None:
    """Joint positions ``joints`` (T, A, n) on the paths at ``places`` (A, T)."""
    for i in range(places.shape[0]):
        n, table = world.size[i, 1], table_of(world, i)
        for k in range(places.shape[1]):
            path_point(table, places[i, k], joints[k, i][:n])


@uncounted
def moved_closer(before: Floats, now: Floats, lever: Floats) -> float:
    """By how much, at most, two arms have come closer [m] between joint positions (A, n): the two that moved most.

    ``lever`` (A, n): how far a point of the arm gets, at most, per radian or metre of each joint.
    """
    most, second, total = 0.0, 0.0, 0.0
    for i in range(now.shape[0]):
        way = 0.0
        for j in range(now.shape[1]):
            way += lever[i, j] * abs(now[i, j] - before[i, j])
        if way > most:
            most, second = way, most
        elif way > second:
            second = way
        total += way
    return most + second + 0.0 * total  # NaN, which no comparison sees, stays NaN


@njit
def tip_positions(world: World, q: Floats, out: Floats) -> None:
    """Tips (A, 3) [m] at joint positions ``q`` (A, n)."""
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = tip_of(model_of(world, i), q[i][: world.size[i, 1]])


@njit
def tracking_error(world: World, lam: Floats, q: Floats, error: Floats) -> None:
    """Distance [m] of every tip from its reference on the path, from measured ``q`` (A, n)."""
    for i in range(q.shape[0]):
        n, model = world.size[i, 1], model_of(world, i)
        wanted = np.empty(n)
        path_point(table_of(world, i), lam[i], wanted)
        a, b = tip_of(model, q[i][:n]), tip_of(model, wanted)
        error[i] = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@uncounted
def _signed(share: float) -> float:
    """[0, 1] to [-1, 1]."""
    return 2.0 * min(max(share, 0.0), 1.0) - 1.0


@uncounted
def _own(world: World, episodes: Episodes, first: int, last: int, active: Bools, scratch: Scratch) -> None:
    """Fill ``scratch.own``."""
    for i in range(episodes.lam.shape[1]):
        steps, to_go = steps_of(world, i), to_go_of(world, i)
        end, fastest, scale = steps[steps.shape[0] - 1, phase_kernels.STATION], world.scale[i, 0], world.scale[i, 1]
        for e in range(first, last):
            if not active[e]:
                continue
            lam, mu, own = episodes.lam[e, i], episodes.mu[e, i], scratch.own[e - first, i]
            k = phase_kernels.interval_at(steps, lam)
            begin, stop = steps[k, phase_kernels.STATION], steps[k + 1, phase_kernels.STATION]
            w = (lam - begin) / (stop - begin)
            edge = np.sqrt(max(phase_kernels.upper_edge(steps, k, w), 0.0))
            lowest, highest = phase_kernels.bounds_in(steps, k, w, mu * mu, 0.0)
            own[5] = to_go[k] + w * (to_go[k + 1] - to_go[k])
            own[0] = _signed(lam / end)
            own[1] = _signed(mu / edge if edge > 0.0 else 0.0)
            own[2] = min(max(lowest / scale, -1.0), 1.0)
            own[3] = min(max(highest / scale, -1.0), 1.0)
            own[4] = _signed(own[5] / fastest)


@uncounted
def _pairs(world: World, episodes: Episodes, first: int, last: int, active: Bools, scratch: Scratch) -> None:
    """Fill ``scratch.pair``: shares of paths, and the wait as a share of the own minimum time (-1: no region ahead)."""
    arms = episodes.lam.shape[1]
    for i in range(arms):
        for j in range(arms):
            if i == j:
                continue
            occupied, block, waits = last_occupied(world, i, j), last_in_block(world, i, j), waits_of(world, i, j)
            rows, length, other = occupied.shape[0], length_of(world, i), length_of(world, j)
            for e in range(first, last):
                if not active[e]:
                    continue
                here, there, pair = episodes.lam[e, i] / length, episodes.lam[e, j], scratch.pair[e - first, i, j]
                begin = min(int(here * rows), rows - 1)
                pair[0], pair[1], pair[2] = 1.0, 0.0, -1.0
                row = begin if waits[begin, 1] > -np.inf else rows  # nothing ahead at all
                while row < rows:
                    if row % CELLS_PER_BLOCK == 0 and block[row // CELLS_PER_BLOCK] < there:
                        row += CELLS_PER_BLOCK
                    elif occupied[row] >= there:
                        pair[0], pair[1] = max(row / rows - here, 0.0), (occupied[row] - there) / other
                        own = scratch.own[e - first, i, 5]
                        wait = scratch.own[e - first, j, 5] - own + max(own - waits[begin, 0], waits[begin + 1, 1])
                        pair[2] = min(max(wait / world.scale[i, 0], -1.0), 1.0)
                        break
                    else:
                        row += 1


@uncounted
def observe(
    world: World,
    episodes: Episodes,
    first: int,
    last: int,
    active: Bools,
    noise: float,
    others: int,
    own_size: int,
    other_size: int,
    scratch: Scratch,
    out: Floats32,
) -> None:
    """Write the observations (E, A, size) of all arms in the order of ``COORDINATION_ENTRIES`` (see ``_observation``).

    ``noise``: standard deviation of what is added to every entry that is not 0/1-valued or padding.
    """
    arms = episodes.lam.shape[1]
    for begin in range(first, last, scratch.own.shape[0]):
        until = min(begin + scratch.own.shape[0], last)
        _own(world, episodes, begin, until, active, scratch)
        _pairs(world, episodes, begin, until, active, scratch)
        for e in range(begin, until):
            if not active[e]:
                continue
            b = e - begin
            own, pair = scratch.own[b], scratch.pair[b]
            for i in range(arms):
                for k in range(own_size):
                    out[e, i, k] = own[i, k]
                for k in range(own_size, out.shape[2]):
                    out[e, i, k] = 0.0
                taken = -1  # the slots hold the others, the nearest region first; equal ones in their order
                for slot in range(min(others, arms - 1)):
                    best = -1
                    for j in range(arms):
                        behind = (
                            taken < 0
                            or pair[i, j, 0] > pair[i, taken, 0]
                            or (pair[i, j, 0] == pair[i, taken, 0] and j > taken)
                        )
                        if j != i and behind and (best < 0 or pair[i, j, 0] < pair[i, best, 0]):
                            best = j
                    taken = best
                    base = own_size + slot * other_size
                    out[e, i, base] = 1.0
                    out[e, i, base + 1], out[e, i, base + 2] = _signed(pair[i, best, 0]), _signed(pair[i, best, 1])
                    out[e, i, base + 3], out[e, i, base + 4] = own[best, 0], own[best, 1]
                    out[e, i, base + 5] = own[best, 4]
                    out[e, i, base + 6], out[e, i, base + 7] = pair[i, best, 2], pair[best, i, 2]
                if noise > 0.0:
                    key, number, step = episodes.key[e], episodes.number[e], episodes.steps[e]
                    for k in range(own_size + min(others, arms - 1) * other_size):
                        if k < own_size or (k - own_size) % other_size > 0:
                            value = out[e, i, k] + noise * normal(key, number, step, NOISE, i * out.shape[2] + k)
                            out[e, i, k] = min(max(value, -1.0), 1.0)


@uncounted
def _reward(
    world: World,
    episodes: Episodes,
    e: int,
    reference_time: float,
    time_limit: float,
    team: bool,
    rewards: Floats,
    terminated: Bools,
    truncated: Bools,
) -> None:
    """Rewards and ends of one episode after a period; the terms of ``_reward``, in the same order, so the same bits."""
    arms, violated = episodes.lam.shape[1], episodes.violated[e]
    time = episodes.ticks[e] * world.tick
    late = time >= time_limit - 1e-9
    progress, left, latest = 0.0, 0.0, 0.0
    for i in range(arms):
        lam, arrival, length = episodes.lam[e, i], episodes.arrival[e, i], length_of(world, i)
        arrived = not np.isnan(arrival)
        until = arrival if arrived else time
        moved = (lam - episodes.rewarded[e, i]) / length
        collision = -(2.0 + (1.0 - lam / length)) if violated else 0.0
        progress, left, latest = progress + moved / arms, left + (1.0 - lam / length) / arms, max(latest, until)
        before = terminated[e, i]
        rewards[e, i] = 0.0
        if not before:
            rewards[e, i] = moved + -(until - episodes.charged[e, i]) / reference_time + collision
        terminated[e, i] = before or arrived or violated
        truncated[e, i] = late and not terminated[e, i]
        episodes.rewarded[e, i] = lam
        if not team:
            episodes.charged[e, i] = until
    if team:
        together = progress - (latest - episodes.charged[e, 0]) / reference_time - (2.0 + left if violated else 0.0)
        for i in range(arms):
            rewards[e, i] = together
            episodes.charged[e, i] = latest


@uncounted
def run_periods(
    world: World,
    episodes: Episodes,
    first: int,
    last: int,
    active: Bools,
    commands: Floats,
    d_min: float,
    reference_time: float,
    time_limit: float,
    team: bool,
    noise: float,
    others: int,
    own_size: int,
    other_size: int,
    scratch: Scratch,
    observations: Floats32,
    rewards: Floats,
    terminated: Bools,
    truncated: Bools,
) -> None:
    """One control period of the active ones of episodes first..last - 1, without physics; commands (E, A)."""
    span = scratch.places.shape[0]
    for begin in range(first, last, span):
        until = min(begin + span, last)
        move(world, episodes, begin, until, active, commands, scratch)
        watch(world, episodes, begin, until, active, d_min, scratch)
        for e in range(begin, until):
            if active[e]:
                episodes.steps[e] += 1
                _reward(world, episodes, e, reference_time, time_limit, team, rewards, terminated, truncated)
        observe(world, episodes, begin, until, active, noise, others, own_size, other_size, scratch, observations)
