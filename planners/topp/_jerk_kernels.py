r"""A primal-dual interior point method for minimum time with jerk limits; every step costs O(rows).

``x = mu^2`` is a quadratic spline over the inner stations 0..K, in B-splines with coefficients ``c`` (K + 2):

    x_k = (h_k c_k + h_(k-1) c_(k+1)) / (h_(k-1) + h_k)      u_k = x_k'/2 = (c_(k+1) - c_k) / (h_(k-1) + h_k)
    z_k = u' = (u_(k+1) - u_k) / h_k in interval k            h_(-1) = h_K = 0

so that every limit touches three neighbours and the normal matrix has five diagonals. Limits are rows ``g >= 0``:

    a station's speed         1 - x / cap
    its torque, acceleration  high - v,  v - low      v = a u + b x + r sqrt(x)
    jerk at an interval's end p x^(-1/2) - L,  p x^(-1/2) + L    L = d1 z + d2 u + d3 x

where p scales rows to about one (``|L| sqrt(x) <= p`` is the limit),

each with a slack s and a multiplier l, ``s l -> 0``. Rows are renewed at every step: where g is convex (jerk; friction
on one side) its tangent lies inside, and its curvature is left out, so that the matrix stays positive definite. First
and last coefficient fold away their neighbours: beyond the inner stations x ~ distance^(4/3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.robots import njit

BOUNDARY_SHARE = 0.99  # of the way to the boundary that a step takes
LOSS_MAX = 0.5  # of x in one step: x near an end would collapse, and regrow three times a step at most
CENTERING_LEAST = 1e-4
CENTERING_POWER = 3
GAP_SHARE = 3e-4  # of the time: so far it may be from the least one of the discretised problem, at most
INFEASIBILITY_MAX = 1e-6  # of a limit
STEPS_MAX = 100


class ThirdOrder(NamedTuple):
    """Limits of a motion from rest to rest over K intervals; R point rows of m limits, n joints with jerk limits."""

    step: Floats
    """(K,) lengths of the intervals."""
    weight: Floats
    """(K+1,) of ``x^(-1/2)`` in the time that is minimised."""
    fold: Floats
    """(2,) c_1 / c_0 and c_K / c_(K+1)."""
    cap: Floats
    """(K+1,) of x."""
    scale: Floats
    """(K+1,) about mu."""
    at: Ints
    """(R,) the station of each point row; never falling."""
    a: Floats
    """(R, m), as b, r, low and high, divided by the limit."""
    b: Floats
    r: Floats
    low: Floats
    high: Floats
    d1: Floats
    """(K, 2, n): at both ends of every interval ``f'`` scale / limit; with ``3 f''`` it is d2, with ``f'''`` d3."""
    d2: Floats
    d3: Floats


class Slacks(NamedTuple):
    """Of all rows in one order: caps, point rows (upper, lower), jerk rows (upper, lower)."""

    s: Floats
    inverse: Floats
    l: Floats  # noqa: E741 - the letter of multipliers
    g: Floats
    ds: Floats
    dl: Floats


class Point(NamedTuple):
    """A spline at its stations: x, u (K+1,) and z (K,)."""

    x: Floats
    u: Floats
    z: Floats


class Normal(NamedTuple):
    """The normal equations in x, u, z: second derivatives and right side."""

    xx: Floats  # (K+1,), as xu and uu
    xu: Floats
    uu: Floats
    xz: Floats  # (K, 2), as uz: at both ends of an interval
    uz: Floats
    zz: Floats  # (K,)
    px: Floats  # (K+1,), as pu
    pu: Floats
    pz: Floats  # (K,)


@njit
def unfold(problem: ThirdOrder, y: Floats, c: Floats) -> None:
    """All coefficients (K+2,) from the free ones (K,)."""
    last = y.shape[0] - 1
    c[0], c[1] = y[0], problem.fold[0] * y[0]
    for k in range(1, last):
        c[k + 1] = y[k]
    c[last + 1], c[last + 2] = problem.fold[1] * y[last], y[last]


@njit
def spline(problem: ThirdOrder, c: Floats, point: Point) -> None:
    """Evaluate at all stations."""
    h, last = problem.step, problem.step.shape[0]
    for k in range(last + 1):
        before, after = h[k - 1] if k > 0 else 0.0, h[k] if k < last else 0.0
        share = 1.0 / (before + after)
        point.x[k] = share * (after * c[k] + before * c[k + 1])
        point.u[k] = share * (c[k + 1] - c[k])
    for k in range(last):
        point.z[k] = (point.u[k + 1] - point.u[k]) / h[k]


@njit
def values(problem: ThirdOrder, point: Point, g: Floats) -> None:
    """All g."""
    m, n = problem.a.shape[1], problem.d1.shape[2]
    i = point.x.shape[0]
    for k in range(i):
        g[k] = 1.0 - point.x[k] / problem.cap[k]
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        x, u = point.x[k], point.u[k]
        mu = np.sqrt(x)
        for j in range(m):
            value = problem.a[row, j] * u + problem.b[row, j] * x + problem.r[row, j] * mu
            g[i], g[i + 1] = problem.high[row, j] - value, value - problem.low[row, j]
            i += 2
    for k in range(problem.step.shape[0]):
        for e in range(2):
            x, u, z = point.x[k + e], point.u[k + e], point.z[k]
            most = problem.scale[k + e] / np.sqrt(x)
            for j in range(n):
                value = problem.d1[k, e, j] * z + problem.d2[k, e, j] * u + problem.d3[k, e, j] * x
                g[i], g[i + 1] = most - value, most + value
                i += 2


@njit
def rises(problem: ThirdOrder, point: Point, change: Point, rise: Floats) -> None:
    """By how much all g change, to first order, with a change of x, u, z."""
    m, n = problem.a.shape[1], problem.d1.shape[2]
    i = point.x.shape[0]
    for k in range(i):
        rise[k] = -change.x[k] / problem.cap[k]
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        dx, du = change.x[k], change.u[k]
        dmu = 0.5 * dx / np.sqrt(point.x[k])
        for j in range(m):
            way = problem.a[row, j] * du + problem.b[row, j] * dx + problem.r[row, j] * dmu
            rise[i], rise[i + 1] = -way, way
            i += 2
    for k in range(problem.step.shape[0]):
        for e in range(2):
            dx, du, dz = change.x[k + e], change.u[k + e], change.z[k]
            most = -0.5 * problem.scale[k + e] / (point.x[k + e] * np.sqrt(point.x[k + e])) * dx
            for j in range(n):
                way = problem.d1[k, e, j] * dz + problem.d2[k, e, j] * du + problem.d3[k, e, j] * dx
                rise[i], rise[i + 1] = most - way, most + way
                i += 2


@njit
def add_slopes(problem: ThirdOrder, point: Point, push: Floats, normal: Normal) -> None:
    """Add the slopes of all g, each times its ``push``, to the right side."""
    m, n = problem.a.shape[1], problem.d1.shape[2]
    i = point.x.shape[0]
    for k in range(i):
        normal.px[k] -= push[k] / problem.cap[k]
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        px, pu, pmu = 0.0, 0.0, 0.0
        for j in range(m):
            both = push[i + 1] - push[i]
            pu += both * problem.a[row, j]
            px += both * problem.b[row, j]
            pmu += both * problem.r[row, j]
            i += 2
        normal.px[k] += px + 0.5 * pmu / np.sqrt(point.x[k])
        normal.pu[k] += pu
    for k in range(problem.step.shape[0]):
        for e in range(2):
            px, pu, pz, most = 0.0, 0.0, 0.0, 0.0
            for j in range(n):
                both = push[i + 1] - push[i]
                pz += both * problem.d1[k, e, j]
                pu += both * problem.d2[k, e, j]
                px += both * problem.d3[k, e, j]
                most += push[i] + push[i + 1]
                i += 2
            slope = 0.5 * problem.scale[k + e] / (point.x[k + e] * np.sqrt(point.x[k + e]))
            normal.px[k + e] += px - most * slope
            normal.pu[k + e] += pu
            normal.pz[k] += pz


@njit
def bend_time_and_caps(problem: ThirdOrder, point: Point, slacks: Slacks, normal: Normal) -> None:
    """The second derivatives of the time, and what caps add to them; all else is cleared."""
    for array in (normal.xu, normal.uu, normal.zz):
        array[:] = 0.0
    for k in range(point.x.shape[0]):
        x = point.x[k]
        normal.xx[k] = 0.75 * problem.weight[k] / (x * x * np.sqrt(x))
        normal.xx[k] += slacks.l[k] * slacks.inverse[k] / (problem.cap[k] * problem.cap[k])


@njit
def bend_point_rows(problem: ThirdOrder, point: Point, slacks: Slacks, normal: Normal) -> None:
    """What torques and accelerations add to the second derivatives."""
    inverse, l = slacks.inverse, slacks.l  # noqa: E741
    i = point.x.shape[0]
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        half = 0.5 / np.sqrt(point.x[k])
        xx, xu, uu, bend = 0.0, 0.0, 0.0, 0.0
        for j in range(problem.a.shape[1]):
            a, r = problem.a[row, j], problem.r[row, j]
            b = problem.b[row, j] + r * half
            w = l[i] * inverse[i] + l[i + 1] * inverse[i + 1]
            xx += w * b * b
            xu += w * a * b
            uu += w * a * a
            bend += r * (l[i + 1] - l[i])
            i += 2
        bend *= 0.5 * half / point.x[k]
        normal.xx[k] += xx + max(bend, 0.0)  # without what bends the whole downwards
        normal.xu[k] += xu
        normal.uu[k] += uu


@njit
def bend_jerk_rows(problem: ThirdOrder, point: Point, slacks: Slacks, normal: Normal) -> None:
    """What jerk adds to the second derivatives."""
    inverse, l = slacks.inverse, slacks.l  # noqa: E741
    n = problem.d1.shape[2]
    i = l.shape[0] - 4 * n * problem.step.shape[0]
    for k in range(problem.step.shape[0]):
        for e in range(2):
            x = point.x[k + e]
            slope = 0.5 * problem.scale[k + e] / (x * np.sqrt(x))
            xx, xu, uu, xz, uz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(n):
                z1, u1, x1 = problem.d1[k, e, j], problem.d2[k, e, j], problem.d3[k, e, j]
                above, below = l[i] * inverse[i], l[i + 1] * inverse[i + 1]
                up, down = x1 + slope, x1 - slope
                w, wx = above + below, above * up + below * down
                xx += above * up * up + below * down * down
                xu += wx * u1
                xz += wx * z1
                uu += w * u1 * u1
                uz += w * u1 * z1
                zz += w * z1 * z1
                i += 2
            normal.xx[k + e] += xx
            normal.xu[k + e] += xu
            normal.uu[k + e] += uu
            normal.xz[k, e] = xz
            normal.uz[k, e] = uz
            normal.zz[k] += zz


@njit
def advance_rows(slacks: Slacks, primal: float, dual: float) -> tuple[float, float, int]:
    """Move slacks and multipliers by shares of their directions.

    Returns the gap, the largest s - g and the row that has it.
    """
    s, inverse, l, g, ds, dl = slacks  # noqa: E741
    gap, worst, row = 0.0, 0.0, 0
    for i in range(s.shape[0]):
        s[i] = max(s[i] + primal * ds[i], g[i])  # where g is convex, its tangent lies below
        l[i] += dual * dl[i]
        inverse[i] = 1.0 / s[i]
        gap += s[i] * l[i]
        if s[i] - g[i] > worst:
            worst, row = s[i] - g[i], i
    return gap, worst, row


@njit
def predict_rows(slacks: Slacks, rise: Floats) -> tuple[float, float, float]:
    """Directions towards s l = 0 if all g change by ``rise``.

    Returns the largest shares of both that keep s and l positive, at most 1, and what is left of the gap after them.
    """
    s, inverse, l, g, ds, dl = slacks  # noqa: E741
    fall_s, fall_l, gap, by_s, by_l, by_both = 1.0, 1.0, 0.0, 0.0, 0.0, 0.0
    for i in range(s.shape[0]):
        change = rise[i] + g[i] - s[i]
        ratio = change * inverse[i]
        ds[i], dl[i] = change, -l[i] * (1.0 + ratio)
        fall_s, fall_l = max(fall_s, -ratio), max(fall_l, 1.0 + ratio)
        gap += s[i] * l[i]
        by_s += l[i] * change
        by_l += s[i] * dl[i]
        by_both += change * dl[i]
    primal, dual = 1.0 / fall_s, 1.0 / fall_l
    return primal, dual, (gap + primal * by_s + dual * by_l + primal * dual * by_both) / gap


@njit
def correct_rows(slacks: Slacks, rise: Floats, tau: float) -> tuple[float, float]:
    """Directions towards ``s l = tau``, with the products that the prediction left out; the same shares, unbounded."""
    s, inverse, l, g, ds, dl = slacks  # noqa: E741
    fall_s, fall_l = 1e-30, 1e-30
    for i in range(s.shape[0]):
        change = rise[i] + g[i] - s[i]
        ratio = change * inverse[i]
        turn = (tau - ds[i] * dl[i]) * inverse[i] - l[i] * (1.0 + ratio)
        ds[i], dl[i] = change, turn
        fall_s = max(fall_s, -ratio)
        if -turn > fall_l * l[i]:
            fall_l = -turn / l[i]
    return 1.0 / fall_s, 1.0 / fall_l


@njit
def to_coefficients(problem: ThirdOrder, normal: Normal, gradient: Floats) -> None:
    """The right side in x, u, z as one of the coefficients (K+2,)."""
    h, last = problem.step, problem.step.shape[0]
    gradient[:] = 0.0
    for k in range(last + 1):
        before, after = h[k - 1] if k > 0 else 0.0, h[k] if k < last else 0.0
        share = 1.0 / (before + after)
        px, pu = normal.px[k], normal.pu[k]
        if k > 0:
            pu += normal.pz[k - 1] / h[k - 1]
        if k < last:
            pu -= normal.pz[k] / h[k]
        gradient[k] += share * (after * px - pu)
        gradient[k + 1] += share * (before * px + pu)


@njit
def bands(problem: ThirdOrder, normal: Normal, band: Floats) -> None:
    """The second derivatives as diagonals (K+2, 3) of the coefficients."""
    h, last = problem.step, problem.step.shape[0]
    band[:] = 0.0
    for k in range(last + 1):
        before, after = h[k - 1] if k > 0 else 0.0, h[k] if k < last else 0.0
        share = 1.0 / (before + after)
        p, q = share * after, share * before
        xx, xu, uu = normal.xx[k], normal.xu[k], normal.uu[k]
        band[k, 0] += p * p * xx - 2.0 * p * share * xu + share * share * uu
        band[k, 1] += p * q * xx + (p - q) * share * xu - share * share * uu
        band[k + 1, 0] += q * q * xx + 2.0 * q * share * xu + share * share * uu
    for k in range(last):
        outer = 1.0 / ((h[k - 1] if k > 0 else 0.0) + h[k])
        other = 1.0 / (h[k] + (h[k + 1] if k + 1 < last else 0.0))
        z0, z2 = outer / h[k], other / h[k]
        z1 = -z0 - z2
        x0, x1, u0, u1 = normal.xz[k, 0], normal.xz[k, 1], normal.uz[k, 0], normal.uz[k, 1]
        v0 = outer * (h[k] * x0 - u0) + 0.5 * normal.zz[k] * z0
        v1 = outer * ((h[k - 1] if k > 0 else 0.0) * x0 + u0) + 0.5 * normal.zz[k] * z1
        v1 += other * ((h[k + 1] if k + 1 < last else 0.0) * x1 - u1)
        v2 = other * (h[k] * x1 + u1) + 0.5 * normal.zz[k] * z2
        band[k, 0] += 2.0 * v0 * z0
        band[k, 1] += v0 * z1 + v1 * z0
        band[k, 2] += v0 * z2 + v2 * z0
        band[k + 1, 0] += 2.0 * v1 * z1
        band[k + 1, 1] += v1 * z2 + v2 * z1
        band[k + 2, 0] += 2.0 * v2 * z2


@njit
def fold(problem: ThirdOrder, band: Floats, free: Floats) -> None:
    """The same of the free coefficients (K, 3): without the second and the last but one."""
    first, final, last = problem.fold[0], problem.fold[1], free.shape[0] - 1
    for k in range(last + 1):
        for d in range(3):
            free[k, d] = band[k + 1, d]
    free[0, 0] = band[0, 0] + 2.0 * first * band[0, 1] + first * first * band[1, 0]
    free[0, 1] = band[0, 2] + first * band[1, 1]
    free[0, 2] = first * band[1, 2]
    n = last + 2  # the last coefficient
    free[last, 0] = band[n, 0] + 2.0 * final * band[n - 1, 1] + final * final * band[n - 1, 0]
    free[last - 1, 1] = band[n - 2, 2] + final * band[n - 2, 1]
    free[last - 2, 2] = final * band[n - 3, 2]


@njit
def fold_right(problem: ThirdOrder, gradient: Floats, free: Floats) -> None:
    """Likewise for a right side."""
    last = free.shape[0] - 1
    for k in range(last + 1):
        free[k] = gradient[k + 1]
    free[0] = gradient[0] + problem.fold[0] * gradient[1]
    free[last] = gradient[last + 2] + problem.fold[1] * gradient[last + 1]


@njit
def factor(band: Floats) -> bool:
    """LDL' of a symmetric matrix of five diagonals (n, 3), in place; False: it is not positive definite."""
    n = band.shape[0]
    for k in range(n):
        pivot = band[k, 0]
        if not pivot > 0.0:
            return False
        one, two = band[k, 1] / pivot, band[k, 2] / pivot
        if k + 1 < n:
            band[k + 1, 0] -= one * band[k, 1]
            band[k + 1, 1] -= one * band[k, 2]
        if k + 2 < n:
            band[k + 2, 0] -= two * band[k, 2]
        band[k, 1], band[k, 2] = one, two
    return True


@njit
def solve(band: Floats, right: Floats) -> None:
    """Solve with what ``factor`` left, in place."""
    n = band.shape[0]
    for k in range(n):
        if k > 0:
            right[k] -= band[k - 1, 1] * right[k - 1]
        if k > 1:
            right[k] -= band[k - 2, 2] * right[k - 2]
    for k in range(n - 1, -1, -1):
        value = right[k] / band[k, 0]
        if k + 1 < n:
            value -= band[k, 1] * right[k + 1]
        if k + 2 < n:
            value -= band[k, 2] * right[k + 2]
        right[k] = value


@njit
def _directed(problem: ThirdOrder, normal: Normal, factors: Floats, change: Floats, free: Floats) -> None:
    """The change of the free coefficients (K,), and of all (K+2,), that the right side asks for."""
    to_coefficients(problem, normal, change)
    fold_right(problem, change, free)
    solve(factors, free)
    unfold(problem, free, change)


@njit
def _largest_share(point: Point, moved: Point, c: Floats, change: Floats) -> float:
    """The largest share of a change in which x loses no more than half anywhere, at stations and between them."""
    share, last = 1.0, point.x.shape[0] - 1
    for k in range(last + 1):
        share = min(share, LOSS_MAX * point.x[k] / max(-moved.x[k], 1e-300))
        if k < last:  # a parabola between positive ends may dip below 0
            middle, rise = point.x[k] + point.x[k + 1], moved.x[k] + moved.x[k + 1]
            middle, rise = middle + 2.0 * c[k + 1], rise + 2.0 * change[k + 1]
            share = min(share, LOSS_MAX * middle / max(-rise, 1e-300))
    return share


@njit
def _right_side(problem: ThirdOrder, point: Point, push: Floats, normal: Normal, time: bool) -> float:
    """Fill the right side with slopes of all rows, and of the time; returns that."""
    normal.px[:], normal.pu[:], normal.pz[:] = 0.0, 0.0, 0.0
    add_slopes(problem, point, push, normal)
    total = 0.0
    for k in range(point.x.shape[0]):
        share = problem.weight[k] / np.sqrt(point.x[k])
        total += share
        if time:
            normal.px[k] += 0.5 * share / point.x[k]
    return total


@njit
def descend(problem: ThirdOrder, y: Floats, floor: float, centering: float) -> Floats:
    """Minimise the time from coefficients y (K,), in place.

    Slacks begin at ``floor`` or more, the gap at that share of the time.

    Returns the steps, the gap, the worst excess of a row and which row it is, the time. Failed: the gap or the excess
    is too large.
    """
    K, rows = problem.step.shape[0], problem.cap.shape[0] + 2 * problem.a.size + 2 * problem.d1.size
    slacks = Slacks(
        np.full(rows, floor), np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros(rows)
    )
    _, inverse, l, g, ds, dl = slacks  # noqa: E741
    rise, point = np.zeros(rows), Point(np.zeros(K + 1), np.zeros(K + 1), np.zeros(K))
    moved = Point(np.zeros(K + 1), np.zeros(K + 1), np.zeros(K))
    at, ends, between = np.zeros((5, K + 1)), np.zeros((2, K, 2)), np.zeros((2, K))
    normal = Normal(at[0], at[1], at[2], ends[0], ends[1], between[0], at[3], at[4], between[1])
    c, change, free = np.zeros(K + 2), np.zeros(K + 2), np.zeros(K)
    band, factors = np.zeros((K + 2, 3)), np.zeros((K, 3))
    unfold(problem, y, c)
    spline(problem, c, point)
    values(problem, point, g)
    advance_rows(slacks, 0.0, 0.0)
    time = _right_side(problem, point, rise, normal, True)
    l[:] = centering * time / rows * inverse
    gap, worst, row = advance_rows(slacks, 0.0, 0.0)
    steps = 0
    while (gap > GAP_SHARE * time or worst > INFEASIBILITY_MAX) and steps < STEPS_MAX:
        bend_time_and_caps(problem, point, slacks, normal)
        bend_point_rows(problem, point, slacks, normal)
        bend_jerk_rows(problem, point, slacks, normal)
        bands(problem, normal, band)
        fold(problem, band, factors)
        if not factor(factors):
            break
        rise[:] = l - l * inverse * g
        _right_side(problem, point, rise, normal, True)
        _directed(problem, normal, factors, change, free)
        y_ahead = free.copy()
        spline(problem, change, moved)
        rises(problem, point, moved, rise)
        _, _, left = predict_rows(slacks, rise)
        tau = min(max(left**CENTERING_POWER, CENTERING_LEAST), 1.0) * gap / rows
        rise[:] = (tau - ds * dl) * inverse
        _right_side(problem, point, rise, normal, False)
        _directed(problem, normal, factors, change, free)
        free += y_ahead
        unfold(problem, free, change)
        spline(problem, change, moved)
        rises(problem, point, moved, rise)
        primal, dual = correct_rows(slacks, rise, tau)
        primal, dual = min(1.0, BOUNDARY_SHARE * primal), min(1.0, BOUNDARY_SHARE * dual)
        primal = min(primal, _largest_share(point, moved, c, change))
        y += primal * free
        unfold(problem, y, c)
        spline(problem, c, point)
        values(problem, point, g)
        gap, worst, row = advance_rows(slacks, primal, dual)
        time = (problem.weight / np.sqrt(point.x)).sum()
        steps += 1
    return np.array([float(steps), gap, worst, float(row), time])
