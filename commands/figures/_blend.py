"""Figures of blend cells: the path and how it is followed, line speed, accelerations against limits, torques."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armtempo.commands.figures._one_arm import (
    FROM_ABOVE,
    FROM_THE_SIDE,
    LIMIT,
    START,
    View,
    draw_arm,
    draw_start,
    legend,
    line_of,
    purposeful,
    torques,
)
from armtempo.commands.figures._style import FAINT, INK, MUTED, new_figure, note, styled
from armtempo.planners import BlendCell
from armtempo.planners.blends import Blend

if TYPE_CHECKING:
    from armtempo.agents import BlendEvaluation
    from armtempo.envs import BlendTrace


SAMPLES = 2000
RISE = 0.15  # of its length: a path that rises and falls by more is seen from the side, too
BLEND = "#E69F00"
SMALLEST_ERROR = 1e-7  # [mm] contour errors below are drawn there


def evaluation_figures(evaluation: BlendEvaluation) -> dict[str, Figure]:
    """Figures of an evaluation by file name."""
    traces = {name: result.trace for name, result in evaluation.results.items()}
    figures = {"path": blended_path(evaluation.cell, traces)} if evaluation.options.family == "given" else {}
    figures |= {"line_speed": line_speeds(traces), "accelerations": accelerations(traces)}
    return {**figures, "torque": torques(traces)}


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
    height = cell.blended.position(np.linspace(0.0, cell.blended.length, SAMPLES))[:, 2]
    rises = float(np.ptp(height)) > RISE * cell.blended.length
    views = (FROM_ABOVE, FROM_THE_SIDE) if rises else (FROM_ABOVE,)
    figure = new_figure(9.2 + 3.6 * rises, 4.4)
    *seen, errors = figure.subplots(1, len(views) + 1, width_ratios=(1.15,) * len(views) + (1.0,))
    for axes, view in zip(seen, views, strict=True):
        axes.set_title(f"Path {view.title}" + (f", {cell.config.blend.curve} blends" if view is views[0] else ""))
        _draw_path(axes, view, cell)
    allowed = _contour_errors(errors, cell, traces)
    handles = (
        Line2D([], [], color=MUTED, linewidth=1.0, linestyle=(0, (2, 2)), label="given segments"),
        Line2D([], [], color=INK, linewidth=1.8, label="blended path"),
        Line2D([], [], color=BLEND, linewidth=3.0, label="blend"),
        Line2D([], [], label="start", **START),
        *allowed,
    )
    legend(figure, traces if allowed else {}, *handles)
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


@styled
def accelerations(traces: Mapping[str, BlendTrace]) -> Figure:
    """Acceleration of the reference along and across the path and its jerk as shares of their limits."""
    figure = new_figure(8.6, 6.2)
    along, across, jerk = figure.subplots(3, 1, sharex=True)
    most = [1.0, 1.0, 1.0]
    traces = purposeful(traces)
    for name, trace in traces.items():
        cell, limits = trace.cell, trace.cell.limits
        _, d1, d2, d3 = cell.blended.derivatives(trace.s)
        v, a, j = trace.v[:, None], trace.a[:, None], trace.j[:, None]
        vector = np.linalg.norm(d1 * j + 3.0 * d2 * v * a + d3 * v**3, axis=-1)
        normal = np.linalg.norm(d2, axis=-1) * trace.v**2
        shares = (np.abs(trace.a) / limits.acceleration, normal / limits.normal, vector / limits.jerk)
        for k, (axes, share) in enumerate(zip((along, across, jerk), shares, strict=True)):
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
