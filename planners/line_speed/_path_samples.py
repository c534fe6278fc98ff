"""Where to look at a path: at the joints of its pieces, and so often between that its curvature hardly changes."""

from __future__ import annotations

from typing import Any

import numpy as np

from armtempo.arrays import Floats

CURVATURE_MIN = 1e-9  # [1/m] times the length of a piece: less is straight
EVEN_SAMPLES, END_SAMPLES = 32, 16  # of a piece to begin with, and towards each of its ends
END_SHARE_MIN = 1e-6  # of a piece: the closest of those
CHANGE_MAX = 0.4  # of the logarithm of the curvature, from sample to sample
TURN_MIN = 1e-3  # [rad] from sample to sample: less needs no closer look
HALVINGS = 40
CLOSENESS_MIN = 1e-12  # of the length: samples are no closer


def path_marks(path: Any, start: float, end: float) -> Floats:
    """(K+1,) both lengths and the joints of the path's pieces between them [m]."""
    joints = np.asarray(getattr(path, "breakpoints", []), dtype=np.float64)
    return np.concatenate([[start], joints[(joints > start) & (joints < end)], [end]])


def path_rests(path: Any, end: float) -> Floats:
    """Where a motion with a limit of jerk must rest [m]: 0 and ``end``, and where the curvature jumps between them."""
    if not hasattr(path, "breakpoints"):  # one segment
        return np.array([0.0, end])
    inner = np.asarray(path.breakpoints, dtype=np.float64)[1:-1]
    if hasattr(path, "continuity"):
        jumps = np.asarray(path.continuity) < 2
    else:
        before, after = (path.derivatives(inner, before=side)[2] for side in (True, False))
        size = np.maximum(np.linalg.norm(before, axis=-1), np.linalg.norm(after, axis=-1))
        jumps = np.linalg.norm(after - before, axis=-1) > 1e-9 * np.maximum(size, 1.0 / path.length)
    jumps &= inner < end
    return np.concatenate([[0.0], inner[jumps], [end]])


def path_samples(path: Any, marks: Floats) -> tuple[Floats, Floats]:
    """Lengths (S,), rising, inside every piece between ``marks`` (K+1,) and next to both its ends; curvature there.

    A corner that nearly turns back bends within a millionth of its blend, so intervals are halved where it changes.
    """
    closer = np.geomspace(END_SHARE_MIN, 1.0 / EVEN_SAMPLES, END_SAMPLES, endpoint=False)
    even = np.linspace(0.0, 1.0, EVEN_SAMPLES + 1)[1:-1]
    share = np.concatenate([[1e-9], closer, even, 1.0 - closer[::-1], [1.0 - 1e-9]])
    s = np.unique(marks[:-1, None] + np.diff(marks)[:, None] * share)
    s = s[(s > marks[0]) & (s < marks[-1])]  # a piece of nanometres far down a path: shares of it are rounded off
    bend = np.linalg.norm(path.derivatives(s)[2], axis=-1)
    least = CURVATURE_MIN / np.diff(marks).max()
    for _ in range(HALVINGS):
        gap = np.diff(s)
        change = np.abs(np.diff(np.log(np.maximum(bend, least))))
        turn = 0.5 * (bend[1:] + bend[:-1]) * gap
        coarse = np.flatnonzero((change > CHANGE_MAX) & (turn > TURN_MIN) & (gap > CLOSENESS_MIN * marks[-1]))
        if not len(coarse):
            break
        more = 0.5 * (s[coarse] + s[coarse + 1])
        s = np.insert(s, coarse + 1, more)
        bend = np.insert(bend, coarse + 1, np.linalg.norm(path.derivatives(more)[2], axis=-1))
    return s, np.asarray(bend)
