r"""Best response: the earliest arrival of one arm behind and before others whose motions are known.

One search over the whole controllable set on a coarse lattice finds the gaps to take, then the lattice is drawn again
round the motion found, in a tube that shrinks while the stations grow dense, until every row of the plane's grid is
one. A level of ``x`` is reached by one constant ``u`` between two stations, so a lattice of fixed speeds costs
1 to 2 %; the tubes take that away.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, final

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.errors import InfeasibleError
from armtempo.planners.coordination._interval_kernels import (
    INTERVALS_PER_STATE,
    Lattice,
    Windows,
    arrival,
    reach,
    trace,
)
from armtempo.planners.coordination._time_windows import Occupancy, Runs, forbidden_windows
from armtempo.planners.joint_paths import Standing
from armtempo.planners.topp import LIMIT_EXCESS_MAX, PhasePlane, PhaseTrajectory
from armtempo.planners.topp.kernels import Rows
from armtempo.robots import njit

MOST_INTERVALS = 1200  # between stations
RUN_INTERVALS = 8  # at least, between two stops
LEAST_SLOTS = 1024  # equal pieces of the path with windows of their own
SAME_WINDOW_SHARE = 0.1  # of the mean time between stations: windows that differ by less are one
LEAST_GAIN_SHARE = 2e-4  # of the arrival time: what is worth another search


class Stage(NamedTuple):
    """One search: intervals between stations, levels per station, half width of the tube as a share of the edge.

    ``levels / (tube * intervals)`` is the number of levels that the torque limits leave to choose from per interval:
    some eight are needed to follow those limits. ``repeats``: redrawn round what it found, as long as that gains.
    """

    intervals: int
    levels: int
    tube: float
    repeats: int


COARSE_STAGES = (Stage(128, 161, 0.5, 1), Stage(128, 121, 0.12, 4))
ALL_STAGES = (*COARSE_STAGES, Stage(256, 81, 0.04, 3), Stage(512, 61, 0.015, 3), Stage(MOST_INTERVALS, 61, 0.0075, 4))


@njit
def _levels(low: Floats, high: Floats, middle: Floats, half: Floats, extra: Floats, out: Floats, width: Ints) -> None:
    """Equal levels in ``middle`` +- ``half``, cut off at ``low`` and ``high``; ``low`` and ``extra`` too; rising."""
    count = out.shape[1] - 2
    for i in range(low.shape[0]):
        more = min(max(extra[i], low[i]), high[i])
        n = 1
        out[i, 0] = low[i]
        for k in range(count + 1):
            level = high[i]
            if k < count:
                level = min(max(middle[i] + half[i] * (2.0 * k / (count - 1) - 1.0), low[i]), high[i])
            if out[i, n - 1] < more and (more <= level or k == count):
                out[i, n] = more
                n += 1
            if k < count and level > out[i, n - 1]:
                out[i, n] = level
                n += 1
        width[i] = n  # the rest is never read


class _Found(NamedTuple):
    pick: Ints
    x: Floats
    leave: Floats  # [s] when each station is left


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class IntervalSearch:
    """Finds the earliest arrival of one arm among others.

    Attributes:
        plane: The arm's phase plane.
        runs_with: Gives the runs of the chart with another arm (first index along the other's path).
    """

    plane: PhasePlane
    runs_with: Callable[[int], Runs]

    @cached_property
    def _stations(self) -> Ints:
        """Rows of the grid that may be stations: the first at each place, thinned if there are too many."""
        station = self.plane.rows.station
        rows = np.flatnonzero(np.concatenate([[True], np.diff(station) > 0.0]))
        forced = rows[np.isin(station[rows], self._forced)]
        return np.union1d(rows[:: -(-(len(rows) - 1) // MOST_INTERVALS)], np.append(forced, len(station) - 1))

    @cached_property
    def _forced(self) -> Floats:
        """Places without which no lattice will do: the ends, stops, and the middles of parts where the arm stands."""
        path, station = self.plane.dynamics.path, self.plane.rows.station
        stops = () if path is None else path.stops
        return np.unique([station[0], *stops, *(part.middle for part in self._standing), station[-1]])

    def _pick(self, intervals: int) -> Ints:
        """Rows of the grid for so many intervals, more where few would be left of a run between two stops."""
        rows, total = self._stations, len(self._stations) - 1
        marks = np.flatnonzero(np.isin(self.plane.rows.station[rows], self._forced))
        if len(marks) == 2:
            pick = rows[:: max(1, round(total / intervals))]
            return pick if pick[-1] == rows[-1] else np.append(pick, rows[-1])
        places = [marks[-1:]]
        still = np.array([part.middle for part in self._standing])
        for first, last in pairwise(marks):
            ends = self.plane.rows.station[rows[[first, last]]]
            stands = np.isin(ends, still).any()
            rows_between = int(last - first)
            count = 1 if stands else max(min(RUN_INTERVALS, rows_between), round(intervals * rows_between / total))
            places.append(np.linspace(first, last, count + 1).round().astype(np.int64)[:-1])
        return np.asarray(rows[np.unique(np.concatenate(places))])

    @property
    def _standing(self) -> tuple[Standing, ...]:
        path = self.plane.dynamics.path
        return () if path is None else path.standing

    @cached_property
    def fastest(self) -> PhaseTrajectory:
        """The minimum-time motion, which the answer is where no window is in the way."""
        return self.plane.fastest()

    @cached_property
    def _border(self) -> Floats:
        station = self.plane.rows.station[self._stations]
        return np.union1d(station, np.linspace(0.0, self.plane.length, LEAST_SLOTS + 1)[1:-1])

    def respond(
        self,
        others: Mapping[int, PhaseTrajectory | Occupancy],
        *,
        horizon: float = np.inf,
        stages: Sequence[Stage] = ALL_STAGES,
    ) -> PhaseTrajectory:
        """The earliest arrival found.

        Args:
            others: How the other arms move, or when they are in which column of the chart.
            horizon: Arrivals later than this are of no use [s].
            stages: Searches to make, the first over all of the controllable set.

        Raises:
            InfeasibleError: There is no such motion on the lattice; ``reason`` says what is in the way, if it is known.
        """
        if self.plane.edges.low[0] > 0.0:
            raise InfeasibleError("the arm cannot start from rest", remedy="move the start of its path")
        first, start, stop = forbidden_windows(
            self._border, [(self.runs_with(j), other) for j, other in others.items()]
        )
        self._check_ends(first, start, stop)
        reserve = excess = 0.0
        for _ in range(4):
            motion = self._search(first, start, stop, horizon, stages, self._reserved(reserve))
            excess = motion.certificate.excess
            if excess <= LIMIT_EXCESS_MAX:
                return motion
            reserve = 1.0 - (1.0 - reserve) * (1.0 - 1.5 * excess)
        raise InfeasibleError(
            f"a limit is exceeded by {100.0 * excess:.2g} % between stations",
            remedy="give the cell more stations",
            reason="grid",
        )

    def _reserved(self, share: float) -> Rows:
        rows = self.plane.rows
        if share <= 0.0:
            return rows
        off_low, off_high = share * np.abs(rows.low), share * np.abs(rows.high)
        wide = rows.high - rows.low > off_low + off_high  # else it is a dwell's, which is no limit to stay away from
        return rows._replace(
            low=np.where(wide, rows.low + off_low, rows.low), high=np.where(wide, rows.high - off_high, rows.high)
        )

    def _check_ends(self, first: Ints, start: Floats, stop: Floats) -> None:
        begin, end = slice(first[0], first[1]), slice(first[-2], first[-1])
        if (start[begin] <= 0.0).any() and (stop[begin][start[begin] <= 0.0] > 0.0).any():
            raise InfeasibleError("another arm is too close where the arm starts", reason="unsafe start")
        if np.isinf(stop[end]).any():
            raise InfeasibleError("another arm ends where the arm has to pass or to end", reason="parked in the way")

    def _windows(self, pick: Ints, first: Ints, start: Floats, stop: Floats) -> Windows:
        border = self._border
        slot = np.searchsorted(border, self.plane.rows.station[pick])
        loose = SAME_WINDOW_SHARE * self.fastest.duration / len(pick)
        return Windows(border, first, start, stop, slot.astype(np.int64), loose)

    def _search(
        self, first: Ints, start: Floats, stop: Floats, horizon: float, stages: Sequence[Stage], rows: Rows
    ) -> PhaseTrajectory:
        found: _Found | None = None
        for stage in stages:
            pick = self._pick(stage.intervals)
            windows = self._windows(pick, first, start, stop)
            for _ in range(stage.repeats):
                # who is not past a station by then cannot arrive in time, whatever it does
                latest = horizon - self._to_go[pick]
                better = _earliest(rows, self._lattice(pick, stage, found), windows, latest)
                if better is None:
                    break
                gained = found is None or better.leave[-1] < (1.0 - LEAST_GAIN_SHARE) * found.leave[-1]
                if found is None or better.leave[-1] <= found.leave[-1] * (1.0 + 1e-9):
                    found, horizon = better, float(better.leave[-1]) * (1.0 + 1e-9)
                if not gained:
                    break
            if found is None:
                raise InfeasibleError("no gap between the others' motions lets the arm through", reason="no gap")
        assert found is not None
        return self._motion(found)

    @cached_property
    def _to_go(self) -> Floats:
        """Minimum time from every row of the grid to the end [s]."""
        return self.fastest.duration - self.fastest.time_at(self.plane.rows.station)

    def _lattice(self, pick: Ints, stage: Stage, found: _Found | None) -> Lattice:
        edges, station = self.plane.edges, self.plane.rows.station
        fastest = np.interp(station[pick], self.fastest.lam, self.fastest.mu**2)
        low = edges.low[pick]
        high = np.maximum(np.minimum(edges.high[pick], fastest), low)  # nothing from rest gets above the fastest motion
        if found is None:
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
        else:
            middle, half = np.interp(station[pick], station[found.pick], found.x), stage.tube * high
        level = np.zeros((len(pick), stage.levels + 2))
        width = np.empty(len(pick), dtype=np.int64)
        _levels(low, high, middle, half, fastest, level, width)
        level[0, 0], width[0] = 0.0, 1
        level[-1, 0], width[-1] = self.plane.mu_end**2, 1
        return Lattice(pick, level, width, self.plane.holdable[pick])

    def _motion(self, found: _Found) -> PhaseTrajectory:
        lam, mu = self.plane.rows.station[found.pick], np.sqrt(found.x)
        transit = 2.0 * np.diff(lam) / (mu[1:] + mu[:-1])
        arrive = np.concatenate([[0.0], found.leave[:-1] + transit])
        wait = np.where((found.x <= 0.0) & (found.leave - arrive > 1e-9), found.leave - arrive, 0.0)
        wait[-1] = 0.0
        left = np.cumsum(wait + np.concatenate([[0.0], transit]))
        twice = np.repeat(np.arange(len(lam)), 1 + (wait > 0.0))
        time = left[twice]
        time[np.flatnonzero(np.diff(twice) == 0)] -= wait[wait > 0.0]
        return PhaseTrajectory(
            lam=lam[twice], mu=mu[twice], time=time, dynamics=self.plane.dynamics, mu_end=self.plane.mu_end
        )


def _earliest(rows: Rows, lattice: Lattice, windows: Windows, latest: Floats) -> _Found | None:
    """The motion through a lattice that arrives first, if there is one."""
    label = np.empty((*lattice.level.shape, INTERVALS_PER_STATE, 2))
    count = np.zeros(lattice.level.shape, dtype=np.int64)
    reach(rows, lattice, windows, latest, label, count)
    time = arrival(windows, label[-1, 0], count[-1, 0])
    if not np.isfinite(time):
        return None
    x, leave = np.empty(len(lattice.pick)), np.empty(len(lattice.pick))
    if trace(rows, lattice, windows, label, count, 0, time, x, leave):
        return None
    return _Found(lattice.pick, x, leave)
