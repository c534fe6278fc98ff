r"""What an interpolating controller makes of the points that it is sent.

Controllers fit a polynomial between two points, as ``joint_trajectory_controller`` does: of the third degree through
(q, qd), of the fifth through (q, qd, qdd). With s in [0, 1] over a period h and d = q_1 - q_0:

    cubic    q = q_0 + h qd_0 s + (3 d - h (2 qd_0 + qd_1)) s^2 + (h (qd_0 + qd_1) - 2 d) s^3
    quintic  the same idea with six coefficients
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.topp import JointTrajectory
from armtempo.robots import Arm

Kind = Literal["cubic", "quintic"]
SHARES = np.linspace(0.0, 1.0, 9)  # of a period: where limits are looked at, on either side of every point


@dataclass(frozen=True, kw_only=True, slots=True)
class Interpolation:
    """What a controller that interpolates points makes of a motion.

    Attributes:
        position_error: Largest distance of a joint from the planned motion [rad or m]; None where nothing is known of
            it between the points.
        joint: Whose it is.
        time: When it is [s].
        speed_ratio_max: Largest joint speed / limit.
        acceleration_ratio_max: Largest joint acceleration / limit; 0 without such limits.
        torque_ratio_max: Largest joint torque / limit by the arm's model; 0 without such limits.
    """

    position_error: float | None
    joint: str
    time: float
    speed_ratio_max: float
    acceleration_ratio_max: float
    torque_ratio_max: float

    @property
    def excess(self) -> dict[str, float]:
        """How far speed, acceleration and torque are above their limits, as a share of them; 0 within."""
        return {
            name: max(getattr(self, f"{name}_ratio_max") - 1.0, 0.0) for name in ("speed", "acceleration", "torque")
        }


def interpolate(points: JointTrajectory, shares: Floats, kind: Kind) -> tuple[Floats, Floats, Floats]:
    """q, qd and qdd (N-1, K, n) at ``shares`` (K,) of every period of points (N, n) [rad or m, s]."""
    h = np.diff(points.time)[:, None, None]
    s = shares[None, :, None]
    q_0, q_1, v_0, v_1 = (value[:, None] for value in (points.q[:-1], points.q[1:], points.qd[:-1], points.qd[1:]))
    d, v_0, v_1 = q_1 - q_0, h * v_0, h * v_1
    if kind == "cubic":
        powers = [q_0, v_0, 3.0 * d - 2.0 * v_0 - v_1, v_0 + v_1 - 2.0 * d]
    else:
        a_0, a_1 = h**2 * points.qdd[:-1, None], h**2 * points.qdd[1:, None]
        powers = [
            q_0,
            v_0,
            0.5 * a_0,
            10.0 * d - 6.0 * v_0 - 4.0 * v_1 - 1.5 * a_0 + 0.5 * a_1,
            -15.0 * d + 8.0 * v_0 + 7.0 * v_1 + 1.5 * a_0 - a_1,
            6.0 * d - 3.0 * (v_0 + v_1) - 0.5 * (a_0 - a_1),
        ]
    q, qd, qdd = (np.zeros(np.broadcast_shapes(d.shape, s.shape)) for _ in range(3))
    for k in reversed(range(len(powers))):  # Horner, with both derivatives
        qdd = qdd * s + qd
        qd = qd * s + q
        q = q * s + powers[k]
    return q, qd / h, 2.0 * qdd / h**2


def interpolation(arm: Arm, points: JointTrajectory, finer: JointTrajectory, kind: Kind) -> Interpolation:
    """What a controller makes of an arm's ``points``, against the same motion at whole parts of their periods.

    Limits are looked at in nine instants of every period, its ends included; torques have friction, by the model.
    """
    parts = (len(finer.time) - 1) // (len(points.time) - 1)
    q, qd, qdd = interpolate(points, SHARES, kind)
    torque = arm.inverse_dynamics(q, qd, qdd)
    error, joint, time = None, "", 0.0
    if parts > 1:
        shares = np.arange(parts) / parts
        made = interpolate(points, shares, kind)[0].reshape(-1, arm.dof)
        off = np.abs(made - finer.q[:-1])
        row, worst = np.unravel_index(int(off.argmax()), off.shape)
        error, joint, time = float(off[row, worst]), arm.joint_names[worst], float(finer.time[row])
    return Interpolation(
        position_error=error,
        joint=joint,
        time=time,
        speed_ratio_max=float((np.abs(qd) / arm.speed_max).max()),
        acceleration_ratio_max=float((np.abs(qdd) / arm.acceleration_max).max()),
        torque_ratio_max=float((np.abs(torque) / arm.torque_max).max()),
    )
