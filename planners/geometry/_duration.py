"""Lower bounds of durations: what is known of one, and the time that an interval takes at least."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armtempo.arrays import Floats


@dataclass(frozen=True, kw_only=True, slots=True)
class DurationBound:
    """No motion with the same ends, inside the limits, takes less than ``seconds``.

    Attributes:
        seconds: The bound [s].
        proven: By an argument that holds between samples, too; else it is an estimate, from how the time falls with
            the grid.
    """

    seconds: float
    proven: bool


def least_times(way: Floats, first: Floats, last: Floats, peak: Floats, slope: Floats) -> Floats:
    """(N,) least times [s] of intervals from upper bounds of x, the square of the speed along them; all (N,).

    Args:
        way: Their lengths [m, or the path's own unit].
        first: Bounds of x where they begin [unit^2/s^2], not above ``peak``.
        last: Likewise where they end.
        peak: Bounds of x between their ends.
        slope: Of ``|x'| / 2``, the acceleration [unit/s^2].
    """
    root = np.sqrt(np.maximum(peak, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        sloping = (2.0 * root - np.sqrt(first) - np.sqrt(last)) / slope
        flat = np.maximum(way - (2.0 * peak - first - last) / (2.0 * slope), 0.0) / root
    return np.asarray(sloping + flat)
