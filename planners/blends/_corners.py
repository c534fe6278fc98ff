r"""The corners of a chain of lines and arcs: what is refused, how far each blend reaches, and its polynomial.

Blends are Bezier curves with two, three or four control points per end; ``_families`` says where.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError, PathError
from armtempo.planners.blends import _path_kernels as kernels
from armtempo.planners.blends._families import LEAST_TIME, Curve, PassingLimits, curve_shares, per_corner
from armtempo.planners.blends._least_time import least_time_shares
from armtempo.planners.blends._path_kernels import ARC
from armtempo.planners.geometry import SEGMENT_LENGTH_MIN, TANGENT_TOLERANCE, Arc, Line

CORNER_ANGLE_MIN = 1e-4  # [rad] a smaller interior angle counts as a reversal
SEGMENT_GAP_MAX = 1e-6  # [m]
COORDINATE_ROUNDING = 2e-15  # of coordinates: how far off a computed distance is
CURVE_SPEED_MIN = 1e-5  # of the remaining distance: where |F'| is smaller, a blend stands still


class Corners(NamedTuple):
    """The C corners of a chain.

    ``remaining`` (C, 2) [m], 0 where two segments simply join; ``shares`` (C, 3) and ``degree`` (C,); coefficients
    ``curve`` (C, 8, 3) [m]; ``deviation`` (C,) [m] from the vertex; ``turn`` (C,) [rad].
    """

    remaining: Floats
    shares: Floats
    degree: Ints
    curve: Floats
    deviation: Floats
    turn: Floats


def packed_segments(segments: Sequence[Line | Arc]) -> tuple[Ints, Floats, Floats]:
    """``kind`` (n,), ``shape`` (n, 8, 3) and lengths (n,) of lines and arcs for the kernels."""
    if isinstance(segments, Line | Arc) or not isinstance(segments, Sequence):
        raise InputError(f"segments must be a list of lines and arcs, got a {type(segments).__name__}")
    kind, shape = np.zeros(len(segments), dtype=np.int64), np.zeros((len(segments), 8, 3))
    for k, segment in enumerate(segments):
        if isinstance(segment, Line):
            shape[k, 0], shape[k, 1] = segment.start, (segment.end - segment.start) / segment.length
        elif isinstance(segment, Arc):
            kind[k] = ARC
            shape[k] = arc_shapes(*segment.evaluate(np.zeros(1)), np.array([segment.radius]))[0]
        else:
            raise InputError(f"segment {k} is a {type(segment).__name__}", remedy="blend lines and arcs")
    return kind, shape, np.array([segment.length for segment in segments])


def arc_shapes(start: Floats, tangent: Floats, curvature: Floats, radius: Floats) -> Floats:
    """Kernel shapes (n, 8, 3) of arcs that start at points (n, 3) with these tangents and curvature vectors."""
    shape = np.zeros((len(start), 8, 3))
    shape[:, 0], shape[:, 1], shape[:, 2] = start, -curvature * radius[:, None] ** 2, tangent
    shape[:, 3, 0] = radius
    return shape


def plan_corners(
    kind: Ints,
    shape: Floats,
    lengths: Floats,
    remaining_distance: ArrayLike | None,
    *,
    shape_factor: ArrayLike = 3.0,
    tolerance: ArrayLike | None = None,
    curve: Curve = "cubic",
    limits: PassingLimits | None = None,
) -> Corners:
    """Blends of all corners of a chain. Arguments as for ``BlendedPath``, segments packed."""
    count = len(kind) - 1
    before, after = np.empty((count, 4, 3)), np.empty((count, 4, 3))
    kernels.segment_points(kind[:-1], shape[:-1], lengths[:-1], before)
    kernels.segment_points(kind[1:], shape[1:], np.zeros(count), after)
    station = np.cumsum(lengths)
    turn = _turns(before, after, station)
    smooth = turn <= TANGENT_TOLERANCE
    jump = np.abs(before[:, 2] - after[:, 2]).max(axis=1, initial=0.0)
    straight = smooth & (jump * np.minimum(lengths[:-1], lengths[1:]) <= 1e-9)
    least_time = isinstance(curve, str) and curve == LEAST_TIME
    if remaining_distance is None and tolerance is None and not smooth.all():
        k = int(np.argmin(smooth))
        raise InputError(
            f"segments {k} and {k + 1} meet in a corner of {math.degrees(turn[k]):.4g} degrees",
            remedy="give remaining_distance or tolerance",
        )
    most, miss = np.full((count, 2), np.inf), np.full(count, np.inf)
    if remaining_distance is not None:
        most = per_corner("remaining_distance", remaining_distance, count, pairs=True)
    if tolerance is not None:
        miss = per_corner("tolerance", tolerance, count)
        if (miss[~smooth] <= 0.0).any():
            raise InputError("tolerance must be positive at every corner", remedy="give metres > 0")
        # blends reach as far to both sides, or the tolerance would not be that of the curve
        reach = most.min(axis=1)
        joined = straight | (smooth & ((miss <= 0.0) | (remaining_distance is None) | (reach <= 0.0)))
        if least_time:
            reach = np.minimum(reach, _room(lengths))
            shares, degree = least_time_shares(kind, shape, lengths, miss, reach, joined, limits)
        else:
            shares, degree = curve_shares(curve, shape_factor, count)
        reach = np.minimum(reach, _wanted(kind, shape, lengths, shares, degree, miss, joined))
        remaining = np.repeat(_shared(reach, lengths)[:, None], 2, axis=1)
    elif least_time:
        raise InputError("curve 'least-time' needs a tolerance", remedy="give tolerance, in metres, and limits")
    else:
        shares, degree = curve_shares(curve, shape_factor, count)
        remaining = np.where(straight[:, None] | ~np.isfinite(most), 0.0, most)
    _check_reach(remaining, smooth, turn, lengths, station)
    remaining[(remaining <= 0.0).any(axis=1)] = 0.0
    coefficients, deviation = np.zeros((count, 8, 3)), np.zeros(count)
    kernels.corner_blends(kind, shape, lengths, remaining, shares, degree, coefficients, deviation)
    rounding = COORDINATE_ROUNDING * (np.abs(shape[1:, 0]).max(axis=1, initial=0.0) + lengths[1:])
    _check_curves(coefficients, degree, remaining, deviation, station, miss * (1.0 + 1e-9) + rounding)
    return Corners(
        remaining=remaining, shares=shares, degree=degree, curve=coefficients, deviation=deviation, turn=turn
    )


def _room(lengths: Floats) -> Floats:
    """How far blends may reach from their corners (C,) [m]: two of them share an inner segment."""
    room = 0.5 * lengths
    room[0], room[-1] = lengths[0], lengths[-1]
    return np.minimum(room[:-1], room[1:])


def _wanted(
    kind: Ints, shape: Floats, lengths: Floats, shares: Floats, degree: Ints, tolerance: Floats, joined: Bools
) -> Floats:
    """How far blends must reach to use up the tolerances (C,) [m], however long the segments; 0 where ``joined``."""
    reach = np.zeros(len(tolerance))
    kernels.corner_distances(kind, shape, lengths, shares, degree, tolerance, joined, reach)
    if not (reach <= 1e10 * tolerance).all():
        raise InputError("this curve passes through the vertex at any size", remedy="give remaining_distance")
    return reach


def _shared(wanted: Floats, lengths: Floats) -> Floats:
    """What corners take that want so much of both segments (C,), where two of them want more than there is [m].

    Half of an inner segment, or what the other corner leaves of it: as far as each corner wants, no farther.
    """
    left, right = np.full(len(wanted), lengths[0]), np.full(len(wanted), lengths[-1])
    inner = lengths[1:-1]
    right[:-1] = np.maximum(0.5 * inner, inner - wanted[1:])
    left[1:] = np.maximum(0.5 * inner, inner - wanted[:-1])
    return np.asarray(np.minimum(wanted, np.minimum(left, right)))


def _check_curves(
    coefficients: Floats, degree: Ints, remaining: Floats, deviation: Floats, station: Floats, tolerance: Floats
) -> None:
    """Refuse blends that stand still somewhere, and those that miss the tolerance after all."""
    slowest = np.full(len(degree), np.inf)
    kernels.slowest_speeds(coefficients, degree, remaining, slowest)
    standing = slowest < CURVE_SPEED_MIN * remaining.min(axis=1, initial=np.inf)
    if standing.any():
        k = int(np.argmax(standing))
        raise InputError(
            f"the blend of segments {k} and {k + 1} at {station[k]:.6g} m stands still: its |F'| comes down to "
            f"{slowest[k]:.3g} m",
            remedy="give other shares, or a named curve",
        )
    missed = (remaining[:, 0] > 0.0) & (deviation > tolerance)
    if missed.any():
        k = int(np.argmax(missed))
        raise PathError(
            f"no blend of segments {k} and {k + 1} at {station[k]:.6g} m keeps the tolerance of {tolerance[k]:.6g} m: "
            f"the one found leaves {deviation[k]:.6g} m",
            remedy="give another curve, or a smaller remaining_distance",
            station=float(station[k]),
            segments=(k, k + 1),
        )


def _turns(before: Floats, after: Floats, station: Floats) -> Floats:
    """By how much the direction changes at each corner [rad]; gaps and reversals are refused."""
    gap = np.linalg.norm(after[:, 0] - before[:, 0], axis=1)
    if (gap > SEGMENT_GAP_MAX).any():
        k = int(np.argmax(gap > SEGMENT_GAP_MAX))
        raise PathError(
            f"segments {k} and {k + 1} are {gap[k]:.6g} m apart at {station[k]:.6g} m",
            remedy="let each start where the last ends",
            station=float(station[k]),
            segments=(k, k + 1),
        )
    cross = np.linalg.norm(np.cross(before[:, 1], after[:, 1]), axis=1)
    turn = np.arctan2(cross, np.sum(before[:, 1] * after[:, 1], axis=1))
    back = turn > math.pi - CORNER_ANGLE_MIN
    if back.any():
        k = int(np.argmax(back))
        raise PathError(
            f"segment {k + 1} turns straight back on segment {k} at {station[k]:.6g} m: no blend can pass there",
            remedy="split the task into two paths that stop there, or put a segment between",
            station=float(station[k]),
            segments=(k, k + 1),
        )
    return np.asarray(turn)


def _check_reach(remaining: Floats, smooth: Bools, turn: Floats, lengths: Floats, station: Floats) -> None:
    """Refuse corners without a blend, blends longer than their segment, and two that overlap."""
    bare = ~smooth & (remaining <= 0.0).any(axis=1)
    if bare.any():
        k = int(np.argmax(bare))
        raise PathError(
            f"segments {k} and {k + 1} meet in a corner of {math.degrees(turn[k]):.4g} degrees at {station[k]:.6g} m, "
            "and its remaining distance is 0",
            remedy="give it a remaining distance",
            station=float(station[k]),
            segments=(k, k + 1),
        )
    remedy = "lower the remaining distance, or give a tolerance: then it is the most that is taken"
    for side, segment_lengths in ((0, lengths[:-1]), (1, lengths[1:])):
        long = remaining[:, side] > segment_lengths + SEGMENT_LENGTH_MIN
        if long.any():
            k = int(np.argmax(long))
            need = f"{remaining[k, side]:.6g} m" if remaining[k, side] <= 10 * segment_lengths[k] else "more"
            raise PathError(
                f"the blend of segments {k} and {k + 1} at {station[k]:.6g} m needs {need} of segment {k + side}, "
                f"which is {segment_lengths[k]:.6g} m long",
                remedy=remedy,
                station=float(station[k]),
                segments=(k, k + 1),
            )
    excess = remaining[1:, 0] + remaining[:-1, 1] - lengths[1:-1]
    if (excess > SEGMENT_LENGTH_MIN).any():
        k = int(np.argmax(excess > SEGMENT_LENGTH_MIN))
        raise PathError(
            f"the blends at {station[k]:.6g} m and {station[k + 1]:.6g} m overlap by {excess[k]:.6g} m on segment "
            f"{k + 1}, which is {lengths[k + 1]:.6g} m long",
            remedy=remedy,
            station=float(station[k]),
            segments=(k, k + 1, k + 2),
        )
