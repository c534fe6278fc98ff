r"""Smooth curves near many points: quintic splines with as few pieces as a tolerance allows, certified everywhere.

The points are joined by chords; the spline is the least-squares fit to them over the chord length, with both ends kept.
Pieces are halved where it strays too far. What is certified is the distance at equal parameters,

    max |c(t) - chord(t)| over all t,

not only at the points: between two neighbouring knots or points the difference is a polynomial, and its Bernstein
coefficients bound it. The distance between the two curves is no larger, either way round.

Where the points lie on something smooth, halving all pieces brings the spline closer 64 times, and the curvature with
it, far below the tolerance: that is done while it pays. Noise it does not bring closer.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline
from scipy.linalg import solveh_banded

from armtempo.arrays import Bools, Floats, Ints
from armtempo.errors import InputError, PathError, brief
from armtempo.planners.geometry._cartesian_path import SEGMENT_LENGTH_MIN, number

FIT_DEGREE = 5
SAMPLES_PER_PIECE = 12  # of the chords, besides the points
ROUNDS_MAX = 60
CLOSE = (1.0, 0.5)  # of the tolerance: points so close are one, as far as the length of the way goes; tried in turn
PIECE_SHARE_MIN = 1e-10  # of the length: pieces are no shorter
GAIN_MIN = 4.0  # of halving all pieces, for it to be done below the tolerance
FACTORIALS = np.array([math.factorial(k) for k in range(FIT_DEGREE + 1)], dtype=np.float64)
_TO_BERNSTEIN = np.array(  # from derivatives by the share of a piece: b_j = sum C(j, k) / C(5, k) f_k / k!
    [
        [math.comb(j, k) / math.comb(FIT_DEGREE, k) / math.factorial(k) for k in range(FIT_DEGREE + 1)]
        for j in range(FIT_DEGREE + 1)
    ]
)
POINTS_PER_PIECE = 6  # or more, where all pieces are halved below the tolerance


class SmoothFit(NamedTuple):
    """Quintics by rising powers of ``t - knots[k]``: ``coefficients`` (K, 6, n); ``knots`` (K+1,); ``deviation``."""

    knots: Floats
    coefficients: Floats
    deviation: float


def checked_tolerance(value: ArrayLike) -> float:
    """A tolerance of a fit. Raises InputError unless it is positive and finite."""
    tolerance = number(value, "tolerance")
    if not 0.0 < tolerance < math.inf:
        raise InputError(f"tolerance must be positive and finite, got {brief(value)}", remedy="give a number > 0")
    return tolerance


class _Recorded(NamedTuple):
    """All points (N, n) and where they are along the chords of those in ``kept``, ``t`` (N,)."""

    points: Floats
    t: Floats
    kept: Ints


def smooth_fit(points: Floats, tolerance: float) -> SmoothFit:
    """A C4 spline that is nowhere farther than ``tolerance`` from the chords of ``points`` (N, n), nor they from it.

    Where points are closer together than the tolerance, the length is not measured from each to the next: noise would
    be most of it, where a recording begins and ends.

    Raises:
        PathError: All points are the same; no spline keeps the tolerance.
    """
    for share in CLOSE:
        recorded = _recorded(points, max(share * tolerance, SEGMENT_LENGTH_MIN))
        knots, spline, off = _refined(recorded, tolerance)
        if off.max() <= tolerance:
            break
    else:
        raise PathError(
            f"no smooth path near {len(points)} points keeps the tolerance of {tolerance:.6g}: {off.max():.6g} is left",
            remedy="give a larger tolerance, or split the path where it turns back",
        )
    while 2 * (len(knots) - 1) * POINTS_PER_PIECE <= len(points):
        finer = _halved(knots, np.ones(len(knots) - 1, dtype=bool))
        trial, closer = _fitted(recorded, finer)
        if closer.max() * GAIN_MIN > off.max():
            break
        spline, off, knots = trial, closer, finer
    rising = _derivatives(spline, knots[:-1], 0.5 * (knots[1:] + knots[:-1])) / FACTORIALS[:, None, None]
    coefficients = np.ascontiguousarray(np.moveaxis(rising, 0, 1))
    return SmoothFit(knots=knots, coefficients=coefficients, deviation=float(off.max()))


def _refined(recorded: _Recorded, tolerance: float) -> tuple[Floats, BSpline, Floats]:
    """Knots (K+1,), halved where the spline is off by more than the tolerance, the spline, its distances (K,)."""
    knots = recorded.t[[0, -1]]
    spline, off = _fitted(recorded, knots)
    for _ in range(ROUNDS_MAX):
        if off.max() <= tolerance:
            break
        finer = _halved(knots, off > tolerance)
        if len(finer) == len(knots):
            break
        knots = finer
        spline, off = _fitted(recorded, knots)
    return knots, spline, off


def _recorded(points: Floats, least: float) -> _Recorded:
    """Points no closer than ``least`` to the one before, with both ends; others by where they are along the chords."""
    kept = [0]
    far = np.linalg.norm(np.diff(points, axis=0), axis=1) >= least
    for k in range(1, len(points)):
        if (far[k - 1] and kept[-1] == k - 1) or np.linalg.norm(points[k] - points[kept[-1]]) >= least:
            kept.append(k)
    if kept[-1] != len(points) - 1:
        kept = [*kept[: max(len(kept) - 1, 1)], len(points) - 1]
    chosen = points[kept]
    steps = np.diff(chosen, axis=0)
    size = np.linalg.norm(steps, axis=1)
    if size.min() < SEGMENT_LENGTH_MIN:
        raise PathError("all points are the same, within the tolerance", remedy="give points that go somewhere")
    t = np.concatenate([[0.0], np.cumsum(size)])
    chord = np.clip(np.searchsorted(kept, np.arange(len(points)), side="right") - 1, 0, len(steps) - 1)
    share = ((points - chosen[chord]) * steps[chord]).sum(axis=1) / size[chord] ** 2
    along = t[chord] + np.clip(share, 0.0, 1.0) * size[chord]
    along[kept] = t
    return _Recorded(points, along, np.array(kept))


def _halved(knots: Floats, which: Bools) -> Floats:
    """Knots with the middles of pieces (K,) between them."""
    which = which & (np.diff(knots) > PIECE_SHARE_MIN * knots[-1])
    return np.sort(np.concatenate([knots, 0.5 * (knots[1:] + knots[:-1])[which]]))


def _fitted(recorded: _Recorded, knots: Floats) -> tuple[BSpline, Floats]:
    """The spline with these knots, and its largest distance from the chords by pieces (K,)."""
    points, t, kept = recorded
    share = (np.arange(SAMPLES_PER_PIECE) + 0.5) / SAMPLES_PER_PIECE
    even = (knots[:-1, None] + np.diff(knots)[:, None] * share).ravel()
    at, wanted = np.concatenate([t, even]), np.concatenate([points, _chords(t[kept], points[kept], even)])
    padded = np.concatenate([np.repeat(knots[0], FIT_DEGREE), knots, np.repeat(knots[-1], FIT_DEGREE)])
    design = BSpline.design_matrix(at, padded, FIT_DEGREE).tocsc()
    inner = design[:, 1:-1]
    rest = wanted - design[:, [0]].toarray() * points[0] - design[:, [-1]].toarray() * points[-1]
    normal = (inner.T @ inner).todia()
    bands = np.zeros((FIT_DEGREE + 1, inner.shape[1]))
    for offset, row in zip(normal.offsets, normal.data, strict=True):
        if 0 <= offset <= FIT_DEGREE:
            bands[FIT_DEGREE - offset, : len(row)] = row[: inner.shape[1]]
    control = np.concatenate([points[:1], solveh_banded(bands, inner.T @ rest), points[-1:]])
    spline = BSpline(padded, control, FIT_DEGREE)
    return spline, _distances(spline, recorded, knots)


def _chords(t: Floats, points: Floats, at: Floats) -> Floats:
    return np.stack([np.interp(at, t, axis) for axis in points.T], axis=1)


def _distances(spline: BSpline, recorded: _Recorded, knots: Floats) -> Floats:
    """Bounds of ``|c(t) - chord(t)|`` over the pieces (K,): largest Bernstein coefficients of the difference.

    Chords run between neighbouring points, over t as these have it: back, too, where a recording is noisy.
    """
    points, t, _ = recorded
    low, high = np.minimum(t[:-1], t[1:]), np.maximum(t[:-1], t[1:])
    last = len(knots) - 2
    first = np.clip(np.searchsorted(knots, low, side="right") - 1, 0, last)
    count = np.clip(np.searchsorted(knots, high, side="left") - 1, first, last) - first + 1
    chord = np.repeat(np.arange(len(low)), count)  # cut at the knots
    piece = first[chord] + np.arange(len(chord)) - np.repeat(np.cumsum(count) - count, count)
    start, end = np.maximum(low[chord], knots[piece]), np.minimum(high[chord], knots[piece + 1])
    span = np.diff(t)
    slope = np.diff(points, axis=0) / np.where(span == 0.0, np.inf, span)[:, None]
    values = _derivatives(spline, start, 0.5 * (knots[piece] + knots[piece + 1]))
    values[0] -= points[chord] + slope[chord] * (start - t[chord])[:, None]
    values[1] -= slope[chord]
    powers = values * (end - start)[:, None] ** np.arange(FIT_DEGREE + 1)[:, None, None]
    off = np.zeros(len(knots) - 1)
    np.maximum.at(off, piece, np.linalg.norm(np.einsum("jk,kmn->jmn", _TO_BERNSTEIN, powers), axis=2).max(axis=0))
    own = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, last)
    np.maximum.at(off, own, np.linalg.norm(spline(t) - points, axis=1))
    return off


def _derivatives(spline: BSpline, start: Floats, inside: Floats) -> Floats:
    """(6, K, n) the spline and its derivatives behind ``start`` (K,), in the pieces that points ``inside`` are in."""
    return np.stack([spline(inside if order == FIT_DEGREE else start, order) for order in range(FIT_DEGREE + 1)])
