r"""Joint paths ``q = f(lambda)`` (Lee1991 eq. 2): what the phase plane and the charts need of a path.

``lambda`` runs over ``[0, length]``: the travelled length [m] of Cartesian paths, the length of the chords in joint
space [rad] of paths through waypoints. The derivatives
``f' = dq/dlambda`` and ``f'' = d2q/dlambda2`` are exact, not differences (Lee1991 eqs. 3-4):

    qd = f' mu,    qdd = f'' mu^2 + f' mu_dot,    mu = dlambda/dt
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, all_finite
from armtempo.errors import PathError
from armtempo.robots import njit

THIRD_STEP_SHARE = 1e-4  # of a piece: steps of the differences that stand for f'''


class PathTable(NamedTuple):
    """A joint path sampled for inner loops: quintic Hermite pieces through exact values and derivatives.

    ``station`` (K+1,) rising, repeated at stops, where ``f'`` may jump; ``q``, ``dq``, ``ddq`` (K+1, n), the values
    *after* the station, of a repeated one in its first row those before it; ``ddq_before`` (K+1, n), those before it.
    With K = 2048 the pieces reproduce smooth paths to 1e-12 rad.
    """

    station: Floats
    q: Floats
    dq: Floats
    ddq: Floats
    ddq_before: Floats


class Standing(NamedTuple):
    """A part of a path on which the arm stands: ``f' = 0`` from lambda ``start`` to ``stop``, for ``seconds`` at least.

    ``exact``: and no longer. All three places are breakpoints.
    """

    start: float
    stop: float
    seconds: float
    exact: bool

    @property
    def middle(self) -> float:
        """Up to there ``mu`` rises, from there on it falls."""
        return 0.5 * (self.start + self.stop)


class AbstractJointPath(ABC):
    """A path of an arm in joint space.

    Attributes:
        length: ``lambda_max``.
        dof: Number of joints n.
        breakpoints: Rising stations, first 0 and last ``length``, between which the path is smooth.
        stops: Rising breakpoints inside the path at which every motion comes to rest; ``f'`` may jump there.
        standing: Parts on which the arm stands; their ends are stops or the path's ends.
        unit: Of ``lambda``: ``m``, ``rad``, or ``share`` of the path.
    """

    unit: str = "m"
    length: float
    dof: int
    breakpoints: Floats
    stops: Floats = np.empty(0)
    standing: tuple[Standing, ...] = ()

    @abstractmethod
    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``f``, ``f'``, ``f''`` at ``lam``, each (..., n); ``before``: a breakpoint belongs to the piece before it."""

    @abstractmethod
    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over intervals [low, high], (..., n), not from samples: charts certify with them."""

    def third(self, lam: ArrayLike, *, before: bool = False) -> Floats:
        """``f'''`` at ``lam``, (..., n): what jerk needs.

        Differences of ``f''`` inside the piece; a path that knows better says so.
        """
        stations = np.asarray(lam, dtype=np.float64)
        piece = np.searchsorted(self.breakpoints, stations, side="left" if before else "right") - 1
        piece = np.clip(piece, 0, len(self.breakpoints) - 2)
        low, high = self.breakpoints[piece], self.breakpoints[piece + 1]
        step = THIRD_STEP_SHARE * (high - low)
        middle = np.clip(stations, low + 2.0 * step, high - 2.0 * step)
        ahead, behind = middle + step, middle - step
        rise = self.evaluate(ahead)[2] - self.evaluate(behind)[2]
        third: Floats = rise / (ahead - behind)[..., None]
        return third

    def sampled(self, lam: Floats, dof: int, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``evaluate`` for an arm with ``dof`` joints, looked through: paths may be anybody's.

        Raises:
            PathError: The arrays are not (..., dof), or not finite; the message names the station.
        """
        q, dq, ddq = rows = self.evaluate(lam, before=before)
        for what, array in (("f", q), ("f'", dq), ("f''", ddq)):
            if np.shape(array) != (*lam.shape, dof):
                raise PathError(
                    f"{what} of a {type(self).__name__} has shape {np.shape(array)} at stations {lam.shape}",
                    remedy=f"give (..., {dof}): one value per joint",
                )
            if not all_finite(array):
                station = float(lam[~np.isfinite(array).all(axis=-1)].flat[0])
                raise PathError(
                    f"{what} of a {type(self).__name__} is not finite at station {station:.6g} {self.unit}",
                    remedy="give a path that is finite, with two derivatives, from 0 to its length",
                    station=station,
                )
        return rows

    def check_stations(self) -> None:
        """Look through ``length`` and ``breakpoints``. Raises PathError."""
        marks = np.asarray(self.breakpoints, dtype=np.float64)
        rising = marks.ndim == 1 and len(marks) > 1 and all_finite(marks) and bool((np.diff(marks) > 0.0).all())
        if not rising or marks[0] != 0.0 or marks[-1] != self.length:
            raise PathError(
                f"the breakpoints of a {type(self).__name__} do not rise from 0 to its length {self.length:.6g}",
                remedy="give finite stations, the first 0 and the last the length",
            )

    def table(self, pieces: int = 2048) -> PathTable:
        """Samples for numba kernels; breakpoints are stations."""
        station = np.union1d(np.linspace(0.0, self.length, pieces + 1), self.breakpoints)
        station = np.sort(np.concatenate([station, self.stops]))
        q, dq, ddq = self.evaluate(station)
        q_before, dq_before, ddq_before = self.evaluate(station, before=True)
        first = np.flatnonzero(np.diff(station) == 0.0)
        q[first], dq[first] = q_before[first], dq_before[first]
        return PathTable(station=station, q=q, dq=dq, ddq=ddq, ddq_before=ddq_before)


@njit
def path_point(table: PathTable, lam: float, q: Floats) -> None:
    """Write ``f(lam)`` to ``q`` (n,)."""
    station = table.station
    last = station.shape[0] - 2
    low = min(max(int(lam / station[last + 1] * (last + 1)), 0), last)
    while low > 0 and lam < station[low]:
        low -= 1
    while low < last and lam >= station[low + 1]:
        low += 1
    h = station[low + 1] - station[low]
    w = min(max((lam - station[low]) / h, 0.0), 1.0)
    w3 = w * w * w
    to_end = w3 * (10.0 - 15.0 * w + 6.0 * w * w)
    d_start = w - w3 * (6.0 - 8.0 * w + 3.0 * w * w)
    d_end = w3 * (-4.0 + 7.0 * w - 3.0 * w * w)
    c_start = 0.5 * w * w - w3 * (1.5 - 1.5 * w + 0.5 * w * w)
    c_end = w3 * (0.5 - w + 0.5 * w * w)
    for j in range(q.shape[0]):
        q[j] = (
            table.q[low, j]
            + to_end * (table.q[low + 1, j] - table.q[low, j])
            + h * (d_start * table.dq[low, j] + d_end * table.dq[low + 1, j])
            + h * h * (c_start * table.ddq[low, j] + c_end * table.ddq_before[low + 1, j])
        )
