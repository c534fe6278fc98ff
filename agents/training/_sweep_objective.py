"""What a trial of a sweep comes to: the gap that its agent is left with."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from armtempo.configs import TrainConfig


def training_gap(config: TrainConfig, folder: Path) -> float:
    """Train in ``folder``; how far the agent is from the best, in percent, lower is better.

    Several arms: the makespan above the certified bound, undisturbed, and 100 more for every tenth of the disturbed
    episodes in which two arms came too close or one did not arrive; infinity where an undisturbed cell was not
    finished. One arm: minus 100 times the mean reward.
    """
    from armtempo.agents.training._extra import load_training

    train: Any = load_training("train")
    return gap_of(train(config, folder).curve[-1], several=config.coordination is not None)


def gap_of(row: dict[str, Any], *, several: bool) -> float:
    """The last row of a learning curve as one number."""
    if not several:
        return -100.0 * float(row["reward"])
    if row["gap_percent"] is None:
        return math.inf
    episodes = int(row["episodes"])
    failed = episodes - int(row["finished"])  # a violation is no arrival
    return float(row["gap_percent"]) + 1000.0 * failed / max(episodes, 1)
