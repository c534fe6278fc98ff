"""Torques of arms that are exactly on their references, from where these were at the ticks."""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners import PathDynamics


def ideal_torque(dynamics: PathDynamics, lam: Floats, mu: Floats, tick: float) -> Floats:
    """Mean torque over each tick.

    Where a tick passes from one piece of the path into another the torque may jump, and no limit holds for the
    dynamics of one piece with the mean acceleration of both: such a tick counts by its two parts.

    Args:
        dynamics: Along the arm's path.
        lam: (T+1,) places at the ticks.
        mu: (T+1,) their rates.
        tick: [s].

    Returns:
        (T+1, n) [N m]; row k from tick k - 1 to tick k, row 0 is 0.
    """
    torque = np.zeros((len(lam), dynamics.joints))
    if len(lam) == 1:
        return torque
    l0, l1, mu0, mu1 = lam[:-1], lam[1:], mu[:-1], mu[1:]
    mu_dot = np.where(l1 > l0, (mu1 - mu0) / tick, 0.0)
    torque[1:] = dynamics.torque(0.5 * (l0 + l1), 0.5 * (mu0 + mu1), mu_dot)
    grid = dynamics.grid
    jumps = np.append(grid[1:][grid[1:] == grid[:-1]], np.inf)
    jump = jumps[np.searchsorted(jumps, l0, side="right")]
    k = np.flatnonzero(jump < l1)
    if not k.size:
        return torque
    l0, l1, mu0, mu1, jump = l0[k], l1[k], mu0[k], mu1[k], jump[k]
    # mu^2 is linear on both sides, and both take a tick: 2 (jump - l0) / (mu0 + m) + 2 (l1 - jump) / (m + mu1) = tick
    half = 0.5 * (mu0 + mu1) - (l1 - l0) / tick
    m = np.sqrt(np.maximum(half**2 - mu0 * mu1 + 2.0 * ((jump - l0) * mu1 + (l1 - jump) * mu0) / tick, 0.0)) - half
    before = dynamics.torque(0.5 * (l0 + jump), 0.5 * (mu0 + m), 0.5 * (m**2 - mu0**2) / (jump - l0))
    after = dynamics.torque(0.5 * (jump + l1), 0.5 * (m + mu1), 0.5 * (mu1**2 - m**2) / (l1 - jump))
    share = np.clip(2.0 * (jump - l0) / ((mu0 + m) * tick), 0.0, 1.0)[:, None]
    torque[k + 1] = share * before + (1.0 - share) * after
    return torque
