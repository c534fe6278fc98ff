"""Spaces of observations and actions: one table of entries gives the space, the docstrings and the tests."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box

MEANING_COLUMN = 48  # of a table
MEANING_WIDTH = 68


class Entry(NamedTuple):
    """One number of an observation, between ``low`` and ``high``."""

    name: str
    low: float
    high: float
    meaning: str


def observation_space(entries: Sequence[Entry]) -> Box:
    """The space of observations of these entries, float32."""
    return Box(
        np.array([entry.low for entry in entries], dtype=np.float32),
        np.array([entry.high for entry in entries], dtype=np.float32),
        dtype=np.float32,
    )


def action_space(size: int = 1) -> Box:
    """The space of one arm's action, (size,) float32 in [-1, 1]."""
    return Box(-1.0, 1.0, (size,), dtype=np.float32)


def share(entry: float) -> float:
    """An entry in [-1, 1] back to a share in [0, 1]."""
    return 0.5 * (float(entry) + 1.0)


def observation_table(entries: Sequence[Entry]) -> str:
    """The table of entries as docstrings have it (a simple table of reStructuredText), 116 columns wide."""
    rule = "=====  ==============================  =======  " + "=" * MEANING_WIDTH
    lines = [rule, "index  name                            range    meaning", rule]
    for k, entry in enumerate(entries):
        first, *more = wrap(entry.meaning, MEANING_WIDTH)
        lines.append(f"{k:<5}  {entry.name:<30}  {f'[{entry.low:g}, {entry.high:g}]':<7}  {first}")
        lines += [" " * MEANING_COLUMN + rest for rest in more]
    return "\n".join([*lines, rule])
