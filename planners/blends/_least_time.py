r"""Of all blends at a given corner tolerance, the quickest to pass: a search over curve families and their shares.

What is compared is the time of a simple motion that keeps the limits, not that of the best one: from the line speed V
it slows along an S-shaped ramp to v_0 at the middle of the blend, and picks up again the same way. Over a few jerks
near the middle and accelerations the largest v_0 is sought at which speed, normal acceleration and the norm of the jerk

    p''' v^3 + 3 p'' v a + p' j

stay in their limits at samples of the blend. Against running through the vertex at V that costs, with ramps of time t_r
and distance d_r, the blend's length S and its remaining distances L_1 and L_2,

    2 (t_r - d_r / V) + (S - L_1 - L_2) / V.

Estimates order curves as planned motions do, to about one per cent of the task's time; a search takes some 50 ms.
"""

from __future__ import annotations

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError, brief
from armtempo.planners.blends import _path_kernels as kernels
from armtempo.planners.blends._curve_kernels import curve_speed
from armtempo.planners.blends._families import CURVES, PassingLimits
from armtempo.robots import njit

CURVE_SAMPLES = 48  # of u
FIRST_STEP, STEP_HALVINGS = 0.08, 4  # of the shares, in the search
JERK_SHARES = (0.35, 0.2, 0.5, 0.1, 0.15, 0.27, 0.7, 0.9, 0.06, 0.03)  # near the middle, as shares of the limit
ACCELERATION_SHARES = (1.0, 0.6)
SPEED_BISECTIONS = 12  # of v_0
SPEED_SHARE_MIN = 1e-3  # of V


@njit
def _samples(shape: Floats, degree: int, out: Floats) -> float:
    """What a motion needs of a blend at evenly spaced u: into ``out`` (49, 4); returns the length.

    Columns: distance from its middle [m], negative before; |p''|^2, |p'''|^2, p''.p'''.
    """
    point = np.empty((4, 3))
    s, last = 0.0, 0.0
    for i in range(CURVE_SAMPLES + 1):
        u = i / CURVE_SAMPLES
        speed = curve_speed(shape, degree, u)
        if i > 0:
            middle = curve_speed(shape, degree, u - 0.5 / CURVE_SAMPLES)
            s += (last + 4.0 * middle + speed) / (6.0 * CURVE_SAMPLES)
        last = speed
        kernels.piece_point(degree, shape, u, point)
        out[i, 0] = s
        out[i, 1] = out[i, 2] = out[i, 3] = 0.0
        for k in range(3):
            out[i, 1] += point[2, k] ** 2
            out[i, 2] += point[3, k] ** 2
            out[i, 3] += point[2, k] * point[3, k]
    out[:, 0] -= 0.5 * s
    return float(s)


@njit
def _ramp(v0: float, top: float, j: float, last: float, a: float) -> tuple[float, float, float]:
    """Peak acceleration, time at it and distance of the ramp from ``v0`` to ``top``: jerk ``j``, none, ``-last``."""
    peak = min(a, np.sqrt(2.0 * (top - v0) / (1.0 / j + 1.0 / last)))
    rise = 0.5 * peak * peak * (1.0 / j + 1.0 / last)
    held = max(top - v0 - rise, 0.0) / peak if peak > 0.0 else 0.0
    t1, t3 = peak / j, peak / last
    v1 = v0 + 0.5 * peak * t1
    distance = v0 * t1 + j * t1**3 / 6.0 + v1 * held + 0.5 * peak * held * held + top * t3 - last * t3**3 / 6.0
    return peak, held, distance


@njit
def _ramp_cost(v0: float, top: float, j: float, last: float, a: float) -> float:
    """What two such ramps cost against the line speed [s]: less for a higher ``v0``."""
    peak, held, distance = _ramp(v0, top, j, last, a)
    return float(2.0 * (peak / j + held + peak / last - distance / top))


@njit
def _keeps(samples: Floats, v0: float, j: float, last: float, a: float, limits: Floats) -> bool:
    """Whether the ramps from ``v0`` in the middle keep the limits on the blend."""
    top, _, jerk, normal = limits
    peak, _held, s3 = _ramp(v0, top, j, last, a)
    t1, t3 = peak / j, peak / last
    v1, s1 = v0 + 0.5 * peak * t1, v0 * t1 + j * t1**3 / 6.0
    s2 = s3 - top * t3 + last * t3**3 / 6.0
    for m in range(len(samples)):
        # From the middle outward: what fails, fails there.
        i = CURVE_SAMPLES // 2 + ((m + 1) // 2 if m % 2 else -(m // 2))
        s = abs(samples[i, 0])
        side = -1.0 if samples[i, 0] < 0.0 else 1.0
        if s >= s3:
            v, acc, jt = top, 0.0, 0.0
        elif s >= s2:  # Newton on the distance still to go, backwards in time from the line speed
            jt, t = -last, (s3 - s) / top
            for _ in range(4):
                t += (s3 - s - top * t + last * t**3 / 6.0) / (top - 0.5 * last * t * t)
            v, acc = top - 0.5 * last * t * t, side * last * t
        elif s >= s1:
            jt, v = 0.0, np.sqrt(v1 * v1 + 2.0 * peak * (s - s1))
            acc = side * peak
        else:  # Newton from above, at most half as long again
            jt, t = j, min(s / v0, np.cbrt(6.0 * s / j))
            for _ in range(4):
                t -= (v0 * t + j * t**3 / 6.0 - s) / (v0 + 0.5 * j * t * t)
            v, acc = v0 + 0.5 * j * t * t, side * j * t
        k2, d2, c = samples[i, 1], samples[i, 2], samples[i, 3]
        if k2 * v**4 > normal * normal:
            return False
        square = d2 * v**6 + 9.0 * k2 * (v * acc) ** 2 + jt * jt + 6.0 * c * v**4 * acc - 2.0 * k2 * v**3 * jt
        if square > jerk * jerk:
            return False
    return True


@njit
def estimated_cost(shape: Floats, degree: int, remaining: float, limits: Floats) -> float:
    """The cost above [s]; ``remaining`` is L_1 + L_2, ``limits`` (4,) V, a, j, a_n."""
    top, acceleration, jerk, _ = limits
    samples = np.empty((CURVE_SAMPLES + 1, 4))
    length = _samples(shape, degree, samples)
    saved = (length - remaining) / top
    if _keeps(samples, top, jerk, jerk, acceleration, limits):
        return float(saved)
    best = np.inf
    for part in ACCELERATION_SHARES:
        for whole in (True, False):
            for share in JERK_SHARES:
                a, j = part * acceleration, share * jerk
                last = jerk if whole else j
                low, high = SPEED_SHARE_MIN * top, top
                for _ in range(SPEED_BISECTIONS):  # the v_0 that would beat the best so far
                    middle = 0.5 * (low + high)
                    if _ramp_cost(middle, top, j, last, a) >= best:
                        low = middle
                    else:
                        high = middle
                high = top
                if not _keeps(samples, low, j, last, a, limits):
                    continue
                for _ in range(SPEED_BISECTIONS):
                    middle = 0.5 * (low + high)
                    if _keeps(samples, middle, j, last, a, limits):
                        low = middle
                    else:
                        high = middle
                best = min(best, _ramp_cost(low, top, j, last, a))
    return float(best + saved)


@njit
def _cost(
    kind: Ints,
    segment: Floats,
    lengths: Floats,
    shares: Floats,
    degree: int,
    tolerance: float,
    most: float,
    limits: Floats,
) -> float:
    """Cost of one candidate at one corner."""
    reach = kernels.remaining_for(
        kind, segment, lengths[0], shares, degree, tolerance, min(lengths[0], lengths[1])
    )  # fmt: skip
    reach = min(reach, most)
    points, shape = np.empty((8, 3)), np.empty((8, 3))
    kernels.corner_blend(kind, segment, lengths[0], np.array([reach, reach]), shares, degree, points, shape)
    return estimated_cost(shape, degree, 2.0 * reach, limits)


@njit
def _search(
    kind: Ints, shape: Floats, lengths: Floats, tolerance: Floats, most: Floats, skip: Bools, limits: Floats,
    starts: Floats, start_degrees: Ints, shares: Floats, degree: Ints,
) -> None:  # fmt: skip
    """Coordinate search from every start, at every corner, into ``shares`` (C, 3) and ``degree`` (C,)."""
    for k in range(len(tolerance)):
        degree[k] = start_degrees[0]
        shares[k] = starts[0]
        if skip[k]:
            continue
        best = np.inf
        for j in range(len(starts)):
            here, n = starts[j].copy(), start_degrees[j]
            if n == 3 and (kind[k] == kernels.ARC or kind[k + 1] == kernels.ARC):  # only tangent beside an arc
                continue
            corner = (kind[k : k + 2], shape[k : k + 2], lengths[k : k + 2])
            cost = _cost(*corner, here, n, tolerance[k], most[k], limits)
            step = FIRST_STEP
            for _ in range(STEP_HALVINGS):
                moved = True
                while moved:
                    moved = False
                    for i in range((n - 1) // 2):
                        for sign in (-1.0, 1.0):
                            trial = here.copy()
                            trial[i] += sign * step
                            falls = trial[0] <= 0.95 and trial[(n - 3) // 2] >= 0.05
                            for m in range((n - 3) // 2):
                                falls = falls and trial[m] > trial[m + 1]
                            if n == 3 or not falls:
                                continue
                            other = _cost(*corner, trial, n, tolerance[k], most[k], limits)
                            if other < cost - 1e-12:
                                here, cost, moved = trial, other, True
                step *= 0.5
            if cost < best:
                best = cost
                shares[k], degree[k] = here, n


def checked_limits(limits: PassingLimits | None) -> Floats:
    if limits is None:
        raise InputError("curve 'least-time' needs limits", remedy="give LineSpeedLimits")
    try:
        normal = limits.acceleration if limits.normal_acceleration is None else limits.normal_acceleration
        values = np.array([limits.speed, limits.acceleration, limits.jerk, normal], dtype=np.float64)
    except (AttributeError, TypeError, ValueError):
        raise InputError(
            f"limits {brief(limits)} are no limits of the line speed", remedy="give LineSpeedLimits"
        ) from None
    if not np.isfinite(values).all() or values.min() <= 0.0:
        raise InputError(f"limits {brief(limits)} must be positive and finite", remedy="give SI values > 0")
    return values


def least_time_shares(
    kind: Ints,
    shape: Floats,
    lengths: Floats,
    tolerance: Floats,
    most: Floats,
    smooth: Bools,
    limits: PassingLimits | None,
) -> tuple[Floats, Ints]:
    """``shares`` (C, 3) and degrees (C,) of the quickest blends of C corners; no further out than ``most`` (C,)."""
    values = checked_limits(limits)
    names = ("quintic", "low-peak", "septic", "cubic")
    starts = np.zeros((len(names), 3))
    for j, name in enumerate(names):
        starts[j, : len(CURVES[name])] = CURVES[name]
    degrees = np.array([2 * len(CURVES[name]) + 1 for name in names])
    shares, degree = np.zeros((len(tolerance), 3)), np.zeros(len(tolerance), dtype=np.int64)
    _search(kind, shape, lengths, tolerance, most, smooth, values, starts, degrees, shares, degree)
    return shares, degree
