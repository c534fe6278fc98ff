"""Compiled: control periods of a blend cell for many episodes at once, always on the reference.

A period has two halves: the joints in between are numpy's, whose ``arctan2`` has other bits than the compiled one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Floats32, Ints
from armtempo.envs.blend._kernels import follow_ideal
from armtempo.envs.blend._observation import BlendScales, observe_state
from armtempo.planners.blends.kernels import PackedPath, blended_point, corrected_parameters, mapped_positions
from armtempo.planners.line_speed.kernels import advance_often, profile_state, turn
from armtempo.robots import ArmModel, njit, unlocked

PROFILE_PIECES, MARKS, PATH_PIECES, PANELS = range(4)
"""Columns of ``BlendPaths.counts``."""
LENGTH, SPEED, ACCELERATION, SIGMA, OVERRIDE = 0, 1, 2, 4, 5
"""Columns of what ``advance_often`` writes."""
ROW_FIXED = 7
"""Columns of a row of ``follow_ideal`` before those of joints."""


class BlendPaths(NamedTuple):
    """Paths in S slots and their profiles; arrays are as long as the longest needs it."""

    counts: Ints
    """(S, 4) how much of them is used."""
    path: PackedPath
    """With an axis of slots in front of every array."""
    knots: Floats
    """(S, K + 1) of the profile; so are the next four, as ``PackedFeed`` has them."""
    coefficients: Floats
    marks: Floats
    limits: Floats
    shortest: Floats
    """(S,)."""


class BlendEpisodes(NamedTuple):
    """E episodes."""

    slot: Ints
    """(E,) whose path."""
    ticks: Ints
    """(E,)."""
    warp: Floats
    """(E, 10) of the feed override."""
    mapping: Floats
    """(E, 7) state of the paper's mapping."""
    feed: Floats
    """(E, 2) time of the profile [s] and override now."""
    motion: Floats
    """(E, 3) length, speed and acceleration of the reference."""
    reference: Floats
    """(E, 3, n) joints before, now and next."""
    joint_speeds: Floats
    """(E, n)."""
    demand: Floats
    """(E, n) torques of the last tick, before clipping."""
    tip: Floats
    """(E, 3)."""
    station: Floats
    """(E,) place of the path nearest to it [m]."""
    contour_error: Floats
    """(E,) how far it is from there [m]."""
    tip_speed: Floats
    """(E,) point to point [m/s]."""
    arc_speed: Floats
    """(E,) along the path [m/s]."""
    end: Floats
    """(E,) instant at which the reference arrives [s]; nan before."""
    arrival: Floats
    """(E,) the same, once it is past."""


@njit
def path_of(paths: BlendPaths, slot: int) -> PackedPath:
    """The path of a slot."""
    pieces, panels = paths.counts[slot, PATH_PIECES], paths.counts[slot, PANELS]
    own = paths.path
    return PackedPath(
        own.breakpoints[slot, : pieces + 1], own.kind[slot, :pieces], own.shape[slot, :pieces],
        own.first_panel[slot, : pieces + 1], own.panel_start[slot, :panels], own.panel_size[slot, :panels],
        own.inverse[slot, :panels],
    )  # fmt: skip


@unlocked
def plan_periods(
    paths: BlendPaths,
    keeps_normal: int | None,
    paper: bool,
    corrections: tuple[int, bool],
    episodes: BlendEpisodes,
    first: int,
    last: int,
    active: Bools,
    overrides: Floats,
    tick: float,
    motion: Floats,
    full: Floats,
    points: Floats,
) -> None:
    """The reference of a period of the active ones of the episodes ``first`` to ``last``.

    ``keeps_normal``: None for profiles that keep limits along the path only. ``paper`` and ``corrections``: whether the
    paper's mapping is used, and its settings. Written: ``motion`` (E, K, 8), ``full`` (E, K) the speed at full rate
    there, ``points`` (E, K, 3) of the path.
    """
    ticks = motion.shape[1]
    at, zero = np.empty((4, 3)), np.zeros(1)
    lengths, piece, u = np.empty(ticks), np.empty(ticks, dtype=np.int64), np.empty(ticks)
    for e in range(first, last):
        if not active[e]:
            continue
        slot = episodes.slot[e]
        path, pieces = path_of(paths, slot), paths.counts[slot, PROFILE_PIECES]
        knots, coefficients = paths.knots[slot, : pieces + 1], paths.coefficients[slot, :pieces]
        marks, limits = paths.marks[slot, : paths.counts[slot, MARKS]], paths.limits[slot]
        warp, rows = episodes.warp[e], motion[e]
        if keeps_normal is None:
            turn(knots, coefficients, marks, None, limits, warp, overrides[e], paths.shortest[slot])
        else:
            turn(knots, coefficients, marks, path, limits, warp, overrides[e], paths.shortest[slot])
        advance_often(knots, coefficients, warp, tick, rows)
        sigma, rate, duration = episodes.feed[e, 0], episodes.feed[e, 1], knots[pieces]
        if rows[ticks - 1, SIGMA] >= duration > sigma:  # the rest of the way at the rate before, inside the tick
            k = 0
            while rows[k, SIGMA] < duration:
                sigma, rate = rows[k, SIGMA], rows[k, OVERRIDE]
                k += 1
            rest = (duration - sigma) / rate if rate > 0.0 else tick
            episodes.end[e] = episodes.ticks[e] * tick + k * tick + min(rest, tick)
        episodes.feed[e, 0], episodes.feed[e, 1] = rows[ticks - 1, SIGMA], rows[ticks - 1, OVERRIDE]
        for k in range(ticks):
            full[e, k] = profile_state(knots, coefficients, rows[k, SIGMA])[1]
            lengths[k] = min(max(rows[k, LENGTH], 0.0), path.breakpoints[-1])
            if not paper:
                blended_point(path, rows[k, LENGTH], at)
                points[e, k] = at[0]
        if paper:
            state = episodes.mapping[e]
            if episodes.ticks[e] == 0:  # the first tick
                corrected_parameters(path, zero, corrections[0], corrections[1], state, piece, u)
            corrected_parameters(path, lengths, corrections[0], corrections[1], state, piece, u)
            mapped_positions(path, piece, u, points[e])


@unlocked
def follow_periods(
    model: ArmModel,
    paths: BlendPaths,
    episodes: BlendEpisodes,
    first: int,
    last: int,
    active: Bools,
    motion: Floats,
    joints: Floats,
    coulomb: Floats,
    torque_max: Floats,
    gain: float,
    tick: float,
    allowed: float,
    rows: Floats,
    ran: Ints,
) -> None:
    """The same episodes on their references ``joints`` (E, K, n), up to the first tick out of the tube.

    Written: ``rows`` (E, K, 7 + 3 n) as ``follow_ideal`` has them, ``ran`` (E,) how many.
    """
    n = joints.shape[2]
    for e in range(first, last):
        if not active[e]:
            continue
        station, tip, reference = episodes.station[e], episodes.tip[e], episodes.reference[e]
        near = station + episodes.arc_speed[e] * tick if episodes.ticks[e] else motion[e, 0, LENGTH]
        count = follow_ideal(
            model, path_of(paths, episodes.slot[e]), joints[e], reference, coulomb, torque_max, gain, tick, near,
            allowed, tip, rows[e],
        )  # fmt: skip
        rows[e, 0, 3] = (rows[e, 0, 0] - station) / tick
        row = rows[e, count - 1]
        for j in range(n):
            episodes.joint_speeds[e, j] = (reference[2, j] - reference[1, j]) / tick
            episodes.demand[e, j] = row[ROW_FIXED + 2 * n + j]
        episodes.station[e], episodes.contour_error[e] = row[0], row[1]
        episodes.tip_speed[e], episodes.arc_speed[e] = row[2], row[3]
        for k in range(3):
            episodes.motion[e, k] = motion[e, count - 1, LENGTH + k]
        episodes.ticks[e] += count
        if episodes.end[e] <= episodes.ticks[e] * tick + 1e-12 and np.isnan(episodes.arrival[e]):
            episodes.arrival[e] = episodes.end[e]
        ran[e] = count


@unlocked
def observe_episodes(
    paths: BlendPaths,
    episodes: BlendEpisodes,
    first: int,
    last: int,
    changed: Bools,
    scales: BlendScales,
    torque_max: Floats,
    speed_max: Floats,
    seen: Floats32,
) -> None:
    """What is seen in the changed ones of the episodes ``first`` to ``last``: ``seen`` (E, 15)."""
    state = np.empty(8)
    for e in range(first, last):
        if not changed[e]:
            continue
        slot = episodes.slot[e]
        state[:3] = episodes.motion[e]
        state[3], state[4] = episodes.tip_speed[e], episodes.contour_error[e]
        state[5] = episodes.motion[e, LENGTH] - episodes.station[e]
        state[6] = episodes.feed[e, 1]
        state[7] = 1.0 - episodes.feed[e, 0] / paths.knots[slot, paths.counts[slot, PROFILE_PIECES]]
        observe_state(
            path_of(paths, slot), scales, torque_max, speed_max, state, episodes.joint_speeds[e], episodes.demand[e],
            seen[e],
        )  # fmt: skip
