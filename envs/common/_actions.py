"""Actions: checked, clipped, read as commands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.envs.common._options import is_number
from armtempo.errors import ActionError, InputError, brief

TIME_LIMIT = 5.0  # sequential times after which an episode is truncated


def finite_numbers(values: ArrayLike, most: int) -> Floats | None:
    """An array of finite numbers, None if these are none, or lists of more than so many items, nested ones included.

    Texts, objects and truth values are not taken for numbers.
    """
    if isinstance(values, list | tuple) and not _within(values, most):
        return None
    try:
        array = np.asarray(values)
    except (TypeError, ValueError, OverflowError, RuntimeError):  # ragged, or a tensor that needs its gradient
        return None
    if array.dtype.kind not in "iuf":
        return None
    numbers = array.astype(np.float64, copy=False)
    return numbers if np.isfinite(numbers).all() else None


def _within(values: list[Any] | tuple[Any, ...], most: int) -> bool:
    """Whether lists in lists have at most so many items: numpy would look at all of them."""
    left: list[Any] = [values]
    count = 0
    while left:
        one = left.pop()
        if isinstance(one, list | tuple):
            count += len(one)
            if count > most:
                return False
            left.extend(one)
    return True


def read_action(action: ArrayLike, agent: str) -> float:
    """An action in [-1, 1] as a command in [0, 1]; values outside are clipped.

    Raises:
        ActionError: It is not one finite number.
    """
    return read_command(action, 1, agent)[0]


def read_command(action: ArrayLike, size: int, agent: str) -> tuple[float, float]:
    """An action of one or two numbers in [-1, 1] as a command in [0, 1], and the second number; nan: there is none.

    Raises:
        ActionError: It is not so many finite numbers.
    """
    values = read_actions(action, size, agent)
    return 0.5 * (float(values[0]) + 1.0), float(values[1]) if size > 1 else math.nan


def read_actions(action: ArrayLike, size: int, agent: str) -> Floats:
    """An action of so many numbers, clipped to [-1, 1].

    Raises:
        ActionError: It is not so many finite numbers.
    """
    values = finite_numbers(action, size)
    if size == 1 and values is not None and values.shape == ():
        values = values[None]
    if values is None or values.shape != (size,):
        what = "one finite number" if size == 1 else f"{size} finite numbers"
        raise ActionError(
            f"action of {agent} must be {what} in an array of shape ({size},), got {brief(action)}",
            remedy="clip it to [-1, 1] and replace NaN before env.step",
            agent=agent,
            action=action,
        )
    return np.clip(values, -1.0, 1.0)


def check_late(late: object) -> None:
    """Raise InputError unless ``late`` is a time [s] to wait."""
    if not (is_number(late) and late >= 0.0):
        raise InputError(f"master_late_s must be a time in seconds, got {brief(late)}", remedy="give 0 or more")
