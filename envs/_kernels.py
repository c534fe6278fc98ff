"""Compiled loops of the environments: arms along their paths tick by tick, the joint controller, the observation.

Arrays have one row per arm, padded to the largest number of joints.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armtempo.envs._world import (
    BLOCK,
    State,
    World,
    clearance_of,
    edges_of,
    last_in_block,
    last_occupied,
    length_of,
    model_of,
    rows_of,
    table_of,
    to_go_of,
)
from armtempo.planners import path_point, phase_kernels, tabulated_clearance
from armtempo.robots import ArmModel, kernels, njit

Array = NDArray[np.float64]


@njit
def run_arm(
    rows: phase_kernels.Rows,
    edges: phase_kernels.Edges,
    lam: float,
    mu: float,
    command: float,
    by_speed: bool,
    tick: float,
    ticks: int,
    out: Array,
) -> tuple[float, float, float]:
    """One command of one arm for so many ticks, without physics: place and speed after them, and the time used.

    ``out`` (ticks,): the place at the end of every tick. The time is less than ``ticks * tick`` only on arrival.
    """
    total, scratch = 0.0, np.empty((0, 3))
    for k in range(ticks):
        if lam < rows.station[-1]:
            lam, mu, used, _ = phase_kernels.advance(rows, edges, lam, mu, command, by_speed, tick, scratch, 0)
            total += used
        out[k] = lam
    return lam, mu, total


@njit
def move(
    rows: phase_kernels.Rows,
    edges: phase_kernels.Edges,
    state: State,
    i: int,
    command: float,
    by_speed: bool,
    late: float,
    time: float,
    tick: float,
) -> None:
    """One tick of arm i's reference; an arm that is ``late`` stands until that instant, whatever its command."""
    dt = min(time + tick - late, tick)
    if dt <= 1e-12 or not np.isnan(state.arrival[i]):
        return
    state.lam[i], state.mu[i], used, _ = phase_kernels.advance(
        rows, edges, state.lam[i], state.mu[i], command, by_speed, dt, np.empty((0, 3)), 0
    )
    if state.lam[i] >= rows.station[-1]:
        state.arrival[i] = time + (tick - dt) + used


@njit
def joint_torques(
    model: ArmModel,
    before: Array,
    now: Array,
    after: Array,
    q: Array,
    qd: Array,
    coulomb: Array,
    torque_max: Array,
    gain: float,
    dt: float,
    demand: Array,
    torque: Array,
) -> None:
    r"""The joint controller of one arm: from measured ``q``, ``qd`` to ``torque``; ``demand`` is before clipping.

    PyBullet steps semi-implicitly: ``qd' = qd + dt qdd(q, qd, tau)``, ``q' = q + dt qd'``. On the plan, the
    acceleration that lands on the next reference is its second difference, and the measured speed is the *backward*
    difference: with both, a plan at the torque limits runs without a reserve. ``before``, ``now``, ``after``:
    references. All (n,).
    """
    n = q.shape[0]
    qdd = np.empty(n)
    for j in range(n):
        wanted = (after[j] - 2.0 * now[j] + before[j]) / (dt * dt)
        speed = (now[j] - before[j]) / dt
        qdd[j] = wanted + gain * gain * (now[j] - q[j]) + 2.0 * gain * (speed - qd[j])
    kernels.inverse_dynamics(model, q, qd, qdd, demand)
    for j in range(n):  # friction: viscous as it is felt, dry as the reference moves
        demand[j] += model.damping[j] * qd[j] + coulomb[j] * np.sign(after[j] - now[j])
        torque[j] = min(max(demand[j], -torque_max[j]), torque_max[j])


@njit
def control(
    world: World,
    state: State,
    commands: Array,
    late: Array,
    time: float,
    gain: float,
    measured: Array,
    reference: Array,
    demand: Array,
    torque: Array,
) -> None:
    """One tick of references and of the joint controllers, from ``measured`` (2, A, n) to ``torque`` (A, n).

    ``reference`` (3, A, n): before, now, next; shifted here.
    """
    dt = world.tick
    arms = demand.shape[0]
    for i in range(arms):
        move(rows_of(world, i), edges_of(world, i), state, i, commands[i], world.by_speed, late[i], time, dt)
        n = world.size[i, 1]
        reference[0, i], reference[1, i] = reference[1, i], reference[2, i]
        path_point(table_of(world, i), state.lam[i], reference[2, i][:n])
        joint_torques(
            model_of(world, i),
            reference[0, i][:n],
            reference[1, i][:n],
            reference[2, i][:n],
            measured[0, i][:n],
            measured[1, i][:n],
            world.coulomb[i],
            world.torque_max[i],
            gain,
            dt,
            demand[i][:n],
            torque[i][:n],
        )


@njit
def moved_closer(before: Array, now: Array, lever: Array) -> float:
    """By how much, at most, two arms have come closer [m] between joint positions (A, n): the two that moved most.

    ``lever`` (A, n): how far a point of the arm gets, at most, per radian or metre of each joint.
    """
    most, second = 0.0, 0.0
    for i in range(now.shape[0]):
        way = 0.0
        for j in range(now.shape[1]):
            way += lever[i, j] * abs(now[i, j] - before[i, j])
        if way > most:
            most, second = way, most
        elif way > second:
            second = way
    return most + second


@njit
def tip_positions(world: World, q: Array, out: Array) -> None:
    """Tips (A, 3) [m] at joint positions ``q`` (A, n)."""
    for i in range(q.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = tip_of(model_of(world, i), q[i][: world.size[i, 1]])


@njit
def tracking_error(world: World, state: State, q: Array, error: Array) -> None:
    """Distance [m] of every tip from its reference on the path, from measured ``q`` (A, n)."""
    for i in range(q.shape[0]):
        n, model = world.size[i, 1], model_of(world, i)
        wanted = np.empty(n)
        path_point(table_of(world, i), state.lam[i], wanted)
        a, b = tip_of(model, q[i][:n]), tip_of(model, wanted)
        error[i] = np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@njit
def tip_of(model: ArmModel, q: Array) -> tuple[float, float, float]:
    n = model.mass.shape[0]
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    kernels.link_frames(model, q, R, p)
    t, last, origin = model.tip_p, R[n - 1], p[n - 1]
    return (
        origin[0] + last[0, 0] * t[0] + last[0, 1] * t[1] + last[0, 2] * t[2],
        origin[1] + last[1, 0] * t[0] + last[1, 1] * t[1] + last[1, 2] * t[2],
        origin[2] + last[2, 0] * t[0] + last[2, 1] * t[1] + last[2, 2] * t[2],
    )


@njit
def _signed(share: float) -> float:
    """[0, 1] to [-1, 1]."""
    return 2.0 * min(max(share, 0.0), 1.0) - 1.0


@njit
def _progress(world: World, state: State, i: int) -> tuple[float, float, float]:
    """Shares of the path, of ``mu*`` and of the minimum time still to go, as signed entries."""
    rows = rows_of(world, i)
    lam = state.lam[i]
    k = phase_kernels.locate(rows.station, lam)
    w = (lam - rows.station[k]) / (rows.station[k + 1] - rows.station[k])
    to_go = to_go_of(world, i)
    edge = phase_kernels.edge_speed(rows, edges_of(world, i), lam)
    return (
        _signed(lam / rows.station[-1]),
        _signed(state.mu[i] / edge if edge > 0.0 else 0.0),
        _signed((to_go[k] + w * (to_go[k + 1] - to_go[k])) / world.scale[i, 0]),
    )


@njit
def _next_region(world: World, state: State, i: int, j: int) -> tuple[float, float]:
    """How far arm i is from the next region that arm j has not released, and how far j must go (shares of paths)."""
    occupied, block = last_occupied(world, i, j), last_in_block(world, i, j)
    rows = occupied.shape[0]
    here = state.lam[i] / length_of(world, i)
    row = min(int(here * rows), rows - 1)
    while row < rows:
        if row % BLOCK == 0 and block[row // BLOCK] < state.lam[j]:
            row += BLOCK
        elif occupied[row] >= state.lam[j]:
            still = occupied[row] - state.lam[j]
            return max(row / rows - here, 0.0), still / length_of(world, j)
        else:
            row += 1
    return 1.0, 0.0


@njit
def observe(world: World, state: State, others: int, own_size: int, other_size: int, out: NDArray[np.float32]) -> None:
    """Write the observations (A, size) of all arms in the order of ``ENTRIES`` (see ``_observation``)."""
    arms = state.lam.shape[0]
    progress = np.empty((arms, 3))
    for i in range(arms):
        progress[i, 0], progress[i, 1], progress[i, 2] = _progress(world, state, i)
    out[:] = 0.0
    for i in range(arms):
        lowest, highest = phase_kernels.acceleration_bounds(rows_of(world, i), state.lam[i], state.mu[i] ** 2)
        out[i, 0], out[i, 1], out[i, 4] = progress[i, 0], progress[i, 1], progress[i, 2]
        out[i, 2] = min(max(lowest / world.scale[i, 1], -1.0), 1.0)
        out[i, 3] = min(max(highest / world.scale[i, 1], -1.0), 1.0)
        taken = np.zeros(arms, np.bool_)
        taken[i] = True
        for slot in range(min(others, arms - 1)):
            best, distance, release = -1, np.inf, 0.0
            for j in range(arms):
                if not taken[j]:
                    way, still = _next_region(world, state, i, j)
                    if way < distance:
                        best, distance, release = j, way, still
            taken[best] = True
            base = own_size + slot * other_size
            out[i, base], out[i, base + 1], out[i, base + 2] = 1.0, _signed(distance), _signed(release)
            out[i, base + 3], out[i, base + 4], out[i, base + 5] = (
                progress[best, 0],
                progress[best, 1],
                progress[best, 2],
            )


@njit
def run_ideal(
    world: World,
    state: State,
    d_min: float,
    commands: Array,
    late: Array,
    first_tick: int,
    ticks: int,
    record: Array,
    others: int,
    own_size: int,
    other_size: int,
    observation: NDArray[np.float32],
) -> tuple[int, bool, float]:
    """Run ticks without physics; stops at the first one that ends closer than ``d_min``.

    ``record`` (ticks, 2 A + 1): lam, mu of all arms, clearance; ``observation``: as ``observe``, in the same call
    because calls cost more than ticks. Returns ticks run, whether one violated, and the smallest clearance.
    """
    arms = commands.shape[0]
    ran, violated, smallest = ticks, False, np.inf
    for i in range(arms):  # one after the other: they do not feel each other
        rows, edges = rows_of(world, i), edges_of(world, i)
        for k in range(ticks):
            time = (first_tick + k) * world.tick
            move(rows, edges, state, i, commands[i], world.by_speed, late[i], time, world.tick)
            record[k, i], record[k, arms + i] = state.lam[i], state.mu[i]
    for k in range(ticks):
        nearest = np.inf
        for p in range(world.clearance.shape[0]):
            i, j = world.clearance[p, 0], world.clearance[p, 1]
            nearest = min(nearest, tabulated_clearance(clearance_of(world, p), record[k, i], record[k, j]))
        record[k, 2 * arms] = nearest
        smallest = min(smallest, nearest)
        if nearest < d_min:  # it ends here: back to where the arms were
            ran, violated = k + 1, True
            for i in range(arms):
                state.lam[i], state.mu[i] = record[k, i], record[k, arms + i]
                if state.arrival[i] > (first_tick + ran) * world.tick:
                    state.arrival[i] = np.nan
            break
    observe(world, state, others, own_size, other_size, observation)
    return ran, violated, smallest
