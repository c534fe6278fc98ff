"""Figures of cells with one arm: how policies are drawn, and the torques."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from armtempo.commands._style import new_figure, note, policy_color, styled
from armtempo.planners import BlendCell, IKCell

Array = NDArray[np.float64]

LIMIT: dict[str, Any] = {"color": "#B00020", "linewidth": 1.0, "linestyle": (0, (5, 2)), "zorder": 2.0}
DASHES = {"random": (0, (1, 1.4)), "feedback-damped": (0, (4, 2))}  # the latter often lies on feedback-ff


class Trace(Protocol):
    """What is drawn of every trace."""

    @property
    def cell(self) -> BlendCell | IKCell: ...

    @property
    def time(self) -> Array: ...

    @property
    def torque(self) -> Array: ...


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
    figure.legend(handles=[*handles, *more], loc="outside lower center", ncols=min(len(handles) + len(more), 6))


@styled
def torques(traces: Mapping[str, Trace]) -> Figure:
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
