"""What a solve in the phase plane met: controllable sets, limit curves, islands, and which limit was active where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.planners.topp._greedy import active_rows
from armtempo.planners.topp._phase_plane import PhasePlane
from armtempo.planners.topp._trajectory import PhaseTrajectory

AT_CAP_SHARE = 1e-6  # of a speed limit: so near to it a motion is held by it


class Island(NamedTuple):
    """A part of the phase plane below the limit curve where no ``mu_dot`` keeps the limits: viscous friction's work."""

    lam_first: float
    lam_last: float
    mu_low: float
    mu_high: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PhaseDiagnostics:
    """Everything about one solve that explains its motion.

    Attributes:
        grid: (N+1,) stations.
        controllable: (N+1, K, 2) the intervals of ``mu`` from which the end can be met; NaN where there are fewer.
        admissible: (N+1, K, 2) those at which some ``mu_dot`` keeps the limits of the station; likewise.
        islands: Inadmissible islands along the path.
        limits: Names of the rows.
        active: (N,) the limit that holds the motion in every interval: its row, -1 for a speed limit, -2 for none.
        side: (N,) 1: its upper end, -1: its lower end, 0: neither.
    """

    grid: Floats
    controllable: Floats
    admissible: Floats
    islands: tuple[Island, ...]
    limits: tuple[str, ...]
    active: Ints
    side: Ints

    def describe(self, interval: int) -> str:
        """The active limit of an interval in words."""
        row = int(self.active[interval])
        if row < 0:
            return "speed limit" if row == -1 else "none"
        return f"{self.limits[row]}, {'upper' if self.side[interval] > 0 else 'lower'} end"


def diagnose(plane: PhasePlane, motion: PhaseTrajectory | None = None) -> PhaseDiagnostics:
    """Explain a motion on the plane's own grid; by default the minimum-time motion from rest (or the slowest start)."""
    if motion is None:
        motion = plane.fastest(float(np.sqrt(plane.sets[0, 0, 0])))
    rows = plane.rows
    x = np.interp(rows.station, motion.lam, motion.mu**2)
    steps = 2.0 * np.diff(rows.station)
    u = np.divide(np.diff(x), steps, out=np.zeros_like(steps), where=steps > 0.0)
    active, side = np.empty(len(u), dtype=np.int64), np.empty(len(u), dtype=np.int64)
    active_rows(rows, x, u, active, side)
    share = np.divide(x, rows.x_cap, out=np.zeros_like(x), where=rows.x_cap > 0.0)  # 0 is a stop
    capped = np.maximum(share[:-1], share[1:]) > 1.0 - AT_CAP_SHARE
    active = np.where(active >= 0, active, np.where(capped, -1, -2))
    return PhaseDiagnostics(
        grid=rows.station,
        controllable=plane.controllable,
        admissible=plane.admissible,
        islands=_islands(rows.station, plane.admissible),
        limits=tuple(plane.limit_name(row) for row in range(rows.a.shape[1])),
        active=active,
        side=side,
    )


def _islands(station: Floats, admissible: Floats) -> tuple[Island, ...]:
    """Gaps between admissible intervals, those of neighbouring stations that overlap put together."""
    islands: list[Island] = []
    open_ones: list[Island] = []
    for k, lam in enumerate(station):
        gaps = [
            (float(below), float(above))
            for below, above in zip(admissible[k, :-1, 1], admissible[k, 1:, 0], strict=True)
            if above > below
        ]
        still: list[Island] = []
        for low, high in gaps:
            touching = [island for island in open_ones if island.mu_low <= high and low <= island.mu_high]
            grown = Island(
                min([island.lam_first for island in touching], default=float(lam)),
                float(lam),
                min([low, *(island.mu_low for island in touching)]),
                max([high, *(island.mu_high for island in touching)]),
            )
            open_ones = [island for island in open_ones if island not in touching]
            still.append(grown)
        islands += open_ones
        open_ones = still
    return tuple(islands + open_ones)
