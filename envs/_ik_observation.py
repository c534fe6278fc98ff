"""What the agent of an IK cell sees: one table gives the space, the docstring and the tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armtempo.envs._ik_simulation import IKSimulation
from armtempo.envs._observation import Entry

AHEAD = (1, 10)
"""Control periods from now at which the target is seen."""
LAG = 1e-3  # [rad, m] of a joint: bodies 30 % heavier than believed bring a few of these
FAR = 10.0  # error scales of the cell: unit of what is ahead

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
    for k in AHEAD:
        periods = f"{k} control period{'s' if k > 1 else ''}"
        entries += each(
            f"ahead_{k}_position", f"as position_error, to the target in {periods}, in {FAR:g} error scales"
        )
        entries += each(f"ahead_{k}_rotation", "the same of the rotation vector")
    return (
        *entries,
        Entry("singular_value", -1.0, 1.0, "s / (s + damping), 0 is -1, s: the smallest singular value now"),
        Entry("margin", -1.0, 1.0, "distance of the nearest position limit as a share of half its range, 0 is -1"),
        Entry("torque_use", -1.0, 1.0, "largest torque asked for as a share of its limit, 0 is -1"),
        Entry("progress", -1.0, 1.0, "time, start of the target -1, end 1"),
    )


def _soft(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(x / (1.0 + np.abs(x)))


def observe_ik(simulation: IKSimulation) -> NDArray[np.float32]:
    """The observation now, in the order of ``ik_entries``; a new array."""
    cell, arm, target = simulation.cell, simulation.cell.arm, simulation.cell.target
    config, row = cell.config, 2 * simulation.tick
    q = simulation.joint_positions()[0]
    limited = np.isfinite(arm.position_min) & np.isfinite(arm.position_max)
    low, high = np.where(limited, arm.position_min, -np.pi), np.where(limited, arm.position_max, np.pi)
    shown = np.where(limited, q, (q + np.pi) % (2.0 * np.pi) - np.pi)
    half = 0.5 * (high - low)
    parts = [
        (shown - low) / half - 1.0,
        simulation.measured_speeds / arm.speed_max,
        _soft((simulation.reference - q) / LAG),
        _soft(simulation.error[:3] / config.error_scale_m),
        _soft(simulation.error[3:] / config.error_scale_rad),
        _soft(target.velocity[row] / cell.solver.length),
        _soft(target.angular_velocity[row]),
    ]
    ahead = [min(row + 2 * cell.ticks_per_period * k, 2 * cell.ticks) for k in AHEAD]
    off = simulation.pose_errors(q, ahead)
    units = FAR * np.repeat([config.error_scale_m, config.error_scale_rad], 3)
    parts.append(_soft(off / units).ravel())
    value = simulation.singular_value
    room = np.minimum(q - arm.position_min, arm.position_max - q) / half
    shares = [
        value / (value + config.law.damping),
        float(room.min(initial=1.0, where=limited)),
        float((np.abs(simulation.demand) / arm.torque_max).max()),
        simulation.tick / cell.ticks,
    ]
    parts.append(2.0 * np.array(shares) - 1.0)
    return np.asarray(np.clip(np.concatenate(parts), -1.0, 1.0), dtype=np.float32)
