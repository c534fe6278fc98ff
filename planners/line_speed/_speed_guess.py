"""A speed along a path that caps, acceleration and jerk allow, nearly: where to start a search, and how fine.

Two sweeps from rest, forth and back, each with constant jerk up to the caps; the slower of both counts. The jerk
across the path is looked at only as far as a steady speed asks for it, ``|p'''| v^3``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.line_speed._limits import LineSpeedLimits, square_caps
from armtempo.robots import njit

NEWTON_STEPS = 5


@njit
def _sweep(s: Floats, cap: Floats, acceleration: float, jerk: float, out: Floats) -> None:
    """Speeds (S,) from rest at ``s[0]`` into ``out``: jerk, then acceleration, then the cap, with no look ahead."""
    v = a = 0.0
    out[0] = 0.0
    for i in range(1, len(s)):
        h = s[i] - s[i - 1]
        if h > 0.0:
            t = np.cbrt(6.0 * h / jerk)
            if v > 0.0:
                t = min(t, h / v)
            for _ in range(NEWTON_STEPS):  # h = v t + a t^2/2 + j t^3/6, from above: it falls to the root
                t -= (v * t + 0.5 * a * t * t + jerk * t**3 / 6.0 - h) / (v + a * t + 0.5 * jerk * t * t)
            ahead = min(v + a * t + 0.5 * jerk * t * t, np.sqrt(v * v + 2.0 * acceleration * h))
            a = min(a + jerk * t, acceleration)
            if ahead >= cap[i]:
                ahead = cap[i]
                a = max(0.0, min(a, (ahead * ahead - v * v) / (2.0 * h)))
            v = ahead
        out[i] = v


@njit
def guessed_speeds(s: Floats, cap: Floats, acceleration: float, jerk: float, out: Floats) -> None:
    """Speeds (S,) at rising lengths ``s`` (S,), at rest at both ends, into ``out``; ``cap`` (S,) is 0 there."""
    back = np.empty(len(s))
    _sweep(s, cap, acceleration, jerk, out)
    _sweep(-s[::-1], cap[::-1], acceleration, jerk, back)
    for i in range(len(s)):
        out[i] = min(out[i], back[len(s) - 1 - i])


def guessed_squares(path: Any, limits: LineSpeedLimits, s: Floats, ends: Floats) -> Floats:
    """v^2 at lengths ``s`` between rests at ``ends`` (2,), shaped as ``s``, which rises."""
    _, _, d2, d3 = path.derivatives(s)
    by_jerk = np.cbrt(limits.jerk / np.maximum(np.linalg.norm(d3, axis=-1), 1e-300))
    cap = np.minimum(np.sqrt(square_caps(limits, np.linalg.norm(d2, axis=-1))), by_jerk)
    at = np.concatenate([ends[:1], s.ravel(), ends[1:]])
    speed = np.empty_like(at)
    guessed_speeds(at, np.pad(cap.ravel(), 1), limits.acceleration, limits.jerk, speed)
    return np.asarray(speed[1:-1].reshape(s.shape) ** 2)
