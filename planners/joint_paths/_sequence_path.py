r"""Moves and dwells end to end, as one joint path: the arm comes to rest wherever two of them meet.

A dwell is a piece of the path's own axis on which the arm stands: ``f' = f'' = 0`` over a width w. Rest to rest over w
with ``|mu_dot| <= a`` takes ``2 sqrt(w / a)``, which is d for ``a = 4 w / d^2``. So with the further row

    (d^2 / 4 w) mu_dot  in  [-1, 1]

no motion is shorter than d. Of a ``Dwell`` it is +1 up to the middle and -1 behind it, to 1e-7: none is longer either,
whatever is planned, commanded or disturbed. A ``Wait`` may be as long as one likes.

Lambda is the share of the path, [0, 1]: every piece is stretched to a whole number of ``cells``, which is allowed
because the arm rests at its borders. Borders of pieces then are borders of cells in any chart with at least as many.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Floats, Ints
from armtempo.errors import InputError, PathError, brief
from armtempo.planners.geometry import number
from armtempo.planners.joint_paths._joint_path import AbstractJointPath, Standing

CELLS_LEAST, CELLS_MOST = 1024, 8192
CELLS_OF_A_DWELL = 4
CELLS_OF_A_MOVE = 16  # at least
WAY_SAMPLES = 257  # of a move, for the length of its way in joint space
MEETING_TOLERANCE = 1e-7  # [rad or m] between the end of a move and the start of the next


@dataclass(frozen=True, slots=True)
class Dwell:
    """The arm stands for ``seconds``, no less and no more: no command and no disturbance stretches it.

    Raises:
        InputError: ``seconds`` is not finite and positive.
    """

    seconds: float

    def __post_init__(self) -> None:
        if not 0.0 < number(self.seconds, "seconds of a dwell") < np.inf:
            raise InputError(f"a dwell of {brief(self.seconds)} s", remedy="give a finite time > 0, or leave it out")


@dataclass(frozen=True, slots=True)
class Wait(Dwell):
    """A place to wait at: the arm stands for at least ``seconds``, longer if that is planned or commanded."""


@final
class SequencePath(AbstractJointPath):
    """Moves, dwells and waits one after the other. Usually made by ``JointPath.sequence``.

    Args:
        steps: Joint paths, ``Dwell``, ``Wait``; a number is a dwell of so many seconds. Each move begins where the one
            before it ends.

    Attributes:
        steps: What it was made from.
        border: (K+1,) where each step begins, and the end [lambda].
        cells: Cells of equal length that its borders are borders of, a power of two.

    Raises:
        InputError: There is no move, or something else among the steps, or too many of them.
        PathError: A move does not begin where the one before it ends; the message names the step.
    """

    unit = "share"
    length = 1.0

    def __init__(self, steps: Sequence[AbstractJointPath | Dwell | float]) -> None:
        self.steps = tuple(_step(step, k) for k, step in enumerate(steps))
        moves = [step for step in self.steps if isinstance(step, AbstractJointPath)]
        if not moves:
            raise InputError(
                f"a sequence of {len(self.steps)} steps has no move", remedy="give a joint path among them"
            )
        for move in moves:
            move.check_stations()
        self.dof = moves[0].dof
        counts = _cells_of(self.steps)
        self.cells = int(counts.sum())
        self.border = np.append(0, np.cumsum(counts)) / self.cells
        self._rest = self._standing_postures()
        self.standing = tuple(
            Standing(self.border[k], self.border[k + 1], step.seconds, not isinstance(step, Wait))
            for k, step in enumerate(self.steps)
            if isinstance(step, Dwell)
        )
        self.stops = self.border[1:-1].copy()
        inner = [self._stretched(k, move.breakpoints) for k, move in self._moves]
        middles = [[standing.middle for standing in self.standing]]
        self.breakpoints = np.unique(np.concatenate([self.border, *inner, *middles]))
        for array in (self.border, self.stops, self.breakpoints):
            array.setflags(write=False)

    @property
    def _moves(self) -> list[tuple[int, AbstractJointPath]]:
        return [(k, step) for k, step in enumerate(self.steps) if isinstance(step, AbstractJointPath)]

    def _standing_postures(self) -> Floats:
        """(K, n) where the arm stands in each step that is a dwell."""
        postures: list[Floats | None] = []
        at: Floats | None = None
        for k, step in enumerate(self.steps):
            if isinstance(step, AbstractJointPath):
                start, end = (rows[0] for rows in step.sampled(np.array([[0.0], [step.length]]), self.dof)[0])
                if at is not None and np.abs(start - at).max() > MEETING_TOLERANCE:
                    joint = int(np.abs(start - at).argmax())
                    raise PathError(
                        f"step {k} of the sequence begins with joint {joint} at {start[joint]:.6g}, and the step "
                        f"before it ends at {at[joint]:.6g}",
                        remedy="begin each move where the one before it ends",
                        joint=joint,
                        step=k,
                    )
                postures = [start if posture is None else posture for posture in postures]
                at = end
            postures.append(at)
        return np.array(postures)

    def _stretched(self, k: int, own: Floats) -> Floats:
        """Stations of move k's own as stations of the whole; its ends exactly the borders."""
        move, (start, stop) = self.steps[k], self.border[k : k + 2]
        assert isinstance(move, AbstractJointPath)
        lam = start + (stop - start) * (np.asarray(own) / move.length)
        return np.asarray(np.clip(lam, start, stop))

    def step_at(self, lam: ArrayLike, *, before: bool = False) -> Ints:
        """The number of the step at ``lam`` (any shape); ``before``: a border belongs to the step before it."""
        k = np.searchsorted(self.border, np.asarray(lam), side="left" if before else "right") - 1
        return np.clip(k, 0, len(self.steps) - 1)

    def own(self, k: int, lam: ArrayLike) -> Floats:
        """Move k's own stations at ``lam`` (any shape) of the whole.

        Raises:
            InputError: Step k is no move.
        """
        move = self.steps[k]
        if not isinstance(move, AbstractJointPath):
            raise InputError(f"step {k} of the sequence is no move")
        return self._own(k, move, np.asarray(lam, dtype=np.float64))[0]

    def _own(self, k: int, move: AbstractJointPath, lam: Floats) -> tuple[Floats, float]:
        """Move k's own stations at ``lam``, and by how much it is stretched."""
        start, stop = self.border[k : k + 2]
        stretch = move.length / (stop - start)
        return np.clip((lam - start) * stretch, 0.0, move.length), stretch

    def evaluate(self, lam: ArrayLike, *, before: bool = False) -> tuple[Floats, Floats, Floats]:
        """``f``, ``f'``, ``f''`` at ``lam``, each (..., n); ``f'`` and ``f''`` are 0 in dwells, and jump at stops."""
        stations = np.asarray(lam, dtype=np.float64)
        flat = stations.reshape(-1)
        step = self.step_at(flat, before=before)
        q, dq, ddq = self._rest[step], np.zeros((len(flat), self.dof)), np.zeros((len(flat), self.dof))
        for k, move in self._moves:
            at = step == k
            if at.any():
                own, stretch = self._own(k, move, flat[at])
                q[at], slope, bend = move.sampled(own, self.dof, before=before)
                dq[at], ddq[at] = stretch * slope, stretch**2 * bend
        shape = (*stations.shape, self.dof)
        return q.reshape(shape), dq.reshape(shape), ddq.reshape(shape)

    def third(self, lam: ArrayLike, *, before: bool = False) -> Floats:
        """``f'''`` (..., n)."""
        stations = np.asarray(lam, dtype=np.float64)
        flat = stations.reshape(-1)
        step, out = self.step_at(flat, before=before), np.zeros((stations.size, self.dof))
        for k, move in self._moves:
            at = step == k
            if at.any():
                own, stretch = self._own(k, move, flat[at])
                out[at] = stretch**3 * move.third(own, before=before)
        return out.reshape(*stations.shape, self.dof)

    def speed_bound(self, low: ArrayLike, high: ArrayLike) -> Floats:
        """Upper bounds of ``|f'|`` over [low, high], (..., n): the largest of the moves' own there."""
        low, high = np.broadcast_arrays(np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64))
        shape = (*low.shape, self.dof)
        low, high = low.reshape(-1), high.reshape(-1)
        bound = np.zeros((len(low), self.dof))
        for k, move in self._moves:
            at = np.flatnonzero((high >= self.border[k]) & (low <= self.border[k + 1]))
            if len(at):
                first, stretch = self._own(k, move, low[at])
                bound[at] = np.maximum(bound[at], stretch * move.speed_bound(first, self._own(k, move, high[at])[0]))
        return bound.reshape(shape)


def _step(step: object, k: int) -> AbstractJointPath | Dwell:
    if isinstance(step, AbstractJointPath | Dwell):
        return step
    if isinstance(step, int | float | np.floating) and not isinstance(step, bool):
        return Dwell(float(step))
    raise InputError(
        f"step {k} of a sequence is {brief(step)}", remedy="give joint paths, and dwells in seconds between them"
    )


def _cells_of(steps: Sequence[AbstractJointPath | Dwell]) -> Ints:
    """(K,) how many cells each step gets: moves by their ways in joint space, in all a power of two."""
    ways = np.array([0.0 if isinstance(step, Dwell) else _way(step) for step in steps])
    counts = np.where(ways > 0.0, CELLS_OF_A_MOVE, CELLS_OF_A_DWELL).astype(np.int64)
    cells = CELLS_LEAST
    while cells < 2 * counts.sum() and cells < CELLS_MOST:
        cells *= 2
    rest = cells - int(counts.sum())
    if rest < 0:
        raise InputError(
            f"a sequence of {len(steps)} steps needs {counts.sum()} cells, a chart has {CELLS_MOST}",
            remedy="split it into several cells, or join moves",
        )
    share = rest * ways / ways.sum()
    counts += share.astype(np.int64)
    left = np.argsort(share.astype(np.int64) - share, kind="stable")[: cells - int(counts.sum())]
    counts[left] += 1
    return counts


def _way(move: AbstractJointPath) -> float:
    """The length of a move's way in joint space; never 0."""
    q = move.sampled(np.linspace(0.0, move.length, WAY_SAMPLES), move.dof)[0]
    return max(float(np.linalg.norm(np.diff(q, axis=0), axis=1).sum()), 1e-12)
