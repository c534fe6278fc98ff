"""What the vector environments share: their arguments, actions and automatic resets."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike

from armtempo.arrays import Floats
from armtempo.envs.bodies import Physics
from armtempo.errors import ActionError, InputError


def spread(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """One seed per environment, as Gymnasium has it: ``seed + k``, or a sequence of them.

    Raises:
        InputError: The sequence is not that long.
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer):
        return [int(seed) + k for k in range(count)]
    if len(seed) != count:
        raise InputError(f"{len(seed)} seeds for {count} episodes", remedy="give one for each, or a single number")
    return [None if one is None else int(one) for one in seed]


def count_of(number: int, what: str = "num_envs") -> int:
    """A number of things, one at least."""
    if not (isinstance(number, int | np.integer) and number > 0):
        raise InputError(f"{what} must be a whole number above 0, got {number!r}")
    return int(number)


def check_ideal(physics: Physics, render_mode: str | None) -> None:
    """Refuse what many environments at once cannot do."""
    if physics != "ideal" or render_mode is not None:
        what = f"physics {physics!r}" if physics != "ideal" else f"render_mode {render_mode!r}"
        raise InputError(
            f"many environments at once run without physics and pictures, got {what}",
            remedy='use physics="ideal", or gymnasium.make_vec(..., vectorization_mode="sync")',
        )


def autoreset_of(mode: AutoresetMode | str) -> AutoresetMode:
    """``NEXT_STEP`` or ``SAME_STEP``.

    Raises:
        InputError: It is neither.
    """
    known = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)
    if mode not in (*known, *(one.value for one in known)):
        raise InputError(f"autoreset_mode is {mode!r}", remedy="use AutoresetMode.NEXT_STEP or SAME_STEP")
    return AutoresetMode(mode)


def read_many(actions: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Actions of many environments, clipped to [-1, 1], with the bits of ``read_actions``.

    Raises:
        ActionError: They are not finite numbers of that shape.
    """
    try:
        values = np.asarray(actions, dtype=np.float64)
    except (TypeError, ValueError):  # not numbers at all
        values = np.array(np.nan)
    if values.shape != shape or not np.isfinite(values).all():
        raise ActionError(
            f"actions must be finite numbers in an array of shape {shape}, got shape {values.shape}",
            remedy="clip them to [-1, 1] and replace NaN before step",
        )
    return np.clip(values, -1.0, 1.0)


def read_commands(actions: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Such actions as commands in [0, 1], with the bits of ``read_action``."""
    return np.asarray(0.5 * (read_many(actions, shape) + 1.0), dtype=np.float64)
