r"""A proven lower bound of the duration of motions from rest to rest along a path, within limits of its speed.

With ``x(s) = v^2`` all motions within the limits have ``|x'| <= 2 a_max``, ``x <= v_max^2`` and ``x <= a_normal /
kappa``, and x = 0 at both ends and wherever the curvature jumps (an acceleration that jumps is an endless jerk). What
is asked at *some* places allows more than what is asked at all: so with caps ``c_i`` at samples ``s_i``

    x(s) <= min(v_max^2, c_i + 2 a_max |s - s_i| for all i)

holds between the samples, too, whatever the path does there, and no motion is shorter than the integral of
``ds / sqrt(x)`` of the right side.

Of the jerk the bound knows what it costs beside a rest. The acceleration vector is 0 there, and its size at most
``j t`` a time t later or sooner: so the speed grows no faster than ``min(j t, a_max)``, and to be s away takes at
least the time ``r(s)`` of that ramp, on any path. With ``theta(s)`` the integral above, a run between two rests, L
apart, takes at least

    max over s1 <= s2 of  r(s1) + theta(s2) - theta(s1) + r(L - s2).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.geometry import least_times
from armtempo.planners.line_speed._limits import LineSpeedLimits, square_caps
from armtempo.planners.line_speed._path_samples import path_marks, path_rests, path_samples

RISE_MAX = 0.002  # of a cap, between two samples, as a share
SAMPLES_MAX = 500_000  # about, for that
NEAR_REST = np.geomspace(1e-4, 0.5, 200)  # shares of a run: more samples
ROUNDING = 1e-9  # of the bound


def least_duration(path: Any, length: float, limits: LineSpeedLimits) -> float:
    """No motion within the limits, from rest at the path's start to rest at ``length`` [m], is shorter [s]."""
    marks, rests = path_marks(path, 0.0, length), path_rests(path, length)
    samples, bend = _closer(path, limits, path_samples(path, marks)[0])
    runs = np.diff(rests)[:, None] * NEAR_REST
    s = np.unique(np.concatenate([marks, samples, (rests[:-1, None] + runs).ravel(), (rests[1:, None] - runs).ravel()]))
    cap, way = np.full(len(s), limits.speed**2), np.diff(s)
    cap[np.searchsorted(s, samples)] = square_caps(limits, bend)
    rest = np.searchsorted(s, rests)
    cap[rest] = 0.0
    for sense in (1, -1):  # c_i + 2 a |s - s_i|, the least over all i on one side
        line = sense * 2.0 * limits.acceleration * s[::sense]
        cap[::sense] = np.maximum(np.minimum.accumulate(cap[::sense] - line) + line, 0.0)
    peak = np.minimum(0.5 * (cap[1:] + cap[:-1]) + limits.acceleration * way, limits.speed**2)
    times = least_times(way, cap[:-1], cap[1:], peak, np.full_like(way, limits.acceleration))
    theta, total = np.append(0.0, np.cumsum(times)), 0.0
    for first, last in pairwise(rest):
        run = slice(first, last + 1)
        own, leaving, coming = theta[run] - theta[first], *_ramp_times(limits, s[run] - s[first], s[last] - s[run])
        total += float((np.maximum.accumulate(leaving - own) + own + coming).max())
    return total * (1.0 - ROUNDING)


def _ramp_times(limits: LineSpeedLimits, *away: Floats) -> list[Floats]:
    """Least times to be so far away [m] from a rest: at the jerk, then at the acceleration, then at the speed."""
    speed, acceleration, jerk = limits.speed, limits.acceleration, limits.jerk
    t_jerk = min(acceleration / jerk, math.sqrt(2.0 * speed / jerk))
    v, s = 0.5 * jerk * t_jerk**2, jerk * t_jerk**3 / 6.0
    t_ramp = max(speed - v, 0.0) / acceleration
    s_ramp = s + (v + 0.5 * acceleration * t_ramp) * t_ramp

    def at(far: Floats) -> Floats:
        rising = (np.sqrt(v * v + 2.0 * acceleration * np.maximum(far - s, 0.0)) - v) / acceleration
        steady = t_ramp + (far - s_ramp) / speed
        return np.where(far <= s, np.cbrt(6.0 * far / jerk), t_jerk + np.where(far <= s_ramp, rising, steady))

    return [at(far) for far in away]


def _closer(path: Any, limits: LineSpeedLimits, s: Floats) -> tuple[Floats, Floats]:
    """Samples (S,) of a path and more where caps would rise by much from one to the next; all, and curvatures there."""
    cap = square_caps(limits, np.linalg.norm(path.derivatives(s)[2], axis=-1))
    low, high = np.minimum(cap[1:], cap[:-1]), np.maximum(cap[1:], cap[:-1])
    parts = np.ceil(limits.acceleration * np.diff(s) / (RISE_MAX * high))
    parts = np.where(low < limits.speed**2, parts, 1.0)
    count = np.append(0, np.cumsum(np.ceil(parts * min(1.0, SAMPLES_MAX / parts.sum()))))
    s = np.interp(np.arange(count[-1] + 1), count, s)
    return s, np.linalg.norm(path.derivatives(s)[2], axis=-1)
