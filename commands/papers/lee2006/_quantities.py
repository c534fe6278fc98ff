"""The values and figures of Lee, Ryu, Cheong (2006), beside ours. The paper's unit of length is the millimetre."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.papers._reproduction import Quantity
from armtempo.planners import BlendCell, BlendedPath, Line, PredictorCorrector, blend
from armtempo.planners.blends import Blend, ExactMapping, LengthMapping, arc_length

MM = 1e3  # per metre
TICK = 0.002  # [s] the paper's control period, which it does not print; all its instants are multiples of it
REMAINING_MM = (30.0, 25.0, 20.0, 15.0)  # Table 2, Figs. 3, 5, 6
Column = tuple[tuple[float, ...], float, Callable[[float], float]]
TABLE2: dict[str, Column] = {  # L_s / L_r: printed, angle [deg], shape factor by remaining distance
    "α = 30, 90°": ((0.530, 0.495, 0.443, 0.354), 90.0, lambda remaining: 30.0 / remaining),
    "α = L_r, 90°": ((0.530,) * 4, 90.0, lambda remaining: 1.0),
    "α = L_r, 45°": ((0.693,) * 4, 45.0, lambda remaining: 1.0),
}
WINDOWS = (0.356, 0.628, 0.982, 1.254)  # [s] when the blends begin and end


class Run(NamedTuple):
    """The paper's simulation, sampled at its ticks."""

    time: Floats  # (T,) [s]
    s: Floats  # (T,) travelled length [m]
    v: Floats  # (T,) line speed [m/s]
    a: Floats  # (T,) line acceleration [m/s^2]
    p: Floats  # (T, 3) exact positions [m]
    velocity: Floats  # (T, 3) [m/s]
    acceleration: Floats  # (T, 3) [m/s^2]
    mapped: Floats  # (T, 3) positions by the paper's mapping [m]
    q: Floats  # (T, 4) joints [rad, m]
    qd: Floats
    qdd: Floats


def corner(angle_deg: float, remaining: float, shape_factor: float) -> Blend:
    """The blend of two lines that meet at the origin under an angle, the first along x; lengths in the same unit."""
    turned = math.radians(angle_deg)
    far = 2.0 * remaining * np.array([math.cos(turned), math.sin(turned), 0.0])
    near = np.array([2.0 * remaining, 0.0, 0.0])
    return blend(Line(near, np.zeros(3)), Line(np.zeros(3), far), remaining, shape_factor)


def run(cell: BlendCell) -> Run:
    """The paper's run at its ticks: profile and mapping of the paper beside the exact one."""
    profile, path = cell.line_speed, cell.blended
    time = np.arange(0.0, profile.duration + TICK, TICK)
    s, v, a, _ = profile.at(time)
    p, tangent, curvature = path.evaluate(s)
    q, dq, ddq = cell.path.evaluate(s)
    return Run(
        time, s, v, a, p, tangent * v[:, None], curvature * (v**2)[:, None] + tangent * a[:, None],
        PredictorCorrector(path).positions(s), q, dq * v[:, None], ddq * (v**2)[:, None] + dq * a[:, None],
    )  # fmt: skip


def compare(cell: BlendCell, sampled: Run) -> list[Quantity]:
    """Every number of the paper, and what it leaves out, beside ours."""
    return [*_table2(), *_shape(), *_simulation(cell, sampled), *_beyond(cell, sampled)]


def _table2() -> list[Quantity]:
    values = []
    for column, (printed, angle, factor) in TABLE2.items():
        for remaining, gamma in zip(REMAINING_MM, printed, strict=True):
            ours = corner(angle, remaining, factor(remaining)).deviation / remaining
            slip = "0.44194: the print rounds up" if gamma == 0.443 else ""
            values.append(
                Quantity("Table 2: γ = L_s / L_r", f"{column}, L_r = {remaining:g} mm", "1", gamma, ours, 3, slip)
            )
    return values


def _shape() -> list[Quantity]:
    section = "Curvature where a blend begins (90°)"
    values = []
    for factor, note in ((1.0, "jumps"), (2.0, "jumps"), (3.0, "exactly continuous, at every angle: a theorem")):
        _, _, bend = corner(90.0, 150.0, factor).evaluate(0.0)
        values.append(
            Quantity(section, f"λ = {factor:g}, L_r = 150 mm", "1/m", None, MM * float(np.linalg.norm(bend)), 6, note)
        )
    values.append(
        Quantity(section, "length of the blend, λ = 3", "mm", None, corner(90.0, 150.0, 3.0).length, 4, "1.80214 L_r")
    )
    return values


def _simulation(cell: BlendCell, sampled: Run) -> list[Quantity]:
    section = "Section IV: SCARA simulation"
    path, profile = cell.blended, cell.line_speed
    ends = path.breakpoints
    names = ("first line", "first blend", "second line", "second blend", "arc")
    values = [
        Quantity(section, f"length of the {name}", "mm", None, MM * float(length), 2)
        for name, length in zip(names, np.diff(ends), strict=True)
    ]
    instants = [float(profile.time_at(float(s))) for s in ends[1:-1]]
    whats = ("first blend begins", "first blend ends", "second blend begins", "second blend ends")
    for k, (what, paper, ours) in enumerate(zip(whats, WINDOWS, instants, strict=True)):
        values.append(Quantity(section, what, "s", paper, ours, 4, "the paper seems to repeat a sample per piece:"))
        values.append(Quantity(section, f"  and {k + 3} repeated samples", "s", paper, ours + TICK * (k + 3), 4))
    values += [
        Quantity(section, "duration of the first blend", "s", 0.272, instants[1] - instants[0]),
        Quantity(section, "duration of the line between", "s", None, instants[2] - instants[1]),
        Quantity(section, "duration of the second blend", "s", 0.272, instants[3] - instants[2]),
        Quantity(section, "duration of the run", "s", None, profile.duration),
        Quantity(section, "largest acceleration of the ramp", "mm/s²", None, MM * float(np.abs(sampled.a).max()), 1,
                 "5000 is its mean"),
    ]  # fmt: skip
    for k, (first, last) in enumerate(((1, 2), (3, 4)), start=1):
        within = (sampled.s > ends[first]) & (sampled.s < ends[last])
        error = MM * differenced_error(sampled.mapped, sampled.s)[within[1:]]
        worst, note = float(error[np.abs(error).argmax()]), "from point to point; a quarter of it is chord against arc"
        values.append(Quantity(section, f"speed error in blend {k}, the paper's way", "mm/s", -0.4, worst, 2, note))
    return values


def differenced_error(points: Floats, s: Floats) -> Floats:
    """(T-1,) what the speed from point to point differs from that along the path [m/s]."""
    return np.asarray((np.linalg.norm(np.diff(points, axis=0), axis=1) - np.diff(s)) / TICK)


def _arc_error(path: BlendedPath, s: Floats, mapping: LengthMapping) -> float:
    """The largest error of the speed inside the blends, by the lengths of the curve between ticks [%]."""
    pieces, u = mapping.parameters(s)
    worst = 0.0
    for k, piece in enumerate(path.pieces):
        if isinstance(piece, Blend):
            inside = pieces == k
            error = np.diff(arc_length(piece, u[inside])) / np.diff(s[inside]) - 1.0
            worst = max(worst, float(np.abs(error).max()))
    return 100.0 * worst


def _beyond(cell: BlendCell, sampled: Run) -> list[Quantity]:
    section = "Not printed"
    path, limits = cell.blended, cell.limits
    quintic = cell.variant(curve="quintic")
    exact = MM * differenced_error(sampled.p, sampled.s)
    normal = np.linalg.norm(
        sampled.acceleration - sampled.velocity * (sampled.a / np.maximum(sampled.v, 1e-12))[:, None], axis=1
    )
    kept = f"normal acceleration {limits.normal:g} m/s², vector jerk {limits.jerk:g} m/s³"
    rows: tuple[tuple[str, str, float, int, str], ...] = (
        (
            "speed error along the path, the paper's way",
            "%",
            _arc_error(path, sampled.s, PredictorCorrector(path)),
            4,
            "",
        ),
        ("speed error along the path, exact mapping", "%", _arc_error(path, sampled.s, ExactMapping(path)), 12, ""),
        ("speed error, exact mapping", "mm/s", float(exact[np.abs(exact).argmax()]), 3, "all of it chord against arc"),
        ("largest normal acceleration", "mm/s²", MM * float(normal.max()), 0, "five times the limit along the path"),
        ("largest joint speed", "rad/s", float(np.abs(sampled.qd[:, :2]).max()), 2, ""),
        ("largest joint acceleration", "rad/s²", float(np.abs(sampled.qdd[:, :2]).max()), 1, ""),
        ("curvature jump at the arc, cubic", "1/m", _jump(path, 4), 6, "2 / (3 R); a quintic has none"),
        (
            "duration, limit-aware",
            "s",
            cell.limit_aware.duration,
            4,
            f"{kept}; stops at both ends of the cubic beside the arc",
        ),
        ("duration, limit-aware, quintic blends", "s", quintic.limit_aware.duration, 4, kept),
    )
    return [Quantity(section, what, unit, None, ours, digits, note) for what, unit, ours, digits, note in rows]


def _jump(path: BlendedPath, joint: int) -> float:
    s = path.breakpoints[joint]
    before, after = path.evaluate(s, before=True)[2], path.evaluate(s)[2]
    return float(np.linalg.norm(after - before))
