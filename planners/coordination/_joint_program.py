r"""All arms' motions with who passes first where given, as one program; see ``_joint_refinement``.

Unknowns are ``x = mu^2`` at every station of every arm, a wait ``w`` of every arm at its start, and the makespan T:

    min T    with    w_i + t_i(end) <= T,    the rows of every interval at both of its ends,
             w_i + t_i(enters) >= w_j + t_j(leaves) + margin    at every corner of a region that arm j passes first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.coordination._joint_kernels import HIGH, LOW, Chain, Places, log_sum, read_clocks, room
from armtempo.planners.coordination._passing_corners import Corners
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem, makespan
from armtempo.planners.topp import PhasePlane, PhaseTrajectory
from armtempo.planners.topp.kernels import Rows

CORNER_MARGIN = (
    4e-6  # [s] between an arm's leaving and the next one's coming; motions are checked a little early or late
)
NO_CAP = 1e11  # of x: a plane's cap above it is none


class Room(NamedTuple):
    """What is left of all that is bounded, at a point: of rows, of ``x``, of corners and, behind them, arrivals."""

    rows: Floats  # (S, 2, J, 2)
    x: Floats  # (S, 2)
    gaps: Floats  # (E + A,) [s], may be negative


@dataclass(frozen=True, kw_only=True, eq=False)
class JointProgram:
    """The program as arrays. A point of it is ``x`` (S,) and ``waits`` (A+1,), the last of which is the makespan.

    Attributes:
        problem: Whose motions are sought.
        chain: The stations and rows of all arms.
        fastest: (S,) x of the minimum-time motions.
        places: Where clocks are read.
        minus: (E+A,) the place whose time counts against each corner, and each arrival.
        plus: (E+A,) the place whose time counts for it; one past the last: none.
        share: (E+A, A+1) how waits and makespan count.
        region: (E+A,) of each corner; other numbers for arrivals.
    """

    problem: TimingProblem
    chain: Chain
    fastest: Floats
    places: Places
    minus: Ints
    plus: Ints
    share: Floats
    region: Ints

    @classmethod
    def of(cls, problem: TimingProblem, corners: Corners, reserve: float = 0.0) -> JointProgram:
        """The program of arms that pass each other at these corners, and leave a share of their limits unused."""
        joints = max(plane.rows.a.shape[1] for plane in problem.planes)
        parts = [_own_rows(plane.rows, joints, reserve) for plane in problem.planes]
        station, rows, cap = (np.concatenate(column) for column in zip(*parts, strict=True))
        first = np.cumsum([0, *(len(own) for own, _, _ in parts)], dtype=np.int64)
        fixed = np.concatenate([_fixed(plane, own) for plane, (own, _, _) in zip(problem.planes, parts, strict=True)])
        given = np.append(fixed[:-1] & fixed[1:], True)  # nothing is to be chosen there
        rows[given, ..., LOW], rows[given, ..., HIGH] = -np.inf, np.inf
        chain = Chain(station, first, rows, cap, fixed)
        fastest = [np.interp(own, m.lam, m.mu**2) for (own, _, _), m in zip(parts, problem.fastest, strict=True)]
        places, leave, enter, ends = _places(chain, corners)
        arms, count = len(problem.arms), len(leave)
        share = np.zeros((count + arms, arms + 1))
        each = np.arange(count + arms)
        share[each[:count], corners.second] = 1.0
        share[each, np.concatenate([corners.first, problem.arms])] = -1.0
        share[count:, arms] = 1.0
        return cls(
            problem=problem,
            chain=chain,
            fastest=np.concatenate(fastest),
            places=places,
            minus=np.concatenate([leave, ends]),
            plus=np.concatenate([enter, np.full(arms, len(places.station))]),
            share=share,
            region=np.concatenate([corners.region, -1 - np.array(problem.arms)]),
        )

    @property
    def corners(self) -> int:
        """How many corners there are, E."""
        return len(self.share) - len(self.problem.arms)

    def gaps(self, x: Floats, waits: Floats) -> Floats:
        """(E+A,) by how much corners and arrivals are kept [s]."""
        time = np.zeros(len(self.places.station) + 1)
        read_clocks(self.chain, self.places, x, time)
        gaps: Floats = time[self.plus] - time[self.minus] + self.share @ waits
        gaps[: self.corners] -= CORNER_MARGIN
        return gaps

    def room(self, x: Floats, waits: Floats) -> Room | None:
        """What is left at a point; None if rows, bounds of x or waits are not kept, with room to spare."""
        if not (waits[:-1] > 0.0).all():
            return None
        of_rows, of_x = np.full((*self.chain.rows.shape[:3], 2), np.inf), np.full((len(x), 2), np.inf)
        if not room(self.chain, x, of_rows, of_x) > 0.0:
            return None
        return Room(of_rows, of_x, self.gaps(x, waits))

    def logarithms(self, left: Room, slack: Floats, waits: Floats) -> float:
        """The barrier: of what is left of rows and x, of slacks (K,) and waits."""
        return log_sum(self.chain, left.rows, left.x) + float(np.log(slack).sum() + np.log(waits[:-1]).sum())

    def nearest(self, gaps: Floats) -> Bools:
        """(E+A,) the corners that are kept by no more than their neighbours in their region; and the arrivals."""
        falls, same = gaps[1:] <= gaps[:-1], self.region[1:] == self.region[:-1]
        rises = gaps[1:] >= gaps[:-1]
        return np.asarray(np.append(True, falls | ~same) & np.append(rises | ~same, True))

    def motions(self, x: Floats, waits: Floats) -> Motions:
        """The motions that a point means."""
        found = []
        for plane, begin, end, wait in zip(
            self.problem.planes, self.chain.first[:-1], self.chain.first[1:], waits, strict=False
        ):
            station, mu = self.chain.station[begin:end], np.sqrt(x[begin:end])
            found.append(
                PhaseTrajectory.from_profile(station, mu, plane.dynamics, delay=float(wait), mu_end=plane.mu_end)
            )
        return tuple(found)

    @property
    def scale(self) -> float:
        """The longest minimum time [s]."""
        return makespan(self.problem.fastest)


def _fixed(plane: PhasePlane, station: Floats) -> Bools:
    """(S,) whether ``x`` is given there: at both ends, at stops, in dwells."""
    path = plane.dynamics.path
    given = np.array([station[0], station[-1]]) if path is None else np.append(path.stops, station[[0, -1]])
    return np.asarray(np.isin(station, given) | np.isin(station, plane.rows.station[plane.dwelling]))


def _own_rows(own: Rows, joints: int, reserve: float) -> tuple[Floats, Floats, Floats]:
    """An arm's stations (S,), rows (S, 2, joints, 5) of the interval behind each, and caps of x (S,)."""
    new = np.diff(own.station) > 0.0
    begins, ends = np.flatnonzero(np.append(new, False)), np.flatnonzero(np.append(False, new))
    at = np.append(begins, len(own.station) - 1)  # the last row of each station begins the interval behind it
    station = own.station[at]
    rows = np.zeros((len(at), 2, joints, 5))
    rows[..., LOW], rows[..., HIGH] = -np.inf, np.inf
    for e, pick in enumerate((begins, ends)):
        low, high = (
            (1.0 - sign * reserve * np.sign(v)) * v for sign, v in ((-1.0, own.low[pick]), (1.0, own.high[pick]))
        )
        half = np.where(np.isfinite(high - low), 0.5 * (high - low), 1.0)
        a = own.a[pick] / (2.0 * np.diff(station)[:, None])
        values = np.stack([a, own.b[pick], own.r[pick], low, high], axis=-1)
        rows[:-1, e, : own.a.shape[1]] = values / half[..., None]
    cap = np.minimum(own.x_cap[at], own.x_cap[np.append(0, ends)])
    return station, rows, np.where(cap < NO_CAP, cap, np.inf)


def _places(chain: Chain, corners: Corners) -> tuple[Places, Ints, Ints, Ints]:
    """Where clocks are read: at all corners and ends; which place is each corner's leaving and entering, each end."""
    firsts, stations, ways = [0], [], []
    leave, enter = np.empty(len(corners.first), dtype=np.int64), np.empty(len(corners.first), dtype=np.int64)
    for arm in range(len(chain.first) - 1):
        own = chain.station[chain.first[arm] : chain.first[arm + 1]]
        left, entered = corners.first == arm, corners.second == arm
        leaves, enters = (np.minimum(lam, own[-1]) for lam in (corners.leaves[left], corners.enters[entered]))
        lam = np.unique(np.concatenate([leaves, enters, own[-1:]]))
        before = np.searchsorted(own, lam, side="left") - 1
        leave[left] = firsts[-1] + np.searchsorted(lam, leaves)
        enter[entered] = firsts[-1] + np.searchsorted(lam, enters)
        stations.append(chain.first[arm] + before)
        ways.append(lam - own[before])
        firsts.append(firsts[-1] + len(lam))
    first = np.array(firsts)
    return Places(first, np.concatenate(stations), np.concatenate(ways)), leave, enter, first[1:] - 1
