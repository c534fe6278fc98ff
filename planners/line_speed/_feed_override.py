"""Feed-rate override: a profile run slower, or stopped and resumed, while it runs, within the same limits.

The profile is read at a warped time ``sigma`` with ``sigma' = f`` in [0, 1]. Then ``v = v0 f``, ``a = a0 f^2 + v0 f'``
and ``j = j0 f^3 + 3 a0 f f' + v0 f''``: a constant ``f`` is always within limits that hold at ``f = 1``. A transition
between two values is a quintic in time, smooth at both ends, and is taken only when all of it keeps the limits.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError, InputError, brief
from armtempo.planners.blends import Blend, BlendedPath
from armtempo.planners.blends.kernels import PackedPath, blended_point
from armtempo.planners.geometry import Arc, CartesianPath, Line
from armtempo.planners.line_speed._limits import LineSpeedLimits
from armtempo.planners.line_speed._profile import LineSpeedProfile, profile_state
from armtempo.robots import njit
from armtempo.state import Stateful

# Of a warp: sigma at its start, time since then, duration, first coefficient of f, override wanted.
WARP_START, WARP_PAST, WARP_LASTS, WARP_POWERS, WARP_WANTED = 0, 1, 2, 3, 9
TRANSITION_SAMPLES = 16  # samples of a whole transition, to refuse most of them early
PIECE_SAMPLES_MIN = 4  # samples of every piece of the profile, at least
OVERRIDE_ROUNDING = 1e-14
LIMIT_RESERVE_SHARE = 2e-3  # for what lies between samples; where the profile itself asks for more, that holds
FIRST_DURATION_SHARE = 0.02  # of the ramp to line speed: the first duration tried
DURATION_GROWTH, DURATIONS_TRIED = 1.25, 24
SHARES_TRIED = 6  # of the way to the override wanted: all, a half, a quarter..


PathOf = BlendedPath | CartesianPath | Blend | Line | Arc


class PackedFeed(NamedTuple):
    """What the loops know of a profile that is turned down and up."""

    knots: Floats
    """(K + 1,) [s] of the profile."""
    coefficients: Floats
    """(K, 6) of the profile."""
    marks: Floats
    """(M,) instants of the profile [s] between which all is smooth."""
    limits: Floats
    """(4,) speed, acceleration, jerk, normal acceleration."""
    shortest: float
    """The shortest transition tried [s]."""


class FeedOverride(Stateful):
    """A profile with its speed turned down and up while it runs.

    Where the profile itself is at a limit there may be no way to change the override at once; a profile planned with
    less than the limits given here (say 0.9 of them) always leaves some.

    Args:
        profile: What is run at an override of 1.
        limits: What every motion keeps; the profile's own unless given.
        path: Keep normal acceleration and vector jerk along it, too; the one the profile was made for unless given. A
            profile without one keeps tangential limits only.

    Attributes:
        profile: As given.
        limits: As given.

    Raises:
        InfeasibleError: The profile itself does not keep the limits.
        InputError: A path of another kind, or of another length than the profile's.
    """

    changing = ("_warp", "_out")

    def __init__(
        self, profile: LineSpeedProfile, limits: LineSpeedLimits | None = None, path: PathOf | None = None
    ) -> None:
        self.profile = profile
        self.limits = profile.limits if limits is None else limits
        given = profile.path if path is None else path
        path = None if given is None else _checked_path(given, profile.length)
        same = self.limits == profile.limits and path is profile.path  # it may know its certificate already
        certified = profile if same else replace(profile, limits=self.limits, path=path)
        worst = certified.certificate.ratio_max
        if worst > 1.0 + 1e-6:
            raise InfeasibleError(
                f"the profile asks for {worst:.4g} times its limits",
                remedy="plan it with limit_aware_profile" if path is not None else "plan it within these limits",
                ratio=worst,
            )
        limits = self.limits
        self._limits = np.array([limits.speed, limits.acceleration, limits.jerk, limits.normal])
        self._packed = None if path is None else path.packed
        marks = profile.knots if path is None else np.append(profile.knots, profile.time_at(path.packed.breakpoints))
        self._marks = np.unique(marks)  # inside of two of them everything is smooth
        swing = min(limits.acceleration / limits.jerk, math.sqrt(limits.speed / limits.jerk))
        self._shortest = FIRST_DURATION_SHARE * (limits.speed / min(limits.acceleration, limits.jerk * swing) + swing)
        self._warp = np.zeros(10)
        self._out = np.zeros(8)
        self.reset()

    def reset(self) -> None:
        """Back to the start, at an override of 1."""
        self._warp[:] = start_warp()
        self.step(0.0)

    def request(self, override: float) -> bool:
        """Turn to another override [0, 1] as fast as the limits allow, from now on.

        Returns:
            False if no transition that starts now gets there within the limits: the motion goes on as it was, or turns
            to an override in between; ask again.

        Raises:
            InputError: Not a number in [0, 1].
        """
        if not (isinstance(override, int | float | np.number) and 0.0 <= override <= 1.0):
            raise InputError(f"an override is a number in 0..1, got {brief(override)}")
        return bool(
            turn(
                self.profile.knots, self.profile.coefficients, self._marks, self._packed, self._limits,
                self._warp, float(override), self._shortest,
            )
        )  # fmt: skip

    def step(self, dt: float) -> tuple[float, float, float]:
        """Go on by ``dt`` [s]; length [m], speed and acceleration then.

        Raises:
            InputError: Not a finite number, or less than 0.
        """
        if not (isinstance(dt, int | float | np.number) and 0.0 <= dt < math.inf):
            raise InputError(f"a step is a finite number of seconds, 0 or more, got {brief(dt)}")
        advance(self.profile.knots, self.profile.coefficients, self._warp, float(dt), self._out)
        return float(self._out[0]), float(self._out[1]), float(self._out[2])

    def steps(self, dt: float, count: int) -> Floats:
        """Go on by ``dt`` [s] so many times; (count, 8) as ``advance`` writes them."""
        rows = np.empty((count, 8))
        advance_often(self.profile.knots, self.profile.coefficients, self._warp, dt, rows)
        self._out[:] = rows[-1]
        return rows

    @property
    def packed(self) -> PackedFeed:
        """For loops that run it themselves, from ``start_warp`` on."""
        profile = self.profile
        return PackedFeed(profile.knots, profile.coefficients, self._marks, self._limits, self._shortest)

    @property
    def jerk(self) -> float:
        """Tangential jerk now [m/s^3]."""
        return float(self._out[3])

    @property
    def sigma(self) -> float:
        """Time of the profile now [s]."""
        return float(self._out[4])

    @property
    def override(self) -> float:
        """The override now."""
        return float(self._out[5])

    @property
    def done(self) -> bool:
        """Whether the end of the profile is reached."""
        return self.sigma >= self.profile.duration


def start_warp() -> Floats:
    """(10,) the warp of a motion that starts at an override of 1."""
    warp = np.zeros(10)
    warp[[WARP_LASTS, WARP_POWERS, WARP_WANTED]] = 1.0
    return warp


def _checked_path(path: Any, length: float) -> BlendedPath | Blend:
    """A path with kernels, as long as the profile."""
    if isinstance(path, Line | Arc):
        path = BlendedPath([path])
    elif isinstance(path, CartesianPath):
        path = BlendedPath(path.segments)  # type: ignore[arg-type]
    if not isinstance(path, BlendedPath | Blend):
        raise InputError(f"the path of an override is a {type(path).__name__}", remedy="give the BlendedPath")
    if abs(path.length - length) > 1e-9 * max(length, path.length):
        raise InputError(
            f"the path is {path.length:.9g} m long but its profile {length:.9g} m",
            remedy="give the path that the profile was made for",
        )
    return path


@njit
def warped(warp: Floats, t: float) -> tuple[float, float, float, float]:
    """``sigma``, ``f`` and its two derivatives at ``t`` [s] after the start of a transition."""
    lasts = warp[WARP_LASTS]
    c0, c1, c2, c3, c4, c5 = warp[WARP_POWERS], warp[4], warp[5], warp[6], warp[7], warp[8]
    x = min(t / lasts, 1.0)
    way = x * (c0 + x * (c1 / 2.0 + x * (c2 / 3.0 + x * (c3 / 4.0 + x * (c4 / 5.0 + x * c5 / 6.0)))))
    f = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * c5))))
    f = min(max(f, 0.0), 1.0)
    sigma = warp[WARP_START] + lasts * way
    if t >= lasts:
        on = warp[WARP_WANTED] * (t - lasts) if warp[WARP_WANTED] > 0.0 else 0.0  # however long it stands
        return sigma + on, warp[WARP_WANTED], 0.0, 0.0
    first = (c1 + x * (2.0 * c2 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))) / lasts
    second = (2.0 * c2 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))) / lasts**2
    return sigma, f, first, second


@njit
def advance(knots: Floats, coefficients: Floats, warp: Floats, dt: float, out: Floats) -> None:
    """Time goes on; ``out``: s, v, a, j, sigma, f, f', f''."""
    warp[WARP_PAST] += dt
    sigma, f, first, second = warped(warp, warp[WARP_PAST])
    end = knots[len(knots) - 1]
    sigma = min(sigma, end)
    s, v, a, j = profile_state(knots, coefficients, sigma)
    out[0] = s
    if sigma < end:
        out[1], out[2] = v * f, a * f**2 + v * first
        out[3] = j * f**3 + 3.0 * a * f * first + v * second
    else:
        out[1], out[2], out[3] = 0.0, 0.0, 0.0
    out[4], out[5], out[6], out[7] = sigma, f, first, second


@njit
def advance_often(knots: Floats, coefficients: Floats, warp: Floats, dt: float, rows: Floats) -> None:
    """``advance`` into each of ``rows`` (K, 8)."""
    for k in range(rows.shape[0]):
        advance(knots, coefficients, warp, dt, rows[k])


@njit
def ratio(
    state: tuple[float, float, float, float], f: float, first: float, second: float, packed: PackedPath | None,
    limits: Floats, point: Floats,
) -> float:  # fmt: skip
    """The worst ratio to the limits at a state of the profile; ``point`` as of ``blended_point`` there."""
    _, v0, a0, j0 = state
    v, a = v0 * f, a0 * f**2 + v0 * first
    j = j0 * f**3 + 3.0 * a0 * f * first + v0 * second
    worst = max(v / limits[0], abs(a) / limits[1])
    if packed is None:
        return float(max(worst, abs(j) / limits[2]))
    normal, jerk = 0.0, 0.0
    for k in range(3):
        normal += point[2, k] ** 2
        jerk += (point[1, k] * j + 3.0 * point[2, k] * v * a + point[3, k] * v**3) ** 2
    return float(max(worst, math.sqrt(normal) * v**2 / limits[3], math.sqrt(jerk) / limits[2]))


@njit
def keeps(
    knots: Floats,
    coefficients: Floats,
    packed: PackedPath | None,
    limits: Floats,
    warp: Floats,
    t: float,
    point: Floats,
) -> bool:
    """Whether a transition keeps the limits at ``t``, with a reserve that the profile itself need not keep."""
    sigma, f, first, second = warped(warp, t)
    state = profile_state(knots, coefficients, sigma)
    if packed is not None:
        blended_point(packed, state[0], point)
    worst = ratio(state, f, first, second, packed, limits, point)
    if worst <= 1.0 - LIMIT_RESERVE_SHARE:
        return True
    return worst <= min(ratio(state, 1.0, 0.0, 0.0, packed, limits, point), 1.0)


@njit
def clean(
    knots: Floats, coefficients: Floats, marks: Floats, packed: PackedPath | None, limits: Floats, warp: Floats,
    point: Floats,
) -> bool:  # fmt: skip
    """Whether a transition keeps the limits all the way, and its override stays in [0, 1]."""
    lasts, end = warp[WARP_LASTS], marks[len(marks) - 1]
    # Of the quintic's six control values, its hull; the last three are the end.
    second = warp[WARP_POWERS] + 0.2 * warp[4]
    third = second + 0.2 * warp[4] + 0.1 * warp[5]
    if min(second, third) < -OVERRIDE_ROUNDING or max(second, third) > 1.0 + OVERRIDE_ROUNDING:
        return False
    for i in range(1, TRANSITION_SAMPLES):
        t = lasts * i / TRANSITION_SAMPLES
        if warped(warp, t)[0] < end and not keeps(knots, coefficients, packed, limits, warp, t, point):
            return False
    now, piece = 0.0, 0
    while piece < len(marks) - 2 and marks[piece + 1] <= warp[WARP_START]:
        piece += 1
    while now < lasts and piece < len(marks) - 1:
        until = lasts  # when the piece of the profile ends
        if warped(warp, lasts)[0] > marks[piece + 1]:
            low, high = now, lasts
            until = 0.5 * (low + high)
            for _ in range(60):
                sigma, f, _, _ = warped(warp, until)
                if sigma < marks[piece + 1]:
                    low = until
                else:
                    high = until
                step = until - (sigma - marks[piece + 1]) / f if f > 0.0 else 0.5 * (low + high)
                if not low < step < high:
                    step = 0.5 * (low + high)
                if abs(step - until) <= 1e-14 * lasts or high - low <= 1e-14 * lasts:
                    break
                until = step
        samples = max(PIECE_SAMPLES_MIN, math.ceil(100.0 * (until - now) / lasts))
        for i in range(samples):
            share = min(max(i / (samples - 1), 1e-9), 1.0 - 1e-9)
            if not keeps(knots, coefficients, packed, limits, warp, now + share * (until - now), point):
                return False
        now = until
        piece += 1
    return True


@njit
def turn(
    knots: Floats, coefficients: Floats, marks: Floats, packed: PackedPath | None, limits: Floats, warp: Floats,
    wanted: float, shortest: float,
) -> bool:  # fmt: skip
    """Put the shortest clean transition to ``wanted`` into ``warp``, or to some of the way; False if not to all."""
    sigma, f, first, second = warped(warp, warp[WARP_PAST])
    if wanted == warp[WARP_WANTED]:  # on its way, or there
        return True
    point, trial = np.zeros((4, 3)), np.zeros(10)
    trial[WARP_START] = sigma
    over = sigma >= knots[len(knots) - 1]
    # Part of the way only from a constant override.
    for k in range(SHARES_TRIED if warp[WARP_PAST] >= warp[WARP_LASTS] else 1):
        target = wanted if k == 0 else f + (wanted - f) / 2.0**k
        way, lasts = target - f, shortest
        for _ in range(DURATIONS_TRIED):
            slope, bend = first * lasts, second * lasts**2
            trial[WARP_LASTS], trial[WARP_WANTED] = lasts, target
            trial[WARP_POWERS], trial[4], trial[5] = f, slope, 0.5 * bend
            trial[6] = 10.0 * way - 6.0 * slope - 1.5 * bend
            trial[7] = -15.0 * way + 8.0 * slope + 1.5 * bend
            trial[8] = 6.0 * way - 3.0 * slope - 0.5 * bend
            if over or clean(knots, coefficients, marks, packed, limits, trial, point):
                warp[:] = trial
                return k == 0
            lasts *= DURATION_GROWTH
    return False
