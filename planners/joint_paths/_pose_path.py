"""Where a tip goes and how it is turned, by length: what a joint path of any arm needs of a Cartesian path.

Lines, arcs, chains of them and blended paths are adapted by ``TipPosePath``; any other motion is one that has the
members of ``PosePath``.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.planners.blends import Blend, BlendedPath
from armtempo.planners.geometry import Arc, CartesianPath, Line, Segment

__all__ = ["PosePath", "Poses", "TipPosePath", "TipSegments", "as_pose_path"]

TipSegments = Line | Arc | CartesianPath | BlendedPath
BLEND_PARTS = 64  # of a blend, to bound its curvature


class Poses(NamedTuple):
    """Poses of the tip and their exact derivatives by lambda, world axes."""

    position: Floats
    """(..., 3) [m]."""
    rotation: Floats
    """(..., 3, 3) columns: the tool's x, y and z."""
    tangent: Floats
    """(..., 3) dp/dlambda."""
    turning: Floats
    """(..., 3) w = angular velocity per lambda [rad]."""
    curvature: Floats
    """(..., 3) d2p/dlambda2."""
    turning_change: Floats
    """(..., 3) dw/dlambda."""


@runtime_checkable
class PosePath(Protocol):
    """A moving pose. Tangent and turning are continuous; their derivatives may jump at breakpoints."""

    @property
    def length(self) -> float:
        """``lambda_max`` [m]."""
        ...

    @property
    def breakpoints(self) -> Floats:
        """(K + 1,) rising stations, first 0 and last ``length``, between which the motion is smooth."""
        ...

    @property
    def bends(self) -> Floats:
        """(K, 2) upper bounds, per piece, of ``|d2p/dlambda2|`` and of ``|dw/dlambda|``: speed bounds stand on them."""
        ...

    def poses(self, s: ArrayLike, *, before: bool = False) -> Poses:
        """The poses at ``s``; ``before``: a breakpoint belongs to the piece before it."""
        ...


@final
class TipPosePath:
    """A Cartesian path with an orientation.

    Args:
        cartesian: Where the tip goes [m].
        rotation: (3, 3) that the tool keeps; not used where the path has an orientation of its own (``BlendedPath``).
    """

    def __init__(self, cartesian: TipSegments, rotation: ArrayLike) -> None:
        self._path = CartesianPath([cartesian]) if isinstance(cartesian, Line | Arc) else cartesian
        self.length = self._path.length
        self.breakpoints = self._path.breakpoints
        turn = np.zeros(3)
        if isinstance(self._path, BlendedPath):
            pieces: tuple[Segment, ...] = self._path.pieces
            self._own = self._path.oriented
            if self._own:
                first, last = self._path.orientation(np.array([0.0, self.length]))
                # slerp turns about one axis at one rate: the vector part of last * conjugate(first)
                axis = first[3] * last[:3] - last[3] * first[:3] - np.cross(last[:3], first[:3])
                sine = float(np.linalg.norm(axis))
                if sine > 1e-12:
                    turn = 2.0 * np.arctan2(sine, first @ last) * axis / sine
        else:
            pieces, self._own = self._path.segments, False
        self._turning = turn / self.length
        self._rotation = np.asarray(rotation, dtype=np.float64)
        self.bends = np.array([[_curvature_bound(piece), 0.0] for piece in pieces])

    def poses(self, s: ArrayLike, *, before: bool = False) -> Poses:
        """The poses at length ``s`` [m]."""
        s = np.asarray(s, dtype=np.float64)
        position, tangent, curvature = self._path.evaluate(s, before=before)
        if self._own:
            assert isinstance(self._path, BlendedPath)
            quaternions = self._path.orientation(s)
            rotation = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix().reshape(*s.shape, 3, 3)
        else:
            rotation = np.broadcast_to(self._rotation, (*s.shape, 3, 3))
        turning = np.broadcast_to(self._turning, position.shape)
        return Poses(
            position=position,
            rotation=rotation,
            tangent=tangent,
            turning=turning,
            curvature=curvature,
            turning_change=np.zeros_like(position),
        )


def as_pose_path(path: TipSegments | PosePath, rotation: Floats) -> PosePath:
    """The path as poses; ``rotation`` (3, 3) where it has no orientation.

    Raises:
        InputError: It is no path; its poses at breakpoints are none.
    """
    if isinstance(path, TipSegments):
        return TipPosePath(path, rotation)
    if not isinstance(path, PosePath):
        raise InputError(
            f"{type(path).__name__} is no Cartesian path",
            remedy="give a Line, Arc, CartesianPath, BlendedPath, or what has the members of PosePath",
        )
    ends, bends = np.asarray(path.breakpoints), np.asarray(path.bends)
    if len(ends) < 2 or ends[0] != 0.0 or ends[-1] != path.length or not (np.diff(ends) > 0.0).all():
        raise InputError("breakpoints do not rise from 0 to the length", remedy="give (K + 1,) rising stations")
    if bends.shape != (len(ends) - 1, 2) or not ((bends >= 0.0) & np.isfinite(bends)).all():
        raise InputError(f"bends of shape {bends.shape}", remedy=f"give ({len(ends) - 1}, 2) finite upper bounds >= 0")
    poses = path.poses(ends)
    R, finite = poses.rotation, all(np.isfinite(a).all() for a in poses)
    if not finite or np.abs(R @ np.swapaxes(R, -1, -2) - np.eye(3)).max() > 1e-9 or np.linalg.det(R).min() < 0.0:
        raise InputError("its poses are not finite, or no rotations", remedy="give orthonormal right-handed rotations")
    return path


def _curvature_bound(piece: Segment) -> float:
    """An upper bound of its curvature [1/m], not from samples."""
    if isinstance(piece, Line):
        return 0.0
    if isinstance(piece, Arc):
        return 1.0 / piece.radius
    if isinstance(piece, Blend):
        return _polynomial_curvature_bound(piece.coefficients)
    raise InputError(
        f"the curvature of a {type(piece).__name__} has no known bound",
        remedy="give lines, arcs and blends, or a PosePath of your own",
    )


def _polynomial_curvature_bound(coefficients: Floats) -> float:
    """The same for F(u), 0 <= u <= 1, (degree + 1, 3) by rising powers: |F' x F''| / |F'|^3.

    On each of many short parts: a polynomial is, in norm, nowhere larger than the sum of its coefficients about the
    middle of the part, and nowhere smaller than the first of them less the others.
    """
    first = coefficients[1:] * np.arange(1, len(coefficients))[:, None]
    second = first[1:] * np.arange(1, len(first))[:, None]
    across = np.zeros((len(first) + len(second) - 1, 3))
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            across[i + j] += np.cross(a, b)
    parts = BLEND_PARTS
    while True:  # a curve is nowhere at rest: short enough parts have a bound
        half = 0.5 / parts
        middles = (np.arange(parts) + 0.5) / parts
        speed, force = (_about(rows, middles, half) for rows in (first, across))
        slowest = speed[:, 0] - speed[:, 1:].sum(axis=1)
        if slowest.min() > 0.5 * speed[:, 0].min() or parts >= 2**16:
            return float((force.sum(axis=1) / np.maximum(slowest, 1e-300) ** 3).max() * (1.0 + 1e-9))
        parts *= 2


def _about(rows: Floats, middles: Floats, half: float) -> Floats:
    """(P, N) norms of the coefficients of a polynomial (N, 3) about each of the middles (P,), for |u - middle| <= half.

    By repeated differentiation: the j-th is F^(j)(middle) half^j / j!.
    """
    norms = []
    scale = 1.0
    for j in range(len(rows)):
        values = np.polynomial.polynomial.polyval(middles, rows)  # (3, P)
        norms.append(np.linalg.norm(values, axis=0) * scale)
        rows = rows[1:] * np.arange(1, len(rows))[:, None]
        scale *= half / (j + 1)
    return np.stack(norms, axis=1)
