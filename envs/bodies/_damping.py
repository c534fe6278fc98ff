"""Whether PyBullet's steps are small enough for the damping of the joints, which it applies explicitly."""

from __future__ import annotations

import logging

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import RobotError
from armtempo.planners import Cell
from armtempo.robots import Arm

POSTURES = 33
"""Of each arm along its way, at which that is looked at."""
UNSTABLE, REFUSED, DOUBTFUL = 2.0, 1.8, 1.0
"""Of a joint's damping over its inertia times the tick: speeds grow without end; refused; told."""
_LOG = logging.getLogger("armtempo")


def check_damping(cell: Cell, factor: float = 1.0) -> None:
    """Raise RobotError where the damping of an arm along its way is too strong for the tick; warn where it nearly is.

    A step is ``qd' = qd - dt M^-1 D qd``: where an eigenvalue of ``dt M^-1 D`` is above 2 speeds grow, above 1 they
    change their sign from tick to tick.

    Args:
        cell: The arms, their ways and the tick.
        factor: The damping is so many times as strong beside the inertia as the arms say.
    """
    if not any(arm.damping.any() for arm in cell.arms):
        return  # a cell may have to solve for its ways
    for arm, sweep in zip(cell.arms, cell.sweeps(POSTURES), strict=True):
        rate, joint = _fastest_decay(arm, sweep.q)
        stiffness = cell.physics_tick * factor * rate
        if stiffness <= DOUBTFUL:
            continue
        problem = (
            f"arm {arm.name!r}: the damping of joint {joint!r} over its inertia, {factor * rate:.4g} 1/s, "
            f"is too strong for a tick of {cell.physics_tick:.4g} s "
            f"({stiffness:.2f}, and PyBullet's steps are unstable above {UNSTABLE:g})"
        )
        remedy = f"give the cell a physics_tick_s of {DOUBTFUL / (factor * rate):.2g} or less, or less damping"
        if stiffness > REFUSED:
            raise RobotError(problem, remedy=remedy, element=f"joint {joint!r}")
        _LOG.warning("%s (%s)", problem, remedy)


def _fastest_decay(arm: Arm, q: Floats) -> tuple[float, str]:
    """The largest eigenvalue of M^-1 D at the postures ``q`` (K, n) [1/s], and the joint that moves most in it."""
    M, root = arm.mass_matrix(q), np.sqrt(arm.damping)
    decays, modes = np.linalg.eigh(root[:, None] * np.linalg.inv(M) * root)  # similar to M^-1 D, and symmetric
    k = int(np.argmax(decays[:, -1]))
    return float(decays[k, -1]), arm.joint_names[int(np.argmax(np.abs(modes[k, :, -1])))]
