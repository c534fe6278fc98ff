r"""Motions whose path acceleration is continuous, in closed form, and the certificate of their jerk.

Between rows the path jerk is ``mu_ddot = growth mu + path_jerk``, one of the two being zero:

``growth``: ``mu^2`` is a parabola over ``lambda`` (``growth = d mu_dot / d lambda``). With ``y = growth t^2``,
``C = cosh sqrt y``, ``S = sinh sqrt y / sqrt y`` (cos and sin where y < 0),

    mu = mu_0 C + u_0 t S        lambda = lambda_0 + mu_0 t S + u_0 t^2 (C - 1) / y

and an interval of length h takes ``2 theta artanh(sqrt v) / sqrt v``, ``v = growth theta^2``,
``theta = h / (mu_0 + mu_1)``. ``path_jerk``: ``lambda`` is a cubic in time, as at either end of a motion from rest to
rest, where ``mu^2`` grows with the power 4/3 of the distance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError
from armtempo.planners.geometry import floats
from armtempo.planners.topp._trajectory import (
    CERTIFY_SAMPLES,
    INSIDE_SHARE,
    MotionCertificate,
    PhaseTrajectory,
    worst_share,
)

SERIES_BELOW = 1e-3  # of the square of an angle: there a series of three terms has all digits


def _circular(y: Floats) -> tuple[Floats, Floats]:
    """``cosh sqrt y`` and ``sinh sqrt y / sqrt y``; cos and sin where y < 0."""
    root = np.sqrt(np.abs(y))
    small = np.abs(y) < SERIES_BELOW
    with np.errstate(over="ignore"):
        slope = np.where(y > 0.0, np.sinh(root), np.sin(root)) / np.where(small, 1.0, root)
        value = np.where(y > 0.0, np.cosh(root), np.cos(root))
    return value, np.where(small, 1.0 + y / 6.0 * (1.0 + y / 20.0 * (1.0 + y / 42.0)), slope)


def passing_time(way: Floats, mu_0: Floats, mu_1: Floats, growth: Floats) -> Floats:
    """How long a parabola of ``mu^2`` takes from ``mu_0`` to ``mu_1`` over ``way`` [s]; 0 where nothing moves."""
    pace = mu_0 + mu_1
    theta = np.divide(way, pace, out=np.zeros_like(way), where=pace > 0.0)
    y = growth * theta**2
    small = np.abs(y) < SERIES_BELOW
    root = np.sqrt(np.where(small, 1.0, np.abs(y)))
    inside = np.minimum(root, 1.0 - 1e-16)
    share = np.where(y > 0.0, np.arctanh(inside), np.arctan(root)) / root
    series = 1.0 + y * (1.0 / 3.0 + y * (1.0 / 5.0 + y * (1.0 / 7.0 + y / 9.0)))
    return np.asarray(2.0 * theta * np.where(small, series, share))


@dataclass(frozen=True, kw_only=True, eq=False)
class SmoothTrajectory(PhaseTrajectory):
    """A motion along a path with joint jerk limits: ``mu_dot`` is continuous, and 0 at both ends.

    Attributes:
        mu_dot_start: (N,) path acceleration at the start of every interval between rows.
        growth: (N,) ``d mu_dot / d lambda`` in it [1/s^2].
        path_jerk: (N,) ``mu_ddot`` in it, where growth is 0.
        jerk_max: (n,) limits of the joints' jerk [rad/s^3 or m/s^3]; inf: none.

    Raises:
        InputError: Rows or laws are not arrays of one length.
    """

    mu_dot_start: Floats
    growth: Floats
    path_jerk: Floats
    jerk_max: Floats

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("mu_dot_start", "growth", "path_jerk", "jerk_max"):
            value = floats(getattr(self, name), name, np.inf)
            if name != "jerk_max" and value.shape != (len(self.lam) - 1,):
                raise InputError(f"{name} has shape {value.shape}", remedy=f"give ({len(self.lam) - 1},)")
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def delayed(self, delay: float) -> SmoothTrajectory:
        """The same motion after standing at its start for ``delay`` [s] more."""
        if delay <= 0.0:
            return self
        waiting = super().delayed(delay)
        mu_dot, growth, jerk = (np.append(0.0, law) for law in (self.mu_dot_start, self.growth, self.path_jerk))
        return replace(
            self, lam=waiting.lam, mu=waiting.mu, time=waiting.time, mu_dot_start=mu_dot, growth=growth, path_jerk=jerk
        )

    def at(self, t: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """``lam``, ``mu``, ``mu_dot`` at times ``t`` [s] (any shape); at rest before and after the motion."""
        t = floats(t, "times", np.inf)
        inside = np.clip(t, 0.0, self.duration)
        i = np.clip(np.searchsorted(self.time, inside, side="right") - 1, 0, len(self.time) - 2)
        tau = inside - self.time[i]
        mu_0, u_0, growth, jerk = self.mu[i], self.mu_dot_start[i], self.growth[i], self.path_jerk[i]
        y = growth * tau**2
        value, slope = _circular(y)
        bend = 0.5 * _circular(0.25 * y)[1] ** 2  # (C - 1) / y
        lam = self.lam[i] + tau * (mu_0 * slope + tau * (u_0 * bend + tau * jerk / 6.0))
        mu = np.maximum(mu_0 * value + tau * (u_0 * slope + 0.5 * tau * jerk), 0.0)
        mu_dot = growth * tau * mu_0 * slope + u_0 * value + jerk * tau
        ended = (t < 0.0) | (t > self.duration)
        lam = np.clip(lam, self.lam[i], self.lam[i + 1])
        return lam, np.where(ended, 0.0, mu), np.where(ended, 0.0, mu_dot)

    def _step(self, i: Ints, way: Floats) -> Floats:
        """How long intervals i take for their first ``way`` [s]."""
        way = np.minimum(way, self.lam[i + 1] - self.lam[i])
        mu = np.sqrt(self._squared(i, way))
        step = passing_time(way, self.mu[i], mu, self.growth[i])
        share = way / np.maximum(self.lam[i + 1] - self.lam[i], 1e-300)
        cubic = np.where(self.mu[i] > 0.0, 1.0 - np.cbrt(1.0 - share), np.cbrt(share)) * np.diff(self.time)[i]
        return np.where(self.path_jerk[i] != 0.0, cubic, step)

    def _squared(self, i: Ints, way: Floats) -> Floats:
        """``mu^2`` after a way into intervals i."""
        x = self.mu[i] ** 2 + way * (2.0 * self.mu_dot_start[i] + way * self.growth[i])
        share = way / np.maximum(np.diff(self.lam)[i], 1e-300)
        rising = np.where(self.mu[i] > 0.0, 1.0 - share, share)
        most = np.maximum(self.mu[:-1], self.mu[1:])[i] ** 2
        return np.maximum(np.where(self.path_jerk[i] != 0.0, most * np.maximum(rising, 0.0) ** (4.0 / 3.0), x), 0.0)

    def _accelerations(self, way: Floats) -> Floats:
        """``mu_dot`` (N, K) after ways into every interval."""
        share = way / np.maximum(np.diff(self.lam), 1e-300)[:, None]
        cubic = self.mu_dot_start[:, None] + self.path_jerk[:, None] * np.diff(self.time)[:, None] * np.where(
            self.mu[:-1, None] > 0.0, 1.0 - np.cbrt(np.maximum(1.0 - share, 0.0)), np.cbrt(share)
        )
        parabola = self.mu_dot_start[:, None] + self.growth[:, None] * way
        return np.where(self.path_jerk[:, None] != 0.0, cubic, parabola)

    def torque(self) -> Floats:
        """(N, 2, n) torques at the start and the end of every interval [N m]."""
        way = np.diff(self.lam)[:, None] * np.array([INSIDE_SHARE, 1.0 - INSIDE_SHARE])
        speed = np.stack([self.mu[:-1], self.mu[1:]], axis=1)
        return self.dynamics.torque(self.lam[:-1, None] + way, speed, self._accelerations(way))

    def _samples(self) -> tuple[Floats, Floats, Floats]:
        """``lam``, ``mu``, ``mu_dot`` (N, CERTIFY_SAMPLES) inside every interval."""
        return self._certified_samples

    @cached_property
    def _certified_samples(self) -> tuple[Floats, Floats, Floats]:
        return self.inside(np.linspace(0.0, 1.0, CERTIFY_SAMPLES))

    def inside(self, shares: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """``lam``, ``mu``, ``mu_dot`` (N, K) at ``shares`` (K,) of every interval; its ends belong to it."""
        share = np.clip(np.asarray(shares, dtype=np.float64), INSIDE_SHARE, 1.0 - INSIDE_SHARE)
        way = np.diff(self.lam)[:, None] * share
        every = np.broadcast_to(np.arange(len(self.lam) - 1)[:, None], way.shape)
        return self.lam[:-1, None] + way, np.sqrt(self._squared(every, way)), self._accelerations(way)

    @cached_property
    def _jerk_ratio(self) -> Floats:
        """The largest joint jerk / limit at the samples (N, CERTIFY_SAMPLES)."""
        path = self.dynamics.path
        assert path is not None
        lam, mu, mu_dot = (value[..., None] for value in self._samples())
        _, dq, ddq = path.evaluate(lam[..., 0])
        path_jerk = self.growth[:, None, None] * mu + self.path_jerk[:, None, None]
        jerk = path.third(lam[..., 0]) * mu**3 + 3.0 * ddq * mu * mu_dot + dq * path_jerk
        return worst_share(jerk, self.jerk_max)

    @cached_property
    def certificate(self) -> MotionCertificate:
        """Worst ratios by dense sampling inside every interval, of jerk too, and the errors at the end."""
        return replace(self._certified(), jerk_ratio_max=float(self._jerk_ratio.max()))

    def stations_above(self, tolerance: float) -> Floats:
        """The sampled stations at which a limit, of jerk too, is exceeded by more than that share of it."""
        too_jerky = self._samples()[0][~(self._jerk_ratio <= 1.0 + tolerance)]
        return np.union1d(super().stations_above(tolerance), too_jerky)
