"""Spaces of observations and actions: one table of entries gives the space, the docstrings and the tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box


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
    """The table of entries as text, for docstrings."""
    lines = ["====  ==============================  ==========  " + "=" * 70]
    lines.append("index name                            range       meaning")
    lines.append(lines[0])
    lines += [f"{k:<5} {e.name:<31} [{e.low:g}, {e.high:g}]".ljust(49) + f" {e.meaning}" for k, e in enumerate(entries)]
    return "\n    ".join([*lines, lines[0]])
