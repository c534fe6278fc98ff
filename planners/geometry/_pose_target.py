"""A pose that moves, sampled for a tracker: positions and rotations, their rates, and the middles between samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.geometry._cartesian_path import floats, number

__all__ = ["Motion", "PoseTarget"]

STEP_MIN = 1e-9  # [s]
SAMPLES_MAX = 1e7

Motion = Callable[[Floats], tuple[ArrayLike, ArrayLike, ArrayLike | None, ArrayLike | None]]
"""Times (N,) [s] to positions (N, 3) [m], rotations (N, 3, 3), velocities and turnings (N, 3) [rad/s], or two None."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PoseTarget:
    """Where the tip should be, at even times 0, step, 2 step, ..., and in the middle between them.

    All arrays have 2 T - 1 rows: sample, middle, sample, ... World axes. Make one with ``sample`` (a function of
    time, exact middles) or ``through`` (samples only).
    """

    step: float
    """[s] between samples."""
    position: Floats
    """(2 T - 1, 3) [m]."""
    rotation: Floats
    """(2 T - 1, 3, 3) columns n, s, a: the tool's x, y and z."""
    velocity: Floats
    """(2 T - 1, 3) [m/s]."""
    angular_velocity: Floats
    """(2 T - 1, 3) [rad/s]."""
    differentiated: bool
    """The rates are differences of the samples: good for bounds, not fed forward."""
    acceleration: float
    """[m/s^2] the greatest: the largest change of velocity between rows, unless given."""
    angular_acceleration: float
    """[rad/s^2]."""

    @classmethod
    def sample(
        cls,
        motion: Motion,
        duration: float,
        step: float,
        *,
        acceleration: float | None = None,
        angular_acceleration: float | None = None,
    ) -> Self:
        """Sample a function of time over [0, duration] (rounded to whole steps, one or more).

        Without rates, differences of its values, the middles too, serve for bounds, and nothing is fed forward.

        Raises:
            InputError: Step or duration is not positive; the motion's values have wrong shapes, are not finite, or are
                no rotations; one of its two rates is missing; an acceleration is negative or not finite.
        """
        step, duration = number(step, "step"), number(duration, "duration")
        if not (STEP_MIN <= step < np.inf and 0.5 * step <= duration < np.inf and duration <= SAMPLES_MAX * step):
            raise InputError(
                f"duration {duration} s, step {step} s",
                remedy=f"give a step from {STEP_MIN:g} s on, and a duration of one to {SAMPLES_MAX:g} of them",
            )
        rows = 2 * max(1, round(duration / step)) + 1
        p, R, v, w = motion(np.asarray(0.5 * step * np.arange(rows), dtype=np.float64))
        p, R = _checked_poses(p, R)
        if len(p) != rows:
            raise InputError(f"{rows} times give {len(p)} poses", remedy="give one for each")
        given = _checked_rates(v, w, p)
        rates = _differences(p, R, 0.5 * step) if given is None else given
        return cls._make(step, p, R, *rates, given is None, acceleration, angular_acceleration)

    @classmethod
    def through(
        cls,
        position: ArrayLike,
        rotation: ArrayLike,
        step: float,
        *,
        velocity: ArrayLike | None = None,
        angular_velocity: ArrayLike | None = None,
        acceleration: float | None = None,
        angular_acceleration: float | None = None,
    ) -> Self:
        """Samples (T, 3) and (T, 3, 3), with rates (T, 3) or without; the middles from cubics through both.

        Without rates their differences serve to place the middles and for bounds, and nothing is fed forward.

        Raises:
            InputError: As of ``sample``; fewer than two samples.
        """
        p, R = _checked_poses(position, rotation)
        step = number(step, "step")
        if not STEP_MIN <= step < np.inf:
            raise InputError(f"step {step} s", remedy=f"give a step from {STEP_MIN:g} s on")
        given = _checked_rates(velocity, angular_velocity, p)
        v, w = _differences(p, R, step) if given is None else given
        turn = Rotation.from_matrix(R)
        between = (turn[1:] * turn[:-1].inv()).as_rotvec()
        # The rotation vector from a sample on, as a cubic with the rates at both ends (its end rate by the inverse of
        # the left Jacobian, to second order in the angle: the rest is of the cubic's own order).
        start, end = w[:-1], w[1:] - 0.5 * np.cross(between, w[1:]) + np.cross(between, np.cross(between, w[1:])) / 12
        half = 0.5 * between + step / 8 * (start - end)
        rate = 1.5 * between / step - 0.25 * (start + end)
        rows = 2 * len(p) - 1
        P, V, W, M = np.empty((rows, 3)), np.empty((rows, 3)), np.empty((rows, 3)), np.empty((rows, 3, 3))
        P[::2], V[::2], W[::2], M[::2] = p, v, w, R
        P[1::2] = 0.5 * (p[1:] + p[:-1]) + step / 8 * (v[:-1] - v[1:])
        V[1::2] = 1.5 * (p[1:] - p[:-1]) / step - 0.25 * (v[1:] + v[:-1])
        M[1::2] = (Rotation.from_rotvec(half) * turn[:-1]).as_matrix()
        W[1::2] = rate + 0.5 * np.cross(half, rate) + np.cross(half, np.cross(half, rate)) / 6
        return cls._make(step, P, M, V, W, given is None, acceleration, angular_acceleration)

    @classmethod
    def _make(
        cls,
        step: float,
        p: Floats,
        R: Floats,
        v: Floats,
        w: Floats,
        differentiated: bool,
        acceleration: float | None,
        angular_acceleration: float | None,
    ) -> Self:
        R = 1.5 * R - 0.5 * R @ R.transpose(0, 2, 1) @ R  # they may be off by 1e-9, which bounds would see
        for array in (p, R, v, w):
            array.setflags(write=False)
        most = [
            2.0 * float(np.linalg.norm(np.diff(rate, axis=0), axis=1).max()) / step
            if given is None
            else number(given, "an acceleration")
            for rate, given in ((v, acceleration), (w, angular_acceleration))
        ]
        if not all(0.0 <= value < np.inf for value in most):
            raise InputError(f"accelerations {most[0]} m/s^2, {most[1]} rad/s^2", remedy="give finite numbers >= 0")
        return cls(
            step=float(step),
            position=p,
            rotation=R,
            velocity=v,
            angular_velocity=w,
            differentiated=differentiated,
            acceleration=most[0],
            angular_acceleration=most[1],
        )

    @property
    def time(self) -> Floats:
        """(T,) [s]."""
        return np.asarray(self.step * np.arange((len(self.position) + 1) // 2), dtype=np.float64)


def _checked_poses(position: ArrayLike, rotation: ArrayLike) -> tuple[Floats, Floats]:
    """Copies."""
    p, R = floats(position, "positions"), floats(rotation, "rotations")
    if p.ndim != 2 or len(p) < 2 or p.shape[1] != 3 or R.shape != (len(p), 3, 3):
        raise InputError(
            f"target of shapes {p.shape} and {R.shape}",
            remedy="give two or more positions (T, 3), and as many rotations (T, 3, 3)",
        )
    if not (np.isfinite(p).all() and np.isfinite(R).all()):
        raise InputError("the target is not finite", remedy="give finite numbers")
    off = float(np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max())
    if not off <= 1e-9 or not (np.linalg.det(R) > 0.0).all():
        raise InputError(f"the target's rotations are none (by {off:.3g})", remedy="give orthonormal right-handed R")
    return np.ascontiguousarray(p), np.ascontiguousarray(R)


def _checked_rates(velocity: ArrayLike | None, turning: ArrayLike | None, p: Floats) -> tuple[Floats, Floats] | None:
    """Copies, or None where there are none."""
    if velocity is None and turning is None:
        return None
    if velocity is None or turning is None:
        raise InputError("one of velocity and angular velocity is missing", remedy="give both, or neither")
    v, w = floats(velocity, "velocities"), floats(turning, "angular velocities")
    if v.shape != p.shape or w.shape != p.shape or not (np.isfinite(v).all() and np.isfinite(w).all()):
        raise InputError(f"rates of shapes {v.shape} and {w.shape}, or not finite", remedy=f"give finite {p.shape}")
    return np.ascontiguousarray(v), np.ascontiguousarray(w)


def _differences(p: Floats, R: Floats, step: float) -> tuple[Floats, Floats]:
    """Rates (T, 3) of poses ``step`` apart: central, one-sided at the ends."""
    turn = Rotation.from_matrix(R)
    between = (turn[1:] * turn[:-1].inv()).as_rotvec()
    w = np.concatenate([between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]]) / step
    return np.gradient(p, step, axis=0), w
