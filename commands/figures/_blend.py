"""Figures of blend cells: the path and how it is followed, line speed, accelerations against limits, torques."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armtempo.arrays import Floats
from armtempo.commands.figures._one_arm import (
    FROM_ABOVE,
    FROM_THE_SIDE,
    LIMIT,
    START,
    Loaded,
    Moving,
    Timed,
    View,
    draw_arm,
    draw_start,
    joint_speeds,
    legend,
    line_of,
    purposeful,
    torques,
)
from armtempo.commands.figures._style import FAINT, INK, MUTED, new_figure, note, policy_color, styled
from armtempo.commands.figures._workspace import workspace
from armtempo.planners import BlendCell
from armtempo.planners.blends import Blend

if TYPE_CHECKING:
    from armtempo.agents import BlendEvaluation
    from armtempo.envs import BlendTrace


SAMPLES = 2000
RISE = 0.15  # of its length: a path that rises and falls by more is seen from the side, too
BLEND = "#E69F00"
SMOOTH = policy_color("limit-aware-smooth")
SMALLEST_ERROR = 1e-7  # [mm] contour errors below are drawn there


def evaluation_figures(evaluation: BlendEvaluation) -> dict[str, Figure]:
    """Figures of an evaluation by file name."""
    traces = {name: result.trace for name, result in evaluation.results.items()}
    figures = {}
    if evaluation.options.family == "given":
        figures = {"workspace": workspace(evaluation.cell), "path": blended_path(evaluation.cell, traces)}
    figures |= {"line_speed": line_speeds(traces), "accelerations": accelerations(traces)}
    return {**figures, "torque": torques(traces)}


class Accelerated(Timed, Protocol):
    """A motion along the path of a cell: length, speed, acceleration, jerk (T,) on it."""

    @property
    def cell(self) -> BlendCell: ...

    @property
    def s(self) -> Floats: ...

    @property
    def v(self) -> Floats: ...

    @property
    def a(self) -> Floats: ...

    @property
    def j(self) -> Floats: ...


class AlongPath(Accelerated, Loaded, Moving, Protocol):
    """That, and what the joints do."""

    @property
    def cell(self) -> BlendCell: ...


def blend_plan_figures(plans: Mapping[str, AlongPath]) -> dict[str, Figure]:
    """Figures of planned profiles by file name."""
    return {
        "workspace": workspace(next(iter(plans.values())).cell),
        "path": planned_path(plans),
        "line_speed": planned_speeds(plans),
        "accelerations": accelerations(plans),
        "joint_speeds": joint_speeds(plans),
        "torque": torques(plans),
    }


def _windows(cell: BlendCell) -> list[tuple[float, float]]:
    """Lengths [m] between which the path is in a blend."""
    ends = cell.blended.breakpoints
    pieces = zip(cell.blended.pieces, ends[:-1], ends[1:], strict=True)
    return [(float(low), float(high)) for piece, low, high in pieces if isinstance(piece, Blend)]


def _shade(axes: Axes, cell: BlendCell) -> None:
    for low, high in _windows(cell):
        axes.axvspan(low, high, color="#F3F3F3", zorder=0.0, linewidth=0.0)


@styled
def blended_path(cell: BlendCell, traces: Mapping[str, BlendTrace]) -> Figure:
    """The path with its corners and the arm, and each policy's contour error along it.

    The path is seen from above, and from the side too where it rises by more than it could show.
    """
    figure, errors = _path_figure(cell)
    allowed = _contour_errors(errors, cell, traces)
    legend(figure, traces if allowed else {}, *_path_handles(), *allowed)
    return figure


def _path_handles() -> tuple[Line2D, ...]:
    """What the legend says of a path."""
    return (
        Line2D([], [], color=MUTED, linewidth=1.0, linestyle=(0, (2, 2)), label="given segments"),
        Line2D([], [], color=INK, linewidth=1.8, label="blended path"),
        Line2D([], [], color=BLEND, linewidth=3.0, label="blend"),
        Line2D([], [], label="start", **START),
    )


def _path_figure(cell: BlendCell) -> tuple[Figure, Axes]:
    """A figure with the path and the arm on its left, and axes for something else on its right."""
    height = cell.blended.position(np.linspace(0.0, cell.blended.length, SAMPLES))[:, 2]
    rises = float(np.ptp(height)) > RISE * cell.blended.length
    views = (FROM_ABOVE, FROM_THE_SIDE) if rises else (FROM_ABOVE,)
    figure = new_figure(9.2 + 3.6 * rises, 4.4)
    *seen, beside = figure.subplots(1, len(views) + 1, width_ratios=(1.15,) * len(views) + (1.0,))
    for axes, view in zip(seen, views, strict=True):
        axes.set_title(f"Path {view.title}" + (f", {cell.config.blend.curve} blends" if view is views[0] else ""))
        _draw_path(axes, view, cell)
    return figure, beside


@styled
def planned_path(plans: Mapping[str, AlongPath]) -> Figure:
    """The path with its corners and the arm, and the curvature of every curve that is planned on."""
    cell = next(iter(plans.values())).cell
    figure, curvature = _path_figure(cell)
    curvature.set_title("Curvature along the path")
    _shade(curvature, cell)
    curves = {plan.cell.config.blend.curve: plan.cell.blended for plan in plans.values()}
    lines: list[Line2D] = []
    for name, path in curves.items():
        s, first = np.linspace(0.0, path.length, SAMPLES), not lines
        lines += curvature.plot(
            s, path.curvature(s), color=INK if first else SMOOTH, linewidth=1.2, label=f"{name} blends"
        )
    curvature.set_ylim(bottom=0.0)
    curvature.set_xlabel("length along the path [m]")
    curvature.set_ylabel("curvature [1/m]")
    legend(figure, {}, *_path_handles(), *lines)
    return figure


@styled
def planned_speeds(plans: Mapping[str, AlongPath]) -> Figure:
    """Speed of every profile over time, and along the path with its blends shaded."""
    figure = new_figure(8.6, 4.8)
    over_time, along = figure.subplots(2, 1)
    over_time.set_title("Line speed over time")
    along.set_title("Line speed along the path, blends shaded")
    cell = next(iter(plans.values())).cell
    _shade(along, cell)
    for name, plan in plans.items():
        over_time.plot(plan.time, 1e3 * plan.v, **line_of(name))
        along.plot(plan.s / plan.cell.blended.length * cell.blended.length, 1e3 * plan.v, **line_of(name))
    for axes, label in ((over_time, "time [s]"), (along, "length along the path [m]")):
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("speed [mm/s]")
        axes.set_xlabel(label)
    legend(figure, plans)
    return figure


def _draw_path(axes: Axes, view: View, cell: BlendCell) -> None:
    view.prepare(axes)
    for segment in cell.segments:
        points = segment.evaluate(np.linspace(0.0, segment.length, 50))[0]
        axes.plot(*points[:, view.axes].T, color=MUTED, linewidth=1.0, linestyle=(0, (2, 2)), zorder=3.0)
    points = cell.blended.position(np.linspace(0.0, cell.blended.length, SAMPLES))
    axes.plot(*points[:, view.axes].T, color=INK, linewidth=1.8, zorder=4.0)
    for low, high in _windows(cell):
        corner = cell.blended.position(np.linspace(low, high, 200))
        axes.plot(*corner[:, view.axes].T, color=BLEND, linewidth=3.0, zorder=5.0)
    for station in (0.0, cell.blended.length):
        draw_arm(axes, view, cell.arm, cell.path.evaluate(station)[0], pale=station > 0.0)
    draw_start(axes, view, points)


def _contour_errors(axes: Axes, cell: BlendCell, traces: Mapping[str, BlendTrace]) -> list[Line2D]:
    """Contour errors along the path, and what the legend says of their limit; where none can be seen, in words."""
    axes.set_title("Distance of the tip from the path")
    largest = {name: 1e3 * float(trace.contour_error.max()) for name, trace in traces.items()}
    allowed = 1e3 * cell.contour_error_max
    if max(largest.values()) < SMALLEST_ERROR:
        axes.set(xticks=[], yticks=[], xlabel=" ")  # the label keeps the figure's layout
        for spine in axes.spines.values():
            spine.set_visible(False)
        note(axes, 0.0, 0.9, f"on the path to rounding, {allowed:g} mm are allowed; largest:", va="top")
        for k, (name, value) in enumerate(largest.items()):
            note(axes, 0.04, 0.8 - 0.08 * k, name, va="top")
            note(axes, 0.55, 0.8 - 0.08 * k, f"{value:.1e} mm", va="top")
        return []
    _shade(axes, cell)
    for name, trace in traces.items():
        share = trace.s / trace.cell.blended.length * cell.blended.length  # other corners, other lengths
        axes.semilogy(share, np.maximum(1e3 * trace.contour_error, SMALLEST_ERROR), **line_of(name))
    axes.axhline(allowed, **LIMIT)
    axes.set_ylim(0.5 * SMALLEST_ERROR, 4.0 * allowed)
    axes.set_xlabel("length along the path [m]")
    axes.set_ylabel("contour error [mm]")
    return [Line2D([], [], label="allowed", **LIMIT)]


@styled
def line_speeds(traces: Mapping[str, BlendTrace]) -> Figure:
    """Speed of the tip over time, and its error against the reference."""
    from armtempo.agents import in_blends

    figure = new_figure(8.6, 4.8)
    speed, error = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    speed.set_title("Line speed of the tip, point to point")
    error.set_title("Its error inside the blends")
    for name, trace in traces.items():
        speed.plot(trace.time[1:], 1e3 * trace.line_speed[1:], **line_of(name))
        if name == "random":
            continue
        wanted = np.diff(trace.s, prepend=0.0) / float(trace.time[1])
        error.plot(trace.time, 1e3 * np.where(in_blends(trace), trace.line_speed - wanted, np.nan), **line_of(name))
    error.axhline(0.0, color=FAINT, linewidth=0.8, zorder=1.0)
    speed.set_ylabel("speed [mm/s]")
    speed.set_ylim(bottom=0.0)
    error.set_ylabel("error [mm/s]")
    error.set_xlabel("time [s]")
    legend(figure, traces)
    return figure


def acceleration_shares(motion: Accelerated) -> Floats:
    """(T, 3) shares of their limits: acceleration along the path and across it, jerk as a vector."""
    limits = motion.cell.limits
    _, d1, d2, d3 = motion.cell.blended.derivatives(motion.s)
    v, a, j = motion.v[:, None], motion.a[:, None], motion.j[:, None]
    vector = np.linalg.norm(d1 * j + 3.0 * d2 * v * a + d3 * v**3, axis=-1)
    normal = np.linalg.norm(d2, axis=-1) * motion.v**2
    return np.stack([np.abs(motion.a) / limits.acceleration, normal / limits.normal, vector / limits.jerk], axis=1)


@styled
def accelerations(traces: Mapping[str, Accelerated]) -> Figure:
    """Acceleration of the reference along and across the path and its jerk as shares of their limits."""
    figure = new_figure(8.6, 6.2)
    along, across, jerk = figure.subplots(3, 1, sharex=True)
    most = [1.0, 1.0, 1.0]
    traces = purposeful(traces)
    for name, trace in traces.items():
        for k, (axes, share) in enumerate(zip((along, across, jerk), acceleration_shares(trace).T, strict=True)):
            axes.plot(trace.time, share, **line_of(name))
            most[k] = max(most[k], float(share.max()))
    titles = ("Acceleration along the path", "Normal acceleration", "Jerk (of the whole vector)")
    for k, (axes, title) in enumerate(zip((along, across, jerk), titles, strict=True)):
        axes.axhline(1.0, **LIMIT)
        axes.set_ylim(0.0, 1.12 * most[k])
        axes.set_title(title)
        axes.set_ylabel("share of limit")
    jerk.set_xlabel("time [s]")
    legend(figure, traces, Line2D([], [], label="limit", **LIMIT))
    return figure
