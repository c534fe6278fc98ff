"""Figures of IK cells: where the tip goes, errors over time, joint speeds against their caps, torques."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armtempo.arrays import Floats
from armtempo.commands.figures._one_arm import (
    ARM,
    FROM_ABOVE,
    FROM_THE_SIDE,
    START,
    Loaded,
    Moving,
    Timed,
    draw_arm,
    draw_start,
    joint_speeds,
    legend,
    line_of,
    purposeful,
    torques,
)
from armtempo.commands.figures._style import INK, MUTED, new_figure, note, styled
from armtempo.commands.figures._workspace import workspace
from armtempo.planners import IKCell

if TYPE_CHECKING:
    from armtempo.agents import IKEvaluation


SMALLEST_M, SMALLEST_RAD = 1e-6, 1e-7  # errors below are drawn there
BACK = 0.05  # of its extent: a target that ends so near its start has come back
TARGET: dict[str, Any] = {"color": INK, "linewidth": 8.0, "alpha": 0.28, "zorder": 2.5}
LAG: dict[str, Any] = {"color": INK, "linewidth": 1.1, "linestyle": (0, (2, 2)), "zorder": 6.0}
BOUND: dict[str, Any] = {"color": "#B00020", "linewidth": 0.9, "linestyle": (0, (2, 2)), "zorder": 5.5}
DAMPED = "#F3E3C3"


class FollowsPose(Timed, Protocol):
    """What is drawn of who follows a pose, simulated or planned: T rows each."""

    @property
    def cell(self) -> IKCell: ...

    @property
    def tip(self) -> Floats: ...

    @property
    def position_error(self) -> Floats: ...

    @property
    def orientation_error(self) -> Floats: ...

    @property
    def singular_value(self) -> Floats: ...


class PlannedRun(FollowsPose, Moving, Loaded, Protocol):
    """A run of inverse kinematics, with what its law says beforehand."""

    @property
    def cell(self) -> IKCell: ...

    @property
    def error_bounds(self) -> tuple[Floats, Floats] | None:
        """Bounds (T,) of its errors of position [m] and orientation [rad], where it has some."""
        ...


def evaluation_figures(evaluation: IKEvaluation) -> dict[str, Figure]:
    """Figures of an evaluation's first episode by file name."""
    traces = {name: result.trace for name, result in evaluation.results.items()}
    return {
        "workspace": workspace(_cell(traces)),
        "path": paths(traces),
        "errors": errors(traces),
        "joint_speeds": joint_speeds(traces),
        "torque": torques(traces),
    }


def ik_plan_figures(plans: Mapping[str, PlannedRun]) -> dict[str, Figure]:
    """Figures of planned runs by file name."""
    return {
        "workspace": workspace(_cell(plans)),
        "path": paths(plans),
        "errors": errors(plans, {name: plan.error_bounds for name, plan in plans.items() if plan.error_bounds}),
        "joint_speeds": joint_speeds(plans),
        "torque": torques(plans),
    }


def _cell(traces: Mapping[str, FollowsPose]) -> IKCell:
    return next(iter(traces.values())).cell


@styled
def paths(traces: Mapping[str, FollowsPose]) -> Figure:
    """Target and tips from above and from the side, with the arm where it starts and where it is to be later.

    Policies lie on each other where all are good: the first is the widest.
    """
    figure = new_figure(9.2, 4.6)
    shown, cell = purposeful(traces), _cell(traces)
    target, q = cell.target.position[::2], cell.nominal.q
    widths = dict(zip(shown, 1.2 + 1.5 * np.arange(len(shown))[::-1], strict=True))
    back = float(np.linalg.norm(target[-1] - target[0])) < BACK * float(np.ptp(target, axis=0).max())
    for axes, view in zip(figure.subplots(1, 2), (FROM_ABOVE, FROM_THE_SIDE), strict=True):
        axes.set_title(view.title.capitalize())
        view.prepare(axes)
        axes.plot(*target[:, view.axes].T, **TARGET)
        draw_arm(axes, view, cell.arm, q[len(q) // 2 if back else -1], pale=True)
        draw_arm(axes, view, cell.arm, q[0])
        for k, (name, trace) in enumerate(shown.items()):
            axes.plot(
                *trace.tip[:, view.axes].T, **line_of(name) | {"linewidth": widths[name], "zorder": 4.0 + 0.1 * k}
            )
        draw_start(axes, view, target)
    handles = (
        Line2D([], [], label="target", **TARGET),
        Line2D([], [], label="its start", **START),
        Line2D([], [], label=f"arm, start ({'half-way' if back else 'end'} pale)", **ARM),
    )
    legend(figure, shown, *handles)
    return figure


@styled
def errors(
    traces: Mapping[str, FollowsPose], bounds: Mapping[str, tuple[Floats, Floats]] = MappingProxyType({})
) -> Figure:
    """Position and orientation errors over time, with bounds (T,) of them, and how near to singular the arm is."""
    figure = new_figure(8.6, 6.6)
    position, orientation, singular = figure.subplots(3, 1, sharex=True, height_ratios=(1.3, 1.3, 1.0))
    position.set_title("Distance of the tip from its target")
    orientation.set_title("Angle of the rotation that is left")
    singular.set_title("Smallest singular value")
    cell = _cell(traces)
    for name, trace in traces.items():
        position.semilogy(trace.time, 1e3 * np.maximum(trace.position_error, SMALLEST_M), **line_of(name))
        orientation.semilogy(trace.time, np.maximum(trace.orientation_error, SMALLEST_RAD), **line_of(name))
        if name != "random":
            singular.plot(trace.time, trace.singular_value, **line_of(name))
    for name, both in bounds.items():
        time = traces[name].time
        position.semilogy(time, 1e3 * np.maximum(both[0], SMALLEST_M), **BOUND)
        orientation.semilogy(time, np.maximum(both[1], SMALLEST_RAD), **BOUND)
    gain = cell.config.law.position_gain_1_s
    speed = np.linalg.norm(cell.target.velocity[::2], axis=1)
    position.semilogy(cell.target.time, 1e3 * np.maximum(speed / gain, SMALLEST_M), **LAG)
    scales = ((position, 1e3 * cell.config.error_scale_m), (orientation, cell.config.error_scale_rad))
    for axes, scale in scales:
        _mark(axes, scale, "scale of the reward")
    singular.axhspan(0.0, cell.config.law.damping, color=DAMPED, zorder=0.0, linewidth=0.0)
    note(
        singular,
        0.995,
        cell.config.law.damping,
        "damped",
        va="bottom",
        ha="right",
        color=MUTED,
        transform=singular.get_yaxis_transform(),
    )
    singular.set_ylim(bottom=0.0)
    position.set_ylabel("error [mm]")
    orientation.set_ylabel("error [rad]")
    singular.set_ylabel("singular value")
    singular.set_xlabel("time [s]")
    handles = [Line2D([], [], label=f"target's speed / {gain:g} 1/s", **LAG)]
    if bounds:
        handles.append(Line2D([], [], label="bound of an error", **BOUND))
    legend(figure, traces, *handles)
    return figure


def _mark(axes: Axes, level: float, text: str) -> None:
    axes.axhline(level, color=MUTED, linewidth=0.8, zorder=1.5)
    note(axes, 0.995, level, text, va="bottom", ha="right", color=MUTED, transform=axes.get_yaxis_transform())
