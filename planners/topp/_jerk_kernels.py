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
on one side) its tangent lies inside. First and last coefficient fold away their neighbours: beyond the inner stations
x ~ distance^(4/3).
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
GAP_SHARE = 1e-4  # of the time: so far it may be from the least one of the discretised problem, at most
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
    """The normal equations in x, u, z: second derivatives, and right sides for the predictor, centring, correction."""

    xx: Floats  # (K+1,), as xu and uu
    xu: Floats
    uu: Floats
    hollow: Floats  # (K+1,) curvature of rows whose tangents lie inside: what may be taken off xx
    xz: Floats  # (K, 2), as uz: at both ends of an interval
    uz: Floats
    zz: Floats  # (K,)
    px: Floats  # (3, K+1), as pu
    pu: Floats
    pz: Floats  # (3, K)


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
def _clear(normal: Normal) -> None:
    for array in (normal.xx, normal.xu, normal.uu, normal.hollow, normal.zz):
        array[:] = 0.0
    for array in (normal.xz, normal.uz, normal.px, normal.pu, normal.pz):
        array[:] = 0.0


@njit
def assemble(problem: ThirdOrder, point: Point, slacks: Slacks, primal: float, dual: float, normal: Normal) -> Floats:
    """Move slacks and multipliers by their steps, and build the normal equations there.

    Returns the gap (sum of s l), the worst s - g, the row that has it, the time.
    """
    s, l, g, ds, dl = slacks.s, slacks.l, slacks.g, slacks.ds, slacks.dl  # noqa: E741
    _clear(normal)
    stations, m, n = point.x.shape[0], problem.a.shape[1], problem.d1.shape[2]
    total = np.zeros(4)
    for k in range(stations):
        g[k] = 1.0 - point.x[k] / problem.cap[k]
    i = stations
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        x, u = point.x[k], point.u[k]
        mu = np.sqrt(x)
        for j in range(m):
            value = problem.a[row, j] * u + problem.b[row, j] * x + problem.r[row, j] * mu
            g[i], g[i + 1] = problem.high[row, j] - value, value - problem.low[row, j]
            i += 2
    for k in range(stations - 1):
        for e in range(2):
            x, u, z = point.x[k + e], point.u[k + e], point.z[k]
            most = problem.scale[k + e] / np.sqrt(x)
            for j in range(n):
                value = problem.d1[k, e, j] * z + problem.d2[k, e, j] * u + problem.d3[k, e, j] * x
                g[i], g[i + 1] = most - value, most + value
                i += 2
    for i in range(s.shape[0]):
        s[i], l[i] = max(s[i] + primal * ds[i], g[i]), l[i] + dual * dl[i]
        total[0] += s[i] * l[i]
        if s[i] - g[i] > total[1]:
            total[1], total[2] = s[i] - g[i], i
    for k in range(stations):
        x, slope = point.x[k], -1.0 / problem.cap[k]
        bend = problem.weight[k] / (x * np.sqrt(x))
        total[3] += problem.weight[k] / np.sqrt(x)
        w = l[k] / s[k]
        normal.xx[k] = 0.75 * bend / x + w * slope * slope
        normal.px[0, k] = 0.5 * bend + slope * (l[k] - w * g[k])
        normal.px[1, k] = slope / s[k]
    return total


@njit
def add_point_rows(problem: ThirdOrder, point: Point, slacks: Slacks, normal: Normal) -> None:
    """What torques and accelerations add to the normal equations."""
    s, l, g = slacks.s, slacks.l, slacks.g  # noqa: E741
    i = point.x.shape[0]
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        half = 0.5 / np.sqrt(point.x[k])
        xx, xu, uu, bend, px, pu, cx, cu = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for j in range(problem.a.shape[1]):
            a, r = problem.a[row, j], problem.r[row, j]
            b = problem.b[row, j] + r * half
            above, below = 1.0 / s[i], 1.0 / s[i + 1]
            w_above, w_below = l[i] * above, l[i + 1] * below
            w = w_above + w_below
            xx, xu, uu = xx + w * b * b, xu + w * a * b, uu + w * a * a
            push = (l[i + 1] - w_below * g[i + 1]) - (l[i] - w_above * g[i])
            px, pu = px + push * b, pu + push * a
            centre = below - above
            cx, cu = cx + centre * b, cu + centre * a
            bend += r * (l[i] - l[i + 1])  # of the two sides one is hollow
            i += 2
        bend *= 0.5 * half / point.x[k]
        normal.xx[k] += xx + max(-bend, 0.0)
        normal.hollow[k] += max(bend, 0.0)
        normal.xu[k] += xu
        normal.uu[k] += uu
        normal.px[0, k] += px
        normal.pu[0, k] += pu
        normal.px[1, k] += cx
        normal.pu[1, k] += cu


@njit
def add_jerk_rows(problem: ThirdOrder, point: Point, slacks: Slacks, normal: Normal) -> None:
    """What jerk adds to the normal equations."""
    s, l, g = slacks.s, slacks.l, slacks.g  # noqa: E741
    n = problem.d1.shape[2]
    i = s.shape[0] - 4 * n * (point.x.shape[0] - 1)
    for k in range(point.x.shape[0] - 1):
        for e in range(2):
            x = point.x[k + e]
            slope = 0.5 * problem.scale[k + e] / (x * np.sqrt(x))
            xx, xu, uu, xz, uz, zz, held = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            px, pu, pz, cx, cu, cz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(n):
                z1, u1, x1 = problem.d1[k, e, j], problem.d2[k, e, j], problem.d3[k, e, j]
                above, below = 1.0 / s[i], 1.0 / s[i + 1]
                w_above, w_below = l[i] * above, l[i + 1] * below
                up, down = x1 + slope, x1 - slope
                w, wx = w_above + w_below, w_above * up + w_below * down
                xx += w_above * up * up + w_below * down * down
                xu, xz = xu + wx * u1, xz + wx * z1
                uu, uz, zz = uu + w * u1 * u1, uz + w * u1 * z1, zz + w * z1 * z1
                held += l[i] + l[i + 1]
                p_above, p_below = l[i] - w_above * g[i], l[i + 1] - w_below * g[i + 1]
                push, centre = p_below - p_above, below - above
                px, cx = px + p_below * down - p_above * up, cx + below * down - above * up
                pu, pz = pu + push * u1, pz + push * z1
                cu, cz = cu + centre * u1, cz + centre * z1
                i += 2
            normal.xx[k + e] += xx
            normal.xu[k + e] += xu
            normal.uu[k + e] += uu
            normal.hollow[k + e] += 1.5 * held * slope / x
            normal.xz[k, e] = xz
            normal.uz[k, e] = uz
            normal.zz[k] += zz
            normal.px[0, k + e] += px
            normal.pu[0, k + e] += pu
            normal.pz[0, k] += pz
            normal.px[1, k + e] += cx
            normal.pu[1, k + e] += cu
            normal.pz[1, k] += cz


@njit
def move_rows(
    problem: ThirdOrder, point: Point, change: Point, slacks: Slacks, tau: float, correct: bool, normal: Normal
) -> Floats:
    """Directions of slacks and multipliers for a change of x, u, z; the predictor also notes what it neglects.

    Returns the largest shares of both directions that keep them positive (2), and of the gap: its value, its change
    with the primal share, with the dual share, with their product.
    """
    x = point.x
    stations, m, n = x.shape[0], problem.a.shape[1], problem.d1.shape[2]
    ds, dl, s = slacks.ds, slacks.dl, slacks.s
    fate = np.zeros(6)
    fate[:2] = 1e30
    for k in range(stations):
        _move(slacks, k, -change.x[k] / problem.cap[k], tau, correct, fate)
        if not correct:
            normal.px[2, k] -= ds[k] * dl[k] / (s[k] * problem.cap[k])
    i = stations
    for row in range(problem.at.shape[0]):
        k = problem.at[row]
        half = 0.5 / np.sqrt(x[k])
        for j in range(m):
            a, b = problem.a[row, j], problem.b[row, j] + problem.r[row, j] * half
            way = a * change.u[k] + b * change.x[k]
            _move(slacks, i, -way, tau, correct, fate)
            _move(slacks, i + 1, way, tau, correct, fate)
            if not correct:
                push = ds[i + 1] * dl[i + 1] / s[i + 1] - ds[i] * dl[i] / s[i]
                normal.px[2, k] += push * b
                normal.pu[2, k] += push * a
            i += 2
    for k in range(stations - 1):
        for e in range(2):
            slope = 0.5 * problem.scale[k + e] / (x[k + e] * np.sqrt(x[k + e]))
            dx, du, dz = change.x[k + e], change.u[k + e], change.z[k]
            for j in range(n):
                z1, u1, x1 = problem.d1[k, e, j], problem.d2[k, e, j], problem.d3[k, e, j]
                way = z1 * dz + u1 * du + x1 * dx
                _move(slacks, i, -way - slope * dx, tau, correct, fate)
                _move(slacks, i + 1, way - slope * dx, tau, correct, fate)
                if not correct:
                    above, below = ds[i] * dl[i] / s[i], ds[i + 1] * dl[i + 1] / s[i + 1]
                    normal.px[2, k + e] += (below - above) * x1 - (above + below) * slope
                    normal.pu[2, k + e] += (below - above) * u1
                    normal.pz[2, k] += (below - above) * z1
                i += 2
    return fate


@njit
def _move(slacks: Slacks, i: int, rise: float, tau: float, correct: bool, fate: Floats) -> None:
    """One row: its directions, if g changes by ``rise``."""
    s, l = slacks.s[i], slacks.l[i]  # noqa: E741
    neglected = slacks.ds[i] * slacks.dl[i] if correct else 0.0
    ds = rise + slacks.g[i] - s
    dl = (tau - neglected - l * ds) / s - l
    slacks.ds[i], slacks.dl[i] = ds, dl
    if ds < 0.0:
        fate[0] = min(fate[0], -s / ds)
    if dl < 0.0:
        fate[1] = min(fate[1], -l / dl)
    fate[2] += s * l
    fate[3] += l * ds
    fate[4] += s * dl
    fate[5] += ds * dl


@njit
def to_coefficients(problem: ThirdOrder, normal: Normal, right: int, gradient: Floats) -> None:
    """A right side in x, u, z as one of the coefficients (K+2,)."""
    h, last = problem.step, problem.step.shape[0]
    gradient[:] = 0.0
    for k in range(last + 1):
        before, after = h[k - 1] if k > 0 else 0.0, h[k] if k < last else 0.0
        share = 1.0 / (before + after)
        px, pu = normal.px[right, k], normal.pu[right, k]
        if k > 0:
            pu += normal.pz[right, k - 1] / h[k - 1]
        if k < last:
            pu -= normal.pz[right, k] / h[k]
        gradient[k] += share * (after * px - pu)
        gradient[k + 1] += share * (before * px + pu)


@njit
def bands(problem: ThirdOrder, normal: Normal, hollow: float, band: Floats) -> None:
    """The second derivatives as diagonals (K+2, 3) of the coefficients; ``hollow``: 1 with hollow rows' own, or 0."""
    h, last = problem.step, problem.step.shape[0]
    band[:] = 0.0
    for k in range(last + 1):
        before, after = h[k - 1] if k > 0 else 0.0, h[k] if k < last else 0.0
        share = 1.0 / (before + after)
        p, q = share * after, share * before
        xx, xu, uu = normal.xx[k] - hollow * normal.hollow[k], normal.xu[k], normal.uu[k]
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
def _directed(problem: ThirdOrder, right: Floats, factors: Floats, free: Floats, change: Floats, moved: Point) -> None:
    """The change of the free coefficients (K,) and of x, u, z that a right side (K+2,) asks for."""
    fold_right(problem, right, free)
    solve(factors, free)
    unfold(problem, free, change)
    spline(problem, change, moved)


@njit
def descend(problem: ThirdOrder, y: Floats, floor: float, centering: float, bold: bool) -> Floats:
    """Minimise the time from coefficients y (K,), in place.

    Slacks begin at ``floor`` or more, the gap at that share of the time. ``bold``: with the curvature of hollow rows,
    which saves steps, and now and then leads nowhere.

    Returns the steps, the gap, the worst excess of a row and which row it is, the time. Failed: the gap or the excess
    is too large.
    """
    K, rows = problem.step.shape[0], problem.cap.shape[0] + 2 * problem.a.size + 2 * problem.d1.size
    slacks = Slacks(np.full(rows, floor), np.zeros(rows), np.zeros(rows), np.zeros(rows), np.zeros(rows))
    point = Point(np.zeros(K + 1), np.zeros(K + 1), np.zeros(K))
    moved = Point(np.zeros(K + 1), np.zeros(K + 1), np.zeros(K))
    at, between, ends = np.zeros((4, K + 1)), np.zeros(K), np.zeros((2, K, 2))
    right_at, right_between = np.zeros((2, 3, K + 1)), np.zeros((3, K))
    normal = Normal(
        at[0], at[1], at[2], at[3], ends[0], ends[1], between, right_at[0], right_at[1], right_between
    )  # fmt: skip
    c, change, free = np.zeros(K + 2), np.zeros(K + 2), np.zeros(K)
    right, part, band, factors = np.zeros(K + 2), np.zeros(K + 2), np.zeros((K + 2, 3)), np.zeros((K, 3))
    unfold(problem, y, c)
    spline(problem, c, point)
    tau = centering / rows * assemble(problem, point, slacks, 0.0, 0.0, normal)[3]
    slacks.l[:] = tau / slacks.s
    primal, dual, steps = 0.0, 0.0, 0
    total = assemble(problem, point, slacks, primal, dual, normal)
    while (total[0] > GAP_SHARE * total[3] or total[1] > INFEASIBILITY_MAX) and steps < STEPS_MAX:
        add_point_rows(problem, point, slacks, normal)
        add_jerk_rows(problem, point, slacks, normal)
        for hollow in (1.0 if bold else 0.0, 0.0):  # hollow rows may bend the whole downwards: then without them
            bands(problem, normal, hollow, band)
            fold(problem, band, factors)
            if factor(factors):
                break
        to_coefficients(problem, normal, 0, right)
        _directed(problem, right, factors, free, change, moved)
        fate = move_rows(problem, point, moved, slacks, 0.0, False, normal)
        primal, dual = min(1.0, fate[0]), min(1.0, fate[1])
        left = (fate[2] + primal * fate[3] + dual * fate[4] + primal * dual * fate[5]) / fate[2]
        tau = min(max(left**CENTERING_POWER, CENTERING_LEAST), 1.0) * fate[2] / rows
        to_coefficients(problem, normal, 1, part)
        right += tau * part
        to_coefficients(problem, normal, 2, part)
        right -= part
        _directed(problem, right, factors, free, change, moved)
        fate = move_rows(problem, point, moved, slacks, tau, True, normal)
        primal, dual = min(1.0, BOUNDARY_SHARE * fate[0]), min(1.0, BOUNDARY_SHARE * fate[1])
        for k in range(K + 1):
            primal = min(primal, LOSS_MAX * point.x[k] / max(-moved.x[k], 1e-300))
            if k < K:  # in the middle, too: a parabola between positive ends may dip below 0
                middle, rise = point.x[k] + point.x[k + 1], moved.x[k] + moved.x[k + 1]
                middle, rise = middle + 2.0 * c[k + 1], rise + 2.0 * change[k + 1]
                primal = min(primal, LOSS_MAX * middle / max(-rise, 1e-300))
        y += primal * free
        unfold(problem, y, c)
        spline(problem, c, point)
        total = assemble(problem, point, slacks, primal, dual, normal)
        steps += 1
    return np.array([float(steps), total[0], total[1], total[2], total[3]])
