"""The shield over many episodes at once: the same kernel, an order of passing per episode."""

from __future__ import annotations

from armtempo.arrays import Bools, Floats
from armtempo.envs.coordination.shield._admission import admit
from armtempo.envs.coordination.shield._kernels import Orders, ShieldTables, ShieldWork
from armtempo.envs.coordination.shield._stops_seen import StopsSeen, note_commands
from armtempo.envs.coordination.shield._turning import first_orders, set_wanted
from armtempo.envs.coordination.world import START_ATTEMPTS, Draws, Episodes, World, draw
from armtempo.robots import njit, uncounted, unlocked


@njit
def draw_shielded(
    world: World, draws: Draws, tables: ShieldTables, episodes: Episodes, active: Bools, late: float, scripted: Bools,
    orders: Orders, work: ShieldWork,
) -> int:  # fmt: skip
    """``draw_all`` with orders (E, R) that lead on; -1, or an episode for which there is none."""
    for e in range(active.shape[0]):
        attempt = 0
        while active[e]:
            attempt = draw(world, draws, episodes, e, late, attempt)
            if first_orders(world, tables, episodes.lam[e], scripted, orders[e], work):
                break
            if attempt >= START_ATTEMPTS:
                return e
            attempt += 1
    return -1


@uncounted
def admit_all(
    world: World, tables: ShieldTables, episodes: Episodes, first: int, last: int, active: Bools, orders: Orders,
    asked: Orders, priority: Floats, scripted: Bools, uncertain: Bools, ticks: int, commands: Floats,
    admitted: Floats, work: ShieldWork,
) -> None:  # fmt: skip
    """Commands (E, A) that are let through for the active ones of episodes first..last - 1.

    orders, asked (E, R); priority, uncertain (E, A).
    """
    for e in range(first, last):
        if active[e]:
            set_wanted(tables, asked[e], priority[e], work.wanted)
            admit(
                world,
                tables,
                orders[e],
                work.wanted,
                episodes.lam[e],
                episodes.mu[e],
                commands[e],
                scripted,
                uncertain[e],
                ticks,
                admitted[e],
                work,
            )


@unlocked
def note_all(seen: StopsSeen, episodes: Episodes, first: int, last: int, active: Bools, sent: Floats) -> None:
    """``note_commands`` (E, A) of the active ones of episodes first..last - 1."""
    for e in range(first, last):
        if active[e]:
            note_commands(seen, episodes, e, sent[e])
