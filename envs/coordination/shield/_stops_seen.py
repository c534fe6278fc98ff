"""Compiled: which arms stand though they were sent on, and for how long one should expect it; from their places alone.

Where the references of the arms are is known to whoever commands them. An arm that does as if it had been told to
brake stands; what share of a command the others obey is seen the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.coordination.world import Episodes, World, length_of, steps_of
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit

EXPECTED_REST_SHARE = 0.3  # of the mean minimum time: how long a stop lasts, before one was seen
BEHIND_SHARE = 1e-6  # of a path: an arm that is so far behind where it was sent is disturbed
UNDECIDED_YET = -1  # control periods since the order was decided


class StopsSeen(NamedTuple):
    """What was seen of E episodes with A arms."""

    lam: Floats  # (E, A) where each arm was when it got its last command
    mu: Floats  # (E, A) how fast
    sent: Floats  # (E, A) that command, as the shield let it through; nan: none yet
    clock: Floats  # (E,) how fast the references' time went then, at most
    stands: Bools  # (E, A) whether it stands though it was sent on
    since: Floats  # (E, A) since when it stands or goes [s]
    stops: Ints  # (E, A) how often it came to stand
    rested: Floats  # (E, A) how long it stood in all, when it goes again [s]
    obeyed: Floats  # (E, A) the share of a command that it obeyed last, where that could be seen
    waited: Ints  # (E,) control periods since the order was decided


def stops_seen(episodes: int, arms: int) -> StopsSeen:
    """Of so many episodes that have not begun."""
    shape = (episodes, arms)
    return StopsSeen(
        lam=np.zeros(shape), mu=np.zeros(shape), sent=np.full(shape, np.nan), clock=np.ones(episodes),
        stands=np.zeros(shape, dtype=np.bool_), since=np.zeros(shape), stops=np.zeros(shape, dtype=np.int64),
        rested=np.zeros(shape), obeyed=np.ones(shape), waited=np.full(episodes, UNDECIDED_YET, dtype=np.int64),
    )  # fmt: skip


@njit
def forget(seen: StopsSeen, active: Bools) -> None:
    """The active ones (E,) of the episodes begin anew."""
    for e in range(active.shape[0]):
        if active[e]:
            seen.sent[e], seen.clock[e] = np.nan, 1.0
            seen.stands[e], seen.since[e], seen.stops[e], seen.rested[e] = False, 0.0, 0, 0.0
            seen.obeyed[e], seen.waited[e] = 1.0, UNDECIDED_YET


@njit
def note_commands(seen: StopsSeen, episodes: Episodes, e: int, sent: Floats) -> None:
    """The arms of episode e, where they are now, are given the commands (A,)."""
    seen.lam[e], seen.mu[e], seen.sent[e], seen.clock[e] = episodes.lam[e], episodes.mu[e], sent, episodes.clock[e]


@njit
def look(world: World, seen: StopsSeen, episodes: Episodes, e: int, ticks: int) -> bool:
    """What the arms of episode e made of the commands of a control period ago; True if one stands now, or goes again.

    An arm that was to brake anyway shows nothing.
    """
    now, tick, changed = episodes.ticks[e] * world.tick, seen.clock[e] * world.tick, False
    places, speeds = np.empty(ticks), np.empty(ticks)
    for i in range(episodes.lam.shape[1]):
        here, end, stands = episodes.lam[e, i], length_of(world, i), False
        if here < end and seen.sent[e, i] > 0.0:
            steps, near = steps_of(world, i), BEHIND_SHARE * end
            goes, _, _ = phase_kernels.advance(
                steps, seen.lam[e, i], seen.mu[e, i], seen.sent[e, i], world.by_speed, tick, ticks, places, speeds, 1.0
            )
            brakes, _, _ = phase_kernels.advance(
                steps, seen.lam[e, i], seen.mu[e, i], 0.0, world.by_speed, tick, ticks, places, speeds, 1.0
            )
            stands = here < goes - near and here <= brakes + near
            if goes > brakes + near:
                seen.obeyed[e, i] = min(max((here - brakes) / (goes - brakes), 0.0), 1.0)
        elif here < end:
            stands = seen.stands[e, i]
        if stands != seen.stands[e, i]:
            changed = True
            if stands:
                seen.stops[e, i] += 1
            else:
                seen.rested[e, i] += now - seen.since[e, i]
            seen.stands[e, i], seen.since[e, i] = stands, now
    return changed


@njit
def still_standing(seen: StopsSeen, e: int, now: float, expected: float, period: float, still: Floats) -> None:
    """Fill ``still`` (A,): for how long each arm is expected to stand on [s], as long as those seen so far did.

    ``expected``: how long a stop lasts, before one was seen [s].
    """
    total, count = expected, 1
    for i in range(still.shape[0]):
        total += seen.rested[e, i]
        count += seen.stops[e, i] - int(seen.stands[e, i])
    for i in range(still.shape[0]):
        left = total / count - (now - seen.since[e, i])
        still[i] = max(left, period) if seen.stands[e, i] else 0.0
