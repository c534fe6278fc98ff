"""Motions along a path, ``mu_dot`` constant between rows, and the certificate of what they ask for."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints, all_finite
from armtempo.errors import InfeasibleError, InputError, PathError
from armtempo.planners.geometry import DurationBound, floats
from armtempo.planners.topp._duration_bound import duration_bound
from armtempo.planners.topp._path_dynamics import PathDynamics, moving
from armtempo.robots import njit

CERTIFY_SAMPLES = 10  # per interval, both ends included
INSTANT_SHARE = 1e-12  # of the duration: rows nearer in time than this are one instant (rounding would be their mu_dot)
CAP_FLOOR_SHARE = 1e-5  # of the largest speed cap: a cap below it, beside a stop, is taken for that much
INSIDE_SHARE = 1e-9  # of an interval: each end belongs to its own interval, coefficients may jump at a station


@njit
def _worst_shares(value: Floats, limit: Floats, worst: Floats) -> None:
    """The largest |value| / limit of (M, n) into (M,); NaN stays NaN."""
    for k in range(value.shape[0]):
        largest = 0.0
        for j in range(value.shape[1]):
            share = abs(value[k, j]) / limit[j]
            if not share <= largest:
                largest = share
            if share != share:
                break
        worst[k] = largest


def worst_share(value: Floats, limit: Floats) -> Floats:
    """The largest |value| / limit of (..., n), limits (n,)."""
    worst = np.empty(value.shape[:-1])
    _worst_shares(value.reshape(-1, value.shape[-1]), limit, worst.reshape(-1))
    return worst


@njit
def _limit_shares(torque: Floats, low: Floats, high: Floats, row: Ints, share: Floats, ratio: Floats) -> None:
    """|torque| / limit of (M, n), limits between rows ``row`` and the next.

    Limits that differ in sign count from their middle; a missing one is none.
    """
    for i in range(torque.shape[0]):
        k, after = row[i], share[i]
        for j in range(torque.shape[1]):
            least = (1.0 - after) * low[k, j] + after * low[k + 1, j]
            most = (1.0 - after) * high[k, j] + after * high[k + 1, j]
            middle = 0.5 * (least + most) if np.isfinite(least) and np.isfinite(most) else 0.0
            above = (torque[i, j] - middle) / max(most - middle, 1e-300) if np.isfinite(most) else 0.0
            below = (middle - torque[i, j]) / max(middle - least, 1e-300) if np.isfinite(least) else 0.0
            ratio[i, j] = above if not above <= below else below


@dataclass(frozen=True, kw_only=True, slots=True)
class MotionCertificate:
    """What a motion asks of its arm, sampled densely inside every interval, apart from the planner.

    Attributes:
        torque_ratio_max: Largest |torque| / limit (1 is the limit; limits that differ in sign count from their middle).
        speed_ratio_max: Largest speed / speed limit, of the joints, of mu itself and of the tool.
        acceleration_ratio_max: Largest joint acceleration / limit; 0 without such limits.
        jerk_ratio_max: Largest joint jerk / limit; 0 where none was asked for.
        worst_station: Where the torque ratio is largest [lambda].
        worst_joint: Whose it is.
        end_error: Distance of the last row from the end of the path [lambda].
        end_speed_error: Difference of the last mu from the one wanted.
        dwell_error_max: By how much a dwell of the path is longer or shorter than it is to be [s], at most.
    """

    torque_ratio_max: float
    speed_ratio_max: float
    acceleration_ratio_max: float
    worst_station: float
    worst_joint: int
    end_error: float
    end_speed_error: float
    jerk_ratio_max: float = 0.0
    dwell_error_max: float = 0.0

    @property
    def excess(self) -> float:
        """How far the worst of torque, speed, acceleration, jerk is above its limit, as a share of it; 0 if none is."""
        ratios = (self.torque_ratio_max, self.speed_ratio_max, self.acceleration_ratio_max, self.jerk_ratio_max, 1.0)
        return float(np.max(ratios)) - 1.0  # NaN stays NaN


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseTrajectory:
    """A motion along a path: rows ``(time, lam, mu)``, ``mu_dot`` constant in between (``mu^2`` is linear in ``lam``).

    Attributes:
        lam: (N+1,) stations, never falling; two equal rows at rest are a dwell.
        mu: (N+1,) path speed at the rows.
        time: (N+1,) instants [s], from 0.
        dynamics: What the arm is asked to do along the path.
        mu_end: The path speed wanted at the end.

    Raises:
        InputError: The rows are not three arrays (N+1,) of finite numbers, N > 0.
    """

    lam: Floats
    mu: Floats
    time: Floats
    dynamics: PathDynamics = field(repr=False)
    mu_end: float = 0.0

    def __post_init__(self) -> None:
        for name in ("lam", "mu", "time"):
            value = floats(getattr(self, name), name)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        rows = (self.lam, self.mu, self.time)
        if self.lam.ndim != 1 or len(self.lam) < 2 or len({row.shape for row in rows}) > 1 or not all_finite(*rows):
            raise InputError(
                f"lam, mu and time of shapes {', '.join(str(row.shape) for row in rows)}, or not finite",
                remedy="give three finite arrays (N+1,), N > 0",
            )

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
    def mu_dot(self) -> Floats:
        """(N,) path acceleration between rows; between rows of one instant that of the rows after them."""
        steps = np.diff(self.time)
        lasting = steps > INSTANT_SHARE * self.duration
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
        return self.waiting(0, delay)

    def waiting(self, row: int, delay: float) -> PhaseTrajectory:
        """The same motion that stands still for ``delay`` [s] more at a row at which it rests."""
        if self.mu[row] > 0.0:
            raise InfeasibleError(f"a motion that passes station {self.lam[row]:.4g} cannot wait there")
        parts = (np.split(rows, [row + 1]) for rows in (self.lam, self.mu, self.time))
        (lam, lam_after), (mu, mu_after), (time, time_after) = parts
        return PhaseTrajectory(
            lam=np.concatenate([lam, lam[-1:], lam_after]),
            mu=np.concatenate([mu, [0.0], mu_after]),
            time=np.concatenate([time, time[-1:] + delay, time_after + delay]),
            dynamics=self.dynamics,
            mu_end=self.mu_end,
        )

    def at(self, t: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """``lam``, ``mu``, ``mu_dot`` at times ``t`` [s] (any shape); at rest before and after the motion."""
        t = floats(t, "times", np.inf)
        inside = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.time, inside, side="right") - 1, 0, len(self.time) - 2)
        tau, u = inside - self.time[i], self.mu_dot[i]
        mu = np.maximum(self.mu[i] + u * tau, 0.0)
        lam = np.clip(self.lam[i] + 0.5 * (self.mu[i] + mu) * tau, self.lam[i], self.lam[i + 1])
        ended = (t < 0.0) | (t > self.duration)
        return lam, np.where(ended, 0.0, mu), np.where(ended, 0.0, u)

    def time_at(self, lam: ArrayLike) -> Floats:
        """The first instant [s] at which ``lam`` is reached (any shape); infinite beyond the last row."""
        lam = np.asarray(lam, dtype=np.float64)
        i = np.clip(np.searchsorted(self.lam, lam, side="left") - 1, 0, len(self.lam) - 2)
        step = self._step(i, np.clip(lam - self.lam[i], 0.0, None))
        reached = np.where(lam <= self.lam[0], 0.0, np.minimum(self.time[i] + step, self.time[i + 1]))
        return np.where(lam > self.lam[-1], np.inf, reached)

    def last_time_at(self, lam: ArrayLike) -> Floats:
        """The last instant [s] at which ``lam``, no farther than the last row, is reached (any shape)."""
        lam = np.asarray(lam, dtype=np.float64)
        i = np.clip(np.searchsorted(self.lam, lam, side="right") - 1, 0, len(self.lam) - 2)
        way = np.clip(lam - self.lam[i], 0.0, None)
        return np.minimum(self.time[i] + self._step(i, way), self.time[i + 1])

    def _step(self, i: Ints, way: Floats) -> Floats:
        """How long intervals i take for their first ``way`` [s]."""
        pace = self.mu[i] + np.sqrt(np.maximum(self.mu[i] ** 2 + 2.0 * self.mu_dot[i] * way, 0.0))
        return np.divide(2.0 * way, pace, out=np.zeros_like(way), where=pace > 0.0)

    def torque(self) -> Floats:
        """(N, 2, n) torques at the start and the end of every interval [N m]."""
        inside = INSIDE_SHARE * np.diff(self.lam)
        both = np.stack([self.lam[:-1] + inside, self.lam[1:] - inside], axis=1)
        speed = np.stack([self.mu[:-1], self.mu[1:]], axis=1)
        return self.dynamics.torque(both, speed, np.repeat(self.mu_dot[:, None], 2, axis=1))

    def _samples(self) -> tuple[Floats, Floats, Floats]:
        """``lam``, ``mu``, ``mu_dot`` (N, CERTIFY_SAMPLES) inside every interval."""
        w = np.linspace(0.0, 1.0, CERTIFY_SAMPLES)
        w[0], w[-1] = INSIDE_SHARE, 1.0 - INSIDE_SHARE
        lam = self.lam[:-1, None] + w * np.diff(self.lam)[:, None]
        mu = np.sqrt(np.maximum(self.mu[:-1, None] ** 2 + w * np.diff(self.mu**2)[:, None], 0.0))
        return lam, mu, np.broadcast_to(self.mu_dot[:, None], lam.shape)

    @cached_property
    def _ratios(self) -> tuple[Floats, Floats, Floats]:
        """Torque / limit (N, K, joints), speed / limit and acceleration / limit (N, K) at the samples; none is NaN."""
        lam, mu, mu_dot = self._samples()
        dynamics = self.dynamics
        grid, joints = dynamics.grid, dynamics.joints
        row = np.clip(np.searchsorted(grid, lam, side="right") - 1, 0, len(grid) - 2)
        way = grid[row + 1] - grid[row]
        share = np.divide(lam - grid[row], way, out=np.zeros_like(lam), where=way > 0.0)
        cap2 = np.minimum(dynamics.speed_max, 1e9) ** 2
        known = cap2[cap2 < 1e18]
        floor = max(CAP_FLOOR_SHARE**2 * float(known.max(initial=0.0)), 1e-300)  # 0 over 0 at a stop
        speed = mu / np.sqrt(np.maximum((1.0 - share) * cap2[row] + share * cap2[row + 1], floor))
        arm, path = dynamics.arm, dynamics.path
        acceleration = np.zeros_like(lam)
        if arm is None or path is None:
            torque = dynamics.torque(lam, mu, mu_dot)
        else:  # from the robot model, not from the rows that the planner used
            q, dq, ddq = path.evaluate(lam)
            qd, qdd = dq * mu[..., None], ddq * mu[..., None] ** 2 + dq * mu_dot[..., None]
            torque = arm.inverse_dynamics(q, qd, qdd, friction=False)
            sign = moving(dq)
            # a joint may turn back at either end of an interval, where rounding would choose its sign
            sign[:, 0] = sign[:, -1] = sign[:, CERTIFY_SAMPLES // 2]
            torque += arm.damping * qd + arm.coulomb * np.where(mu[..., None] > 0.0, sign, 0.0)
            speed = np.maximum(speed, worst_share(qd, arm.speed_max))
            speed = np.maximum(speed, dynamics.tool_speed_ratio(lam, mu))
            acceleration = worst_share(qdd, arm.acceleration_max)
        ratio = np.empty((*lam.shape, joints))
        _limit_shares(
            np.ascontiguousarray(torque[..., :joints]).reshape(-1, joints), dynamics.torque_min, dynamics.torque_max,
            row.reshape(-1), share.reshape(-1), ratio.reshape(-1, joints),
        )  # fmt: skip
        ratio[np.diff(self.time) <= 0.0] = 0.0  # two rows of one instant, where coefficients jump: neighbours tell
        if np.isnan(ratio.sum() + speed.sum() + acceleration.sum()):
            at = np.isnan(ratio.sum(axis=-1) + speed + acceleration)
            raise PathError(
                f"what the motion asks for at station {lam[at].flat[0]:.6g} is not a number",
                remedy="the arm, its path and their limits must be finite there",
                station=float(lam[at].flat[0]),
            )
        return ratio, speed, acceleration

    @cached_property
    def certificate(self) -> MotionCertificate:
        """Worst ratios by dense sampling inside every interval, and the errors at the end."""
        return self._certified()

    def _certified(self) -> MotionCertificate:
        torque, speed, acceleration = self._ratios
        worst = np.unravel_index(int(torque.argmax()), torque.shape)
        return MotionCertificate(
            torque_ratio_max=float(torque[worst]),
            speed_ratio_max=float(speed.max()),
            acceleration_ratio_max=float(acceleration.max()),
            worst_station=float(self._samples()[0][worst[0], worst[1]]),
            worst_joint=int(worst[2]),
            end_error=float(abs(self.lam[-1] - self.dynamics.length)),
            end_speed_error=float(abs(self.mu[-1] - self.mu_end)),
            dwell_error_max=self.dwell_error,
        )

    @cached_property
    def dwell_error(self) -> float:
        """By how much a dwell of the path is longer or shorter than it is to be [s], at most; 0 without dwells."""
        path, worst = self.dynamics.path, 0.0
        for part in () if path is None else path.standing:
            if part.exact and self.lam[0] <= part.start and part.stop <= self.lam[-1]:
                lasted = float(self.time_at(part.stop) - self.last_time_at(part.start))
                worst = max(worst, abs(lasted - part.seconds))
        return worst

    @cached_property
    def longest_run(self) -> float:
        """The longest time from one stop of the path, or end, to the next [s]."""
        path = self.dynamics.path
        stops = np.empty(0) if path is None else path.stops
        return float(np.diff(self.time_at(np.concatenate([[self.lam[0]], stops, [self.lam[-1]]]))).max())

    @cached_property
    def bound(self) -> DurationBound:
        """Lower bound of the duration of any motion with the same ends inside the limits; is it proven."""
        first, last = (float(self.lam[end]) for end in (0, -1))
        return duration_bound(self.dynamics, (first, last), (float(self.mu[0]), float(self.mu[-1])))

    def stations_above(self, tolerance: float) -> Floats:
        """The sampled stations at which a torque, speed or acceleration exceeds its limit by more than that share."""
        torque, speed, acceleration = self._ratios
        worst = np.maximum(np.maximum(torque.max(axis=2), speed), acceleration)
        return np.asarray(self._samples()[0][~(worst <= 1.0 + tolerance)])
