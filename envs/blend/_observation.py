"""What the agent of a blend cell sees: one table gives the space, the docstring and the tests."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Floats32
from armtempo.envs.blend._simulation import BlendSimulation
from armtempo.envs.common import Entry
from armtempo.planners import BlendCell
from armtempo.planners.blends.kernels import PackedPath, blended_point
from armtempo.robots import njit

BLENDS_AHEAD = (0.0, 0.5, 1.0, 2.0)
"""Where the curvature is looked at: so many braking distances from the line speed ahead of the reference."""

BLEND_ENTRIES = (
    Entry("progress", -1.0, 1.0, "length that the reference has travelled, start -1, end 1"),
    Entry("speed", -1.0, 1.0, "speed of the reference as a share of the line speed, 0 is -1"),
    Entry("tip_speed", -1.0, 1.0, "speed of the tip as a share of the line speed, 0 is -1"),
    Entry("acceleration", -1.0, 1.0, "acceleration of the reference as a share of its limit"),
    Entry("override", -1.0, 1.0, "feed-rate override now, 0 is -1"),
    *(
        Entry(
            f"curvature_{k}", -1.0, 1.0,
            f"x / (1 + x), 0 is -1, x: normal acceleration at line speed {share:g} braking distances ahead / limit",
        )
        for k, share in enumerate(BLENDS_AHEAD)
    ),
    Entry("contour_error", -1.0, 1.0, "distance of the tip from the path as a share of what is allowed, 0 is -1"),
    Entry("lag", -1.0, 1.0, "how far the tip is behind its reference along the path, in units of the same"),
    Entry("torque_use", -1.0, 1.0, "largest torque asked for as a share of its limit, 0 is -1"),
    Entry("joint_speed_use", -1.0, 1.0, "largest joint speed as a share of its limit, 0 is -1"),
    Entry("normal_use", -1.0, 1.0, "normal acceleration of the reference as a share of its limit, 0 is -1"),
    Entry("time_to_go", -1.0, 1.0, "what the profile still takes at full rate, as a share of its duration; none is -1"),
)  # fmt: skip


class BlendScales(NamedTuple):
    """What a cell's observations are shares of."""

    speed: float
    """[m/s]; its square is the next."""
    speed_squared: float
    acceleration: float
    normal: float
    """[m/s^2]."""
    contour_error: float
    """[m]."""
    braking: float
    """Distance from the line speed to rest [m]."""


def scales_of(cell: BlendCell) -> BlendScales:
    """Of a cell."""
    limits = cell.limits
    braking = limits.speed**2 / (2.0 * limits.acceleration)
    return BlendScales(
        limits.speed, limits.speed**2, limits.acceleration, limits.normal, cell.contour_error_max, braking
    )


@njit
def observe_state(
    path: PackedPath,
    scales: BlendScales,
    torque_max: Floats,
    speed_max: Floats,
    state: Floats,
    joint_speeds: Floats,
    demand: Floats,
    seen: Floats32,
) -> None:
    """Write the entries of ``BLEND_ENTRIES`` to ``seen`` (15,).

    ``state`` (8,): length, speed and acceleration of the reference, speed of the tip, contour error, lag, override,
    share of the profile's time that is left.
    """
    length, at, here = path.breakpoints[-1], np.empty((4, 3)), 0.0
    seen[0] = 2.0 * (state[0] / length) - 1.0
    seen[1] = 2.0 * (state[1] / scales.speed) - 1.0
    seen[2] = 2.0 * (state[3] / scales.speed) - 1.0
    seen[3] = state[2] / scales.acceleration
    seen[4] = 2.0 * state[6] - 1.0
    k = 5
    for ahead in BLENDS_AHEAD:
        blended_point(path, min(state[0] + scales.braking * ahead, length), at)
        bend = np.sqrt(at[2, 0] ** 2 + at[2, 1] ** 2 + at[2, 2] ** 2)
        if ahead == 0.0:
            here = bend
        x = bend * scales.speed_squared / scales.normal
        seen[k] = 2.0 * (x / (1.0 + x)) - 1.0
        k += 1
    torque, speed = 0.0, 0.0
    for j in range(demand.shape[0]):
        torque = max(torque, abs(demand[j]) / torque_max[j])
        speed = max(speed, abs(joint_speeds[j]) / speed_max[j])
    seen[k] = 2.0 * (state[4] / scales.contour_error) - 1.0
    seen[k + 1] = state[5] / scales.contour_error
    seen[k + 2] = 2.0 * torque - 1.0
    seen[k + 3] = 2.0 * speed - 1.0
    seen[k + 4] = 2.0 * (here * state[1] ** 2 / scales.normal) - 1.0
    seen[k + 5] = 2.0 * state[7] - 1.0
    for i in range(seen.shape[0]):
        seen[i] = min(max(seen[i], np.float32(-1.0)), np.float32(1.0))


def observe_blend(simulation: BlendSimulation) -> Floats32:
    """The observation now, in the order of ``BLEND_ENTRIES``; a new array."""
    cell, feed = simulation.cell, simulation.feed
    seen = np.empty(len(BLEND_ENTRIES), dtype=np.float32)
    state = np.array([
        simulation.s, simulation.v, simulation.a, simulation.tip_speed, simulation.contour_error, simulation.lag,
        feed.override, 1.0 - feed.sigma / simulation.profile.duration,
    ])  # fmt: skip
    arm = cell.arm
    observe_state(
        cell.blended.packed, scales_of(cell), arm.torque_max, arm.speed_max, state, simulation.joint_speeds,
        simulation.demand, seen,
    )  # fmt: skip
    return seen
