"""Motions of a pose over time, for ``PoseTarget.sample``: along a line and back, from pose to pose, by the joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.planners.geometry._pose_target import Motion
from armtempo.robots import Arm


def smooth_step(x: ArrayLike) -> tuple[Floats, Floats]:
    """From 0 at x <= 0 to 1 at x >= 1 with no slope and no curvature at the ends, and its slope (at most 15/8)."""
    x = np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * (x * (1.0 - x)) ** 2


def harmonic(center: ArrayLike, amplitude: ArrayLike, rate: float, rotation: ArrayLike) -> Motion:
    """Position ``center + amplitude cos(rate t)`` (3,) [m], constant rotation (3, 3)."""
    middle, swing, R = (np.asarray(a, dtype=np.float64) for a in (center, amplitude, rotation))

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        p = middle + swing * np.cos(rate * t)[:, None]
        v = swing * (-rate * np.sin(rate * t))[:, None]
        return p, np.broadcast_to(R, (len(t), 3, 3)), v, np.zeros_like(p)

    return motion


def through_poses(times: Sequence[float], positions: ArrayLike, rotations: ArrayLike) -> Motion:
    """From each pose to the next in a straight line and about one axis, at rest in all of them; then it stays.

    Args:
        times: (K,) rising [s].
        positions: (K, 3) [m].
        rotations: (K, 3, 3).
    """
    at, p = np.asarray(times, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    R = Rotation.from_matrix(np.asarray(rotations, dtype=np.float64))
    turn = (R[1:] * R[:-1].inv()).as_rotvec()

    def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        leg = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
        duration = (at[leg + 1] - at[leg])[:, None]
        share, rate = smooth_step((t[:, None] - at[leg, None]) / duration)
        way = p[leg + 1] - p[leg]
        return (
            p[leg] + share * way,
            (Rotation.from_rotvec(share * turn[leg]) * R[leg]).as_matrix(),
            rate / duration * way,
            rate / duration * turn[leg],
        )

    return motion


class JointMotion:
    """A spline through postures, run from rest to rest: joints over time, and the pose they give the tip.

    Args:
        arm: The arm.
        postures: (K, n) [rad or m], K >= 2; equal shares of the way between them.
        duration: [s].
    """

    def __init__(self, arm: Arm, postures: Floats, duration: float) -> None:
        self.arm, self.postures, self.duration = arm, postures, duration
        self._spline = CubicSpline(np.linspace(0.0, 1.0, len(postures)), postures, bc_type="natural")

    def joints(self, t: Floats) -> tuple[Floats, Floats]:
        """Positions and speeds (N, n) at times (N,); it stays at the end."""
        share, rate = smooth_step(t / self.duration)
        return self._spline(share), self._spline(share, 1) * (rate / self.duration)[:, None]

    def __call__(self, t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """The tip's pose and its rates: a ``Motion``."""
        q, qd = self.joints(t)
        T, twist = self.arm.tip_pose(q), np.einsum("kij,kj->ki", self.arm.jacobian(q), qd)
        return T[:, :3, 3], T[:, :3, :3], twist[:, :3], twist[:, 3:]
