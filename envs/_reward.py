"""The reward, term by term: progress is worth one path, time what it takes, a collision more than both."""

from __future__ import annotations


def progress_reward(moved: float, length: float) -> float:
    """Share of the path covered since the last step; a whole path is worth 1."""
    return moved / length


def time_reward(elapsed: float, reference: float) -> float:
    """Minus the time spent [s], in units of the reference time; on arrival charged to the exact instant."""
    return -elapsed / reference


def collision_reward(position: float, length: float) -> float:
    """Minus two and the share of the path not covered: colliding is never better than going on."""
    return -(2.0 + (1.0 - position / length))


def deviation_reward(share: float, elapsed: float, reference: float) -> float:
    """Minus a deviation (1: as large as it should never be) over the time it lasted, in units of the reference time."""
    return -share * elapsed / reference
