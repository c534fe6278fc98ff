"""The motion of an arm that is disturbed and yields to nobody: what a clairvoyant would plan around."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, PhaseTrajectory
from armtempo.planners.topp import Mode


def disturbed_motion(
    cell: CoordinationCell, arm: int, drawn: Mapping[str, Any], *, mode: Mode = "speed"
) -> PhaseTrajectory:
    """What becomes of full speed under a disturbance that was drawn.

    Args:
        cell: Where.
        arm: Which of its arms.
        drawn: ``info["disturbance"]`` of a reset.
        mode: What commands mean.

    Raises:
        InputError: The arm does not start at the start of its path.
    """
    if drawn["start_phase"][arm] > 0.0:
        raise InputError(f"arm {arm} starts at {drawn['start_phase'][arm]:.3g} of its path, not at its start")
    late, speed, stops = float(drawn["late_s"][arm]), float(drawn["speed"][arm]), drawn["stops_s"][arm]
    period = cell.control_period
    first = int(late / period)  # the period in which it goes; stops are asked when a period begins
    last = max([first, *(math.ceil(end / period) for _, end in stops)])
    commands = [0.0 if any(begin <= k * period < end for begin, end in stops) else 1.0 for k in range(first, last + 1)]
    times = [(first + 1) * period - late, *[period] * (last - first)]
    times[-1] = np.inf
    motion = cell.planes[arm].motion(commands, times, mode=mode, share=speed)
    return motion.delayed(late)
