"""When an arm has arrived: its reference has ended, and its tip stays where it is to be."""

from __future__ import annotations

from typing import final

import numpy as np

from armtempo.arrays import Floats
from armtempo.state import Stateful

SETTLED_DISTANCE = 1e-3
"""Of the tip from its goal [m], and"""
SETTLED_SPEED = 1e-2
"""of the tip [m/s]: both smaller"""
SETTLED_TIME = 0.020
"""for so long [s]."""

TIME_ROUNDING = 1e-9
"""[s] Less than a tick by far: instants are sums of ticks."""
END_ROUNDING = 1e-12
"""[s] The same, of the instant at which a reference ends."""


@final
class Settling(Stateful):
    """An arm arrives at the later of its reference's end and the first tick from which its tip stays settled.

    Args:
        arms: How many, A.
        distance: A settled tip is nearer to its goal than this [m],
        speed: and slower than this [m/s],
        time: for so long [s].

    Attributes:
        arrival: (A,) instants of arrival [s], nan before.
    """

    changing = ("arrival", "_since")

    def __init__(
        self,
        arms: int,
        *,
        distance: float = SETTLED_DISTANCE,
        speed: float = SETTLED_SPEED,
        time: float = SETTLED_TIME,
    ) -> None:
        self._distance, self._speed, self._time = distance, speed, time
        self.arrival: Floats = np.full(arms, np.nan)
        self._since: Floats = np.full(arms, np.nan)

    def reset(self) -> None:
        """Nobody has arrived."""
        self.arrival = np.full_like(self.arrival, np.nan)
        self._since = np.full_like(self._since, np.nan)

    def watch(self, now: float, ended: Floats, distance: Floats, speed: Floats) -> None:
        """A tick at the instant ``now`` [s].

        All (A,): ``ended``, when the references did [s], nan before; ``distance`` [m] of the tips from their goals and
        their ``speed`` [m/s].
        """
        settled = (ended <= now + END_ROUNDING) & (distance < self._distance) & (speed < self._speed)
        self._since = np.where(settled, np.fmin(self._since, now), np.nan)
        done = np.isnan(self.arrival) & (now - self._since >= self._time - TIME_ROUNDING)
        self.arrival[done] = np.maximum(ended, self._since)[done]
