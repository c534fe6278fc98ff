"""Motions along a path, ``mu_dot`` constant between rows, and the certificate of what they ask for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armtempo.errors import InfeasibleError
from armtempo.planners._path_dynamics import PathDynamics

Array = NDArray[np.float64]
CERTIFY_SAMPLES = 10  # per interval, both ends included
INSTANT = 1e-12  # share of the duration: rows nearer in time than this are one instant (rounding would be their mu_dot)
INSIDE = 1e-9  # share of an interval: each end belongs to its own interval, coefficients may jump at a station


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionCertificate:
    """What a motion asks of its arm, sampled densely inside every interval, apart from the planner.

    Attributes:
        torque_ratio_max: Largest |torque| / limit (1 is the limit; limits that differ in sign count from their middle).
        speed_ratio_max: Largest mu / speed limit.
        worst_station: Where the torque ratio is largest [lambda].
        worst_joint: Whose it is.
        end_error: Distance of the last row from the end of the path [lambda].
        end_speed_error: Difference of the last mu from the one wanted.
    """

    torque_ratio_max: float
    speed_ratio_max: float
    worst_station: float
    worst_joint: int
    end_error: float
    end_speed_error: float

    @property
    def torque_excess(self) -> float:
        """How far the worst torque is above its limit, as a share of it; 0 if it is not."""
        return max(self.torque_ratio_max - 1.0, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseTrajectory:
    """A motion along a path: rows ``(time, lam, mu)``, ``mu_dot`` constant in between (``mu^2`` is linear in ``lam``).

    Attributes:
        lam: (N+1,) stations, never falling; two equal rows at rest are a dwell.
        mu: (N+1,) path speed at the rows.
        time: (N+1,) instants [s], from 0.
        dynamics: What the arm is asked to do along the path.
        mu_end: The path speed wanted at the end.
    """

    lam: Array
    mu: Array
    time: Array
    dynamics: PathDynamics = field(repr=False)
    mu_end: float = 0.0

    def __post_init__(self) -> None:
        for name in ("lam", "mu", "time"):
            value = np.array(getattr(self, name), dtype=np.float64)
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    @classmethod
    def from_profile(
        cls, lam: ArrayLike, mu: ArrayLike, dynamics: PathDynamics, *, delay: float = 0.0, mu_end: float = 0.0
    ) -> PhaseTrajectory:
        """The motion through ``(lam, mu)`` rows, after standing at its start for ``delay`` [s]."""
        lam, mu = np.asarray(lam, dtype=np.float64), np.asarray(mu, dtype=np.float64)
        steps = np.divide(2.0 * np.diff(lam), mu[:-1] + mu[1:], out=np.zeros(len(lam) - 1), where=np.diff(lam) > 0.0)
        time = np.concatenate([[0.0], np.cumsum(steps)])
        return cls(lam=lam, mu=mu, time=time, dynamics=dynamics, mu_end=mu_end).delayed(delay)

    @cached_property
    def mu_dot(self) -> Array:
        """(N,) path acceleration between rows; between rows of one instant that of the rows after them."""
        steps = np.diff(self.time)
        lasting = steps > INSTANT * self.duration
        value = np.divide(np.diff(self.mu), steps, out=np.zeros_like(steps), where=lasting)
        if lasting.any():
            of = np.flatnonzero(lasting)
            value = value[of[np.minimum(np.searchsorted(of, np.arange(len(steps))), len(of) - 1)]]
        value.setflags(write=False)
        return value

    @property
    def duration(self) -> float:
        """Time of the last row [s]."""
        return float(self.time[-1])

    def delayed(self, delay: float) -> PhaseTrajectory:
        """The same motion after standing at its start for ``delay`` [s] more."""
        if delay <= 0.0:
            return self
        if self.mu[0] > 0.0:
            raise InfeasibleError(f"a motion that starts with mu = {self.mu[0]:.4g} cannot wait at its start")
        return PhaseTrajectory(
            lam=np.concatenate([self.lam[:1], self.lam]),
            mu=np.concatenate([[0.0], self.mu]),
            time=np.concatenate([[0.0], self.time + delay]),
            dynamics=self.dynamics,
            mu_end=self.mu_end,
        )

    def at(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """``lam``, ``mu``, ``mu_dot`` at times ``t`` [s] (any shape); at rest before and after the motion."""
        t = np.asarray(t, dtype=np.float64)
        inside = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.time, inside, side="right") - 1, 0, len(self.time) - 2)
        tau, u = inside - self.time[i], self.mu_dot[i]
        mu = np.maximum(self.mu[i] + u * tau, 0.0)
        lam = np.clip(self.lam[i] + 0.5 * (self.mu[i] + mu) * tau, self.lam[i], self.lam[i + 1])
        ended = (t < 0.0) | (t > self.duration)
        return lam, np.where(ended, 0.0, mu), np.where(ended, 0.0, u)

    def time_at(self, lam: ArrayLike) -> Array:
        """The first instant [s] at which ``lam`` is reached (any shape); infinite beyond the last row."""
        lam = np.asarray(lam, dtype=np.float64)
        i = np.clip(np.searchsorted(self.lam, lam, side="left") - 1, 0, len(self.lam) - 2)
        way = np.clip(lam - self.lam[i], 0.0, None)
        mu = np.sqrt(np.maximum(self.mu[i] ** 2 + 2.0 * self.mu_dot[i] * way, 0.0))
        pace = self.mu[i] + mu
        step = np.divide(2.0 * way, pace, out=np.zeros_like(way), where=pace > 0.0)
        reached = np.where(lam <= self.lam[0], 0.0, np.minimum(self.time[i] + step, self.time[i + 1]))
        return np.where(lam > self.lam[-1], np.inf, reached)

    def torque(self) -> Array:
        """(N, 2, n) torques at the start and the end of every interval [N m]."""
        inside = INSIDE * np.diff(self.lam)
        both = np.stack([self.lam[:-1] + inside, self.lam[1:] - inside], axis=1)
        speed = np.stack([self.mu[:-1], self.mu[1:]], axis=1)
        return self.dynamics.torque(both, speed, np.repeat(self.mu_dot[:, None], 2, axis=1))

    @cached_property
    def certificate(self) -> MotionCertificate:
        """Worst torque and speed ratios by dense sampling inside every interval, and the errors at the end."""
        w = np.linspace(0.0, 1.0, CERTIFY_SAMPLES)
        w[0], w[-1] = INSIDE, 1.0 - INSIDE
        lam = self.lam[:-1, None] + w * np.diff(self.lam)[:, None]
        mu = np.sqrt(np.maximum(self.mu[:-1, None] ** 2 + w * np.diff(self.mu**2)[:, None], 0.0))
        mu_dot = np.broadcast_to(self.mu_dot[:, None], lam.shape)
        torque = self._inverse_dynamics(lam, mu, mu_dot)
        grid, dynamics = self.dynamics.grid, self.dynamics
        row = np.clip(np.searchsorted(grid, lam, side="right") - 1, 0, len(grid) - 2)
        way = grid[row + 1] - grid[row]
        share = np.divide(lam - grid[row], way, out=np.zeros_like(lam), where=way > 0.0)[..., None]
        low, high = (
            (1.0 - share) * rows[row] + share * rows[row + 1] for rows in (dynamics.torque_min, dynamics.torque_max)
        )
        both = np.isfinite(low) & np.isfinite(high)
        middle = 0.5 * np.add(low, high, out=np.zeros_like(low), where=both)  # a missing limit is no limit
        half = np.subtract(high, middle, out=np.full_like(low, np.inf), where=np.isfinite(high))
        below = np.subtract(middle, low, out=np.full_like(low, np.inf), where=np.isfinite(low))
        ratio = np.maximum((torque - middle) / np.maximum(half, 1e-300), (middle - torque) / np.maximum(below, 1e-300))
        worst = np.unravel_index(int(ratio.argmax()), ratio.shape)
        cap = np.maximum(dynamics.speed_max[row], dynamics.speed_max[row + 1])
        return MotionCertificate(
            torque_ratio_max=float(ratio[worst]),
            speed_ratio_max=float(np.max(mu / np.maximum(cap, 1e-300))),
            worst_station=float(lam[worst[0], worst[1]]),
            worst_joint=int(worst[2]),
            end_error=float(abs(self.lam[-1] - dynamics.length)),
            end_speed_error=float(abs(self.mu[-1] - self.mu_end)),
        )

    def _inverse_dynamics(self, lam: Array, mu: Array, mu_dot: Array) -> Array:
        """Torques (..., n) from the robot model where there is one, not from the rows that the planner used."""
        arm, path = self.dynamics.arm, self.dynamics.path
        if arm is None or path is None:
            return self.dynamics.torque(lam, mu, mu_dot)
        q, dq, ddq = path.evaluate(lam)
        speed, acceleration = mu[..., None], mu_dot[..., None]
        return arm.inverse_dynamics(q, dq * speed, ddq * speed**2 + dq * acceleration)
