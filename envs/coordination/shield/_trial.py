"""Shielded episodes in one compiled loop, for trials of millions of steps: requests that mean no good, in ``ideal``."""

# ruff: noqa: NPY002 (numba has no Generator that is seeded inside)
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.common import ideal_options
from armtempo.envs.coordination.shield._admission import admit
from armtempo.envs.coordination.shield._kernels import NOBODY_WAITS, Orders, ShieldTables, ShieldWork
from armtempo.envs.coordination.shield._shield import Shield
from armtempo.envs.coordination.shield._turning import first_orders, keep_orders, set_wanted
from armtempo.envs.coordination.world import (
    CoordinationKeywords,
    CoordinationOptions,
    CoordinationSimulation,
    World,
    clearance_of,
    length_of,
    steps_of,
)
from armtempo.planners import CoordinationCell
from armtempo.planners.charts import tabulated_clearance
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit

CHANNELS = ("speed", "speed+priority", "asked")
SPEED, PRIORITY, ASKED = range(3)  # places in ``CHANNELS``
REQUESTS = ("full", "random", "persistent", "bang-bang", "mixed")
FULL, RANDOM, PERSISTENT, BANG_BANG, MIXED = range(5)  # places in ``REQUESTS``
STEPS, EPISODES, VIOLATIONS, STUCK, CHANGED = range(5)  # of what is counted
CHANGE, MAKESPAN, CLEARANCE = range(3)  # of what is measured
SEQUENTIAL_TIMES = 5.0  # within which arms that ask for full speed must arrive


@dataclass(frozen=True, kw_only=True)
class ShieldTrial:
    """What came of it.

    Attributes:
        steps: Agent steps: control periods times arms on their way.
        episodes: How often the arms started.
        violations: Episodes with a tick below ``d_min``.
        stuck: Episodes in which full speed from some state on did not lead all arms to their ends in time.
        changed: Share of agent steps with a command that was cut.
        change: Mean cut over all agent steps, in commands.
        makespan: Longest [s].
        clearance: Smallest [m].
    """

    steps: int
    episodes: int
    violations: int
    stuck: int
    changed: float
    change: float
    makespan: float
    clearance: float


@njit
def _request(kind: int, before: float) -> float:
    if kind == FULL:
        return 1.0
    if kind == RANDOM:
        return np.random.random()
    if np.random.random() > 0.1:
        return before
    if kind == PERSISTENT:
        return np.random.random()
    return 1.0 if np.random.random() < 0.5 else 0.0


@njit
def _begin(
    world: World, tables: ShieldTables, scripted: Bools, orders: Orders, phase: float, d_min: float, lam: Floats,
    work: ShieldWork,
) -> None:  # fmt: skip
    """Arms at rest at the start of their paths, or somewhere on the first ``phase`` of them."""
    apart = phase > 0.0
    for i in range(lam.shape[0]):
        lam[i] = phase * np.random.random() * length_of(world, i)
    for p in range(world.clearance.shape[0]):
        a, b = world.clearance[p, 0], world.clearance[p, 1]
        apart = apart and tabulated_clearance(clearance_of(world, p), lam[a], lam[b]) >= d_min
    if not (apart and first_orders(world, tables, lam, scripted, orders, work)):
        lam[:] = 0.0
        first_orders(world, tables, lam, scripted, orders, work)


@njit
def _want(
    world: World, tables: ShieldTables, channel: int, often: float, scripted: Bools, uncertain: Bools, ticks: int,
    orders: Orders, asked: Orders, priority: Floats, lam: Floats, mu: Floats, work: ShieldWork,
) -> None:  # fmt: skip
    """Now and then other numbers, ties among them, or other orders, some regions left free."""
    if channel == PRIORITY:
        for i in range(priority.shape[0]):
            if np.random.random() < often:
                priority[i] = np.random.random() if np.random.random() < 0.5 else float(np.random.randint(0, 3))
    elif channel == ASKED and np.random.random() < often:
        for r in range(orders.shape[0]):
            work.wanted[r] = np.random.randint(0, 3)
        keep_orders(world, tables, orders, work.wanted, lam, mu, scripted, uncertain, ticks, asked, work)
    set_wanted(tables, asked, priority, work.wanted)


@njit
def _run(
    world: World, tables: ShieldTables, orders: Orders, work: ShieldWork, shielded: bool, kind: int, channel: int,
    phase: float, scripted: Bools, uncertain: Bools, ticks: int, d_min: float, most: int, steps: int, seed: int,
    counts: Ints, figures: Floats,
) -> None:  # fmt: skip
    """Fill ``counts`` (steps, episodes, violations, stuck, changed) and ``figures`` (change, makespan, clearance)."""
    np.random.seed(seed)
    arms = scripted.shape[0]
    places, speeds = np.empty((arms, ticks)), np.empty(ticks)
    kinds = np.empty(arms, np.int64)
    asked, admitted, done = np.empty(arms), np.empty(arms), np.empty(arms)
    kept, priority = np.empty_like(orders), np.zeros(arms)
    while counts[STEPS] < steps:
        counts[EPISODES] += 1
        lam, mu = np.zeros(arms), np.zeros(arms)
        _begin(world, tables, scripted, orders, phase, d_min, lam, work)
        kept[:], priority[:] = NOBODY_WAITS, 0.0
        often = 0.05 if np.random.random() < 0.5 else 1.0  # every period
        for i in range(arms):
            kinds[i] = np.random.randint(0, MIXED) if kind == MIXED else kind
            asked[i] = np.random.random()
        standing = np.random.randint(0, most // 10 + 1)  # periods an uncertain arm is late
        slow = np.random.random() if np.random.random() < 0.5 else 1.0
        stopped = False
        full_from = np.random.randint(1, most) if kind != FULL else 0
        period, running, violated = 0, True, False
        while running and not violated:
            if period > full_from + most:
                counts[STUCK] += 1
                break
            for i in range(arms):
                asked[i] = 1.0 if period >= full_from or scripted[i] else _request(kinds[i], asked[i])
            admitted[:] = asked
            if shielded:
                _want(world, tables, channel, often, scripted, uncertain, ticks, orders, kept, priority, lam, mu, work)
                admit(world, tables, orders, work.wanted, lam, mu, asked, scripted, uncertain, ticks, admitted, work)
            if np.random.random() < 0.05:
                stopped = not stopped and period < full_from + most // 2
            used, running = 0.0, False
            for i in range(arms):
                before = lam[i]
                command = admitted[i]
                if uncertain[i] and period < full_from + most // 2:
                    command = 0.0 if stopped else slow * command
                if uncertain[i] and period < standing:
                    places[i] = lam[i]
                else:
                    path = steps_of(world, i)
                    lam[i], mu[i], done[i] = phase_kernels.advance(
                        path, lam[i], mu[i], command, world.by_speed, world.tick, ticks, places[i], speeds, 1.0,
                    )  # fmt: skip
                if before < length_of(world, i):
                    counts[STEPS] += 1
                    used = max(used, done[i])
                    figures[CHANGE] += asked[i] - admitted[i]
                    counts[CHANGED] += admitted[i] < asked[i]
                running = running or lam[i] < length_of(world, i)
            for p in range(world.clearance.shape[0]):
                table, a, b = clearance_of(world, p), world.clearance[p, 0], world.clearance[p, 1]
                if scripted[a] and scripted[b]:
                    continue
                for k in range(ticks):
                    distance = tabulated_clearance(table, places[a, k], places[b, k])
                    figures[CLEARANCE] = min(figures[CLEARANCE], distance)
                    violated = violated or not distance >= d_min
            if not running:
                figures[MAKESPAN] = max(figures[MAKESPAN], period * ticks * world.tick + used)
            period += 1
        counts[VIOLATIONS] += violated


def shield_trial(
    cell: CoordinationCell,
    requests: str,
    steps: int,
    *,
    seed: int = 0,
    scripted: Sequence[int] = (),
    uncertain: Sequence[int] = (),
    shielded: bool = True,
    channel: str = "speed",
    **options: Unpack[CoordinationKeywords],
) -> ShieldTrial:
    """Run so many agent steps, episode after episode, each at some instant turning to full speed until its end.

    Args:
        cell: The cell.
        requests: One of ``REQUESTS``: always full speed; drawn anew every step; drawn now and then; stop and go; or
            one of these for every arm and episode.
        steps: Agent steps.
        seed: Of what is drawn.
        scripted: Arms at full speed whatever the shield wants, which knows.
        uncertain: Arms that are late, slow, and stop and go; the shield knows only that.
        shielded: Without: the same requests as they are.
        channel: One of ``CHANNELS``: commands alone; with priorities that change, in every second episode every period;
            or orders that are asked for as often. They go on after commands have turned to full speed.
        **options: ``mode``; ``start_phase``, up to which share of their paths the arms may start.

    Raises:
        InfeasibleError: The shield finds no passing order.
    """
    simulation = CoordinationSimulation(cell, ideal_options(CoordinationOptions, options, shield_trial))
    phase = float(np.max(simulation.options.start_phase))
    world = simulation.world
    shield = Shield(cell, world, scripted=scripted)
    shield.reset(np.zeros(len(cell.arms)))
    marks = np.zeros((2, len(cell.arms)), dtype=np.bool_)
    marks[0, list(scripted)], marks[1, list(uncertain)] = True, True
    counts, figures = np.zeros(5, dtype=np.int64), np.array([0.0, 0.0, np.inf])
    most = int(np.ceil(SEQUENTIAL_TIMES * cell.sequential_makespan / cell.control_period))
    _run(
        world, shield.tables, shield.orders, shield.work, shielded, REQUESTS.index(requests),
        CHANNELS.index(channel), phase, marks[0], marks[1], cell.ticks_per_period, cell.d_min, most, steps, seed,
        counts, figures,
    )  # fmt: skip
    agent_steps, episodes, violations, stuck, changed = (int(count) for count in counts)
    return ShieldTrial(
        steps=agent_steps,
        episodes=episodes,
        violations=violations,
        stuck=stuck,
        changed=changed / agent_steps,
        change=float(figures[CHANGE]) / agent_steps,
        makespan=float(figures[MAKESPAN]),
        clearance=float(figures[CLEARANCE]),
    )
