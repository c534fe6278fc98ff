"""Figures of cells with one arm: how policies are drawn, and the torques."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from armtempo.arrays import Floats
from armtempo.commands.figures._style import INK, arm_color, new_figure, note, policy_color, styled
from armtempo.planners import BlendCell, IKCell
from armtempo.robots import Arm

LIMIT: dict[str, Any] = {"color": "#B00020", "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.0}
DASHES = {
    "random": (0, (1, 1.4)),
    "feedback-damped": (0, (4, 2)),  # often lies on feedback-ff
    "law-scheduled": (0, (4, 2)),  # and this on law
}


ARM: dict[str, Any] = {
    "color": arm_color(0), "linewidth": 3.0, "marker": "o", "markersize": 4.5, "zorder": 2.0,
}  # fmt: skip
START: dict[str, Any] = {
    "color": "white", "marker": "o", "markersize": 7.0, "markeredgecolor": INK, "markeredgewidth": 1.4,
    "linestyle": "none", "zorder": 7.0,
}  # fmt: skip


class View(NamedTuple):
    """Which world axes a picture shows: its right, its up."""

    title: str
    axes: tuple[int, int]

    def prepare(self, axes: Axes) -> None:
        """Label the axes; one scale for both."""
        axes.set_aspect("equal", adjustable="datalim")
        axes.set_xlabel(f"{'xyz'[self.axes[0]]} [m]")
        axes.set_ylabel(f"{'xyz'[self.axes[1]]} [m]")


FROM_ABOVE, FROM_THE_SIDE = View("from above", (0, 1)), View("from the side", (0, 2))


class Timed(Protocol):
    """What happens over time in a cell with one arm, simulated or planned."""

    @property
    def cell(self) -> BlendCell | IKCell: ...

    @property
    def time(self) -> Floats: ...


class Loaded(Timed, Protocol):
    """That, and its torques (T, n)."""

    @property
    def torque(self) -> Floats: ...


class Moving(Timed, Protocol):
    """That, and its joint speeds (T, n)."""

    @property
    def joint_speed(self) -> Floats: ...


Some = TypeVar("Some")


def line_of(name: str) -> dict[str, Any]:
    """How a policy is drawn."""
    random = name == "random"
    return {
        "color": policy_color(name),
        "linewidth": 1.0 if random else 1.8,
        "linestyle": DASHES.get(name, "-"),
        "zorder": 2.5 if random else 4.5 if name in DASHES else 4.0,
    }


def purposeful(traces: Mapping[str, Some]) -> dict[str, Some]:
    """All but ``random``, which would hide the rest; unless it is alone."""
    return {name: trace for name, trace in traces.items() if name != "random"} or dict(traces)


def legend(figure: Figure, names: Mapping[str, object], *more: Line2D) -> None:
    """Policies and ``more``, below."""
    handles = [Line2D([], [], label=name, **line_of(name)) for name in names]
    count = len(handles) + len(more)
    figure.legend(handles=[*handles, *more], loc="outside lower center", ncols=count if count <= 6 else -(-count // 2))


def arm_points(arm: Arm, q: Floats) -> Floats:
    """(K, 3) [m] base, joints and tip of an arm at q (n,)."""
    T = arm.link_poses(q)[:, :3, 3]
    return np.vstack([arm.T_world_base[:3, 3], T, arm.tip_pose(q)[:3, 3]])


def draw_arm(axes: Axes, view: View, arm: Arm, q: Floats, *, pale: bool = False) -> None:
    """An arm at q (n,) as lines between its joints."""
    points = arm_points(arm, q)[:, view.axes]
    axes.plot(points[:, 0], points[:, 1], **ARM | {"alpha": 0.3 if pale else 0.9})


def draw_start(axes: Axes, view: View, path: Floats) -> None:
    """Mark where a path (K, 3), evenly sampled, starts, and which way it goes there."""
    points = path[:, view.axes]
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    reach = 0.3 * float(np.ptp(points, axis=0).max())
    if reach == 0.0:
        return  # seen end on, or it stands still
    tail, head = (int(np.searchsorted(travelled, share * reach)) for share in (0.75, 1.0))
    arrow = {
        "arrowstyle": "-|>,head_length=1.3,head_width=0.45",
        "facecolor": INK,
        "edgecolor": "white",
        "shrinkB": 0.0,
    }
    axes.annotate("", points[min(head, len(points) - 1)], points[tail], arrowprops=arrow, zorder=7.0)
    axes.plot(*points[0], **START)


@styled
def torques(traces: Mapping[str, Loaded]) -> Figure:
    """Torque of every joint over time with its limits."""
    shown = purposeful(traces)
    arm = next(iter(traces.values())).cell.arm
    figure = new_figure(8.6, 1.1 + 1.25 * arm.dof)
    for j, axes in enumerate(np.atleast_1d(figure.subplots(arm.dof, 1, sharex=True))):
        limit = float(arm.torque_max[j])
        for sign in (-1.0, 1.0):
            axes.axhline(sign * limit, **LIMIT)
        for name, trace in shown.items():
            axes.step(trace.time[1:], trace.torque[1:, j], where="pre", **line_of(name))
        axes.set_ylim(-1.2 * limit, 1.2 * limit)
        axes.set_ylabel("force [N]" if arm.model.prismatic[j] else "torque [N m]")
        note(axes, 0.995, 0.84, arm.joint_names[j], va="top", ha="right", weight="bold")
    axes.set_xlabel("time [s]")
    legend(figure, shown, Line2D([], [], label="limit", **LIMIT))
    return figure


@styled
def joint_speeds(traces: Mapping[str, Moving]) -> Figure:
    """Speed of every joint over time with its caps."""
    shown, arm = purposeful(traces), next(iter(traces.values())).cell.arm
    figure = new_figure(8.6, 1.1 + 1.25 * arm.dof)
    for j, axes in enumerate(np.atleast_1d(figure.subplots(arm.dof, 1, sharex=True))):
        cap = float(arm.speed_max[j])
        for sign in (-1.0, 1.0):
            axes.axhline(sign * cap, **LIMIT)
        for name, trace in shown.items():
            axes.plot(trace.time, trace.joint_speed[:, j], **line_of(name) | {"linewidth": 1.3})
        axes.set_ylim(-1.2 * cap, 1.2 * cap)
        axes.set_ylabel("[m/s]" if arm.model.prismatic[j] else "[rad/s]")
        note(axes, 0.995, 0.84, arm.joint_names[j], va="top", ha="right", weight="bold")
    axes.set_xlabel("time [s]")
    legend(figure, shown, Line2D([], [], label="cap", **LIMIT))
    return figure
