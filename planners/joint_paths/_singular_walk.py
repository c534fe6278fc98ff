r"""Joints along a path through singular postures that the path can pass: station by station, across each of them.

Where axes come into line the Jacobian loses a rank, and a tracker that inverts it, damped or not, loses its way. A path
that asks for nothing in the lost direction goes through all the same. So joints are predicted from the last station
(Taylor's series) and taken onto the path by Newton's method as long as the posture is regular. Where it is not, within
a zone of small singular values, they are interpolated between the regular stations on either side, or extrapolated
from the one side there is; the interpolant tells the motion of the joints that moves nothing, the pose the rest. Where
all of a piece is singular (a straight wrist that stays so) that motion is free: it is what it tends to beside the
singularity.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, final

import numpy as np
from scipy.interpolate import KroghInterpolator

from armtempo.arrays import Bools, Floats
from armtempo.robots import Arm

__all__ = ["SINGULAR_ZONE", "SingularWalk", "Walk", "crossed"]

SINGULAR_ZONE = 1e-3  # singular value of the scaled Jacobian below which joints are interpolated
EXACT_MIN = 1e-6  # above which the Jacobian's inverse still tells the motion that moves (almost) nothing
BESIDE = 1e-4  # [rad, m] how far beside a singular posture that motion is asked for
PREDICTED_ERROR_MAX = 1e-2  # [rad, m] of joints: farther off it would be another branch
ENTERED_ERROR_MAX = 5e-2  # [rad, m] likewise, after a way within a zone
SPEED_MAX = 1e6  # [rad/m, 1] of a joint: beyond it the path asks for what is lost
NODES_A_SIDE = 3  # of the interpolation, with two derivatives each


class Walk(NamedTuple):
    """Joints at stations (K + 1,) of one piece."""

    q: Floats
    dq: Floats
    ddq: Floats
    singular: Floats
    """(K + 1,) the least singular values."""
    inside: Bools
    """(K + 1,) is the station in a zone."""


Solve = Callable[[int, tuple[Floats, Floats, Floats], bool], tuple[Floats, Floats, Floats, float]]
"""A station's number, joints and two derivatives nearby, is a row lost: the same on the path, how far joints moved."""


def crossed(singular: Floats) -> Bools:
    """(K,) the intervals between stations with these least singular values (K + 1,) that come near zero, or may."""
    change = np.abs(np.diff(singular))
    around = np.maximum(change, np.maximum(np.append(change[1:], 0.0), np.append(0.0, change[:-1])))
    return np.asarray(np.minimum(singular[1:], singular[:-1]) < SINGULAR_ZONE + 1.5 * around)


@final
class SingularWalk:
    """A walk along one piece of a path.

    Args:
        arm: With as many joints as the task has rows.
        task: (m, 6) its rows.
        length: [m] that linear velocities are divided by in singular values.
        station: (K + 1,) even.
        twist: (2 K + 1, 6) of the path there and in between.
        solve: Newton's method.
    """

    def __init__(self, arm: Arm, task: Floats, length: float, station: Floats, twist: Floats, solve: Solve) -> None:
        self.arm, self.station, self._solve = arm, station, solve
        self._rows = task / np.where(task[:, :3].any(axis=1), length, 1.0)[:, None]
        self._twist = twist @ self._rows.T

    def lost(self, q: Floats) -> tuple[Floats, Floats]:
        """The direction of the task (m,) that is lost at joints q (n,), in its own units, and the idle motion (n,)."""
        left, _, right = np.linalg.svd(self._rows @ self.arm.jacobian(q))
        lost = left[:, -1] * np.linalg.norm(self._rows, axis=1)
        return np.asarray(lost / np.linalg.norm(lost), dtype=np.float64), np.array(right[-1])

    def singular(self, q: Floats) -> Floats:
        """The least singular value (...) at joints (..., n)."""
        return np.asarray(np.linalg.svd(self._rows @ self.arm.jacobian(q), compute_uv=False)[..., -1], dtype=np.float64)

    def find(self, start: Floats) -> Walk | None:
        """From joints at the first station to the last; None: there is no way that goes on smoothly."""
        last, n = len(self.station) - 1, self.arm.dof
        q, dq, ddq = (np.full((last + 1, n), np.nan) for _ in range(3))
        k, guess = 0, start
        if self.singular(start) < SINGULAR_ZONE:
            guesses = self._drift(start)
            if len(guesses) == last + 1 and self.singular(guesses[-1]) < SINGULAR_ZONE:
                return self._all_inside(guesses)
            k, guess = len(guesses) - 1, guesses[-1]
        still = np.zeros(n)
        q[k], dq[k], ddq[k], off = self._solve(k, (guess, still, still), False)
        if not off <= (ENTERED_ERROR_MAX if k else PREDICTED_ERROR_MAX):
            return None
        while k < last:
            for there in range(k + 1, last + 1):
                h = self.station[there] - self.station[k]
                guess = q[k] + h * dq[k] + 0.5 * h * h * ddq[k]
                if self.singular(guess) < SINGULAR_ZONE:
                    continue
                q[there], dq[there], ddq[there], off = self._solve(there, (guess, still, still), False)
                if not off <= PREDICTED_ERROR_MAX:
                    return None
                k = there
                break
            else:
                break
        inside = np.isnan(q[:, 0])
        self._fill(q, dq, ddq, inside)
        return Walk(q, dq, ddq, self.singular(q), inside)

    def _rate(self, half: int, q: Floats) -> Floats:
        """Joint speeds (n,) by lambda: what they are, or tend to beside a singular posture."""
        rows, wanted = self._rows @ self.arm.jacobian(q), self._twist[half]
        if np.linalg.svd(rows, compute_uv=False)[-1] >= EXACT_MIN:
            return np.asarray(np.linalg.solve(rows, wanted))
        aside = BESIDE * np.eye(len(q))
        aside = aside[int(self.singular(q + aside).argmax())]
        both = (np.linalg.solve(self._rows @ self.arm.jacobian(q + side), wanted) for side in (aside, -aside))
        return np.asarray(0.5 * sum(both))

    def _drift(self, start: Floats) -> Floats:
        """(L, n) joints from station to station, up to the first that is out of the zone: Runge and Kutta's method."""
        found, (h, *_) = [start], np.diff(self.station)
        for k in range(len(self.station) - 1):
            q = found[-1]
            if not np.isfinite(q).all() or (k and self.singular(q) >= SINGULAR_ZONE):
                break
            a = self._rate(2 * k, q)
            b = self._rate(2 * k + 1, q + 0.5 * h * a)
            c = self._rate(2 * k + 1, q + 0.5 * h * b)
            d = self._rate(2 * k + 2, q + h * c)
            found.append(q + h * (a + 2.0 * b + 2.0 * c + d) / 6.0)
        return np.array(found)

    def _all_inside(self, guesses: Floats) -> Walk | None:
        """Joints on the path at all stations of a piece that is singular from end to end."""
        q, dq = guesses.copy(), np.empty_like(guesses)
        still = np.zeros(guesses.shape[1])
        for k, guess in enumerate(guesses):
            q[k], _, _, off = self._solve(k, (guess, still, still), True)
            if not off <= ENTERED_ERROR_MAX:
                return None
            dq[k] = self._rate(2 * k, q[k])
        if not np.abs(dq).max() <= SPEED_MAX:
            return None
        ddq = np.gradient(dq, self.station, axis=0, edge_order=2)
        return Walk(q, dq, ddq, self.singular(q), np.ones(len(q), dtype=np.bool_))

    def _fill(self, q: Floats, dq: Floats, ddq: Floats, inside: Bools) -> None:
        """Interpolate the rows (K + 1, n) that are inside zones."""
        outside = np.flatnonzero(~inside)
        size = self.station[1] - self.station[0]
        for zone in np.split(np.flatnonzero(inside), np.flatnonzero(np.diff(np.flatnonzero(inside)) > 1) + 1):
            if not len(zone):
                continue
            before, after = outside[outside < zone[0]], outside[outside > zone[-1]]
            stride = max(1, min(len(zone), max(len(before), len(after)) // (2 * NODES_A_SIDE)))
            nodes = np.concatenate([before[::-1][::stride][:NODES_A_SIDE][::-1], after[::stride][:NODES_A_SIDE]])
            at = (self.station[nodes] - self.station[zone[0]]) / size
            rows = np.stack([q[nodes], size * dq[nodes], size**2 * ddq[nodes]], axis=1).reshape(-1, q.shape[1])
            curve = KroghInterpolator(np.repeat(at, 3), rows)
            x = (self.station[zone] - self.station[zone[0]]) / size
            q[zone], dq[zone], ddq[zone] = curve.derivatives(x, 3) / np.array([1.0, size, size**2])[:, None, None]
