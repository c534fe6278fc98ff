"""Actions: checked, clipped, read as commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.envs.common._options import is_number
from armtempo.errors import ActionError, InputError

TIME_LIMIT = 5.0  # sequential times after which an episode is truncated


def read_action(action: ArrayLike, agent: str) -> float:
    """An action in [-1, 1] as a command in [0, 1]; values outside are clipped.

    Raises:
        ActionError: It is not one finite number.
    """
    return 0.5 * (float(read_actions(action, 1, agent)[0]) + 1.0)


def read_actions(action: ArrayLike, size: int, agent: str) -> Floats:
    """An action of so many numbers, clipped to [-1, 1].

    Raises:
        ActionError: It is not so many finite numbers.
    """
    try:
        values = np.asarray(action, dtype=np.float64)
    except (TypeError, ValueError):  # not numbers at all
        values = np.array([np.nan])
    if size == 1 and values.shape == ():
        values = values[None]
    if values.shape != (size,) or not np.isfinite(values).all():
        what = "one finite number" if size == 1 else f"{size} finite numbers"
        raise ActionError(
            f"action of {agent} must be {what} in an array of shape ({size},), got {action!r}",
            remedy="clip it to [-1, 1] and replace NaN before env.step",
            agent=agent,
            action=action,
        )
    return np.clip(values, -1.0, 1.0)


def check_late(late: object) -> None:
    """Raise InputError unless ``late`` is a time [s] to wait."""
    if not (is_number(late) and late >= 0.0):
        raise InputError(f"master_late_s must be a time in seconds, got {late!r}", remedy="give 0 or more")
