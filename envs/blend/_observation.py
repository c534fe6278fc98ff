"""What the agent of a blend cell sees: one table gives the space, the docstring and the tests."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats32
from armtempo.envs.blend._simulation import BlendSimulation
from armtempo.envs.common import Entry

AHEAD = (0.0, 0.5, 1.0, 2.0)
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
        for k, share in enumerate(AHEAD)
    ),
    Entry("contour_error", -1.0, 1.0, "distance of the tip from the path as a share of what is allowed, 0 is -1"),
    Entry("lag", -1.0, 1.0, "how far the tip is behind its reference along the path, in units of the same"),
    Entry("torque_use", -1.0, 1.0, "largest torque asked for as a share of its limit, 0 is -1"),
    Entry("joint_speed_use", -1.0, 1.0, "largest joint speed as a share of its limit, 0 is -1"),
    Entry("normal_use", -1.0, 1.0, "normal acceleration of the reference as a share of its limit, 0 is -1"),
    Entry("time_to_go", -1.0, 1.0, "what the profile still takes at full rate, as a share of its duration; none is -1"),
)  # fmt: skip

SIGNED = (3, 6 + len(AHEAD))
"""Acceleration and lag: shares that may be negative; all others are mapped from [0, 1]."""


def observe_blend(simulation: BlendSimulation) -> Floats32:
    """The observation now, in the order of ``BLEND_ENTRIES``; a new array."""
    cell, profile = simulation.cell, simulation.profile
    limits, length, allowed = cell.limits, cell.blended.length, cell.contour_error_max
    braking = limits.speed**2 / (2.0 * limits.acceleration)
    bend = cell.blended.curvature(np.minimum(simulation.s + braking * np.array(AHEAD), length)).tolist()
    ahead = [curvature * limits.speed**2 / limits.normal for curvature in bend]
    shares = [
        simulation.s / length,
        simulation.v / limits.speed,
        simulation.tip_speed / limits.speed,
        simulation.a / limits.acceleration,
        simulation.feed.override,
        *(x / (1.0 + x) for x in ahead),
        simulation.contour_error / allowed,
        simulation.lag / allowed,
        float((np.abs(simulation.demand) / cell.arm.torque_max).max()),
        float((np.abs(simulation.joint_speeds) / cell.arm.speed_max).max()),
        bend[0] * simulation.v**2 / limits.normal,
        1.0 - simulation.feed.sigma / profile.duration,
    ]
    entries = [share if k in SIGNED else 2.0 * share - 1.0 for k, share in enumerate(shares)]
    return np.array([min(max(entry, -1.0), 1.0) for entry in entries], dtype=np.float32)
