"""Line-speed profiles: travelled length over time in polynomial pieces, and the certificate of what they ask for."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError, brief
from armtempo.planners.geometry import DurationBound, number
from armtempo.planners.line_speed._least_duration import least_duration
from armtempo.planners.line_speed._limits import LineSpeedLimits
from armtempo.planners.line_speed._path_samples import path_marks, path_samples
from armtempo.robots import njit

Reading = Literal["peak", "mean"]

CERTIFY_SAMPLES = 12  # per piece, both ends included
PEAK_CLOSENESS = 2e-2  # of the largest sample: peaks between samples are looked for where they are as close to it
PEAK_SAMPLES, PEAK_ZOOMS = 33, 2  # samples around a peak, and around the peak among those
JOINT_SHARE = 1e-6  # of a piece: instants at which the path bends otherwise are looked at where no knot is closer
ROUNDING = 2e-15  # of a path's length: how far off a length is, to be safe
BOUND_ROUNDING = 1e-9  # of the duration of the fastest profile
END_SHARE = 1e-9  # of a piece: each end belongs to its own piece (jerk, and what a path bends, may jump at a knot)


class SmoothPath(Protocol):
    """A path by arc length with three derivatives, as ``BlendedPath`` and ``CartesianPath`` are."""

    @property
    def length(self) -> float:
        """Arc length [m]."""
        ...

    def derivatives(self, s: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """``p, p', p'', p'''`` at arc length ``s``: each (..., 3)."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class LineSpeedCertificate:
    """What a profile asks for, sampled in every piece, of the path too, and closer at peaks; ratios (1 is the limit).

    Attributes:
        speed_ratio_max: Line speed.
        acceleration_ratio_max: Tangential acceleration.
        jerk_ratio_max: Jerk: of the whole vector along the profile's path, tangential without one.
        normal_ratio_max: Normal acceleration along the profile's path; 0 without one.
        lowest_speed: Smallest line speed [m/s]; below zero the profile runs back.
        gap: Largest jump of length, speed or acceleration between pieces, relative to length and limits.
        end_error: Distance of the end from the length wanted [m].
    """

    speed_ratio_max: float
    acceleration_ratio_max: float
    jerk_ratio_max: float
    normal_ratio_max: float
    lowest_speed: float
    gap: float
    end_error: float

    @property
    def ratio_max(self) -> float:
        """The worst of the four ratios."""
        ratios = (self.speed_ratio_max, self.acceleration_ratio_max, self.jerk_ratio_max, self.normal_ratio_max)
        return float(np.max(ratios))  # NaN stays NaN


@njit
def profile_state(knots: Floats, coefficients: Floats, t: float) -> tuple[float, float, float, float]:
    """Length, speed, acceleration and jerk at time ``t``; at its ends before and after."""
    last = len(coefficients) - 1
    t = min(max(t, knots[0]), knots[last + 1])
    low, high = 0, last
    while low < high:  # the last piece that starts at or before t
        middle = (low + high + 1) // 2
        if knots[middle] <= t:
            low = middle
        else:
            high = middle - 1
    x = t - knots[low]
    c0, c1, c2, c3, c4, c5 = coefficients[low]
    s = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    v = c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    a = 2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))
    j = 6.0 * c3 + x * (24.0 * c4 + x * 60.0 * c5)
    return s, v, a, j


@njit
def profile_states(knots: Floats, coefficients: Floats, t: Floats, out: Floats) -> None:
    """``profile_state`` of many times: (T,) -> ``out`` (4, T)."""
    for i in range(len(t)):
        out[0, i], out[1, i], out[2, i], out[3, i] = profile_state(knots, coefficients, t[i])


@njit
def profile_times(knots: Floats, coefficients: Floats, s: Floats, out: Floats) -> None:
    """The first instants at which the lengths ``s`` are reached, by Newton's method kept inside a bracket."""
    pieces = len(coefficients)
    for i in range(len(s)):
        piece, last = 0, pieces - 1
        while piece < last:  # the last piece that starts before s
            middle = (piece + last + 1) // 2
            if coefficients[middle, 0] < s[i]:
                piece = middle
            else:
                last = middle - 1
        c0, c1, c2, c3, c4, c5 = coefficients[piece]
        low, high = 0.0, knots[piece + 1] - knots[piece]
        x = 0.5 * high
        for _ in range(200):
            error = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5)))) - s[i]
            if error < 0.0:
                low = x
            else:
                high = x
            v = c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
            step = x - error / v if v > 0.0 else 0.5 * (low + high)
            if not low < step < high:
                step = 0.5 * (low + high)
            if step == x or high - low <= 1e-16 * knots[pieces]:
                break
            x = step
        out[i] = knots[piece] + x


@dataclass(frozen=True, kw_only=True, eq=False)
class LineSpeedProfile:
    """Travelled length over time, from rest to rest.

    Attributes:
        knots: (K+1,) instants [s], rising from 0.
        coefficients: (K, 6) length [m] on every piece, rising powers of (t - knot).
        limits: What the profile keeps (with the reading "mean": the peak acceleration that goes with it).
        path: The path it was made for; None if it keeps tangential limits only.
        length: Length wanted [m]; that at the last knot unless given.
    """

    knots: Floats
    coefficients: Floats
    limits: LineSpeedLimits
    path: SmoothPath | None = field(default=None, repr=False)
    length: float = math.nan

    def __post_init__(self) -> None:
        for name in ("knots", "coefficients"):
            value = np.array(getattr(self, name), dtype=np.float64)
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        pieces = len(self.coefficients)
        if self.knots.shape != (pieces + 1,) or self.coefficients.shape != (pieces, 6) or pieces == 0:
            raise InputError(
                f"a profile needs K + 1 knots and K rows of 6 coefficients, got {self.knots.shape} "
                f"and {self.coefficients.shape}"
            )
        if not (np.diff(self.knots) > 0.0).all() or not np.isfinite(self.coefficients).all():
            raise InputError("the knots of a profile must rise, and its coefficients be finite")
        if math.isnan(self.length):
            object.__setattr__(self, "length", self._ends[-1, 0])

    @classmethod
    def plan(cls, length: float, limits: LineSpeedLimits, *, reading: Reading = "peak") -> LineSpeedProfile:
        """The fastest profile over ``length`` [m] with tangential limits only, as in [lee2006].

        Args:
            length: Length of the path [m].
            limits: Speed, acceleration and jerk.
            reading: What ``limits.acceleration`` is: the largest one ("peak"), or the mean over the ramp from rest to
                line speed ("mean", the paper's; where the jerk allows no such mean, only the jerk limits the ramp).

        Raises:
            InputError: A length that is not positive, an unknown reading.
            InfeasibleError: No profile found (numbers too far apart).
        """
        if not 0.0 < number(length, "length") < math.inf:
            raise InputError(f"a line-speed profile needs a positive length, got {brief(length)}")
        if reading not in ("peak", "mean"):
            raise InputError(f"unknown reading {brief(reading)} of the acceleration", remedy="'peak' or 'mean'")
        if reading == "mean":
            limits = replace(limits, acceleration=_peak(limits))
        from ruckig import InputParameter, Result, Ruckig, RuckigError, Trajectory

        wanted, found = InputParameter(1), Trajectory(1)
        wanted.target_position = [length]
        wanted.max_velocity, wanted.max_acceleration = [limits.speed], [limits.acceleration]
        wanted.max_jerk = [limits.jerk]
        try:
            result = Ruckig(1).calculate(wanted, found)
        except RuckigError:
            result = Result.Error
        if result != Result.Working:
            raise InfeasibleError(
                f"no line-speed profile over {length:.6g} m: ruckig says {result.name}", remedy="bring limits closer"
            )
        profile = found.profiles[0][0]
        steps, jerk = np.array(profile.t), np.array(profile.j)
        rows = np.stack([profile.p[:-1], profile.v[:-1], 0.5 * np.array(profile.a[:-1]), jerk / 6.0], axis=1)
        lasting = steps > 0.0
        knots = np.concatenate([[0.0], np.cumsum(steps[lasting])])
        coefficients = np.pad(rows[lasting], ((0, 0), (0, 2)))
        return cls(knots=knots, coefficients=coefficients, limits=limits, length=length)

    @property
    def duration(self) -> float:
        """Time of the last knot [s]."""
        return float(self.knots[-1])

    @cached_property
    def bound(self) -> DurationBound:
        """Proven lower bound of the duration of any profile over its length inside its limits.

        Along a path, if it has one: with rests where the curvature jumps, as a limit of jerk asks for.

        Raises:
            InfeasibleError: As of ``plan``, for a profile without a path.
        """
        if self.path is None:  # the fastest has a closed form
            fastest = self.plan(self.length, self.limits).duration
            return DurationBound(seconds=fastest * (1.0 - BOUND_ROUNDING), proven=True)
        return DurationBound(seconds=least_duration(self.path, self.length, self.limits), proven=True)

    def at(self, t: ArrayLike) -> tuple[Floats, Floats, Floats, Floats]:
        """Length [m], speed, acceleration and jerk at times ``t`` [s] (any shape), clipped to [0, duration]."""
        t = np.asarray(t, dtype=np.float64)
        out = np.empty((4, t.size))
        profile_states(self.knots, self.coefficients, np.ascontiguousarray(t.ravel()), out)
        s, v, a, j = out.reshape(4, *t.shape)
        return s, v, a, j

    def time_at(self, s: ArrayLike) -> Floats:
        """The first instant [s] at which the length ``s`` [m] is reached (any shape), to rounding.

        Raises:
            InputError: A length that is not on the path.
        """
        s = np.asarray(s, dtype=np.float64)
        slack = 1e-9 * self.length
        if s.size and not (s.min() >= -slack and s.max() <= self.length + slack):
            raise InputError(f"lengths must be in 0..{self.length:.6g} m, got {s.min():.6g}..{s.max():.6g}")
        out = np.empty(s.size)
        profile_times(self.knots, self.coefficients, np.ascontiguousarray(s.ravel()), out)
        return out.reshape(s.shape)

    @cached_property
    def _ends(self) -> Floats:
        """(K, 3) length, speed and acceleration at the end of every piece."""
        x = np.diff(self.knots)[:, None]
        powers = x ** np.arange(6)
        c, n = self.coefficients, np.arange(6)
        s = (c * powers).sum(axis=1)
        v = (c[:, 1:] * n[1:] * powers[:, :5]).sum(axis=1)
        a = (c[:, 2:] * n[2:] * n[1:-1] * powers[:, :4]).sum(axis=1)
        return np.stack([s, v, a], axis=1)

    def samples(self, count: int = CERTIFY_SAMPLES) -> Floats:
        """(K, count) instants [s] inside every piece, next to both its ends and evenly between."""
        return self.knots[:-1, None] + shares(count) * np.diff(self.knots)[:, None]

    @cached_property
    def _looked_at(self) -> Floats:
        """(L+1,) instants [s], rising: the knots, and those between at which the path bends otherwise."""
        if self.path is None:
            return self.knots
        s, _ = path_samples(self.path, path_marks(self.path, 0.0, self.path.length))
        at = np.unique(self.time_at(s[s < self.length]))
        piece = np.clip(np.searchsorted(self.knots, at, side="right") - 1, 0, len(self.knots) - 2)
        start, end = self.knots[piece], self.knots[piece + 1]
        # at a knot on a joint of the path, rounding would take the jerk of one side with the bend of the other
        inside = np.minimum(at - start, end - at) > JOINT_SHARE * (end - start)
        return np.sort(np.concatenate([self.knots, at[inside]]))

    @cached_property
    def certificate(self) -> LineSpeedCertificate:
        """Worst ratios inside the pieces, the jumps between them and the error at the end."""
        limits = self.limits

        def sizes(t: Floats) -> Floats:
            s, v, a, j = self.at(t)
            if self.path is None:
                return np.stack([np.abs(v), np.abs(a), np.abs(j), np.zeros_like(v)])
            s = on_own_side(s, t, self.knots, np.append(self.coefficients[:, 0], self.length))
            tangential, normal, jerk = path_quantities(self.path, s, v, a, j)
            return np.stack([np.abs(v), tangential, jerk, normal])

        knots = self._looked_at
        sampled = sizes(knots[:-1, None] + shares(CERTIFY_SAMPLES) * np.diff(knots)[:, None])
        top = sampled.max(axis=(1, 2))
        speed, acceleration, jerk, normal = (float(x) for x in peaks(sizes, knots, sampled, top, PEAK_CLOSENESS))
        starts = self.coefficients[:, :3] * [1.0, 1.0, 2.0]
        scale = np.array([self.length, limits.speed, limits.acceleration])
        jumps = np.concatenate([starts[:1], starts[1:] - self._ends[:-1], self._ends[-1:] * [0.0, 1.0, 1.0]])
        return LineSpeedCertificate(
            speed_ratio_max=speed / limits.speed,
            acceleration_ratio_max=acceleration / limits.acceleration,
            jerk_ratio_max=jerk / limits.jerk,
            normal_ratio_max=normal / limits.normal,
            lowest_speed=float(self.at(self.samples())[1].min()),
            gap=float(np.abs(jumps / scale).max()),
            end_error=float(abs(self._ends[-1, 0] - self.length)),
        )


def shares(count: int) -> Floats:
    """(count,) of a piece: next to both its ends and evenly between."""
    share = np.linspace(0.0, 1.0, count)
    share[0], share[-1] = END_SHARE, 1.0 - END_SHARE
    return share


def peaks(measure: Callable[[Floats], Floats], knots: Floats, sampled: Floats, top: Floats, close: float) -> Floats:
    """The largest values (Q,) of Q quantities over the pieces, also between the samples.

    Args:
        measure: The quantities at instants of any shape, (Q, ...).
        knots: (K+1,) instants [s].
        sampled: (Q, K, S) the quantities at ``shares(S)`` of every piece.
        top: (Q,) what is known to be reached. A peak of the samples is looked at twice as closely where it is nearer
            to it than ``close``, as a share.
        close: See there.
    """
    steps, share = np.diff(knots)[:, None], shares(sampled.shape[2])
    peak = sampled > top[:, None, None] * (1.0 - close)
    peak[..., 1:] &= sampled[..., 1:] >= sampled[..., :-1]
    peak[..., :-1] &= sampled[..., :-1] >= sampled[..., 1:]
    near, at = np.nonzero(peak.any(axis=0))
    low, high = share[np.maximum(at - 1, 0)], share[np.minimum(at + 1, len(share) - 1)]
    for _ in range(PEAK_ZOOMS):
        if not len(near):
            break
        fine = low[:, None] + np.linspace(0.0, 1.0, PEAK_SAMPLES) * (high - low)[:, None]
        values = measure(knots[near][:, None] + fine * steps[near])
        top = np.maximum(top, values.max(axis=(1, 2)))
        kind, of = np.nonzero(values.max(axis=2) > top[:, None] * (1.0 - 1e-4))
        at = values[kind, of].argmax(axis=1)
        near, low, high = near[of], fine[of, np.maximum(at - 1, 0)], fine[of, np.minimum(at + 1, PEAK_SAMPLES - 1)]
    return top


def on_own_side(s: Floats, t: Floats, knots: Floats, lengths: Floats) -> Floats:
    """Lengths ``s`` at instants ``t``, but for rounding between the ``lengths`` (K+1,) of the knots (K+1,) around.

    Where a joint of the path is a knot, rounding would take the jerk of one side with the bend of the other.
    """
    piece = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
    low, high = lengths[piece], np.nextafter(lengths[piece + 1], -np.inf)
    rounding = ROUNDING * lengths[-1]
    s = np.where((s < low) & (s > low - rounding), low, s)
    return np.where((s > high) & (s < high + rounding), high, s)


def path_quantities(path: SmoothPath, s: Floats, v: Floats, a: Floats, j: Floats) -> tuple[Floats, Floats, Floats]:
    """Sizes of the tangential and normal acceleration and of the jerk vector along a path, each shaped as ``s``."""
    v, a, j = (value[..., None] for value in (v, a, j))
    _, d1, d2, d3 = path.derivatives(np.clip(s, 0.0, path.length))
    jerk = d1 * j + 3.0 * d2 * v * a + d3 * v**3
    return np.abs(a[..., 0]), np.linalg.norm(d2 * v**2, axis=-1), np.linalg.norm(jerk, axis=-1)


def _peak(limits: LineSpeedLimits) -> float:
    """Plateau acceleration of a ramp from rest to line speed whose mean acceleration is ``limits.acceleration``."""
    ramp = limits.speed / limits.acceleration
    room = ramp**2 - 4.0 * limits.speed / limits.jerk  # speed / peak + peak / jerk = ramp
    if room <= 0.0:
        return math.sqrt(limits.speed * limits.jerk)
    return 2.0 * limits.speed / (ramp + math.sqrt(room))
