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

from itertools import pairwise
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.geometry import least_times
from armtempo.planners.line_speed._path_samples import path_marks, path_rests, path_samples

RISE_MAX, PARTS_MAX = 0.002, 500  # of a cap from sample to sample, as a share; of an interval
NEAR_REST = np.geomspace(1e-4, 0.5, 200)  # shares of a run: more samples
ROUNDING = 1e-9  # of the bound


def least_duration(path: Any, speed: float, acceleration: float, normal: float, jerk: float) -> float:
    """No motion from rest to rest along ``path`` within these limits (as of ``LineSpeedLimits``) is shorter [s]."""
    marks, rests = path_marks(path, 0.0, path.length), path_rests(path)
    samples, bend = _closer(path, *path_samples(path, marks), speed, acceleration, normal)
    runs = np.diff(rests)[:, None] * NEAR_REST
    s = np.unique(np.concatenate([marks, samples, (rests[:-1, None] + runs).ravel(), (rests[1:, None] - runs).ravel()]))
    cap, way = np.full(len(s), speed**2), np.diff(s)
    at = np.searchsorted(s, samples)
    cap[at] = np.minimum(cap[at], normal / np.maximum(bend, 1e-300))
    rest = np.searchsorted(s, rests)
    cap[rest] = 0.0
    for sense in (1, -1):  # c_i + 2 a |s - s_i|, the least over all i on one side
        line = sense * 2.0 * acceleration * s[::sense]
        cap[::sense] = np.maximum(np.minimum.accumulate(cap[::sense] - line) + line, 0.0)
    peak = np.minimum(0.5 * (cap[1:] + cap[:-1]) + acceleration * way, speed**2)
    times = least_times(way, cap[:-1], cap[1:], peak, np.full_like(way, acceleration))
    theta, total = np.append(0.0, np.cumsum(times)), 0.0
    for first, last in pairwise(rest):
        run = slice(first, last + 1)
        own = theta[run] - theta[first]
        leaving, coming = (
            _ramp_time(away, speed, acceleration, jerk) for away in (s[run] - s[first], s[last] - s[run])
        )
        total += float((np.maximum.accumulate(leaving - own) + own + coming).max())
    return total * (1.0 - ROUNDING)


def _ramp_time(away: Floats, speed: float, acceleration: float, jerk: float) -> Floats:
    """(K,) least times to be so far away [m] from a rest: at the jerk, at the acceleration, at the speed."""
    t_jerk = min(acceleration / jerk, np.sqrt(2.0 * speed / jerk))
    v, s = 0.5 * jerk * t_jerk**2, jerk * t_jerk**3 / 6.0
    t_ramp = max(speed - v, 0.0) / acceleration
    s_ramp = s + (v + 0.5 * acceleration * t_ramp) * t_ramp
    beyond = np.maximum(away - s, 0.0)
    rising = t_jerk + (np.sqrt(v * v + 2.0 * acceleration * beyond) - v) / acceleration
    time = np.where(away <= s, np.cbrt(6.0 * away / jerk), rising)
    return np.asarray(np.where(away <= s_ramp, time, t_jerk + t_ramp + (away - s_ramp) / speed))


def _closer(
    path: Any, s: Floats, bend: Floats, speed: float, acceleration: float, normal: float
) -> tuple[Floats, Floats]:
    """More samples where a cap would rise by much from one to the next, and the curvature there."""
    cap, gap = np.minimum(normal / np.maximum(np.minimum(bend[1:], bend[:-1]), 1e-300), speed**2), np.diff(s)
    bent = np.maximum(bend[1:], bend[:-1]) > normal / speed**2
    parts = np.where(bent, np.clip(np.ceil(acceleration * gap / (RISE_MAX * cap)), 1, PARTS_MAX), 1).astype(np.int64)
    of = np.repeat(np.arange(len(gap)), parts - 1)
    number = np.arange(len(of)) - np.repeat(np.cumsum(parts - 1) - (parts - 1), parts - 1) + 1
    more = s[of] + gap[of] * number / parts[of]
    order = np.argsort(np.concatenate([s, more]), kind="stable")
    more_bend = np.linalg.norm(path.derivatives(more)[2], axis=-1)
    return np.concatenate([s, more])[order], np.concatenate([bend, more_bend])[order]
