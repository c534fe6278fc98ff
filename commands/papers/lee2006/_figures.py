"""Figs. 3, 5-9 and 13-18 of Lee, Ryu, Cheong (2006) from our data."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from armtempo.commands.figures._style import ARM_COLORS, FAINT, INK, MUTED, new_figure, note, styled
from armtempo.commands.papers.lee2006._quantities import MM, REMAINING_MM, TICK, Run, corner, differenced_error
from armtempo.planners import BlendCell, BlendedPath
from armtempo.planners.blends import Blend

SHADES = ("#24476B", "#3F6F9F", "#6B9AC4", "#9CC3E0")  # of one family of curves, the largest first
STEP_MM = 1.0  # between the points of Figs. 8 and 9
BLENDED = "#F3E3D3"  # while the arm is in a blend


def lee2006_figures(cell: BlendCell, run: Run) -> dict[str, Figure]:
    """All figures by file name."""
    return {
        "fig3_constant_alpha": _family(
            90.0, lambda remaining: 30.0 / remaining, "Fig. 3  α = 30: the shape depends on L_r"
        ),
        "fig5_similar_90deg": _family(90.0, lambda _: 1.0, "Fig. 5  α = λ L_r, λ = 1: similar curves, 90°"),
        "fig6_similar_45deg": _family(45.0, lambda _: 1.0, "Fig. 6  α = λ L_r, λ = 1: similar curves, 45°"),
        "fig7_shape_factor": _shape_factors(),
        "fig8_variations_lambda1": _variations(1.0, "Fig. 8  Points 1 mm apart, λ = 1"),
        "fig9_variations_lambda3": _variations(3.0, "Fig. 9  Points 1 mm apart, λ = 3"),
        "fig13_path": _path(cell, run),
        "fig14_position": _over_time(cell, run, "Fig. 14  Cartesian position", [("position [mm]", MM * run.p, "xyz")]),
        "fig15_velocity_acceleration": _over_time(
            cell,
            run,
            "Fig. 15  Cartesian velocity and acceleration",
            [("velocity [mm/s]", MM * run.velocity, "xyz"), ("acceleration [m/s²]", run.acceleration, "xyz")],
        ),
        "fig16_joints": _over_time(
            cell,
            run,
            "Fig. 16  Joint positions",
            [
                ("angle [deg]", np.rad2deg(run.q[:, [0, 1, 3]]), ("θ₁", "θ₂", "θ₄")),
                ("d₃ [mm]", MM * run.q[:, 2:3], ("d₃",)),
            ],
        ),
        "fig17_joint_speeds": _over_time(
            cell,
            run,
            "Fig. 17  Joint speeds and accelerations",
            [("speed [rad/s]", run.qd[:, :2], ("θ₁", "θ₂")), ("acceleration [rad/s²]", run.qdd[:, :2], ("θ₁", "θ₂"))],
        ),
        "fig18_line_speed": _line_speed(cell, run),
    }


def _draw_corner(axes: Axes, angle_deg: float, longest: float) -> None:
    turned = np.deg2rad(angle_deg)
    for x, y in ((1.0, 0.0), (np.cos(turned), np.sin(turned))):
        axes.plot([0.0, 1.25 * longest * x], [0.0, 1.25 * longest * y], color=FAINT, linewidth=4.0, zorder=1)
    axes.set_aspect("equal")
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")


def _draw_blend(axes: Axes, curve: Blend, color: str, label: str) -> None:
    p = curve.evaluate(np.linspace(0.0, curve.length, 200))[0]
    axes.plot(p[:, 0], p[:, 1], color=color, label=label)
    axes.plot(p[[0, -1], 0], p[[0, -1], 1], "o", color=color, markersize=3.5)


@styled
def _family(angle_deg: float, factor: Callable[[float], float], title: str) -> Figure:
    figure = new_figure(5.2, 4.6)
    axes = figure.subplots()
    _draw_corner(axes, angle_deg, max(REMAINING_MM))
    for remaining, color in zip(REMAINING_MM, SHADES, strict=True):
        curve = corner(angle_deg, remaining, factor(remaining))
        _draw_blend(axes, curve, color, f"L_r = {remaining:g} mm, γ = {curve.deviation / remaining:.3f}")
    axes.legend(loc="upper right" if angle_deg > 60.0 else "upper left")
    axes.set_title(title)
    return figure


@styled
def _shape_factors() -> Figure:
    figure = new_figure(5.2, 4.6)
    axes = figure.subplots()
    remaining = max(REMAINING_MM)
    _draw_corner(axes, 90.0, remaining)
    for factor, color in ((1.0, ARM_COLORS[0]), (3.0, ARM_COLORS[1])):
        curve = corner(90.0, remaining, factor)
        _draw_blend(axes, curve, color, f"λ = {factor:g}, γ = {curve.deviation / remaining:.3f}")
    axes.legend(loc="upper right")
    axes.set_title("Fig. 7  A larger λ keeps closer to the corner")
    return figure


@styled
def _variations(factor: float, title: str) -> Figure:
    """First and second differences of points at equal lengths, through a corner of 90 degrees with L_r = 150 mm."""
    remaining = 0.150
    path = BlendedPath.through(
        [[2.0 * remaining, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 2.0 * remaining, 0.0]], remaining, shape_factor=factor
    )
    s = np.arange(0.0, path.length, STEP_MM / MM)
    points = MM * path.position(s)
    first, second = np.diff(points, axis=0), np.diff(points, n=2, axis=0)
    figure = new_figure(7.2, 5.0)
    above, below = figure.subplots(2, 1, sharex=True)
    for axes, values, name in ((above, first, "V"), (below, second, "A")):
        at = MM * s[len(s) - len(values) :]
        for k, axis in enumerate("xy"):
            axes.plot(at, values[:, k], color=ARM_COLORS[k], label=f"{axis}")
        axes.plot(at, np.linalg.norm(values, axis=1), color=INK, linewidth=1.0, linestyle=(0, (4, 2)), label="norm")
        for end in path.breakpoints[1:-1]:
            axes.axvline(MM * end, color=MUTED, linewidth=0.8, linestyle=":")
        axes.set_ylabel(f"{name}ₙ [mm]")
    above.legend(loc="center left", bbox_to_anchor=(0.02, 0.7), ncols=3)
    below.set_xlabel("travelled length [mm]")
    above.set_title(title)
    behind = MM * (s[2:] - path.breakpoints[1])  # a second difference is behind the junction with all of its points
    jump = float(np.linalg.norm(second, axis=1)[np.abs(behind) < 2.5 * STEP_MM].max())
    below.set_ylim(top=1.3 * float(np.linalg.norm(second, axis=1).max()))
    note(below, 0.01, 0.92, f"largest |Aₙ| where the blend begins: {1e3 * jump:.2g} µm")
    return figure


@styled
def _path(cell: BlendCell, run: Run) -> Figure:
    """The path in space, from above and from the side."""
    figure = new_figure(9.6, 4.4)
    above, side = figure.subplots(1, 2)
    path = cell.blended
    p = MM * path.position(np.linspace(0.0, path.length, 1500))
    blends = [MM * path.position(np.linspace(path.breakpoints[k], path.breakpoints[k + 1], 200)) for k in (1, 3)]
    for axes, (i, j) in ((above, (0, 1)), (side, (0, 2))):
        axes.plot(p[:, i], p[:, j], color=ARM_COLORS[0], label="lines and arc")
        for k, blend in enumerate(blends):
            axes.plot(blend[:, i], blend[:, j], color=ARM_COLORS[1], linewidth=2.6, label="blends" if k == 0 else None)
        axes.plot(*p[0, [i, j]], "o", color=INK, markersize=5)
        axes.annotate("start", p[0, [i, j]], xytext=(0, 8), textcoords="offset points", ha="center")
        axes.set_xlabel("x [mm]")
    above.set_ylabel("y [mm]")
    above.set_aspect("equal")
    above.legend(loc="lower left")
    side.set_ylabel("z [mm]")
    above.set_title("Fig. 13  The path from above")
    side.set_title("and from the side: the arc stands upright")
    return figure


def _shade_blends(axes: Axes, cell: BlendCell) -> None:
    profile, ends = cell.line_speed, cell.blended.breakpoints
    for k in (1, 3):
        axes.axvspan(float(profile.time_at(ends[k])), float(profile.time_at(ends[k + 1])), color=BLENDED, zorder=0)


@styled
def _over_time(cell: BlendCell, run: Run, title: str, rows: Sequence[tuple[str, np.ndarray, Sequence[str]]]) -> Figure:
    figure = new_figure(7.2, 1.2 + 2.1 * len(rows))
    every = np.atleast_1d(figure.subplots(len(rows), 1, sharex=True))
    for axes, (label, values, names) in zip(every, rows, strict=True):
        _shade_blends(axes, cell)
        for k, name in enumerate(names):
            axes.plot(run.time, values[:, k], color=ARM_COLORS[k], label=name)
        axes.set_ylabel(label)
        axes.legend(loc="best", ncols=len(names))
    every[0].set_title(title)
    every[-1].set_xlabel("time [s]   (shaded: in a blend)")
    return figure


@styled
def _line_speed(cell: BlendCell, run: Run) -> Figure:
    """Speed and acceleration along the path, and how far differenced points are from the plan."""
    figure = new_figure(7.2, 6.4)
    speed, acceleration, error = figure.subplots(3, 1, sharex=True)
    for axes in (speed, acceleration, error):
        _shade_blends(axes, cell)
    speed.plot(run.time, MM * run.v, color=ARM_COLORS[0])
    speed.set_ylabel("line speed [mm/s]")
    speed.set_title("Fig. 18  Line speed and line acceleration")
    acceleration.plot(run.time, MM * run.a, color=ARM_COLORS[0])
    acceleration.set_ylabel("line accel. [mm/s²]")
    for points, name, color in (
        (run.mapped, "the paper's mapping", ARM_COLORS[1]),
        (run.p, "exact mapping", ARM_COLORS[0]),
    ):
        error.plot(run.time[1:], MM * differenced_error(points, run.s), color=color, label=name)
    error.set_ylabel("speed error [mm/s]")
    error.set_xlabel("time [s]   (shaded: in a blend)")
    error.set_ylim(-0.55, 0.35)  # the two ticks in which the paper's scheme takes its drift back would hide the rest
    error.legend(loc="upper left", bbox_to_anchor=(0.0, 0.98))
    for k in (2, 4):
        note(
            error,
            float(cell.line_speed.time_at(cell.blended.breakpoints[k])),
            0.22,
            " its drift\n taken back",
            data=True,
        )
    note(error, 0.01, 0.06, f"points {1e3 * TICK:g} ms apart; what is left of the exact one is chord against arc")
    return figure
