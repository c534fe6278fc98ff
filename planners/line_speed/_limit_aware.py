r"""Least time along a given path under limits of speed, tangential and normal acceleration, and vector jerk.

With ``x(s) = v^2`` the tangential acceleration is ``x'/2``, the normal one ``kappa x``, and the jerk vector

    sqrt(x) L[x],    L[x] = p' x''/2 + 3/2 p'' x' + p''' x,

so all limits are convex in ``x`` but ``|L[x]| <= jerk x^(-1/2)``. Its right side is convex: the tangent at any
``x_k > 0`` lies below it, and what keeps the tangent keeps the limit. Each round is a second-order cone program with
the tangents taken at the solution before (the convex-concave procedure); all are feasible, and the time only falls.

The time is taken to second order there, and the first tangents at a motion that corners of any sharpness allow,
nearly (``_speed_guess``): from elsewhere, and with knots too far apart for what bends, the same rounds come to far
slower motions.

``x`` is a C1 cubic between knots, and ``x ~ s^(4/3)`` (constant jerk) next to a rest. The result becomes quintics in
time through ``(s, v, a)`` at the knots, and is slowed as a whole by what a dense sampling of the true limits asks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from armtempo.arrays import Floats, Ints
from armtempo.errors import InfeasibleError, InputError
from armtempo.planners.line_speed._limits import LineSpeedLimits, square_caps
from armtempo.planners.line_speed._path_samples import path_rests
from armtempo.planners.line_speed._profile import (
    ROUNDING,
    LineSpeedProfile,
    on_own_side,
    path_quantities,
    peaks,
    profile_states,
    shares,
)
from armtempo.planners.line_speed._speed_guess import guessed_squares
from armtempo.planners.line_speed._stations import stations

ROUNDS_MAX = 12
ROUND_GAIN_MIN = 2e-3  # a round that gains less, as a share of the time, is the last
SHARP, SHARP_GAIN_MIN = 1e-3, 2e-4  # the same where a bend's largest v^2 is so small a share: there rounds gain slowly
LIMIT_POINTS = np.array([1e-6, 0.5, 1.0 - 1e-6])  # shares of every interval where the limits are asked
TRIMS_MAX = 4
QUINTICS_PER_INTERVAL = 2
SAMPLES_PER_QUINTIC = 12  # both ends included
PEAK_CLOSENESS = 2e-3  # of the largest sample: a peak between samples is higher than they by less
SLOWING_MARGIN = 1e-6  # of the final slowing, for what lies between the samples
BEND_ROUNDING = 1e-14  # of the length times the curvature: the share of the jerk that is left for rounding
RATIO_SLACK = 1e-6  # what a certificate may be above 1
GAUSS_NODES = 0.5 + 0.5 * np.polynomial.legendre.leggauss(8)[0]
GAUSS_WEIGHTS = 0.5 * np.polynomial.legendre.leggauss(8)[1]


def limit_aware_profile(path: Any, limits: LineSpeedLimits) -> LineSpeedProfile:
    """The fastest profile from rest to rest along ``path`` that keeps all ``limits`` as vectors, nearly.

    Where the curvature of the path jumps (a breakpoint whose ``continuity`` is 1) it stops. The work grows linearly
    with the number of pieces, and with the logarithm of their length over that of a ramp to line speed.

    Args:
        path: ``length``, ``derivatives(s)``, and where it is made of pieces ``breakpoints`` and ``continuity``; or a
            single line, arc or blend.
        limits: Speed, tangential and normal acceleration, jerk of the whole vector.

    Raises:
        InputError: Limits or a path of another kind.
        InfeasibleError: The program of some part could not be solved, or what came out breaks a limit.
    """
    if not isinstance(limits, LineSpeedLimits):
        raise InputError(f"limits are a {type(limits).__name__}", remedy="give LineSpeedLimits")
    if not (hasattr(path, "length") and hasattr(path, "derivatives")):
        raise InputError(f"a {type(path).__name__} is no path", remedy="give a BlendedPath, or one segment")
    stops = path_rests(path, path.length)
    knots, rows, now = [np.zeros(1)], [], 0.0
    for start, end in pairwise(stops):
        times, coefficients = _between_stops(path, limits, float(start), float(end))
        knots.append(now + times[1:])
        rows.append(coefficients)
        now = float(knots[-1][-1])
    return _certified(
        LineSpeedProfile(
            knots=np.concatenate(knots), coefficients=np.concatenate(rows), limits=limits, path=path, length=path.length
        )
    )


def _certified(profile: LineSpeedProfile) -> LineSpeedProfile:
    """The profile, slowed by what its certificate still asks for.

    Raises:
        InfeasibleError: It asks for more than a limit, or runs back, all the same.
    """
    for _ in range(TRIMS_MAX):
        said = profile.certificate
        if said.ratio_max <= 1.0 + RATIO_SLACK:
            break
        pull = max(said.acceleration_ratio_max, said.normal_ratio_max)
        slower = max(said.speed_ratio_max, math.sqrt(pull), math.cbrt(said.jerk_ratio_max)) * (1.0 + SLOWING_MARGIN)
        profile = replace(
            profile, knots=profile.knots * slower, coefficients=profile.coefficients / slower ** np.arange(6)
        )
    said = profile.certificate
    if not (said.ratio_max <= 1.0 + RATIO_SLACK and said.lowest_speed >= -RATIO_SLACK * profile.limits.speed):
        raise InfeasibleError(
            f"the motion found asks for {said.ratio_max:.6g} times a limit, and its speed comes down to "
            f"{said.lowest_speed:.3g} m/s: numbers too far apart",
            remedy="blend corners by more, or bring the limits closer together",
        )
    return profile


def _between_stops(path: Any, limits: LineSpeedLimits, start: float, end: float) -> tuple[Floats, Floats]:
    """Times from 0 and quintics of the motion between two rests."""
    program = _Program.build(path, limits, stations(path, limits, start, end))
    unknowns = program.solve()
    times, coefficients, over = _motion(path, program, unknowns)
    for _ in range(TRIMS_MAX):  # ask for a little less where the limits are exceeded between the points
        if (over < 1.0 + 1e-3).all():
            break
        program = program.tightened(over)
        unknowns = program.round(program.values(unknowns)[0])
        trimmed, rows, over = _motion(path, program, unknowns)
        if trimmed[-1] < times[-1]:
            times, coefficients = trimmed, rows
    return times, coefficients


def _motion(path: Any, program: _Program, unknowns: Floats) -> tuple[Floats, Floats, Floats]:
    """The motion as quintics in time, slowed until it keeps the limits; what it asked before, (2, K) by interval."""
    s, way, v, a, steps = program.rows(unknowns)
    coefficients = _quintics(s, way, v, a, steps)
    times = np.concatenate([[0.0], np.cumsum(steps)])
    slower, worst = _slowing(path, program.limits, times, coefficients)
    first = np.concatenate([[0], np.arange(1, len(steps) - 1, QUINTICS_PER_INTERVAL), [len(steps) - 1]])
    return times * slower, coefficients / slower ** np.arange(6), np.maximum.reduceat(worst, first, axis=1)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Program:
    """The cone program between two rests. Unknowns at every knot, by turns: ``x`` and ``x' h``, over a first guess.

    Attributes:
        limits: What the motion keeps.
        stations: (K+1,) knots [m]; x grows with (distance from rest)^(4/3) in the first and the last interval.
        free: (2K+2, n) sparse: the unknowns by those that are left when both ends are at rest.
        scale: (K+1, 2) what an unknown of 1 means for x and x'.
        basis: (3, K, P, 4) x and its two derivatives at the points, by the unknowns of both knots.
        weights: (K, P) quadrature weights of ``ds / sqrt(x)`` [m].
        guess: (K, P) a first x to take tangents at [m^2/s^2].
        cap: (K, P) largest x by speed and normal acceleration [m^2/s^2].
        jerk: (K,) limit of the jerk [m/s^3].
        bend: (K, P, 3, 3) third, 3/2 second, 1/2 first derivative of p: L[x] by x and its derivatives.
    """

    limits: LineSpeedLimits
    stations: Floats
    free: Any
    scale: Floats
    basis: Floats
    weights: Floats
    guess: Floats
    cap: Floats
    jerk: Floats
    bend: Floats

    @classmethod
    def build(cls, path: Any, limits: LineSpeedLimits, stations: Floats) -> _Program:
        from scipy import sparse

        steps = np.diff(stations)
        s = stations[:-1, None] + LIMIT_POINTS * steps[:, None]
        _, d1, d2, d3 = path.derivatives(s)
        cap = square_caps(limits, np.linalg.norm(d2, axis=-1))
        guess = guessed_squares(path, limits, s, stations[[0, -1]])
        at_knots = np.concatenate([[1.0], guess[1:, 0], [1.0]])
        near = np.minimum(np.append(steps, np.inf), np.append(np.inf, steps))
        # what a bend asks for that is hardly longer than the rounding of lengths is not known better, and slows later
        rounding = BEND_ROUNDING * path.length * np.linalg.norm(d2, axis=-1).max(axis=1)
        scale = np.stack([at_knots, at_knots / near], axis=1)
        weights = np.array([1.0, 4.0, 1.0]) / 6.0 * steps[:, None]
        weights[0], weights[-1] = [0.0, 0.0, 3.0 * steps[0]], [3.0 * steps[-1], 0.0, 0.0]  # t = 3 s / v
        knots = len(stations)
        free = sparse.eye(2 * knots, format="lil")
        free[3, 2] = 4.0 / 3.0 * near[1] / steps[0]  # x' = 4/3 x / s at the end of a constant jerk
        free[2 * knots - 3, 2 * knots - 4] = -4.0 / 3.0 * near[-2] / steps[-1]
        kept = np.setdiff1d(np.arange(2 * knots), [0, 1, 3, 2 * knots - 3, 2 * knots - 2, 2 * knots - 1])
        return cls(
            limits=limits,
            stations=stations,
            free=free.tocsc()[:, kept],
            scale=scale,
            basis=_basis(stations, scale, LIMIT_POINTS),
            weights=weights,
            guess=guess,
            cap=cap,
            jerk=limits.jerk / (1.0 + rounding),
            bend=np.stack([d3, 1.5 * d2, 0.5 * d1], axis=-2),
        )

    def tightened(self, over: Floats) -> _Program:
        """The same with lower limits of normal acceleration and jerk where time would have to stretch (2, K)."""
        normal, jerk = np.maximum(over, 1.0)
        return replace(self, cap=self.cap / normal[:, None] ** 2, jerk=self.jerk / jerk**3)

    @cached_property
    def hulls(self) -> tuple[Floats, Floats]:
        """(K, 2, 4) inner control values of x over its largest cap, and first two of x' over its limit: hulls."""
        h = np.diff(self.stations)[:, None]
        scale = np.concatenate([self.scale[:-1], self.scale[1:]], axis=1)
        zero = np.zeros_like(h)
        first = np.concatenate([zero + 1.0, h / 3.0, zero, zero], axis=1) * scale
        second = np.concatenate([zero, zero, zero + 1.0, -h / 3.0], axis=1) * scale
        start = np.concatenate([zero, zero + 1.0, zero, zero], axis=1) * scale
        values = np.stack([first, second], axis=1) / self.cap.max(axis=1)[:, None, None]
        slopes = np.stack([start, 3.0 * (second - first) / h], axis=1) / (2.0 * self.limits.acceleration)
        ends = [0, -1]  # constant jerk: largest at the knot, which the neighbour asks for, or the jerk
        values[ends] = 0.0
        slopes[ends] = 0.0
        slopes[-1, 0] = start[-1] / (2.0 * self.limits.acceleration)
        return values, slopes

    def values(self, unknowns: Floats) -> Floats:
        """(3, K, P) x and its two derivatives at the points."""
        return _values(self.basis, self.free @ unknowns)

    def time(self, unknowns: Floats) -> float:
        """Duration by Simpson's rule [s]."""
        x = self.values(unknowns)[0]
        return float((self.weights / np.sqrt(x)).sum()) if (x > 0.0).all() else math.inf

    def solve(self) -> Floats:
        """Rounds of cone programs, each with the tangents of the solution before; the unknowns of the best.

        Raises:
            InfeasibleError: A program that cannot be solved.
        """
        unknowns, best, reference = np.zeros(self.free.shape[1]), math.inf, self.guess
        gain = SHARP_GAIN_MIN if self.cap.min() < SHARP * self.cap.max() else ROUND_GAIN_MIN
        for _ in range(ROUNDS_MAX):
            candidate = self.round(reference)
            time = self.time(candidate)
            while best < time * (1.0 - 1e-6):  # any mean of two feasible motions is one
                candidate = 0.5 * (candidate + unknowns)
                time = self.time(candidate)
            if time < math.inf:
                settled = best - time < gain * best < math.inf
                unknowns, best = candidate, time
                if settled:
                    break
            # tangents may be taken anywhere above zero
            reference = np.maximum(self.values(candidate)[0], 0.02 * reference)
        if best == math.inf:
            raise InfeasibleError("no motion within the limits was found", remedy="bring the limits closer together")
        return unknowns

    def round(self, reference: Floats) -> Floats:
        """The best x whose jerk keeps the tangents at ``reference`` (K, P)."""
        from clarabel import clarabel  # type: ignore[attr-defined, unused-ignore]
        from scipy import sparse

        rows, of, right, cones = self._limits(reference)
        flat = len(rows) - 4 * cones
        # the time to second order about the reference, over what makes its slope 1
        curve = np.sqrt(0.75 * self.weights / reference**2.5)[..., None] * self.basis[0]
        gain = (1.25 * self.weights / reference**1.5)[..., None] * self.basis[0]
        every = np.repeat(np.arange(len(gain)), gain.shape[1])
        worth = self.free.T @ np.asarray(self._matrix(gain.reshape(-1, 4), every).sum(axis=0)).ravel()
        scale = np.abs(worth).sum()
        root = self._matrix(curve.reshape(-1, 4), every) @ self.free
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = 1e-6
        settings.tol_feas = 1e-8
        solution = clarabel.DefaultSolver(
            sparse.triu(root.T @ root / scale, format="csc"),
            -worth / scale,
            (self._matrix(rows, of) @ self.free).tocsc(),
            right,
            [clarabel.NonnegativeConeT(flat)] + [clarabel.SecondOrderConeT(4)] * cones,
            settings,
        ).solve()
        unknowns = np.array(solution.x)
        if not np.isfinite(unknowns).all():
            raise InfeasibleError(
                f"no motion within the limits was found: clarabel says {solution.status}",
                remedy="bring limits closer together",
            )
        return unknowns

    def _matrix(self, rows: Floats, of: Ints) -> Any:
        """Rows (R, 4) that belong to intervals ``of`` (R,), by all unknowns at the knots."""
        from scipy import sparse

        columns, start = 2 * of[:, None] + np.arange(4), 4 * np.arange(len(rows) + 1)
        return sparse.csr_matrix((rows.ravel(), columns.ravel(), start), shape=(len(rows), self.free.shape[0]))

    def _limits(self, reference: Floats) -> tuple[Floats, Ints, Floats, int]:
        """Rows (R, 4), their intervals, right sides (R,); the last are cones of four rows: how many."""
        basis = self.basis
        intervals = len(basis[0])
        interval = np.broadcast_to(np.arange(intervals)[:, None], reference.shape)
        x = basis[0, :, :2]
        values, slope = self.hulls
        size = (np.sqrt(reference) / self.jerk[:, None])[..., None]
        tangent = basis[0] / (2.0 * reference[..., None])  # sqrt(reference) / jerk |L[x]| <= 3/2 - tangent
        curved = np.abs(self.bend[:, :, :2]).max(axis=(2, 3)) > 0.0
        along = (basis[2] * (0.5 * size))[~curved]
        vector = np.einsum("dkpc,kpdn->kpnc", basis, self.bend * size[..., None])[curved]
        plain, at = interval[~curved], interval[:, :2].ravel()
        linear = [
            ((x / self.cap[:, :2, None]).reshape(-1, 4), at, 1.0),
            (-(basis[0, :, 0] / self.guess[:, :1])[1:], np.arange(1, intervals), 0.0),
            (values.reshape(-1, 4), at, 1.0),
            ((-values * (self.cap.max(axis=1) / self.guess[:, 0])[:, None, None]).reshape(-1, 4), at, 0.0),
            (slope.reshape(-1, 4), at, 1.0),
            (-slope.reshape(-1, 4), at, 1.0),
            (tangent[~curved] + along, plain, 1.5),
            (tangent[~curved] - along, plain, 1.5),
        ]
        cone = np.concatenate([tangent[curved][:, None], vector], axis=1)
        rows = np.concatenate([part[0] for part in linear] + [cone.reshape(-1, 4)])
        of = np.concatenate([part[1] for part in linear] + [np.repeat(interval[curved], 4)])
        right = np.concatenate(
            [np.full(len(part[0]), part[2]) for part in linear] + [np.tile([1.5, 0.0, 0.0, 0.0], len(cone))]
        )
        return rows, of, right, len(cone)

    def rows(self, unknowns: Floats) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Of M fine steps: length at the start and way (M,), speed and acceleration at both ends (M+1,), time (M,)."""
        local = self.free @ unknowns
        steps = np.diff(self.stations)
        share = np.arange(QUINTICS_PER_INTERVAL) / QUINTICS_PER_INTERVAL
        x, slope, _ = _values(_basis(self.stations, self.scale, share), local)
        inner = (share[:, None] + GAUSS_NODES / QUINTICS_PER_INTERVAL).ravel()
        pace = 1.0 / np.sqrt(_values(_basis(self.stations, self.scale, inner), local)[0])
        times = (pace.reshape(len(steps), QUINTICS_PER_INTERVAL, -1) * GAUSS_WEIGHTS).sum(axis=-1) * (
            steps[:, None] / QUINTICS_PER_INTERVAL
        )
        s = self.stations[:-1, None] + share * steps[:, None]
        inside = slice(1, -1)  # of the first and the last interval only the ends: there the jerk is constant
        v = np.sqrt(x[inside]).ravel()
        leave, arrive = v[0], math.sqrt(x[-1, 0])
        # not as differences of rounded lengths: in a blend of nanometres they would ask for a jerk
        fine = np.repeat(steps[inside] / QUINTICS_PER_INTERVAL, QUINTICS_PER_INTERVAL)
        ways = np.concatenate([steps[:1], fine, steps[-1:]])
        return (
            np.concatenate([self.stations[:1], s[inside].ravel(), self.stations[-2:-1]]),
            ways,
            np.concatenate([[0.0], v, [arrive, 0.0]]),
            np.concatenate([[0.0], 0.5 * slope[inside].ravel(), [0.5 * slope[-1, 0], 0.0]]),
            np.concatenate([[3.0 * steps[0] / leave], times[inside].ravel(), [3.0 * steps[-1] / arrive]]),
        )


def _basis(stations: Floats, scale: Floats, share: Floats) -> Floats:
    """(3, K, S, 4) x and its two derivatives at shares of every interval, by the scaled x and x' at both knots."""
    h = np.diff(stations)[:, None]
    t = share
    value = [1 - 3 * t**2 + 2 * t**3, t - 2 * t**2 + t**3, 3 * t**2 - 2 * t**3, t**3 - t**2]
    first = [6 * t**2 - 6 * t, 1 - 4 * t + 3 * t**2, 6 * t - 6 * t**2, 3 * t**2 - 2 * t]
    second = [12 * t - 6, 6 * t - 4, 6 - 12 * t, 6 * t - 2]
    cubic = np.stack([np.stack(rows, axis=-1) for rows in (value, first, second)])  # (3, S, 4)
    basis = cubic[:, None] / np.stack([h**0, h, h**2])[..., None]
    basis[..., 1::2] *= h[..., None]
    for k, away, mine in ((0, t, 2), (-1, 1.0 - t, 0)):  # x = x_knot (away)^(4/3)
        sign = 1.0 if k == 0 else -1.0
        basis[:, k] = 0.0
        away = np.maximum(away, 1e-12)
        basis[0, k, :, mine] = away ** (4.0 / 3.0)
        basis[1, k, :, mine] = sign * 4.0 / 3.0 * away ** (1.0 / 3.0) / h[k]
        basis[2, k, :, mine] = 4.0 / 9.0 * away ** (-2.0 / 3.0) / h[k] ** 2
    return np.asarray(basis * np.concatenate([scale[:-1], scale[1:]], axis=1)[:, None])


def _values(basis: Floats, unknowns: Floats) -> Floats:
    """(3, K, S) x and its derivatives from the unknowns (2K+2,)."""
    pairs = unknowns.reshape(-1, 2)
    return np.asarray(np.einsum("dksc,kc->dks", basis, np.concatenate([pairs[:-1], pairs[1:]], axis=1)))


def _quintics(s: Floats, way: Floats, v: Floats, a: Floats, steps: Floats) -> Floats:
    """(M, 6) polynomials through length, speed and acceleration at both ends of every step."""
    h = steps
    position = way - v[:-1] * h - 0.5 * a[:-1] * h**2
    speed = v[1:] - v[:-1] - a[:-1] * h
    acceleration = a[1:] - a[:-1]
    return np.stack(
        [
            s,
            v[:-1],
            0.5 * a[:-1],
            (10.0 * position - 4.0 * speed * h + 0.5 * acceleration * h**2) / h**3,
            (-15.0 * position + 7.0 * speed * h - acceleration * h**2) / h**4,
            (6.0 * position - 3.0 * speed * h + 0.5 * acceleration * h**2) / h**5,
        ],
        axis=1,
    )


def _slowing(path: Any, limits: LineSpeedLimits, knots: Floats, coefficients: Floats) -> tuple[float, Floats]:
    """By how much time must stretch for the true limits to hold; by normal acceleration and jerk for each piece."""
    end = np.polynomial.polynomial.polyval(knots[-1] - knots[-2], coefficients[-1])
    lengths = np.append(coefficients[:, 0], end)

    def stretches(t: Floats) -> Floats:
        out = np.empty((4, t.size))
        profile_states(knots, coefficients, t.ravel(), out)
        s, v, a, j = out.reshape(4, *t.shape)
        s = on_own_side(s, t, knots, lengths)
        tangential, normal, jerk = path_quantities(path, s, v, a, j)
        plain = np.maximum(v / limits.speed, np.sqrt(tangential / limits.acceleration))
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = np.where(v > 0.0, normal / (v * v), 0.0)
        jerk = jerk * (1.0 + ROUNDING * lengths[-1] * bend)  # as lengths are rounded
        return np.stack([plain, np.sqrt(normal / limits.normal), np.cbrt(jerk / limits.jerk)])

    sampled = stretches(knots[:-1, None] + shares(SAMPLES_PER_QUINTIC) * np.diff(knots)[:, None])
    # a peak of any kind may be higher between samples than all others at them
    worst = peaks(stretches, knots, sampled, np.full(3, sampled.max()), PEAK_CLOSENESS).max()
    return float(worst) * (1.0 + SLOWING_MARGIN), sampled[1:].max(axis=2)
