r"""The dynamics of an arm along its path (Lee1991 eqs. 5 and 8).

With ``q = f(lambda)``, ``mu = dlambda/dt``, the torque of joint i is

    U_i = M_i mu_dot + Q_i mu^2 + R_i mu + S_i,        U_min_i <= U_i <= U_max_i
    M = J f'      Q = J f'' + C[f', f']      R = F_v f'      S = G

====== ========================================== ==========================
symbol meaning                                    unit (lambda in metres)
====== ========================================== ==========================
M      inertia seen by the path acceleration      N m s^2 / m
Q      inertia and Coriolis terms of ``mu^2``     N m s^2 / m^2
R      viscous friction                           N m s / m
S      gravity                                    N m
====== ========================================== ==========================
"""

from __future__ import annotations

from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.errors import InputError
from armtempo.planners._joint_path import JointPath
from armtempo.robots import Arm, kernels

Array = NDArray[np.float64]


def _read_only(value: ArrayLike) -> Array:
    array = np.array(value, dtype=np.float64)
    array.setflags(write=False)
    return array


def _coefficients(arm: Arm, q: Array, dq: Array, ddq: Array) -> list[Array]:
    """M, Q, R, S at samples of a path, each (N, n)."""
    rows = [np.empty_like(q) for _ in range(4)]
    kernels.path_coefficients(arm.model, q, dq, ddq, *rows)
    return rows


@final
class PathDynamics:
    """Rows ``U = M mu_dot + Q mu^2 + R mu + S`` with limits, on a grid of stations.

    Rows need not be joints: acceleration limits are rows with ``M = f'`` and ``Q = f''``.

    Args:
        grid: (N+1,) stations, never falling; a station that appears twice is a jump of the coefficients.
        M: (N+1, n) coefficients of ``mu_dot``.
        Q: (N+1, n) coefficients of ``mu^2``.
        R: (N+1, n) coefficients of ``mu``.
        S: (N+1, n) torques at rest.
        torque_min: (n,) or (N+1, n) lower limits.
        torque_max: (n,) or (N+1, n) upper limits.
        speed_max: Upper limits of ``mu``, (N+1,), or None.

    Raises:
        InputError: A shape is wrong, a number is not finite, or limits cross; the message names the argument.
    """

    def __init__(
        self,
        grid: ArrayLike,
        M: ArrayLike,
        Q: ArrayLike,
        R: ArrayLike,
        S: ArrayLike,
        torque_min: ArrayLike,
        torque_max: ArrayLike,
        speed_max: ArrayLike | None = None,
    ) -> None:
        self.grid = _read_only(grid)
        self.M = _read_only(M)
        shape = self.M.shape
        if len(shape) != 2 or self.grid.shape != shape[:1] or shape[0] < 2 or shape[1] < 1:
            raise InputError(f"grid and M must have shapes (N+1,) and (N+1, n), got {self.grid.shape} and {shape}")
        self.Q, self.R, self.S = (_read_only(value) for value in (Q, R, S))
        for name in ("Q", "R", "S"):
            if getattr(self, name).shape != shape:
                raise InputError(f"{name} must have shape {shape} like M, got {getattr(self, name).shape}")
        limits = []
        for name, value in (("torque_min", torque_min), ("torque_max", torque_max)):
            try:
                limits.append(_read_only(np.broadcast_to(np.asarray(value, dtype=np.float64), shape)))
            except ValueError:
                raise InputError(f"{name} must have shape {shape[1:]} or {shape}, got {np.shape(value)}") from None
        self.torque_min, self.torque_max = limits
        self.speed_max = _read_only(np.full(shape[0], np.inf) if speed_max is None else speed_max)
        if self.speed_max.shape != shape[:1]:
            raise InputError(f"speed_max must have shape {shape[:1]}, got {self.speed_max.shape}")
        for name in ("grid", "M", "Q", "R", "S"):
            if not np.isfinite(getattr(self, name)).all():
                k = int(np.argwhere(~np.isfinite(getattr(self, name)))[0][0])
                raise InputError(f"{name} is not finite at row {k}", row=k)
        if np.isnan(self.torque_min).any() or np.isnan(self.torque_max).any() or np.isnan(self.speed_max).any():
            raise InputError("torque_min, torque_max and speed_max must not hold NaN")
        if (self.speed_max < 0.0).any():
            raise InputError("speed_max must not be negative")
        if (np.diff(self.grid) < 0.0).any() or self.grid[0] == self.grid[1] or self.grid[-1] == self.grid[-2]:
            raise InputError("grid must rise, and may stay at one station for two rows only between its ends")
        if (self.torque_min > self.torque_max).any():
            k, joint = np.argwhere(self.torque_min > self.torque_max)[0]
            raise InputError(f"torque_min exceeds torque_max at row {k}, joint {joint}", row=int(k), joint=int(joint))
        self.arm: Arm | None = None
        self.path: JointPath | None = None

    @classmethod
    def from_path(
        cls, arm: Arm, path: JointPath, *, intervals: int = 1000, torque_reserve: float = 0.0
    ) -> PathDynamics:
        """Sample the dynamics of ``arm`` along ``path`` on a uniform grid (and at the path's breakpoints, twice).

        Args:
            arm: Gives the dynamics and the torque [N m] and speed [rad/s] limits.
            path: Where the arm goes.
            intervals: Number of grid intervals N (breakpoints add to it).
            torque_reserve: Share of every torque limit that the plan leaves unused, in [0, 1).
        """
        if intervals < 1 or not 0.0 <= torque_reserve < 1.0:
            raise InputError(
                f"intervals must be at least 1 and torque_reserve in [0, 1), got {intervals} and {torque_reserve}"
            )
        uniform = np.linspace(0.0, path.length, intervals + 1)
        gap = np.abs(uniform[:, None] - path.breakpoints).min(axis=1)
        uniform = uniform[gap > 0.01 * path.length / intervals]  # no slivers beside breakpoints
        jumps = path.breakpoints[1:-1]
        grid = np.sort(np.concatenate([uniform, path.breakpoints, jumps]))
        q, dq, ddq = path.evaluate(grid)
        for jump in jumps:  # the first of the two rows belongs to the piece before
            k = int(np.searchsorted(grid, jump))
            for rows, value in zip((q, dq, ddq), path.evaluate(jump, before=True), strict=True):
                rows[k] = value
        M, Q, R, S = _coefficients(arm, q, dq, ddq)
        with np.errstate(divide="ignore"):
            speed_max = np.min(np.where(np.abs(dq) > 0.0, arm.speed_max / np.abs(dq), np.inf), axis=1)
        share = 1.0 - torque_reserve
        dynamics = cls(grid, M, Q, R, S, -share * arm.torque_max, share * arm.torque_max, speed_max)
        dynamics.arm, dynamics.path = arm, path
        return dynamics

    @property
    def length(self) -> float:
        """``lambda_max``, the last station."""
        return float(self.grid[-1])

    def evaluate(self, lam: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """M, Q, R, S at any ``lam``, each (..., n): exact from arm and path, else interpolated between stations."""
        lam = np.asarray(lam, dtype=np.float64)
        if self.arm is None or self.path is None:
            M, Q, R, S = (
                np.stack([np.interp(lam, self.grid, column) for column in rows.T], axis=-1)
                for rows in (self.M, self.Q, self.R, self.S)
            )
            return M, Q, R, S
        flat = np.atleast_1d(lam).reshape(-1)
        M, Q, R, S = (row.reshape(*lam.shape, -1) for row in _coefficients(self.arm, *self.path.evaluate(flat)))
        return M, Q, R, S

    def torque(self, lam: ArrayLike, mu: ArrayLike, mu_dot: ArrayLike) -> Array:
        """Torques ``M mu_dot + Q mu^2 + R mu + S`` (..., n) [N m] of a motion (Lee1991 eq. 8)."""
        M, Q, R, S = self.evaluate(lam)
        mu, mu_dot = np.asarray(mu)[..., None], np.asarray(mu_dot)[..., None]
        torque: Array = M * mu_dot + Q * mu**2 + R * mu + S
        return torque
