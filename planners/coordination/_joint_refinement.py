r"""Joint refinement: all arms' motions at once, as early as the last can arrive, with who passes first where given.

The program of ``_joint_program`` by a primal-dual interior point method. Times are convex in ``x``, so all is convex
but the clock of the arm that waits at a corner. Rows, caps and waits are kept with room at every step; corners have
slacks and may be missed until the end: along the curved border of "late enough" steps from inside become too small.
In the Newton matrix intervals that should take longer have no curvature, so every step descends on the merit: makespan,
barrier, and the sum of what corners are missed by.

An arm's part of the matrix is tridiagonal, what couples the arms are the corners in use, a few dozen: those that are
nearest within their region. The work of a step is linear in the stations.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg

from armtempo.arrays import Bools, Floats, Ints
from armtempo.planners.coordination import _joint_kernels as kernels
from armtempo.planners.coordination._joint_kernels import Places
from armtempo.planners.coordination._joint_program import JointProgram, Room
from armtempo.planners.coordination._passing_corners import corners_of
from armtempo.planners.coordination._passing_orders import Orders
from armtempo.planners.coordination._timing_problem import Motions, TimingProblem

START_SHARE = 0.6  # of x of the fastest motions: where it begins
START_WAIT_SHARE = 0.05  # of the longest minimum time: waits and slacks there
BARRIER_FIRST, BARRIER_LAST = 1e-4, 1e-8  # [s]
BARRIER_TELLING, HOPELESS_SHARE = 1e-6, 0.015  # below it the makespan falls by no more than that share any more
BARRIER_FALL = 0.2  # of the mean complementarity: the next barrier, after a step that got on
MISSED_PER_BARRIER = 3e3  # corners may be missed by that many times the barrier when it falls
MISSED_MAX = 1e-6  # [s] by which a corner may be missed in the end, a part of its margin
CLOSE_SHARE = 0.05  # of the longest minimum time: corners kept by less come into use
STEPS_MAX = 150
HALVINGS_MAX = 25
BORDER_SHARE = 0.99  # of the way to the border is the longest step
MULTIPLIER_BAND = 1e6  # multipliers stay within this factor of what the barrier makes of them
PRUDENCE_LEAST, PRUDENCE_MOST, PRUDENCE_RATIO = 1e-9, 1e-4, 4.0  # price of relative changes of x [s]
SHORT_STEP, LONG_STEP = 0.3, 0.5  # shorter steps ask for more prudence, longer ones for less
MISS_PRICE = 2.0  # at least: of a second by which a corner is missed, in seconds of makespan


class Refinement(NamedTuple):
    """What came out.

    Attributes:
        motions: One per arm; corners may be missed where it stopped early.
        critical: (R,) what the makespan gains per second by which each region may be passed sooner.
        missed: By how much the worst corner is missed [s].
        steps: Newton steps taken.
    """

    motions: Motions
    critical: Floats
    missed: float
    steps: int


class _Point(NamedTuple):
    """A point of the program, slacks of corners and arrivals, multipliers (of those not in use: 0)."""

    x: Floats
    waits: Floats
    left: Room
    slack: Floats
    z_rows: Floats
    z_x: Floats
    z_waits: Floats  # (A,)
    z_gaps: Floats


class _Step(NamedTuple):
    x: Floats
    waits: Floats
    slack: Floats
    z_rows: Floats
    z_x: Floats
    z_waits: Floats
    z_gaps: Floats


def refine(
    problem: TimingProblem,
    orders: Orders,
    *,
    reserve: float = 0.0,
    beat: float = np.inf,
    deadline: float = np.inf,
) -> Refinement | None:
    """The motions with which the last arm arrives earliest, if every region is passed as ``orders`` say.

    Nothing else is given to it: it begins with slow motions that may well collide.

    Args:
        problem: Arms that can hold still everywhere on their paths.
        orders: (R,) orders of ``problem.passing_orders``.
        reserve: Share of the limits to leave unused.
        beat: A makespan [s]: when this class will not come near it, stop with what there is.
        deadline: Stop then, on the clock of ``time.perf_counter`` [s].

    Returns:
        None if an arm cannot hold still, if a side is impossible or all together a deadlock, or at the deadline. The
        motions are not checked: that they keep clear, and inside their limits between stations, is for the caller to
        see.
    """
    corners = corners_of(problem.passing_orders, orders)
    if corners is None or not all(problem.holdable):
        return None
    return _Solver(JointProgram.of(problem, corners, reserve)).solve(beat, deadline)


@dataclass(eq=False)
class _Solver:
    program: JointProgram
    barrier: float = BARRIER_FIRST
    prudence: float = PRUDENCE_LEAST
    price: float = MISS_PRICE
    steps: int = 0

    def solve(self, beat: float, deadline: float) -> Refinement | None:
        program = self.program
        point = self._start()
        if point is None:
            return None
        used: Bools = np.zeros(len(point.slack), dtype=np.bool_)
        for _ in range(STEPS_MAX):
            if time.perf_counter() > deadline:
                return None
            self.steps += 1
            point, used = self._use_near(point, used)
            try:
                step = self._direction(point, used)
            except linalg.LinAlgError:  # so far from anything possible that the numbers do not do: a deadlock
                return None
            moved, length = self._moved(point, step, used)
            if moved is None:
                break
            point = moved
            missed = float(np.abs(point.left.gaps - point.slack)[used].max())
            if self.barrier <= BARRIER_LAST and missed < MISSED_MAX and point.left.gaps.min() > -MISSED_MAX:
                break
            if self.barrier <= BARRIER_TELLING and point.waits[-1] > (1.0 + HOPELESS_SHARE) * beat:
                break
            self._adapt(point, used, length, missed)
        count = program.corners
        regions = len(program.problem.passing_orders.regions)
        critical = _sums(program.region[:count], point.z_gaps[:count], regions)
        missed = max(0.0, -float(point.left.gaps[:count].min(initial=0.0)))
        return Refinement(program.motions(point.x, point.waits), critical, missed, self.steps)

    def _start(self) -> _Point | None:
        """Slow motions, a little wait each, slacks that are too large where corners are missed."""
        program = self.program
        x = np.where(program.chain.fixed, 1.0, START_SHARE) * program.fastest
        x[program.chain.first[1:] - 1] = [plane.mu_end**2 for plane in program.problem.planes]
        little = START_WAIT_SHARE * program.scale
        waits = np.full(len(program.problem.arms) + 1, little)
        waits[-1] += max(0.0, -1.1 * float(program.gaps(x, waits)[program.corners :].min()))
        left = program.room(x, waits)
        if left is None:
            return None
        slack = np.maximum(left.gaps, little)
        b = self.barrier
        return _Point(x, waits, left, slack, b / left.rows, b / left.x, b / waits[:-1], np.zeros_like(slack))

    def _use_near(self, point: _Point, used: Bools) -> tuple[_Point, Bools]:
        """Take into use corners that have become near; those in use stay."""
        gaps, slack, z = point.left.gaps, point.slack.copy(), point.z_gaps.copy()
        new = self.program.nearest(gaps)
        if used.any():
            new &= ~used & (gaps < CLOSE_SHARE * self.program.scale)
            slack[new] = np.maximum(gaps[new], np.sqrt(self.barrier) * self.program.scale)
        z[new] = self.barrier / slack[new]
        return point._replace(slack=slack, z_gaps=z), used | new

    def _direction(self, point: _Point, used: Bools) -> _Step:
        """Newton's step: the arms' tridiagonal blocks eliminated, then the corners in use, then waits and makespan."""
        chain, b = self.program.chain, self.barrier
        places, minus, plus = self._places(used)
        share, slack, z = self.program.share[used], point.slack[used], point.z_gaps[used]
        count = len(places.station) + 1
        slope, ends = np.empty((len(point.x), 2)), np.empty((count - 1, 2))
        kernels.slopes(chain, places, point.x, slope, ends)
        weight = _sums(minus, z, count) - _sums(plus, z, count)
        diagonal, beside, step = (np.empty_like(point.x) for _ in range(3))
        kernels.assemble(
            chain, places, point.x, point.left.rows, point.left.x, point.z_rows, point.z_x, b, weight, self.prudence,
            diagonal, beside, step,
        )  # fmt: skip
        kernels.factor(chain, diagonal, beside)
        compliance = np.zeros((count, count))
        kernels.condense(chain, places, diagonal, beside, slope, ends, step, compliance)
        answer = compliance[:, -1].copy()
        compliance[:, -1] = 0.0
        matrix = compliance[np.ix_(plus, plus)] - compliance[np.ix_(plus, minus)]
        matrix += compliance[np.ix_(minus, minus)] - compliance[np.ix_(minus, plus)]
        matrix[np.diag_indices_from(matrix)] += slack / z
        wanted = answer[plus] - answer[minus] + b / z + slack - point.left.gaps[used]
        solved = linalg.cho_solve(
            linalg.cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False),
            np.column_stack([share, wanted]),
            check_finite=False,
        )
        whole = share.T @ solved[:, :-1]
        arms = np.arange(len(whole) - 1)
        whole[arms, arms] += point.z_waits / point.waits[:-1]
        force = share.T @ solved[:, -1] - np.append(-b / point.waits[:-1], 1.0)
        waits = np.linalg.solve(whole, force)
        y = solved[:, :-1] @ waits - solved[:, -1]  # minus the new multipliers
        pull = _sums(plus, y, count) - _sums(minus, y, count)
        kernels.back_substitute(chain, places, diagonal, beside, slope, ends, pull, step)
        d_slack, d_gaps = np.zeros_like(point.slack), np.zeros_like(point.slack)
        d_slack[used], d_gaps[used] = b / z + slack / z * y, -y - z
        z_rows, z_x = np.zeros_like(point.z_rows), np.zeros_like(point.z_x)
        z_waits = (b - point.z_waits * waits[:-1]) / point.waits[:-1] - point.z_waits
        return _Step(step, waits, d_slack, z_rows, z_x, z_waits, d_gaps)

    def _places(self, used: Bools) -> tuple[Places, Ints, Ints]:
        """The places of corners in use, and which of them count against and for each; one past the last: none."""
        all_places = self.program.places
        minus, plus = self.program.minus[used], self.program.plus[used]
        kept = np.unique(np.concatenate([minus, plus]))
        kept = kept[kept < len(all_places.station)]
        first = np.searchsorted(kept, all_places.first).astype(np.int64)
        places = Places(first, all_places.station[kept], all_places.way[kept])
        return places, np.searchsorted(kept, minus).astype(np.int64), np.searchsorted(kept, plus).astype(np.int64)

    def _moved(self, point: _Point, step: _Step, used: Bools) -> tuple[_Point | None, float]:
        """Where a step leads that stays inside and lowers the merit, and how much of it that is; None: nowhere."""
        program = self.program
        longest, longest_z = kernels.step_rows(
            program.chain, point.x, step.x, point.left.rows, point.left.x, point.z_rows, point.z_x, self.barrier,
            step.z_rows, step.z_x,
        )  # fmt: skip
        longest = min(
            longest, _longest(point.waits[:-1], step.waits[:-1]), _longest(point.slack[used], step.slack[used])
        )
        longest_z = min(
            longest_z, _longest(point.z_waits, step.z_waits), _longest(point.z_gaps[used], step.z_gaps[used])
        )
        length, length_z = min(1.0, BORDER_SHARE * longest), min(1.0, BORDER_SHARE * longest_z)
        z = [own + length_z * change for own, change in zip(point[4:], step[3:], strict=True)]
        self.price = max(self.price, 1.5 * float(z[-1].max()))
        now = self._merit(point.left, point.slack, point.waits, used)
        for _ in range(HALVINGS_MAX):
            x, waits = point.x + length * step.x, point.waits + length * step.waits
            left = program.room(x, waits)
            if left is not None:
                slack = np.maximum(point.slack + length * step.slack, left.gaps)
                if self._merit(left, slack, waits, used) <= now + 1e-10 * abs(now):
                    return self._banded(_Point(x, waits, left, slack, *z), used), length
            length *= 0.5
        return None, 0.0

    def _merit(self, left: Room, slack: Floats, waits: Floats, used: Bools) -> float:
        missed = float(np.abs(left.gaps - slack)[used].sum())
        return float(waits[-1]) - self.barrier * self.program.logarithms(left, slack[used], waits) + self.price * missed

    def _banded(self, point: _Point, used: Bools) -> _Point:
        slack = np.where(used, point.slack, np.inf)
        for z, room in ((point.z_rows, point.left.rows), (point.z_x, point.left.x), (point.z_gaps, slack)):
            middle = self.barrier / room
            np.clip(z, middle / MULTIPLIER_BAND, middle * MULTIPLIER_BAND, out=z)
        return point

    def _adapt(self, point: _Point, used: Bools, length: float, missed: float) -> None:
        """Lower the barrier after a step that got on; more prudence after a short one."""
        if length < SHORT_STEP:
            self.prudence = min(PRUDENCE_RATIO * self.prudence, PRUDENCE_MOST)
        elif length > LONG_STEP:
            self.prudence = max(self.prudence / PRUDENCE_RATIO, PRUDENCE_LEAST)
        if length <= LONG_STEP or missed >= max(MISSED_MAX, MISSED_PER_BARRIER * self.barrier):
            return
        total, count = kernels.complementarity(point.left.rows, point.left.x, point.z_rows, point.z_x)
        total += float((point.slack * point.z_gaps).sum() + (point.waits[:-1] * point.z_waits).sum())
        mean = total / (count + int(used.sum()) + len(point.z_waits))
        self.barrier = max(min(BARRIER_FALL * mean, self.barrier), BARRIER_LAST)


def _sums(which: Ints, values: Floats, count: int) -> Floats:
    """(count,) the sum of all values of each."""
    return np.bincount(which, values, count).astype(np.float64)


def _longest(value: Floats, change: Floats) -> float:
    """The longest step that leaves no value (K,) below 0."""
    fall = float(np.max(-change / value, initial=0.0))
    return 1.0 / fall if fall > 0.0 else np.inf
