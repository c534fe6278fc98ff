"""What evaluations of every kind share."""

from __future__ import annotations

from armtempo.agents.evaluation._bootstrap import Interval, mean_interval, ratio_interval

__all__ = [
    "Interval",
    "mean_interval",
    "ratio_interval",
]
