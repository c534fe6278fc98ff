"""What a motion along the path of a blend cell asks of its limits and of its arm."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.cells._blend_cell import BlendCell


@dataclass(frozen=True, kw_only=True)
class MotionDemand:
    """What a motion along the path asks for; ratios to the limits (1 is the limit).

    Attributes:
        normal_ratio_max: Normal acceleration.
        jerk_ratio_max: Jerk of the whole vector, between jumps of the curvature.
        torque_ratio_max: Joint torques, by inverse dynamics.
        joint_speed_ratio_max: Joint speeds.
    """

    normal_ratio_max: float
    jerk_ratio_max: float
    torque_ratio_max: float
    joint_speed_ratio_max: float

    @property
    def ratio_max(self) -> float:
        """The worst of them."""
        ratios = (self.normal_ratio_max, self.jerk_ratio_max, self.torque_ratio_max, self.joint_speed_ratio_max)
        return float(np.max(ratios))  # NaN stays NaN


def motion_demand(cell: BlendCell, s: Floats, v: Floats, a: Floats, j: Floats) -> MotionDemand:
    """What a motion asks for, from samples (K,) of length, speed, acceleration and jerk along the path."""
    limits, arm = cell.limits, cell.arm
    _, d1, d2, d3 = cell.blended.derivatives(np.clip(s, 0.0, cell.blended.length))
    normal = np.linalg.norm(d2, axis=-1) * v**2
    jerk = np.linalg.norm(d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None], axis=-1)
    q, dq, ddq = cell.path.evaluate(s)
    qd, qdd = dq * v[:, None], ddq * (v**2)[:, None] + dq * a[:, None]
    torque = arm.inverse_dynamics(q, qd, qdd)
    return MotionDemand(
        normal_ratio_max=float(normal.max()) / limits.normal,
        jerk_ratio_max=float(jerk.max()) / limits.jerk,
        torque_ratio_max=float(np.max(np.abs(torque) / arm.torque_max)),
        joint_speed_ratio_max=float(np.max(np.abs(qd) / arm.speed_max)),
    )
