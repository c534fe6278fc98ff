"""The observation of an arm: one table gives the space, the docstrings and the tests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box

OTHERS = 2
"""How many other arms are seen: the most constraining ones, nearest collision region first; unused entries are 0."""


class Entry(NamedTuple):
    """One number of an observation, between ``low`` and ``high``."""

    name: str
    low: float
    high: float
    meaning: str


OWN = (
    Entry("progress", -1.0, 1.0, "position on the own path, start -1, end 1"),
    Entry("speed", -1.0, 1.0, "mu as a share of mu*, the highest speed from which the end can be met; 0 is -1"),
    Entry("lowest_acceleration", -1.0, 1.0, "LB as a share of 8 length / T^2 (T: minimum time)"),
    Entry("highest_acceleration", -1.0, 1.0, "UB as a share of the same"),
    Entry("time_to_go", -1.0, 1.0, "what the minimum-time motion still takes from here as a share of T; none is -1"),
)
OTHER = (
    Entry("present", 0.0, 1.0, "1 if the slot holds an arm"),
    Entry(
        "distance", -1.0, 1.0, "way to the next collision region with it, as a share of the own path; none ahead is 1"
    ),
    Entry(
        "release", -1.0, 1.0, "way it has still to go until that region is released, as a share of its path; 0 is -1"
    ),
    Entry("progress", -1.0, 1.0, "its position on its path, start -1, end 1"),
    Entry("speed", -1.0, 1.0, "its mu as a share of its mu*; 0 is -1"),
    Entry("time_to_go", -1.0, 1.0, "what its minimum-time motion still takes as a share of its T; none is -1"),
    Entry(
        "wait",
        -1.0,
        1.0,
        "how long to wait so that the minimum-time motion from here passes behind its one from where it is, as a share "
        "of T; 0 and less: no need; no region ahead is -1",
    ),
    Entry("lead", -1.0, 1.0, "the same of it behind this arm, as a share of its T"),
)
ENTRIES = (
    *OWN,
    *(Entry(f"other_{k}.{e.name}", min(e.low, 0.0), e.high, e.meaning) for k in range(OTHERS) for e in OTHER),
)
SIZE = len(ENTRIES)


def observation_space(entries: Sequence[Entry] = ENTRIES) -> Box:
    """The space of observations of these entries, float32; of one arm's among others (21,)."""
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


def observation_table(entries: Sequence[Entry] = ENTRIES) -> str:
    """The table of entries as text, for docstrings."""
    lines = ["====  ==============================  ==========  " + "=" * 70]
    lines.append("index name                            range       meaning")
    lines.append(lines[0])
    lines += [f"{k:<5} {e.name:<31} [{e.low:g}, {e.high:g}]".ljust(49) + f" {e.meaning}" for k, e in enumerate(entries)]
    return "\n    ".join([*lines, lines[0]])
