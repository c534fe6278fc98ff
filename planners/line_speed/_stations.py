"""Where the knots of a motion from rest to rest are laid: at the joints of the path, dense where something changes."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from armtempo.arrays import Floats
from armtempo.planners.line_speed._limits import LineSpeedLimits
from armtempo.planners.line_speed._path_samples import CURVATURE_MIN, path_marks, path_samples
from armtempo.planners.line_speed._speed_guess import guessed_squares

INTERVALS_PER_BLEND, INTERVALS_PER_RADIAN, INTERVALS_PER_RAMP, INTERVALS_PER_E_FOLD = 9, 6, 7, 2
NEAR_REST = 0.25  # of the distance to a rest: the longest interval there
NEAR_BEND = 0.35  # of the radius of a bend, or of the distance to its circle: the longest interval there
FIRST_INTERVALS = 48  # in a ramp or the first piece, if all were like the one next to a rest
FIRST_TURN_MAX = 0.05  # [rad] in the interval next to a rest


def stations(path: Any, limits: LineSpeedLimits, start: float, end: float) -> Floats:
    """Knots [m] of a motion that rests at both lengths, and nowhere between."""
    marks = path_marks(path, start, end)
    s, bend = path_samples(path, marks)
    count = np.concatenate([[0.0], np.cumsum(_density(path, limits, marks, s, bend) * np.diff(s))])
    low = start + _first_interval(limits, marks, s - start, bend)
    high = end - _first_interval(limits, (start + end - marks)[::-1], end - s[::-1], bend[::-1])
    out = [np.array([start, low])]
    for a, b in pairwise(np.concatenate([[low], marks[1:-1], [high]])):
        first, last = np.interp([a, b], s, count)
        inside = np.interp(np.linspace(first, last, max(math.ceil(last - first), 1) + 1)[1:], count, s)
        inside[-1] = b
        out.append(inside)
    return np.concatenate([*out, [end]])


def _density(path: Any, limits: LineSpeedLimits, marks: Floats, s: Floats, bend: Floats) -> Floats:
    """(S-1,) intervals per metre that are wanted between samples (S,) of the path."""
    ramp, _ = _ramp(limits)
    gap, middle = np.diff(s), 0.5 * (s[1:] + s[:-1])
    piece = np.clip(np.searchsorted(marks, middle) - 1, 0, len(marks) - 2)
    size = np.diff(marks)[piece]
    from_end = np.minimum(middle - marks[piece], marks[piece + 1] - middle)
    density = 1.0 / np.minimum(ramp / INTERVALS_PER_RAMP + 0.5 * np.maximum(from_end - ramp, 0.0), size / 4.0)
    turn = 0.5 * (bend[1:] + bend[:-1])
    whole = np.bincount(piece, turn * gap, len(marks) - 1)[piece]
    bent = 0.5 * INTERVALS_PER_BLEND * (1.0 / size + turn / np.maximum(whole, 1e-300))
    density = np.where(whole > CURVATURE_MIN, np.maximum(density, bent), density)
    density = np.maximum(density, INTERVALS_PER_RADIAN * turn)
    radius = 1.0 / np.maximum(bend, 1e-300)
    radius = np.minimum.accumulate(radius - s) + s  # that of a bend nearby, plus the distance from it
    radius = np.minimum.accumulate((radius + s)[::-1])[::-1] - s
    density = np.maximum(density, 1.0 / (NEAR_BEND * np.minimum(radius[1:], radius[:-1])))
    growth = np.abs(np.diff(np.log(guessed_squares(path, limits, s, marks[[0, -1]]))))
    density = np.maximum(density, INTERVALS_PER_E_FOLD * growth / gap)
    from_rest = np.minimum(middle - marks[0], marks[-1] - middle)
    return np.asarray(np.maximum(density, 1.0 / (NEAR_REST * from_rest)))


def _ramp(limits: LineSpeedLimits) -> tuple[float, float]:
    """Length of the ramp to line speed, and of the jerk that begins it [m]."""
    speed, acceleration, jerk = limits.speed, limits.acceleration, limits.jerk
    swing = min(acceleration / jerk, math.sqrt(speed / jerk))  # [s]
    ramp = 0.5 * speed * (speed / min(acceleration, math.sqrt(speed * jerk)) + swing)
    return ramp, jerk * swing**3 / 6.0


def _first_interval(limits: LineSpeedLimits, marks: Floats, away: Floats, bend: Floats) -> float:
    """Length of the interval next to the rest at ``marks[0]``: the jerk is constant there.

    So it must be short against a jerk's way, the first piece of the path, and its radius; ``bend`` (S,) ``away`` (S,).
    """
    whole = float(marks[-1] - marks[0])
    most = max(12.0 / FIRST_INTERVALS * min(_ramp(limits)[1], whole / 12.0), 1e-4 * whole)
    size = min(most, float(marks[1] - marks[0]) / FIRST_INTERVALS)
    while size * bend[: int(np.searchsorted(away, size)) + 2].max() > FIRST_TURN_MAX:
        size *= 0.5
    return size
