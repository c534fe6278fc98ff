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
    """Minus a deviation (1, or more: as large as can be) over the time it lasted, in units of the reference time."""
    return -min(share, 1.0) * elapsed / reference


def leaving_reward(longest: float, reference: float) -> float:
    """Minus one and three times the longest an episode can last, in units of the reference time.

    Inside the tube an episode loses at most 1 for time and 1 for each of two deviations per reference time, and no
    progress: more than minus three times its longest. Who leaves has gained at most 1 before: it ends below any other.
    """
    return -(1.0 + 3.0 * longest / reference)
