r"""Minimum time along a path by the phase plane (Lee1991 section 2.2, after Shin & McKay 1985).

Find ``mu(lambda)`` that minimises ``T = integral d lambda / mu`` (Lee1991 eq. 14) where every joint keeps
``U_min <= M mu_dot + Q mu^2 + S <= U_max`` and ``0 <= mu <= speed_max``. In ``x = mu^2`` the motion is linear,
``dx/dlambda = 2 mu_dot``, and so are the limits: one backward pass finds the controllable set ``K(lambda)``, one greedy
forward pass the fastest motion inside it. The pointwise largest admissible profile is the optimum.
"""

from __future__ import annotations

import math
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.errors import ActionError, InfeasibleError, InputError
from armtempo.planners._path_dynamics import PathDynamics
from armtempo.planners._phase_kernels import (
    Edges,
    Rows,
    acceleration_bounds,
    advance,
    controllable_sets,
    edge_speed,
    greedy_profile,
)
from armtempo.planners._phase_trajectory import PhaseTrajectory

Array = NDArray[np.float64]
Mode = Literal["speed", "acceleration"]

NO_RECORD = np.empty((0, 3))


@final
class PhasePlane:
    """The controllable set of a path, and motions inside it.

    Args:
        dynamics: Limits along the path.
        mu_end: Path speed wanted at the end.

    Attributes:
        rows: The limits as arrays for compiled loops.
        edges: The controllable set, likewise.

    Raises:
        InfeasibleError: From some station no speed lets the arm reach the end; the message names it, the joint and why.
    """

    def __init__(self, dynamics: PathDynamics, mu_end: float = 0.0) -> None:
        if np.any(dynamics.R != 0.0):
            raise InfeasibleError(
                "viscous friction along the path is not supported by the phase plane yet",
                remedy="set the damping of the joints to 0 in the URDF and leave a torque_reserve for it",
            )
        if not (np.isfinite(mu_end) and mu_end >= 0.0):
            raise InputError(f"mu_end must be finite and not negative, got {mu_end}")
        self.dynamics = dynamics
        self.mu_end = float(mu_end)
        count = len(dynamics.grid)
        self.rows = Rows(
            dynamics.grid,
            dynamics.M,
            dynamics.Q,
            dynamics.R,
            dynamics.torque_min - dynamics.S,
            dynamics.torque_max - dynamics.S,
            np.minimum(dynamics.speed_max, 1e6) ** 2,
        )
        self.edges = Edges(np.zeros(count), np.zeros(count), np.zeros(count - 1), np.zeros(count - 1))
        failed = controllable_sets(self.rows, self.mu_end**2, *self.edges)
        if failed >= 0:
            raise self._explain(failed)

    def _explain(self, row: int) -> InfeasibleError:
        """Why nothing is controllable at a row of the grid."""
        dynamics = self.dynamics
        station = float(dynamics.grid[row])
        hold = dynamics.S[row]
        over = np.maximum(hold - dynamics.torque_max[row], dynamics.torque_min[row] - hold)
        joint = int(over.argmax())
        arm = dynamics.arm
        name = repr(arm.joint_names[joint]) if arm is not None and joint < arm.dof else str(joint)
        of_arm = f" of arm {arm.name!r}" if arm is not None else ""
        if over[joint] > 0.0:
            reason = (
                f"joint {name}{of_arm} needs {hold[joint]:.4g} N m to hold still at station {station:.4g}, "
                f"its limits are [{dynamics.torque_min[row, joint]:.4g}, {dynamics.torque_max[row, joint]:.4g}] N m"
            )
            remedy = "raise limits.torque_nm, lower torque_reserve, or move the path"
        else:
            a, low, high = self.rows.a[row], self.rows.low[row], self.rows.high[row]
            with np.errstate(divide="ignore", invalid="ignore"):
                joint = int(np.where(a > 0.0, high / a, np.where(a < 0.0, low / a, np.inf)).argmin())
            name = repr(arm.joint_names[joint]) if arm is not None and joint < arm.dof else str(joint)
            reason = (
                f"no speed at station {station:.4g}{of_arm} lets the path be finished inside the limits "
                f"(joint {name} limits the acceleration from rest most)"
            )
            remedy = "raise the torque or speed limits there, or smooth the path"
        return InfeasibleError(reason, remedy=remedy, station=station, joint=joint, row=row)

    @property
    def length(self) -> float:
        """``lambda_max``."""
        return self.dynamics.length

    def upper(self, lam: ArrayLike) -> Array:
        """``mu*``: the largest speed at ``lam`` (any shape) from which the end can be met."""
        lam = np.asarray(lam, dtype=np.float64)
        return self._edge(lam, self.edges.high, self.edges.high_next)

    def lower(self, lam: ArrayLike) -> Array:
        """The smallest such speed; positive where the arm cannot hold still."""
        lam = np.asarray(lam, dtype=np.float64)
        return self._edge(lam, self.edges.low, self.edges.low_next)

    def _edge(self, lam: Array, here: Array, there: Array) -> Array:
        grid = self.rows.station
        i = np.clip(np.searchsorted(grid, lam, side="right") - 1, 0, len(grid) - 2)
        w = (lam - grid[i]) / (grid[i + 1] - grid[i])
        return np.sqrt(np.maximum(here[i] + w * (there[i] - here[i]), 0.0))

    def acceleration_bounds(self, lam: float, mu: float) -> tuple[float, float]:
        """LB and UB (Lee1991 eqs. 9-10): the largest deceleration and acceleration the torque limits allow there."""
        low, high = acceleration_bounds(self.rows, float(lam), float(mu) ** 2)
        return float(low), float(high)

    def speed_limit(self) -> Array:
        """(N+1,) the boundary of the admissible region: above it no ``mu_dot`` keeps the limits (Lee1991 eq. 10)."""
        a, b, low, high = self.rows.a, self.rows.b, self.rows.low, self.rows.high
        sign = np.where(a < 0.0, -1.0, 1.0)
        a, b = sign * a, sign * b
        low, high = np.where(sign < 0.0, -high, low), np.where(sign < 0.0, -low, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = b[:, None, :] * a[:, :, None] - b[:, :, None] * a[:, None, :]  # [station, p, q]
            room = high[:, None, :] * a[:, :, None] - low[:, :, None] * a[:, None, :]
            bound = np.where(slope > 0.0, room / slope, np.inf)
        limit: Array = np.sqrt(np.minimum(bound.min(axis=(1, 2)), self.rows.x_cap))
        return limit

    def advance(
        self, lam: float, mu: float, command: float, dt: float, *, mode: Mode = "speed"
    ) -> tuple[float, float, float]:
        """Move for ``dt`` [s] under a command in [0, 1]; returns ``lam``, ``mu`` and the time used (less on arrival).

        ``speed``: heads for ``command`` times ``mu*`` as fast as the torque limits allow, so 1 is the minimum-time
        motion and 0 is maximum braking. ``acceleration``: takes that share of the interval between the lowest and the
        highest admissible ``mu_dot``. From every state reached so, the end can be met at rest.
        """
        command = self._checked(command, lam, mu, dt)
        lam, mu, used, _ = advance(
            self.rows, self.edges, float(lam), float(mu), command, mode == "speed", float(dt), NO_RECORD, 0
        )
        return float(lam), float(mu), float(used)

    @staticmethod
    def _checked(command: float, *state: float) -> float:
        """The command, clipped: beyond [0, 1] it would break the torque limits, and NaN would pass every comparison."""
        if not (math.isfinite(command) and all(math.isfinite(value) for value in state)):
            raise ActionError(
                f"command, lam, mu and time step must be finite, got {command}, {', '.join(map(str, state))}"
            )
        return min(max(float(command), 0.0), 1.0)

    def fastest(self, mu_start: float = 0.0) -> PhaseTrajectory:
        """The minimum-time motion from ``mu_start`` to ``mu_end``.

        Raises:
            InfeasibleError: ``mu_start`` is outside the controllable set; the message gives its ends.
        """
        low, high = float(np.sqrt(self.edges.low[0])), float(np.sqrt(self.edges.high[0]))
        if not low - 1e-9 <= mu_start <= high + 1e-9:
            raise InfeasibleError(
                f"mu_start = {mu_start:.6g} is outside [{low:.6g}, {high:.6g}], from where the end can be met",
                station=float(self.rows.station[0]),
            )
        count = len(self.rows.station)
        x, u = np.empty(count), np.empty(count - 1)
        greedy_profile(self.rows, self.edges, float(mu_start) ** 2, x, u)
        stuck = np.flatnonzero((x[:-1] + x[1:] <= 0.0) & (np.diff(self.rows.station) > 0.0))
        if len(stuck):
            station = float(self.rows.station[stuck[0]])
            raise InfeasibleError(
                f"the arm cannot move on from rest at station {station:.4g}",
                remedy="raise the torque limits; a speed limit of 0 is no limit but a stop",
                station=station,
            )
        return PhaseTrajectory.from_profile(self.rows.station, np.sqrt(x), self.dynamics, mu_end=self.mu_end)

    def braking(self, lam: float, mu: float) -> PhaseTrajectory:
        """Maximum braking from a state to rest (or to the end of the path)."""
        return self.motion([0.0], [np.inf], lam, mu)

    def motion(
        self, commands: ArrayLike, times: ArrayLike, lam: float = 0.0, mu: float = 0.0, *, mode: Mode = "speed"
    ) -> PhaseTrajectory:
        """The motion under commands in [0, 1], each for its time [s], row by row; it ends on arrival or at rest."""
        record = np.empty((8 * len(self.rows.station) + 64 * np.size(times), 3))
        pieces = [np.array([[0.0, lam, mu]])]
        clock = 0.0
        for command, dt in zip(np.atleast_1d(commands), np.atleast_1d(times), strict=True):
            step = min(float(dt), 1e3)
            command = self._checked(command, lam, mu, step)
            lam, mu, used, count = advance(
                self.rows, self.edges, lam, mu, float(command), mode == "speed", step, record, 0
            )
            if count:
                pieces.append(record[:count] + np.array([clock, 0.0, 0.0]))
            clock += used
            seen, place, _ = pieces[-1][-1]
            if lam != place or (
                np.isfinite(dt) and clock > seen
            ):  # the end, reached to rounding; or time spent at rest
                pieces.append(np.array([[clock, lam, mu]]))
            if lam >= self.length:
                break
        rows = np.concatenate(pieces)
        rows = np.repeat(rows, 2, axis=0) if len(rows) == 1 else rows  # at rest, and staying there
        return PhaseTrajectory(
            lam=rows[:, 1], mu=rows[:, 2], time=rows[:, 0], dynamics=self.dynamics, mu_end=self.mu_end
        )

    def edge_speed(self, lam: float) -> float:
        """``mu*`` at one station, without NumPy's overhead."""
        return float(edge_speed(self.rows, self.edges, lam))


def minimum_time(dynamics: PathDynamics, mu_start: float = 0.0, mu_end: float = 0.0) -> PhaseTrajectory:
    """The fastest motion along a path inside its torque and speed limits (Lee1991 problem 1, eqs. 14-16).

    Args:
        dynamics: Limits along the path.
        mu_start: Path speed at the start.
        mu_end: Path speed at the end.

    Raises:
        InfeasibleError: No motion keeps the limits; the message names the station, the joint and the reason.
    """
    return PhasePlane(dynamics, mu_end).fastest(mu_start)
