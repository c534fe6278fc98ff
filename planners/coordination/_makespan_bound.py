r"""A certified lower bound on the makespan of arms that are all free to yield, and the class of a pair.

No motion of an arm gains on its minimum-time profile: ``t(b) - t(a) >= theta(b) - theta(a)``, with ``theta`` the time
at which that profile is at a station. In the coordinates ``(theta_a, theta_b)`` each arm is a point of unit top
speed, so the makespan is at least that of a monotone path from corner to corner of the chart redrawn in them, round
the cells that are certified blocked. Sample any schedule every h: its cell indices rise by at most one per sample and
never sit in a cell that is blocked throughout; if K is the least number of cells on such a path, the makespan is at
least (K - 1) h.

The same search with the chart closed behind one arm (what is blocked *later* for the other counts) tells what it
costs if that arm goes first through every region. Where that costs nothing for one of them, the pair is ``uniform``
and a start delay is optimal; else it is ``mixed`` and timing must be shaped.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.charts import BLOCKED, FREE, CoordinationChart
from armtempo.planners.coordination._joint_bound import JointBound
from armtempo.planners.topp import PhaseTrajectory
from armtempo.robots import njit

PriorityClass = Literal["free", "uniform", "mixed", "infeasible"]

CELLS_OF_SLOWER_ARM = 2000  # of the chart redrawn in minimum times
MOST_CHART_CELLS = 2048  # chart cells along each side
NATURAL_COST_SHARE = 0.002  # of the makespan (and two cells): orders that cost no more are natural
UNREACHED = np.int32(1 << 30)


@dataclass(frozen=True, kw_only=True, eq=False)
class PairBound:
    """What the relaxed search says of two arms.

    Attributes:
        time: Lower bound on their makespan [s]; infinite if no monotone timing avoids the blocked cells.
        first_times: Length [s] of the shortest relaxed path with arm a, and with arm b, first through every region;
            infinite where that cannot be.
        path: (K, 2) times theta_a, theta_b [s] along a shortest relaxed path; None if there is none.
        step: Time between its rows [s].
    """

    time: float
    first_times: tuple[float, float]
    path: Floats | None
    step: float

    @property
    def natural(self) -> tuple[bool, bool]:
        """Whether arm a, and arm b, can go first through every region at no cost to the relaxed makespan."""
        most = (1.0 + NATURAL_COST_SHARE) * self.time + 2.0 * self.step
        a, b = (math.isfinite(first) and first <= most for first in self.first_times)
        return a, b


@dataclass(frozen=True, kw_only=True, eq=False)
class MakespanBound:
    """Lower bound on the makespan of all arms, and what it rests on.

    Attributes:
        time: The bound [s]: of all arms together, as far as that search came, and of every pair.
        joint: The search over who passes first, all arms together.
        pairs: Per pair (i, j), i < j, its relaxed search.
        classes: Per pair ``free``: minimum-time motions started together keep clear; ``uniform``: with one
            arm first through every region a start delay is within 3 % of the bound; ``mixed``: it is not;
            ``infeasible``: certified to be so.
        natural: Per pair that meets, whether the first, or the second, may go first like that.
    """

    time: float
    joint: JointBound
    pairs: Mapping[tuple[int, int], PairBound]
    classes: Mapping[tuple[int, int], PriorityClass]
    natural: Mapping[tuple[int, int], tuple[bool, bool]]

    @property
    def priority_class(self) -> PriorityClass:
        """The class of all arms together; uniform pairs whose natural orders go round in a circle are ``mixed``."""
        classes = set(self.classes.values())
        if "infeasible" in classes or math.isinf(self.time):
            return "infeasible"
        if "mixed" in classes:
            return "mixed"
        if "uniform" not in classes:
            return "free"
        return "uniform" if self._ordered() else "mixed"

    def _ordered(self) -> bool:
        """Whether one order of the arms is natural for all pairs."""
        before = set()
        for (i, j), kind in self.classes.items():
            if kind == "uniform":
                a, b = self.natural[i, j]
                before |= {(i, j)} if a and not b else {(j, i)} if b and not a else set()
        left = {arm for pair in self.pairs for arm in pair}
        while left:
            first = next((k for k in sorted(left) if not any((j, k) in before for j in left)), None)
            if first is None:
                return False
            left.remove(first)
        return True


@njit
def _shut_cells(
    occupied: NDArray[np.int32], low_a: Floats, high_a: Floats, low_b: Floats, high_b: Floats, every: bool, shut: Bools
) -> None:
    """Warped cells whose chart cells are all occupied (``every``), or any of them.

    ``occupied`` (R+1, R+1): occupied chart cells before each row and column; ``low``, ``high``: chart cells that a
    warped cell touches.
    """  # fmt: skip
    for k in range(low_a.shape[0]):
        i0, i1 = int(low_a[k]), int(high_a[k])
        for j in range(low_b.shape[0]):
            j0, j1 = int(low_b[j]), int(high_b[j])
            count = occupied[i1, j1] - occupied[i0, j1] - occupied[i1, j0] + occupied[i0, j0]
            shut[k, j] = count == (i1 - i0) * (j1 - j0) if every else count > 0


@njit
def _fewest_cells(shut: Bools, cells: NDArray[np.int32]) -> int:
    """Cells on the shortest king's-move path from the first cell to each one, in ``cells``; returns that to the last.

    0 if there is none.
    """
    m, n = shut.shape
    for k in range(m):
        for j in range(n):
            least = UNREACHED
            if not shut[k, j]:
                if k == 0 and j == 0:
                    least = np.int32(1)
                if k > 0:
                    least = min(least, cells[k - 1, j] + np.int32(1))
                if j > 0:
                    least = min(least, cells[k, j - 1] + np.int32(1))
                if k > 0 and j > 0:
                    least = min(least, cells[k - 1, j - 1] + np.int32(1))
            cells[k, j] = min(least, UNREACHED)
    return int(cells[m - 1, n - 1]) if cells[m - 1, n - 1] < UNREACHED else 0


@njit
def _walk_back(cells: NDArray[np.int32], path: Ints) -> None:
    """Fill the cells (K, 2) of a shortest path: of several, the one that waits as early as it can."""
    k, j = cells.shape[0] - 1, cells.shape[1] - 1
    for row in range(path.shape[0] - 1, -1, -1):
        path[row, 0], path[row, 1] = k, j
        want = cells[k, j] - 1
        if k > 0 and j > 0 and cells[k - 1, j - 1] == want:
            k, j = k - 1, j - 1
        elif k > 0 and cells[k - 1, j] == want:
            k -= 1
        elif j > 0:
            j -= 1


def _closed_behind_a(shut: Bools) -> Bools:
    """A cell is shut too if a later one of arm a's shuts any earlier one of arm b's."""
    later = np.maximum.accumulate(shut[::-1], axis=0)[::-1]
    closed: Bools = np.maximum.accumulate(later, axis=1)
    return closed


def _warp(
    fastest_a: PhaseTrajectory, fastest_b: PhaseTrajectory, chart: CoordinationChart, *, outer: bool
) -> tuple[Bools, float]:
    """The chart in minimum times: which cells are shut, and their side [s].

    Shut where every chart cell beneath is blocked, or, ``outer``, where any is not certified free.
    """
    h = max(fastest_a.duration, fastest_b.duration) / CELLS_OF_SLOWER_ARM
    # A coarser cell counts as blocked where all of its cells are: still a bound, and it stays in the cache.
    occupied, share = (chart.states != FREE) if outer else (chart.states == BLOCKED), 1
    while len(occupied) > MOST_CHART_CELLS and len(occupied) % 2 == 0:
        halves = (occupied[0::2], occupied[1::2])
        occupied = halves[0] | halves[1] if outer else halves[0] & halves[1]
        halves = (occupied[:, 0::2], occupied[:, 1::2])
        occupied = halves[0] | halves[1] if outer else halves[0] & halves[1]
        share *= 2
    resolution = len(occupied)
    before = np.zeros((resolution + 1,) * 2, dtype=np.int32)
    np.cumsum(occupied, axis=0, out=before[1:, 1:])
    np.cumsum(before, axis=1, out=before)
    touched = []
    for fastest, step in ((fastest_a, share * chart.step_a), (fastest_b, share * chart.step_b)):
        count = max(math.ceil(fastest.duration / h * (1.0 - 1e-12)), 1)
        lam = fastest.at(h * np.arange(count + 1))[0]
        low = np.floor(lam[:-1] / step - 1e-9)  # a warped cell that touches a chart cell counts with all of it
        high = np.ceil(lam[1:] / step + 1e-9)
        touched += [np.clip(low, 0, resolution - 1), np.clip(high, 1, resolution)]
    shut = np.empty((len(touched[0]), len(touched[2])), dtype=np.bool_)
    _shut_cells(before, touched[0], touched[1], touched[2], touched[3], not outer, shut)
    return shut, h


def _path(cells: NDArray[np.int32], count: int, h: float) -> Floats:
    path = np.empty((count, 2), dtype=np.int64)
    _walk_back(cells, path)
    theta: Floats = h * path.astype(np.float64)
    return theta


def pair_bound(fastest_a: PhaseTrajectory, fastest_b: PhaseTrajectory, chart: CoordinationChart) -> PairBound:
    """The certified lower bound of two arms, with what it costs if one of them goes first everywhere.

    Args:
        fastest_a: Minimum-time motion of arm a.
        fastest_b: Minimum-time motion of arm b.
        chart: Built at ``d_min`` without reserve; only its blocked cells count.
    """
    longest = max(fastest_a.duration, fastest_b.duration)
    shut, h = _warp(fastest_a, fastest_b, chart, outer=False)
    if not shut.any():  # most pairs of many arms never meet
        rows = np.arange(max(shut.shape))[:, None]
        path = h * np.maximum(rows - (len(rows) - np.array(shut.shape)), 0)
        return PairBound(time=longest, first_times=(longest, longest), path=path, step=h)
    cells = np.empty(shut.shape, dtype=np.int32)

    def length(count: int) -> float:
        return max(longest, (count - 1) * h) if count else math.inf

    count = _fewest_cells(shut, cells)
    path = _path(cells, count, h) if count else None
    first_a = length(_fewest_cells(_closed_behind_a(shut), cells))
    first_b = length(_fewest_cells(np.ascontiguousarray(_closed_behind_a(shut.T).T), cells))
    return PairBound(time=length(count), first_times=(first_a, first_b), path=path, step=h)


def guide_path(fastest_a: PhaseTrajectory, fastest_b: PhaseTrajectory, chart: CoordinationChart) -> Floats | None:
    """(K, 2) times theta_a, theta_b, one row per equal step, along a shortest path through free cells; or None.

    The plan of two arms without momentum: not one to execute, one to start from.
    """
    shut, h = _warp(fastest_a, fastest_b, chart, outer=True)
    cells = np.empty(shut.shape, dtype=np.int32)
    count = _fewest_cells(shut, cells)
    return _path(cells, count, h) if count else None
