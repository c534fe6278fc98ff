"""Limit-aware line speed: limits on many random paths, a direct optimum, and what others make of the same corners.

``ARMTEMPO_BENCH_PATHS`` sets how many random paths are tried (300; the claim is made for 10 000),
``ARMTEMPO_BENCH_OPTIMA`` for how many the optimum is found (100, limits as arms have them).
"""

from __future__ import annotations

import os
import time
from typing import Any

import casadi
import numpy as np
import toppra
from rich.console import Console
from rich.table import Table
from ruckig import InputParameter, Result, Ruckig, Trajectory

from armtempo.arrays import Floats
from armtempo.planners import Arc, BlendedPath, Line, LineSpeedLimits, LineSpeedProfile, limit_aware_profile

PATHS = int(os.environ.get("ARMTEMPO_BENCH_PATHS", "300"))
OPTIMA = int(os.environ.get("ARMTEMPO_BENCH_OPTIMA", "100"))
SHARP = (443, 706, 834, 5138)  # with peaks between the samples, once missed
TABLE = 30


def _unit(v: Floats) -> Floats:
    return np.asarray(v / np.linalg.norm(v))


def corners(seed: int, count: int = 4) -> tuple[Floats, Floats]:
    """Points of a polyline in 3-D, and remaining distances for its corners."""
    rng = np.random.default_rng(seed)
    points = [rng.uniform(-0.5, 0.5, 3)]
    while len(points) < count + 2:
        step = rng.uniform(-0.5, 0.5, 3) - points[-1]
        if np.linalg.norm(step) < 0.15:
            continue
        if len(points) > 1 and not -0.9 < _unit(step) @ _unit(points[-1] - points[-2]) < 0.98:
            continue
        points.append(points[-1] + step)
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.array(points), rng.uniform(0.15, 0.45, count) * np.minimum(lengths[:-1], lengths[1:])


def polyline(seed: int, count: int = 4) -> BlendedPath:
    """Cubic blends of lambda = 3: G2."""
    return BlendedPath.through(*corners(seed, count))


def chain(seed: int, count: int = 4) -> BlendedPath:
    """Lines and arcs in 3-D that meet in corners, quintic blends: G2."""
    rng = np.random.default_rng(seed)
    segments: list[Line | Arc] = []
    point, heading = rng.uniform(-0.5, 0.5, 3), _unit(rng.normal(size=3))
    for _ in range(count + 1):
        turned = heading
        while segments and not -0.85 < turned @ heading < 0.97:
            turned = _unit(rng.normal(size=3))
        heading, length = turned, rng.uniform(0.15, 0.8)
        end = point + length * heading
        if rng.random() < 0.5:
            segments.append(Line(point, end))
        else:
            angle, side = rng.uniform(0.3, 1.8), _unit(np.cross(heading, rng.normal(size=3)))
            center = point + length / angle * side
            end = center + length / angle * (np.sin(angle) * heading - np.cos(angle) * side)
            segments.append(Arc(point, end, center, np.cross(heading, side)))
            heading = _unit(np.cos(angle) * heading + np.sin(angle) * side)
        point = end
    lengths = np.array([segment.length for segment in segments])
    remaining = rng.uniform(0.15, 0.45, count) * np.minimum(lengths[:-1], lengths[1:])
    return BlendedPath(segments, remaining, curve="quintic")


def robot_limits(seed: int) -> LineSpeedLimits:
    """Limits as arms have them: 0.2-2 m/s, 1-10 m/s^2, 20-400 m/s^3."""
    rng = np.random.default_rng(seed + 10**6)
    speed, acceleration, jerk = 10.0 ** rng.uniform([-0.7, 0.0, 1.3], [0.3, 1.0, 2.6])
    return LineSpeedLimits(speed=speed, acceleration=acceleration, jerk=jerk)


def any_limits(seed: int) -> LineSpeedLimits:
    """Limits over two to four decades each."""
    rng = np.random.default_rng(seed + 10**6)
    speed, acceleration, normal, jerk = 10.0 ** rng.uniform([-1.3, -1.0, -1.0, 0.0], [0.7, 1.7, 1.7, 3.7])
    return LineSpeedLimits(speed=speed, acceleration=acceleration, jerk=jerk, normal_acceleration=normal)


def worst_ratio(path: BlendedPath, profile: LineSpeedProfile, limits: LineSpeedLimits, samples: int = 40000) -> float:
    """The worst ratio to the limits at even instants; written apart from the library's own certificate."""
    s, v, a, j = profile.at(np.linspace(0.0, profile.duration, samples))
    _, d1, d2, d3 = path.derivatives(s)
    acceleration = d1 * a[:, None] + d2 * (v**2)[:, None]
    jerk = d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None]
    along = (acceleration * d1).sum(axis=1)
    across = np.linalg.norm(acceleration - along[:, None] * d1, axis=1)
    return float(
        max(
            v.max() / limits.speed,
            np.abs(along).max() / limits.acceleration,
            across.max() / limits.normal,
            np.linalg.norm(jerk, axis=1).max() / limits.jerk,
        )
    )


def test_random_paths_keep_all_limits() -> None:
    worst, spent, above, bounding = [], [], [], []
    for seed in (*range(PATHS), *SHARP):
        path = (polyline, chain)[seed % 2](seed)
        limits = (robot_limits, any_limits)[seed // 2 % 2](seed)
        start = time.perf_counter()
        profile = limit_aware_profile(path, limits)
        spent.append(time.perf_counter() - start)
        worst.append(worst_ratio(path, profile, limits))
        assert worst[-1] <= 1.0 + 1e-6, (seed, worst[-1])
        assert profile.certificate.gap < 1e-9
        start = time.perf_counter()
        above.append(profile.duration / profile.bound.seconds)
        bounding.append(time.perf_counter() - start)
        assert above[-1] >= 1.0, (seed, above[-1])
    Console(width=120).print(
        f"\n{PATHS} paths of 4 corners: worst ratio - 1 = {max(worst) - 1.0:.2e}, smallest {min(worst):.4f}; "
        f"{1e3 * np.median(spent):.0f} ms each (median), {1e3 * max(spent):.0f} ms at most; "
        f"over their bounds {np.median(above):.4f} (median), {np.quantile(above, 0.9):.3f} (p90), {max(above):.2f}; "
        f"a bound takes {1e3 * np.median(bounding):.1f} ms (median)"
    )


def direct_optimum(path: BlendedPath, limits: LineSpeedLimits, start: LineSpeedProfile | None = None) -> float | None:
    """Least time by direct collocation: N = 500 steps of constant jerk along the path, ipopt; None if it fails.

    States v and a at fixed lengths, jerk and duration of every step free. Constraints at both ends of every step.
    """
    share = np.linspace(0.0, 1.0, 501)
    s = path.length * (share - 0.85 * np.sin(2.0 * np.pi * share) / (2.0 * np.pi))  # denser at the ends
    for mark in path.breakpoints[1:-1]:
        s[np.argmin(np.abs(s - mark))] = mark
    h = np.diff(s)
    before, after = path.derivatives(s[:-1] + 1e-6 * h)[1:], path.derivatives(s[1:] - 1e-6 * h)[1:]
    v, a, dt = casadi.SX.sym("v", 501), casadi.SX.sym("a", 501), casadi.SX.sym("dt", 500)
    jerk = (a[1:] - a[:-1]) / dt
    speeds = (v[1:] - v[:-1] - dt * (a[1:] + a[:-1]) / 2.0) / limits.speed
    lengths = (v[:-1] * dt + a[:-1] * dt**2 / 3.0 + a[1:] * dt**2 / 6.0) / h - 1.0
    jerks = [
        sum((d1[:, k] * jerk + 3.0 * d2[:, k] * vs * accs + d3[:, k] * vs**3) ** 2 for k in range(3)) / limits.jerk**2
        for (d1, d2, d3), vs, accs in ((before, v[:-1], a[:-1]), (after, v[1:], a[1:]))
    ]
    bend = np.linalg.norm(np.concatenate([before[1], after[1][-1:]]), axis=1)
    v_max = np.minimum(limits.speed, np.sqrt(limits.normal / np.maximum(bend, 1e-12)))
    a_max = np.full(501, limits.acceleration)
    v_max[[0, -1]] = a_max[[0, -1]] = 0.0
    if start is None:
        away = np.minimum(s, path.length - s)
        v0 = np.minimum(0.5 * v_max, 0.6 * (4.5 * limits.jerk * away**2) ** (1.0 / 3.0))
        dt0 = 2.0 * h / (v0[1:] + v0[:-1])
        a0 = np.gradient(0.5 * v0**2, s).clip(-a_max, a_max)
    else:
        times = start.time_at(s)
        _, v0, a0, _ = start.at(times)
        dt0 = np.diff(times)
    problem = {
        "x": casadi.vertcat(v, a, dt),
        "f": casadi.sum1(dt),
        "g": casadi.vertcat(speeds, lengths, *jerks),
    }
    options: dict[str, Any] = {
        "print_time": 0,
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-7,
        "ipopt.max_iter": 300,
    }
    solver: Any = casadi.nlpsol("optimum", "ipopt", problem, {**options, "ipopt.mu_strategy": "adaptive"})
    found = solver(
        x0=np.concatenate([v0, a0, dt0]),
        lbx=np.concatenate([np.zeros(501), -a_max, np.full(500, 1e-7)]),
        ubx=np.concatenate([v_max, a_max, np.full(500, np.inf)]),
        lbg=np.concatenate([np.zeros(1000), np.full(1000, -np.inf)]),
        ubg=np.concatenate([np.zeros(1000), np.ones(1000)]),
    )
    return float(found["f"]) if solver.stats()["success"] else None


def test_close_to_the_direct_optimum() -> None:
    ratios, unsolved = [], 0
    for seed in range(OPTIMA):
        path, limits = (polyline, chain)[seed % 2](seed), robot_limits(seed)
        profile = limit_aware_profile(path, limits)
        optima = [direct_optimum(path, limits), direct_optimum(path, limits, profile)]
        found = [optimum for optimum in optima if optimum is not None]
        unsolved += not found
        if found:
            ratios.append(profile.duration / min(found))
    low, median, high = np.min(ratios), np.median(ratios), np.max(ratios)
    Console(width=120).print(
        f"\n{len(ratios)} paths ({unsolved} without an optimum): duration / optimum "
        f"{low:.4f} at least, {median:.4f} median, {high:.4f} at most"
    )
    assert len(ratios) >= 0.95 * OPTIMA
    assert median <= 1.05
    assert high <= 1.10


def stretched(path: BlendedPath, profile: LineSpeedProfile, limits: LineSpeedLimits) -> tuple[float, float]:
    """Duration of a profile slowed as a whole until every limit holds, and its worst ratio then."""
    s, v, a, j = profile.at(np.linspace(0.0, profile.duration, 40000))
    _, d1, d2, d3 = path.derivatives(s)
    jerk = np.linalg.norm(d1 * j[:, None] + 3.0 * d2 * (v * a)[:, None] + d3 * (v**3)[:, None], axis=1)
    pull = np.maximum(np.abs(a) / limits.acceleration, np.linalg.norm(d2, axis=1) * v**2 / limits.normal)
    slower = float(max(v.max() / limits.speed, np.sqrt(pull.max()), np.cbrt(jerk.max() / limits.jerk)))
    slow = LineSpeedProfile(
        knots=profile.knots * slower,
        coefficients=profile.coefficients / slower ** np.arange(6),
        limits=limits,
        length=profile.length,
    )
    return slow.duration, worst_ratio(path, slow, limits)


def toppra_and_ruckig(path: BlendedPath, limits: LineSpeedLimits, every: float = 0.1) -> tuple[float, float]:
    """Time-optimal without jerk, states every 0.1 s joined by ruckig, the whole stretched until all limits hold.

    Duration, and the worst ratio to the limits.
    """
    grid = np.linspace(0.0, path.length, 1500)
    bend = np.linalg.norm(path.derivatives(grid)[2], axis=1)
    speed = np.minimum(limits.speed, np.sqrt(limits.normal / np.maximum(bend, 1e-12)))
    way = toppra.SplineInterpolator(grid, grid[:, None])

    def bounds(s: float) -> Floats:
        cap = float(np.interp(s, grid, speed))
        return np.array([[-cap, cap]])

    def pull(s: float) -> Floats:
        return np.array([[-limits.acceleration, limits.acceleration]])

    constraints = [
        toppra.constraint.JointVelocityConstraintVarying(bounds),
        toppra.constraint.JointAccelerationConstraint(pull(0.0)),
    ]
    solver = toppra.algorithm.TOPPRA(constraints, way, gridpoints=grid, parametrizer="ParametrizeConstAccel")
    fast: Any = solver.compute_trajectory(0.0, 0.0)
    times = np.linspace(0.0, fast.duration, max(round(fast.duration / every), 2) + 1)
    states = [(float(fast(t)[0]), float(fast(t, 1)[0]), float(fast(t, 2)[0])) for t in times]
    states[0], states[-1] = (0.0, 0.0, 0.0), (path.length, 0.0, 0.0)
    for slower in 1.1 ** np.arange(40):
        rows, steps = [], []
        now = states[0]
        for s, v, a in states[1:]:
            wanted, found = InputParameter(1), Trajectory(1)
            wanted.current_position, wanted.current_velocity, wanted.current_acceleration = ([x] for x in now)
            v, a = max(v, 0.0) / slower, a / slower**2
            room = np.sqrt(2.0 * limits.jerk * max(min(v, limits.speed - v), 0.0))  # or the speed passes its limits
            now = (s, v, float(np.clip(a, -room, room)))
            wanted.target_position, wanted.target_velocity, wanted.target_acceleration = ([x] for x in now)
            wanted.max_velocity, wanted.max_acceleration = [limits.speed * 1.001], [limits.acceleration * 1.001]
            wanted.max_jerk = [limits.jerk]
            if Ruckig(1).calculate(wanted, found) != Result.Working:
                break
            part = found.profiles[0][0]
            for piece in range(7):
                if part.t[piece] > 1e-12:
                    rows.append([part.p[piece], part.v[piece], 0.5 * part.a[piece], part.j[piece] / 6.0, 0.0, 0.0])
                    steps.append(part.t[piece])
        else:
            knots = np.concatenate([[0.0], np.cumsum(steps)])
            profile = LineSpeedProfile(knots=knots, coefficients=np.array(rows), limits=limits, length=path.length)
            if profile.at(profile.samples())[1].min() > -1e-9:  # it does not run back to meet a way-state
                return stretched(path, profile, limits)
    return np.inf, np.nan


def pilz(points: Floats, remaining: Floats, limits: LineSpeedLimits) -> tuple[float, float, float, float]:
    """Moves from stop to stop, blended in time: x1 + alpha (x2 - x1). Duration stretched and not, worst ratios then."""
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    moves = [LineSpeedProfile.plan(float(length), limits) for length in lengths]
    total = sum(move.duration for move in moves)
    stretch, found = 1.0, []  # of every blend: worst speed, pull and jerk over their limits
    ratio = max(move.certificate.ratio_max for move in moves)
    for k, radius in enumerate(remaining):
        one, two, u1, u2 = moves[k], moves[k + 1], _unit(legs[k]), _unit(legs[k + 1])
        lasts = [one.duration - float(one.time_at(lengths[k] - radius)), float(two.time_at(radius))]
        blend = max(lasts)
        total -= min(lasts)  # both moves run at the same time
        t = np.linspace(0.0, blend, 4000)
        s1, v1, a1, j1 = one.at(one.duration - lasts[0] + t)
        s2, v2, a2, j2 = two.at(t - (blend - lasts[1]))
        over = [np.where(t > lasts[0], 0.0, x) for x in (v1, a1, j1)]
        rest = [np.where(t < blend - lasts[1], 0.0, x) for x in (v2, a2, j2)]
        x = [-(lengths[k] - s1)[:, None] * u1, *(value[:, None] * u1 for value in over)]
        y = [s2[:, None] * u2, *(value[:, None] * u2 for value in rest)]
        w = t / blend
        d0, d1, d2, d3 = (
            value[:, None]
            for value in (
                6 * w**5 - 15 * w**4 + 10 * w**3,
                (30 * w**4 - 60 * w**3 + 30 * w**2) / blend,
                (120 * w**3 - 180 * w**2 + 60 * w) / blend**2,
                (360 * w**2 - 360 * w + 60) / blend**3,
            )
        )
        z = [q - p for p, q in zip(x, y, strict=True)]
        velocity = x[1] + d1 * z[0] + d0 * z[1]
        acceleration = x[2] + d2 * z[0] + 2 * d1 * z[1] + d0 * z[2]
        jerk = np.linalg.norm(x[3] + d3 * z[0] + 3 * d2 * z[1] + 3 * d1 * z[2] + d0 * z[3], axis=1)
        speed = np.linalg.norm(velocity, axis=1)
        along = np.abs((velocity * acceleration).sum(axis=1)) / np.maximum(speed, 1e-9)
        across = np.sqrt(np.maximum((acceleration**2).sum(axis=1) - along**2, 0.0))
        pull = max(along.max() / limits.acceleration, across.max() / limits.normal)
        third = jerk.max() / limits.jerk
        stretch = max(stretch, speed.max() / limits.speed, np.sqrt(pull), np.cbrt(third))
        found.append((speed.max() / limits.speed, pull, third))
    slow = max(max(v / stretch, a / stretch**2, j / stretch**3) for v, a, j in found)
    return total * stretch, total, max(slow, ratio / stretch), max(ratio, *(max(each) for each in found))


def test_table_of_methods() -> None:
    names = [
        "limit-aware",
        "stop at every corner",
        "toppra + ruckig",
        "Pilz, stretched",
        "Pilz, as it is",
        "line speed",
    ]
    rows, violations = [], []
    for seed in range(TABLE):
        (points, remaining), limits = corners(seed), robot_limits(seed)
        path = BlendedPath.through(points, remaining)
        ours = limit_aware_profile(path, limits)
        moves = [LineSpeedProfile.plan(float(x), limits) for x in np.linalg.norm(np.diff(points, axis=0), axis=1)]
        stop, stop_ratio = sum(move.duration for move in moves), max(move.certificate.ratio_max for move in moves)
        smoothed, smoothed_ratio = toppra_and_ruckig(path, limits)
        slow, fast, slow_ratio, fast_ratio = pilz(points, remaining, limits)
        paper = LineSpeedProfile.plan(path.length, limits)
        rows.append([ours.duration, stop, smoothed, slow, fast, paper.duration])
        ours_ratio, paper_ratio = (worst_ratio(path, profile, limits) for profile in (ours, paper))
        violations.append([ours_ratio, stop_ratio, smoothed_ratio, slow_ratio, fast_ratio, paper_ratio])
    times, worst = np.array(rows), np.array(violations)
    relative = times / times[:, :1]
    table = Table("method", "time / ours: median", "least", "most", "worst ratio to the limits: median", "most")
    for k, name in enumerate(names):
        low, median, high = relative[:, k].min(), np.median(relative[:, k]), relative[:, k].max()
        table.add_row(name, f"{median:.3f}", f"{low:.3f}", f"{high:.3f}", f"{np.nanmedian(worst[:, k]):.3f}",
                      f"{np.nanmax(worst[:, k]):.3f}")  # fmt: skip
    Console(width=120).print(table)
    assert (relative[:, 1:4] > 1.0).all()  # on every path
    assert np.nanmax(worst[:, :4]) <= 1.0 + 1e-5
