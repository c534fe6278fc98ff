"""Compiled: control periods of an IK cell, from an action to what came of it; for one episode and for many at once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.envs.ik._braking import hold_back
from armtempo.envs.ik._kernels import allowed_speeds, brake, pose_errors, ramp, run_law
from armtempo.planners import IKCell
from armtempo.planners.ik.kernels import Law as IKLaw
from armtempo.planners.ik.kernels import Targets as IKTargets
from armtempo.planners.ik.kernels import scaled
from armtempo.robots import ArmModel, inlined, njit, unlocked

GAIN_RATIO = 4.0
"""By which an action of 1 multiplies a gain, and one of -1 divides it."""
DAMPING_MAX = 0.9
UNLIMITED_STOP_PERIODS = 10  # control periods in which a joint without a limit of its acceleration is planned to stop
CUT_ROUNDING = 1e-9  # of the caps, mean of the joints: less is rounding


class IKDrive(NamedTuple):
    """What the arm of a cell is and may do; all that is the same in every episode."""

    model: ArmModel
    law: IKLaw
    by_gains: bool
    tick: float
    period: float
    speed_max: Floats
    acceleration_max: Floats
    braking: Floats
    """(n,) accelerations at which it is planned to stop."""
    position_min: Floats
    position_max: Floats
    coulomb: Floats
    torque_max: Floats
    scales: Floats
    """(2,) errors of position [m] and orientation [rad] that count as one."""


def make_drive(cell: IKCell, *, by_gains: bool) -> IKDrive:
    """Of a cell."""
    arm = cell.arm
    unlimited = arm.speed_max / (UNLIMITED_STOP_PERIODS * cell.control_period)
    braking = np.where(np.isfinite(arm.acceleration_max), arm.acceleration_max, unlimited)
    return IKDrive(
        arm.model, cell.solver.law, by_gains, cell.physics_tick, cell.control_period, arm.speed_max,
        arm.acceleration_max, braking, arm.position_min, arm.position_max, arm.coulomb.copy(), arm.torque_max.copy(),
        np.array(cell.error_scales),
    )  # fmt: skip


class IKEpisodes(NamedTuple):
    """E episodes."""

    slot: Ints
    """(E,) whose target."""
    tick: Ints
    """(E,)."""
    reference: Floats
    """(E, 3, n) before, now, next."""
    speeds: Floats
    """(E, n) of the reference."""
    hardness: Floats
    """(E,) share of the braking accelerations at which it can stop."""
    error: Floats
    """(E, 6) from the tip to the target now."""
    demand: Floats
    """(E, n) torques of the last tick."""
    squares: Floats
    """(E, 2) of the errors, sums over all ticks."""
    shares: Floats
    """(E, 4) as ``sum_up`` has them, 1 at most, sums over the periods of the last step."""


@njit
def ask_period(
    drive: IKDrive,
    action: Floats,
    targets: IKTargets,
    row: int,
    q: Floats,
    v: Floats,
    reference: Floats,
    hardness: float,
    joints: Floats,
    asked: Floats,
    speeds: Floats,
    after: Floats,
    rows: Floats,
) -> float:
    """References ``joints`` (K, n) of a control period that the arm can follow, and how hard it can brake after it.

    From the positions ``q`` and speeds ``v`` (n,) of its ``reference`` (3, n), and how hard it can brake before. An
    action (n,) of joint speeds at the period's end as shares of their caps: ``asked`` and ``speeds`` are (1, n). Or one
    (4,) of gains and damping of the law, which goes by its ``targets`` from ``row`` on: they are (K, n). ``after`` and
    ``rows`` as ``hold_back`` writes them.
    """
    period, late = drive.period, 0.5
    if drive.by_gains:
        period, late = drive.tick, 1.0
        factors = (
            GAIN_RATIO ** action[0], GAIN_RATIO ** action[1], GAIN_RATIO ** action[2], GAIN_RATIO ** action[3],
        )  # fmt: skip
        own = scaled(drive.law, factors, DAMPING_MAX)
        run_law(drive.model, own, targets, row, q, v, drive.acceleration_max, joints, asked, speeds)
    else:
        for j in range(q.shape[0]):
            asked[0, j] = action[j] * drive.speed_max[j]
        allowed_speeds(
            q, v, asked[0], period, late, drive.speed_max, drive.acceleration_max, drive.position_min,
            drive.position_max, speeds[0],
        )  # fmt: skip
        ramp(q, v, speeds[0], drive.tick, drive.position_min, drive.position_max, joints)
    stopping, slower = np.empty_like(joints), np.empty_like(speeds)
    brake(
        q, v, period, late, hardness * drive.braking, drive.speed_max, drive.position_min, drive.position_max, stopping,
        slower,
    )  # fmt: skip
    found = hold_back(
        drive.model, joints, speeds, stopping, slower, reference, drive.braking, period, drive.position_min,
        drive.position_max, drive.coulomb, drive.torque_max, drive.tick, after, rows,
    )  # fmt: skip
    return float(found if found > 0.0 else hardness)


@njit
def cut_shares(asked: Floats, speeds: Floats, speed_max: Floats, shares: Floats) -> None:
    """What limits cut from L speeds (L, n), as shares (K,) of the caps, mean of the joints, at K ticks, K / L each."""
    K, L = shares.shape[0], asked.shape[0]
    for k in range(K):
        row, total = k * L // K, 0.0
        for j in range(asked.shape[1]):
            total += min(abs(asked[row, j] - speeds[row, j]) / speed_max[j], 1.0)
        total /= asked.shape[1]
        shares[k] = total if total > CUT_ROUNDING else 0.0


@njit
def sum_up(
    errors: Floats, torques: Floats, cuts: Floats, torque_max: Floats, scales: Floats, squares: Floats, shares: Floats
) -> None:
    """Means over a period's K ticks, from their errors (K, 6), torques (K, n) and what was cut (K,).

    ``shares`` (4,): x / (1 + x) of the errors x of position and orientation in their scales, the mean square of the
    torques as shares of their limits, what was cut. The squares of the errors are added to ``squares`` (2,).
    """
    K, n = torques.shape
    shares[:] = 0.0
    for k in range(K):
        for half in range(2):
            square = 0.0
            for r in range(3 * half, 3 * half + 3):
                square += errors[k, r] * errors[k, r]
            squares[half] += square
            x = np.sqrt(square) / scales[half]
            shares[half] += x / (1.0 + x) / K
        for j in range(n):
            use = torques[k, j] / torque_max[j]
            shares[2] += use * use / (K * n)
        shares[3] += cuts[k] / K


@inlined
def _own(targets: IKTargets, slot: int) -> IKTargets:
    return IKTargets(
        targets.position[slot], targets.rotation[slot], targets.velocity[slot], targets.angular_velocity[slot],
        targets.stride, targets.step,
    )  # fmt: skip


@unlocked
def run_ik_periods(
    drive: IKDrive,
    targets: IKTargets,
    lasts: Ints,
    episodes: IKEpisodes,
    first: int,
    last: int,
    active: Bools,
    actions: Floats,
    ticks: int,
    hold: int,
    limit: int,
) -> None:
    """The active ones of the episodes ``first`` to ``last``, always on the reference, under ``actions`` (E, n or 4).

    ``hold`` control periods of ``ticks``, less where their target ends or there have been ``limit`` ticks.

    ``targets``: of all slots (S, ...), and ``lasts`` (S,) how many ticks they last.
    """
    n = drive.torque_max.shape[0]
    steps = ticks if drive.by_gains else 1
    joints, rows, after = np.empty((ticks, n)), np.empty((ticks, 3, n)), np.empty((3, n))
    asked, speeds, cuts = np.empty((steps, n)), np.empty((steps, n)), np.empty(ticks)
    tips, errors, shares = np.empty((ticks, 3)), np.empty((ticks, 6)), np.empty(4)
    for e in range(first, last):
        if not active[e]:
            continue
        slot = episodes.slot[e]
        own, reference, v = _own(targets, slot), episodes.reference[e], episodes.speeds[e]
        episodes.shares[e] = 0.0
        for _ in range(hold):
            tick = episodes.tick[e]
            if tick >= min(lasts[slot], limit):
                break
            episodes.hardness[e] = ask_period(
                drive, actions[e], own, own.stride * tick, reference[2], v, reference, episodes.hardness[e], joints,
                asked, speeds, after, rows,
            )  # fmt: skip
            v[:], reference[:] = speeds[-1], after
            begun = own.stride * (tick + 1)
            pose_errors(drive.model, joints, own.position[begun:], own.rotation[begun:], own.stride, tips, errors)
            cut_shares(asked, speeds, drive.speed_max, cuts)
            sum_up(errors, rows[:, 1], cuts, drive.torque_max, drive.scales, episodes.squares[e], shares)
            for k in range(4):
                episodes.shares[e, k] += min(shares[k], 1.0)
            episodes.tick[e] = tick + ticks
        episodes.error[e] = errors[-1]
        episodes.demand[e] = rows[-1, 2]


@unlocked
def look_ahead(
    model: ArmModel, targets: IKTargets, slot: Ints, q: Floats, rows: Ints, active: Bools, errors: Floats
) -> None:
    """From the tips at ``q`` (E, n) to their targets at ``rows`` (E, L): ``errors`` (E, L, 6)."""
    tip = np.empty((1, 3))
    for e in range(q.shape[0]):
        if not active[e]:
            continue
        own = _own(targets, slot[e])
        for k in range(rows.shape[1]):
            row = rows[e, k]
            pose_errors(
                model, q[e : e + 1], own.position[row:], own.rotation[row:], own.stride, tip, errors[e, k : k + 1]
            )  # fmt: skip
