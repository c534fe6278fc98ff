r"""A certified lower bound on the makespan of two arms, both free to yield.

No motion of an arm gains on its minimum-time profile: ``t(b) - t(a) >= theta(b) - theta(a)``, with ``theta`` the time
at which that profile is at a station. In the coordinates ``(theta_a, theta_b)`` each arm is a point of unit top
speed, so the makespan is at least that of a monotone path from corner to corner of the chart redrawn in them, round
the cells that are certified blocked. Sample any schedule every h: its cell indices rise by at most one per sample and
never sit in a cell that is blocked throughout; if K is the least number of cells on such a path, the makespan is at
least (K - 1) h.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from armtempo.planners._coordination_chart import BLOCKED, CoordinationChart
from armtempo.planners._phase_trajectory import PhaseTrajectory
from armtempo.robots import njit

Array = NDArray[np.float64]
CELLS = 2000  # along the slower arm
COARSEST = 2048  # chart cells along each side


@njit
def _fewest_cells(blocked_before: NDArray[np.int32], low_a: Array, high_a: Array, low_b: Array, high_b: Array) -> int:
    """Cells on the shortest king's-move path through the warped grid, or 0 if there is none.

    ``blocked_before`` (R+1, R+1): blocked chart cells before each row and column; ``low``, ``high``: chart cells that a
    warped cell touches.
    """
    m, n = low_a.shape[0], low_b.shape[0]
    row = np.zeros(n, np.int64)
    for k in range(m):
        i0, i1 = int(low_a[k]), int(high_a[k])
        diagonal = 0  # the cell before, in the row before
        for j in range(n):
            above = row[j]
            j0, j1 = int(low_b[j]), int(high_b[j])
            shut = blocked_before[i1, j1] - blocked_before[i0, j1] - blocked_before[i1, j0] + blocked_before[i0, j0]
            best = 0
            if shut < (i1 - i0) * (j1 - j0):
                if k == 0 and j == 0:
                    best = 1
                else:
                    least = 1 << 60
                    if above > 0:
                        least = min(least, above)
                    if j > 0 and row[j - 1] > 0:
                        least = min(least, row[j - 1])
                    if diagonal > 0:
                        least = min(least, diagonal)
                    if least < 1 << 60:
                        best = least + 1
            diagonal = above
            row[j] = best
    return int(row[n - 1])


def makespan_bound(fastest_a: PhaseTrajectory, fastest_b: PhaseTrajectory, chart: CoordinationChart) -> float:
    """The certified lower bound [s] on the makespan of both arms; infinite if no monotone timing avoids the chart.

    Args:
        fastest_a: Minimum-time motion of arm a.
        fastest_b: Minimum-time motion of arm b.
        chart: Built at ``d_min`` without reserve; only its blocked cells count.
    """
    longest = max(fastest_a.duration, fastest_b.duration)
    h = longest / CELLS
    # A coarser cell counts as blocked where all of its cells are: still a bound, and it stays in the cache.
    shut, share = chart.states == BLOCKED, 1
    while len(shut) > COARSEST:
        shut = shut[0::2] & shut[1::2]
        shut = shut[:, 0::2] & shut[:, 1::2]
        share *= 2
    resolution = len(shut)
    blocked = np.zeros((resolution + 1,) * 2, dtype=np.int32)
    np.cumsum(shut, axis=0, out=blocked[1:, 1:])
    np.cumsum(blocked, axis=1, out=blocked)
    touched = []
    for fastest, step in ((fastest_a, share * chart.step_a), (fastest_b, share * chart.step_b)):
        count = max(math.ceil(fastest.duration / h * (1.0 - 1e-12)), 1)
        lam = fastest.at(h * np.arange(count + 1))[0]
        low = np.floor(lam[:-1] / step - 1e-9)  # a warped cell that touches a chart cell counts with all of it
        high = np.ceil(lam[1:] / step + 1e-9)
        touched += [np.clip(low, 0, resolution - 1), np.clip(high, 1, resolution)]
    cells = _fewest_cells(blocked, *touched)
    return max(longest, (cells - 1) * h) if cells else math.inf
