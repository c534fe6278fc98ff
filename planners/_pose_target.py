"""A pose that moves, sampled for a tracker: positions and rotations, their rates, and the middles between samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from armtempo.errors import InputError

__all__ = ["Motion", "PoseTarget"]

Array = NDArray[np.float64]
Motion = Callable[[Array], tuple[ArrayLike, ArrayLike, ArrayLike | None, ArrayLike | None]]
"""Times (N,) [s] to positions (N, 3) [m], rotations (N, 3, 3), velocities and angular velocities (N, 3), or None."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PoseTarget:
    """Where the tip should be, at even times 0, step, 2 step, ..., and in the middle between them.

    All arrays have 2 T - 1 rows: sample, middle, sample, ... World axes. Make one with ``sample`` (a function of
    time, exact middles) or ``through`` (samples only).
    """

    step: float
    """[s] between samples."""
    position: Array
    """(2 T - 1, 3) [m]."""
    rotation: Array
    """(2 T - 1, 3, 3) columns n, s, a: the tool's x, y and z."""
    velocity: Array
    """(2 T - 1, 3) [m/s]."""
    angular_velocity: Array
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
        """Sample a function of time over [0, duration] (rounded to whole steps).

        Raises:
            InputError: Step or duration is not positive; the motion's values have wrong shapes, are not finite, or are
                no rotations.
        """
        if not (0.0 < step < np.inf and 0.5 * step <= duration < np.inf):
            raise InputError(f"duration {duration} s, step {step} s", remedy="give a step > 0 and a longer duration")
        rows = 2 * round(duration / step) + 1
        p, R, v, w = motion(np.asarray(0.5 * step * np.arange(rows), dtype=np.float64))
        return cls._make(step, p, R, v, w, acceleration, angular_acceleration)

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
        p, R = np.asarray(position, dtype=np.float64), np.asarray(rotation, dtype=np.float64)
        if not 0.0 < step < np.inf or p.ndim != 2 or len(p) < 2 or p.shape[1] != 3 or R.shape != (len(p), 3, 3):
            raise InputError(
                f"samples of shapes {p.shape} and {R.shape}, step {step} s",
                remedy="give two or more positions (T, 3), as many rotations (T, 3, 3), and a step > 0",
            )
        _check_rotations(R)
        turn = Rotation.from_matrix(R)
        between = (turn[1:] * turn[:-1].inv()).as_rotvec()
        if velocity is None or angular_velocity is None:
            v = np.gradient(p, step, axis=0)
            w = np.concatenate([between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]]) / step
        else:
            v, w = np.asarray(velocity, dtype=np.float64), np.asarray(angular_velocity, dtype=np.float64)
            if v.shape != p.shape or w.shape != p.shape:
                raise InputError(f"rates of shapes {v.shape} and {w.shape}", remedy=f"give {p.shape}")
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
        given = velocity is not None and angular_velocity is not None
        made = cls._make(step, P, M, V, W, acceleration, angular_acceleration)
        return made if given else made._without_rates()

    @classmethod
    def _make(
        cls,
        step: float,
        position: ArrayLike,
        rotation: ArrayLike,
        velocity: ArrayLike | None,
        angular_velocity: ArrayLike | None,
        acceleration: float | None,
        angular_acceleration: float | None,
    ) -> Self:
        p, R = np.array(position, dtype=np.float64, order="C"), np.array(rotation, dtype=np.float64, order="C")
        if velocity is None or angular_velocity is None:
            return cls.through(p[::2], R[::2], step, acceleration=acceleration)
        v, w = (np.array(a, dtype=np.float64, order="C") for a in (velocity, angular_velocity))
        if p.ndim != 2 or p.shape[1] != 3 or v.shape != p.shape or w.shape != p.shape or R.shape != (len(p), 3, 3):
            raise InputError(
                f"target of shapes {p.shape}, {R.shape}, {v.shape}, {w.shape}",
                remedy="give (N, 3), (N, 3, 3), (N, 3), (N, 3)",
            )
        if not all(np.isfinite(a).all() for a in (p, R, v, w)):
            raise InputError("the target is not finite", remedy="give finite numbers")
        _check_rotations(R)
        for array in (p, R, v, w):
            array.setflags(write=False)
        change, turning = (2.0 * np.linalg.norm(np.diff(a, axis=0), axis=1).max() / step for a in (v, w))
        return cls(
            step=float(step),
            position=p,
            rotation=R,
            velocity=v,
            angular_velocity=w,
            differentiated=False,
            acceleration=float(change) if acceleration is None else acceleration,
            angular_acceleration=float(turning) if angular_acceleration is None else angular_acceleration,
        )

    def _without_rates(self) -> Self:
        object.__setattr__(self, "differentiated", True)
        return self

    @property
    def time(self) -> Array:
        """(T,) [s]."""
        return np.asarray(self.step * np.arange((len(self.position) + 1) // 2), dtype=np.float64)


def _check_rotations(R: Array) -> None:
    off = float(np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max())
    if not off <= 1e-9 or not (np.linalg.det(R) > 0.0).all():
        raise InputError(f"the target's rotations are none (by {off:.3g})", remedy="give orthonormal right-handed R")
