r"""A proven lower bound of the duration of motions from rest to rest along a path, within limits of its speed.

With ``x(s) = v^2`` all motions within the limits have ``|x'| <= 2 a_max``, ``x <= v_max^2`` and ``x <= a_normal /
kappa``, and x = 0 at both ends and wherever the curvature jumps (an acceleration that jumps is an endless jerk). What
is asked at *some* places allows more than what is asked at all: so with caps ``c_i`` at samples ``s_i``

    x(s) <= min(v_max^2, c_i + 2 a_max |s - s_i| for all i)

holds between the samples, too, whatever the path does there, and no motion is shorter than the integral of
``ds / sqrt(x)`` of the right side.

Of the jerk the bound knows what leaving a rest costs, or coming to one, on a straight piece, where the jerk along the
path is all there is. There v >= 0 and ``|v''| <= j``, so ``v'^2 <= 2 j v`` (else v would have been below 0 shortly
before), which integrates to ``x <= (9/2 j s^2)^(2/3)``, s from the rest.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.geometry import least_times
from armtempo.planners.line_speed._path_samples import path_marks, path_rests, path_samples

NEAR_REST = np.geomspace(1e-4, 1.0, 200)[:-1]  # shares of a straight piece beside a rest: more samples
RISE_MAX, PARTS_MAX = 0.002, 500  # of a cap from sample to sample, as a share; of an interval
ROUNDING = 1e-9  # of the bound


def least_duration(path: Any, speed: float, acceleration: float, normal: float, jerk: float) -> float:
    """No motion from rest to rest along ``path`` within these limits (as of ``LineSpeedLimits``) is shorter [s]."""
    marks, rests = path_marks(path, 0.0, path.length), path_rests(path)
    samples, bend = _closer(path, *path_samples(path, marks), speed, acceleration, normal)
    straight = [
        (start, end, rest)
        for start, end in pairwise(marks.tolist())
        # a line, an arc or a polynomial bends nowhere, or nearly everywhere
        if not bend[(samples > start) & (samples < end)].any()
        for rest in (start, end)
        if (rests == rest).any()
    ]
    near = [rest + (start + end - 2.0 * rest) * NEAR_REST for start, end, rest in straight]
    s = np.unique(np.concatenate([marks, samples, *near]))
    cap, way = np.full(len(s), speed**2), np.diff(s)
    at = np.searchsorted(s, samples)
    cap[at] = np.minimum(cap[at], normal / np.maximum(bend, 1e-300))
    cap[np.searchsorted(s, rests)] = 0.0
    least = np.zeros_like(way)  # of the time by the jerk beside rests: that bound of x is convex, so below its chords
    for start, end, rest in straight:
        part = slice(np.searchsorted(s, start), np.searchsorted(s, end) + 1)
        most = np.cbrt(4.5 * jerk * (s[part] - rest) ** 2) ** 2
        cap[part] = np.minimum(cap[part], most)
        inside = slice(part.start, part.stop - 1)
        least[inside] = np.maximum(least[inside], 2.0 * way[inside] / (np.sqrt(most[1:]) + np.sqrt(most[:-1])))
    for sense in (1, -1):  # c_i + 2 a |s - s_i|, the least over all i on one side
        line = sense * 2.0 * acceleration * s[::sense]
        cap[::sense] = np.maximum(np.minimum.accumulate(cap[::sense] - line) + line, 0.0)
    peak = np.minimum(0.5 * (cap[1:] + cap[:-1]) + acceleration * way, speed**2)
    times = least_times(way, cap[:-1], cap[1:], peak, np.full_like(way, acceleration))
    return float(np.maximum(times, least).sum()) * (1.0 - ROUNDING)


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
