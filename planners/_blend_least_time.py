r"""Of all blends at a given corner tolerance, the quickest to pass: a search over curve families and their shares.

What is compared is an estimate, not a planned motion. A curve of length S is passed at one steady speed,

    v_c = min(V, sqrt(a_n / max kappa), cbrt(j / max |p'''|)),

the fastest that its sharpest place allows; from the line speed V the motion brakes to it and picks up again at the
mean acceleration a. Against running through the vertex at V that costs, with the remaining distances L_1 and L_2,

    S / v_c - (L_1 + L_2) / V + (V - v_c)^2 / (a V).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armtempo.errors import InputError
from armtempo.planners import _blend_kernels as kernels
from armtempo.planners._blend import Blend
from armtempo.planners._blend_corners import CURVES, PassingLimits
from armtempo.robots import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SAMPLES = 48  # of u on a blend
FIRST_STEP, HALVINGS = 0.08, 4  # of the shares, in the search


@njit
def _passing_cost(shape: Array, degree: int, remaining: float, limits: Array) -> float:
    """The estimate above [s]; ``remaining`` is L_1 + L_2, ``limits`` (4,) V, a, j, a_n."""
    speed, acceleration, jerk, normal = limits
    out = np.empty((4, 3))
    length = bend = swing = 0.0
    for i in range(SAMPLES + 1):
        u = i / SAMPLES
        kernels.piece_point(degree, shape, u, out)
        length += kernels.curve_speed(shape, degree, u) * (0.5 if i in (0, SAMPLES) else 1.0) / SAMPLES
        bend = max(bend, np.sqrt(np.sum(out[2] ** 2)))
        swing = max(swing, np.sqrt(np.sum(out[3] ** 2)))
    passing = min(speed, np.sqrt(normal / bend), np.cbrt(jerk / swing))
    return float(length / passing - remaining / speed + (speed - passing) ** 2 / (acceleration * speed))


@njit
def _cost(
    kind: Ints, segment: Array, lengths: Array, shares: Array, degree: int, tolerance: float, most: float, limits: Array
) -> float:
    """Cost of one candidate at one corner."""
    reach = kernels.remaining_for(
        kind, segment, lengths[0], shares, degree, tolerance, min(lengths[0], lengths[1])
    )  # fmt: skip
    reach = min(reach, most)
    points, shape = np.empty((8, 3)), np.empty((8, 3))
    kernels.corner_blend(kind, segment, lengths[0], np.array([reach, reach]), shares, degree, points, shape)
    return _passing_cost(shape, degree, 2.0 * reach, limits)


@njit
def _search(
    kind: Ints, shape: Array, lengths: Array, tolerance: Array, most: Array, skip: NDArray[np.bool_], limits: Array,
    starts: Array, start_degrees: Ints, shares: Array, degree: Ints,
) -> None:  # fmt: skip
    """Coordinate search from every start, at every corner, into ``shares`` (C, 3) and ``degree`` (C,)."""
    for k in range(len(tolerance)):
        degree[k] = start_degrees[0]
        shares[k] = starts[0]
        if skip[k]:
            continue
        best = np.inf
        for j in range(len(starts)):
            here, n = starts[j].copy(), start_degrees[j]
            corner = (kind[k : k + 2], shape[k : k + 2], lengths[k : k + 2])
            cost = _cost(*corner, here, n, tolerance[k], most[k], limits)
            step = FIRST_STEP
            for _ in range(HALVINGS):
                moved = True
                while moved:
                    moved = False
                    for i in range((n - 1) // 2):
                        for sign in (-1.0, 1.0):
                            trial = here.copy()
                            trial[i] += sign * step
                            falls = trial[0] <= 0.95 and trial[(n - 3) // 2] >= 0.05
                            for m in range((n - 3) // 2):
                                falls = falls and trial[m] > trial[m + 1]
                            if n == 3 or not falls:
                                continue
                            other = _cost(*corner, trial, n, tolerance[k], most[k], limits)
                            if other < cost - 1e-12:
                                here, cost, moved = trial, other, True
                step *= 0.5
            if cost < best:
                best = cost
                shares[k], degree[k] = here, n


def _checked(limits: PassingLimits | None) -> Array:
    if limits is None:
        raise InputError("curve 'least-time' needs limits", remedy="give LineSpeedLimits")
    normal = limits.acceleration if limits.normal_acceleration is None else limits.normal_acceleration
    values = np.array([limits.speed, limits.acceleration, limits.jerk, normal], dtype=np.float64)
    if not np.isfinite(values).all() or values.min() <= 0.0:
        raise InputError(f"limits {limits!r} must be positive and finite", remedy="give SI values > 0")
    return values


def least_time_shares(
    kind: Ints,
    shape: Array,
    lengths: Array,
    tolerance: Array,
    most: Array,
    smooth: NDArray[np.bool_],
    limits: PassingLimits | None,
) -> tuple[Array, Ints]:
    """``shares`` (C, 3) and degrees (C,) of the quickest blends of C corners; no further out than ``most`` (C,)."""
    values = _checked(limits)
    names = ("quintic", "low-peak", "septic", "cubic")
    starts = np.zeros((len(names), 3))
    for j, name in enumerate(names):
        starts[j, : len(CURVES[name])] = CURVES[name]
    degrees = np.array([2 * len(CURVES[name]) + 1 for name in names])
    shares, degree = np.zeros((len(tolerance), 3)), np.zeros(len(tolerance), dtype=np.int64)
    _search(kind, shape, lengths, tolerance, most, smooth, values, starts, degrees, shares, degree)
    return shares, degree


def passing_cost(blend: Blend, limits: PassingLimits) -> float:
    """What a blend costs against running through its vertex at line speed [s]: what ``least-time`` minimises."""
    remaining = blend.start_remaining + blend.end_remaining
    return float(_passing_cost(blend.packed.shape[0], blend.degree, remaining, _checked(limits)))
