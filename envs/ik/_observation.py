"""What the agent of an IK cell sees: one table gives the space, the docstring and the tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Floats32
from armtempo.envs.common import Entry
from armtempo.envs.ik._simulation import IKSimulation
from armtempo.planners import IKCell

PERIODS_AHEAD = (1, 10)
"""Control periods from now at which the target is seen."""
LAG_SCALE = 1e-3  # [rad, m] of a joint: bodies 30 % heavier than believed bring a few of these
AHEAD_SCALE = 10.0  # error scales of the cell: unit of what is ahead

_XYZ = ("x", "y", "z")


def ik_entries(joints: int) -> tuple[Entry, ...]:
    """The entries for an arm of so many joints. World axes; ``x / (1 + |x|)`` for what has no bound."""

    def each(name: str, meaning: str) -> list[Entry]:
        return [Entry(f"{name}_{axis}", -1.0, 1.0, f"{meaning}, {axis}") for axis in _XYZ]

    def every(name: str, meaning: str) -> list[Entry]:
        return [Entry(f"{name}_{j}", -1.0, 1.0, meaning) for j in range(joints)]

    entries = [
        *every("joint", "joint position, lowest -1, highest 1; an angle without limits in half turns"),
        *every("joint_speed", "its speed as a share of its cap"),
        *every("joint_lag", "x / (1 + |x|), x: how far it is behind its reference [mrad, mm]"),
        *each("position_error", "x / (1 + |x|), x: from the tip to the target in error scales"),
        *each("rotation_error", "the same of the rotation vector"),
        *each("target_velocity", "x / (1 + |x|), x: velocity of the target in lengths of the arm per second"),
        *each("target_turning", "x / (1 + |x|), x: angular velocity of the target [rad/s]"),
    ]
    for k in PERIODS_AHEAD:
        periods = f"{k} control period{'s' if k > 1 else ''}"
        entries += each(
            f"ahead_{k}_position", f"as position_error, to the target in {periods}, in {AHEAD_SCALE:g} error scales"
        )
        entries += each(f"ahead_{k}_rotation", "the same of the rotation vector")
    return (
        *entries,
        Entry("singular_value", -1.0, 1.0, "s / (s + damping), 0 is -1, s: the smallest singular value now"),
        Entry("margin", -1.0, 1.0, "distance of the nearest position limit as a share of half its range, 0 is -1"),
        Entry("torque_use", -1.0, 1.0, "largest torque asked for as a share of its limit, 0 is -1"),
        Entry("progress", -1.0, 1.0, "time, start of the target -1, end 1"),
    )


def _soft(x: Floats) -> Floats:
    return np.asarray(x / (1.0 + np.abs(x)))


class IKView(NamedTuple):
    """What E episodes of a cell look like now; their observations are made from it."""

    q: Floats
    """(E, n)."""
    speeds: Floats
    """(E, n) of the joints themselves."""
    reference: Floats
    """(E, n)."""
    error: Floats
    """(E, 6) from the tip to the target."""
    velocity: Floats
    """(E, 3) of the target."""
    turning: Floats
    """(E, 3)."""
    ahead: Floats
    """(E, L, 6) from the tip to the target, ``PERIODS_AHEAD`` periods from now."""
    singular_value: Floats
    """(E,)."""
    demand: Floats
    """(E, n) torques."""
    progress: Floats
    """(E,) share of the target's time."""


def view_of(simulation: IKSimulation) -> IKView:
    """Of one episode."""
    cell, target, row = simulation.cell, simulation.cell.target, 2 * simulation.tick
    q = simulation.joint_positions()
    ahead = [min(row + 2 * cell.ticks_per_period * k, 2 * cell.ticks) for k in PERIODS_AHEAD]
    return IKView(
        q, simulation.measured_speeds[None], simulation.reference[None], simulation.error[None],
        target.velocity[row][None], target.angular_velocity[row][None], simulation.pose_errors(q[0], ahead)[None],
        np.array([simulation.singular_value]), simulation.demand[None], np.array([simulation.tick / cell.ticks]),
    )  # fmt: skip


def observe_ik(cell: IKCell, view: IKView) -> Floats32:
    """Observations (E, size), in the order of ``ik_entries``; a new array."""
    arm, (q, *_) = cell.arm, view
    position_scale, rotation_scale = cell.error_scales
    limited = np.isfinite(arm.position_min) & np.isfinite(arm.position_max)
    low, high = np.where(limited, arm.position_min, -np.pi), np.where(limited, arm.position_max, np.pi)
    shown = np.where(limited, q, (q + np.pi) % (2.0 * np.pi) - np.pi)
    half = 0.5 * (high - low)
    units = AHEAD_SCALE * np.repeat([position_scale, rotation_scale], 3)
    parts = [
        (shown - low) / half - 1.0,
        view.speeds / arm.speed_max,
        _soft((view.reference - q) / LAG_SCALE),
        _soft(view.error[:, :3] / position_scale),
        _soft(view.error[:, 3:] / rotation_scale),
        _soft(view.velocity / cell.solver.length),
        _soft(view.turning),
        _soft(view.ahead / units).reshape(len(q), -1),
    ]
    room = np.minimum(q - arm.position_min, arm.position_max - q) / half
    shares = [
        view.singular_value / (view.singular_value + cell.damping),
        room.min(axis=1, initial=1.0, where=limited),
        (np.abs(view.demand) / arm.torque_max).max(axis=1),
        view.progress,
    ]
    parts.append(2.0 * np.stack(shares, axis=1) - 1.0)
    return np.asarray(np.clip(np.concatenate(parts, axis=1), -1.0, 1.0), dtype=np.float32)
