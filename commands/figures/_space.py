"""Figures in space: the arms on their paths (Lee1991 Figs. 1 and 5), the coordination chart (Figs. 2 and 7)."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy import ndimage

from armtempo.arrays import Floats
from armtempo.commands.figures._style import (
    FAINT,
    FORBIDDEN,
    FORBIDDEN_EDGE,
    HALO,
    arm_color,
    new_figure,
    policy_line,
    styled,
)
from armtempo.planners import CoordinationCell, CoordinationChart, Schedule

Pair = tuple[int, int]

CHART_PIXELS = 1024
CHART_COLORS = ListedColormap(["#FFFFFF", FORBIDDEN_EDGE, FORBIDDEN])  # free, undecided, blocked
COLLISION = "#B00020"
TICK = 0.05  # [s] between the dots on a relative trajectory


def _tip(cell: CoordinationCell, i: int, lam: Floats) -> Floats:
    """(..., 2) places of arm i's tip on its path, seen from above [m]."""
    return cell.arms[i].tip_pose(cell.paths[i].evaluate(lam)[0])[..., :2, 3]


def _xy(point: Floats) -> tuple[float, float]:
    """A point as matplotlib's annotations take it."""
    return float(point[0]), float(point[1])


def _skeleton(cell: CoordinationCell, i: int, lam: float) -> Floats:
    """(n + 2, 2): base, joints and tip of arm i, seen from above [m]."""
    arm = cell.arms[i]
    q = cell.paths[i].evaluate(lam)[0]
    return np.vstack([arm.T_world_base[:2, 3], arm.link_poses(q)[:, :2, 3], arm.tip_pose(q)[:2, 3]])


def _draw_arm(
    axes: Axes, cell: CoordinationCell, i: int, lam: float, *, alpha: float = 1.0, color: str | None = None
) -> None:
    points = _skeleton(cell, i, lam)
    color = color or arm_color(i)
    axes.plot(*points.T, color=color, linewidth=4.5, alpha=alpha, solid_joinstyle="round", zorder=4.0)
    axes.plot(*points[1:-1].T, "o", color="white", markeredgecolor=color, markersize=6.5, alpha=alpha, zorder=5.0)
    axes.plot(*points[0], "s", color=color, markersize=11, alpha=alpha, zorder=3.0)
    axes.plot(*points[-1], "o", color=color, markersize=5.0, alpha=alpha, zorder=6.0)


def _draw_paths(axes: Axes, cell: CoordinationCell) -> None:
    for i, path in enumerate(cell.paths):
        tip = _tip(cell, i, np.linspace(0.0, path.length, 200))
        axes.plot(*tip.T, color=arm_color(i), linewidth=1.6, linestyle=(0, (1, 1.2)), zorder=3.5)


def _space_axes(figure: Figure, title: str) -> Axes:
    axes = figure.add_subplot()
    axes.set_aspect("equal", adjustable="box")
    axes.set(xlabel="x [m]", ylabel="y [m]", title=title)
    axes.margins(0.08)
    return axes


def widest_collision(chart: CoordinationChart) -> float:
    """The master's station at which the longest stretch of the slave's path collides [lambda]; 0 where nothing does.

    With rules: of those where the slave may go on to its end.
    """
    occupied = (chart.states != 0).sum(axis=1)
    passed = chart.states[:, -1] == 0
    if chart.exclusions and occupied[passed].any():
        occupied = np.where(passed, occupied, 0)
    return float((int(occupied.argmax()) + 0.5) * chart.step_a)


@styled
def collision_interval(
    cell: CoordinationCell,
    lam: float | None = None,
    title: str = "Collision interval in the common workspace",
    pair: Pair = (0, 1),
) -> Figure:
    """The master at Q and the stretch [P1, P2] of the slave's path that collides with it there (Lee1991 Fig. 1).

    Args:
        cell: Two arms or more.
        lam: Q as a station of the master's path (default: where the interval is longest).
        title: Of the figure.
        pair: Master and slave.
    """
    chart, (master, slave) = cell.chart_between(*pair), pair
    unit, other = cell.paths[master].unit, cell.paths[slave].unit
    lam = widest_collision(chart) if lam is None else lam
    figure = new_figure(7.2, 4.0)
    axes = _space_axes(figure, title)
    _draw_paths(axes, cell)
    _draw_arm(axes, cell, master, lam)
    q = _tip(cell, master, np.array(lam))
    handles = [
        Line2D(
            [], [], color=arm_color(master), linewidth=4.5, label=f"{cell.arms[master].name} at Q = {lam:.3f} {unit}"
        ),
    ]
    for low, high in chart.collision_interval(lam):
        _draw_interval(axes, cell, slave, low, min(high, cell.paths[slave].length))
        handles += [
            Line2D(
                [], [], color=arm_color(slave), linewidth=4.5, alpha=0.5,
                label=f"{cell.arms[slave].name} at P1 and at P2",
            ),
            Line2D([], [], color=COLLISION, linewidth=6.0, label=f"collision interval [{low:.3f}, {high:.3f}] {other}"),
        ]  # fmt: skip
    _name_point(axes, "Q", q, (-13, 0), master)
    figure.legend(handles=handles[:3], loc="outside lower center", ncols=3, columnspacing=1.2)
    return figure


def _draw_interval(axes: Axes, cell: CoordinationCell, slave: int, p1: float, p2: float) -> None:
    """The slave at P1 and at P2, and the stretch of its path between."""
    for name, p, dy in (("P1", p1, 7), ("P2", p2, -7)):
        _draw_arm(axes, cell, slave, p, alpha=0.45)
        _name_point(axes, name, _tip(cell, slave, np.array(p)), (11, dy), slave)  # aside of the master's tip
    stretch = _tip(cell, slave, np.linspace(p1, p2, 100))
    axes.plot(*stretch.T, color=COLLISION, linewidth=6.0, alpha=0.85, zorder=3.8, solid_capstyle="butt")


def _name_point(axes: Axes, name: str, point: Floats, aside: tuple[int, int], arm: int) -> None:
    """A letter beside a point of an arm's path."""
    axes.annotate(
        name, _xy(point), aside, textcoords="offset points", weight="bold", va="center", color=arm_color(arm),
        path_effects=HALO, zorder=10.0,
    )  # fmt: skip


def _pixels(chart: CoordinationChart) -> NDArray[np.uint8]:
    """The chart's states, thinned to what a picture shows: undecided where one cell of a pixel is, else the worst."""
    states = chart.states
    per = max(1, chart.resolution // CHART_PIXELS)
    if per > 1:
        count = chart.resolution // per
        blocks = states[: count * per, : count * per].reshape(count, per, count, per)
        undecided = (blocks == 1).any(axis=(1, 3))
        states = np.where(undecided, 1, blocks.max(axis=(1, 3))).astype(np.uint8)
    return states


def meeting(cell: CoordinationCell) -> list[Pair]:
    """The pairs of arms that can collide, the largest share of their chart first; at least one pair."""
    pairs = list(combinations(range(len(cell.arms)), 2))
    share = {pair: 1.0 - cell.chart_between(*pair).share(0) for pair in pairs}
    return sorted((pair for pair in pairs if share[pair] > 0.0), key=lambda pair: -share[pair]) or pairs[:1]


def draw_chart(axes: Axes, cell: CoordinationCell, *, label: bool = True, pair: Pair = (0, 1)) -> None:
    """The coordination chart of two arms of a cell as the background of ``axes``."""
    chart = cell.chart_between(*pair)
    pixels = _pixels(chart)
    axes.imshow(
        pixels.T,
        origin="lower",
        extent=(0.0, chart.length_a, 0.0, chart.length_b),
        cmap=CHART_COLORS,
        vmin=0,
        vmax=2,
        interpolation="nearest",
        aspect="equal",
        zorder=1.0,
    )
    axes.grid(False)
    axes.set(
        xlabel=f"{cell.arms[pair[0]].name}'s position on its path [{cell.paths[pair[0]].unit}]",
        ylabel=f"{cell.arms[pair[1]].name}'s position on its path [{cell.paths[pair[1]].unit}]",
    )
    if label and (pixels == 2).any():
        inside = ndimage.distance_transform_edt(np.pad(pixels == 2, 1))[1:-1, 1:-1]
        a, b = np.unravel_index(int(inside.argmax()), inside.shape)
        x, y = (a + 0.5) * chart.length_a / len(pixels), (b + 0.5) * chart.length_b / len(pixels)
        axes.text(x, y, "collision\nregion", ha="center", va="center", color="#7A3535", fontsize=9, zorder=2.0)


@styled
def coordination_chart(
    cell: CoordinationCell, lam: float | None = None, title: str = "Coordination chart", pair: Pair = (0, 1)
) -> Figure:
    """Where two arms collide; P1 and P2 of the slave with the master at Q (Lee1991 Fig. 2)."""
    chart, (master, slave) = cell.chart_between(*pair), pair
    unit, other = cell.paths[master].unit, cell.paths[slave].unit
    lam = widest_collision(chart) if lam is None else lam
    figure = new_figure(6.4, 5.2)
    axes = figure.add_subplot(title=title)
    draw_chart(axes, cell, label=False, pair=pair)
    intervals = chart.collision_interval(lam)
    axes.plot(
        [lam, lam], [0.0, chart.length_b], color=arm_color(master), linewidth=1.0, linestyle=(0, (4, 3)), zorder=3.0
    )
    axes.annotate(
        f"Q = {lam:.3f} {unit}",
        (lam, 0.0),
        (5, 6),
        textcoords="offset points",
        color=arm_color(master),
        path_effects=HALO,
        zorder=9.0,
    )
    for p1, p2 in intervals:
        axes.plot([lam, lam], [p1, p2], color=COLLISION, linewidth=4.0, zorder=4.0, solid_capstyle="butt")
        for p, word, va, dy in (
            (p1, f"P1 = {p1:.3f} {other}: collision point", "top", -4),
            (p2, f"P2 = {p2:.3f} {other}", "bottom", 4),
        ):
            axes.plot([0.0, lam], [p, p], color=arm_color(slave), linewidth=1.0, linestyle=(0, (4, 3)), zorder=3.0)
            axes.plot(lam, p, "o", color=COLLISION, markersize=6, zorder=5.0)
            axes.annotate(
                word,
                (0.0, p),
                (6, dy),
                textcoords="offset points",
                color=arm_color(slave),
                va=va,
                path_effects=HALO,
                zorder=9.0,
            )
    undecided = f"undecided, cells of {chart.step_a:.2g} {unit}\n({100 * chart.share(1):.2g} % of the chart)"
    rules = ",\nor against a rule" if chart.exclusions else ""
    near = f"{1e3 * chart.d_min:.4g} mm{rules}"
    handles = [
        Patch(facecolor="white", edgecolor=FAINT, label="free"),
        Patch(facecolor=FORBIDDEN, label=f"collision region:\ncloser than {near}"),
        Patch(facecolor=FORBIDDEN_EDGE, label=undecided),
        Line2D([], [], color=COLLISION, linewidth=4.0, label="collision interval"),
    ]
    figure.legend(handles=handles, loc="outside right center", labelspacing=0.9)
    return figure


def relative_motion(schedule: Schedule, samples: int = 800) -> tuple[Floats, Floats]:
    """Instants (T,) [s] and positions (T, arms) [lambda] of a schedule until its last arm arrives."""
    instants = np.linspace(0.0, schedule.makespan, samples)
    rows = [trajectory.at(np.minimum(instants, trajectory.duration))[0] for trajectory in schedule.trajectories]
    return instants, np.stack(rows, axis=1)


def draw_relative(
    axes: Axes,
    cell: CoordinationCell,
    motions: Mapping[str, tuple[Floats, Floats]],
    emphasised: str,
    pair: Pair = (0, 1),
) -> list[Line2D]:
    """Relative motions (instants, positions) by name over the chart; dots every 50 ms on the emphasised one."""
    handles = []
    for name, (instants, lam) in motions.items():
        (line,) = axes.plot(lam[:, pair[0]], lam[:, pair[1]], label=name, **policy_line(name, emphasised))
        handles.append(line)
        if name == emphasised:
            ticks = np.arange(TICK, instants[-1], TICK)
            dots = np.stack([np.interp(ticks, instants, column) for column in lam.T[list(pair)]])
            axes.plot(*dots, "o", color="white", markeredgecolor=line.get_color(), markersize=4.5, zorder=6.0)
    reach = np.array([-0.012, 1.012])  # curves run along the borders
    chart = cell.chart_between(*pair)
    axes.set(xlim=tuple(reach * chart.length_a), ylim=tuple(reach * chart.length_b))
    return handles


@styled
def relative_trajectories(
    cell: CoordinationCell,
    schedules: Mapping[str, Schedule],
    emphasised: str = "vci",
    title: str = "Relative motion in the coordination chart",
) -> Figure:
    """The plans of all methods as curves around the collision region, the emphasised one bold (Lee1991 Fig. 7)."""
    pairs = meeting(cell)
    columns = min(len(pairs), 3)
    rows = -(-len(pairs) // columns)
    figure = new_figure(7.2, 5.2) if len(pairs) == 1 else new_figure(2.4 + 4.0 * columns, 0.6 + 4.0 * rows)
    motions = {name: relative_motion(plan) for name, plan in schedules.items()}
    handles: list[Line2D] = []
    for k, pair in enumerate(pairs):
        axes = figure.add_subplot(rows, columns, k + 1)
        draw_chart(axes, cell, pair=pair)
        handles = draw_relative(axes, cell, motions, emphasised, pair)
        if len(pairs) == 1:
            axes.set_title(title)
    if len(pairs) > 1:
        figure.suptitle(title)
    for handle, (name, plan) in zip(handles, schedules.items(), strict=True):
        handle.set_label(f"{name}, {plan.makespan:.3f} s")
    heading = "method and makespan\n"
    if emphasised in schedules:
        heading += f"(dots on {emphasised} every {1e3 * TICK:.0f} ms)\n"
    figure.legend(
        handles=handles,
        loc="outside right center",
        labelspacing=0.7,
        title=heading,
        alignment="left",
    )
    return figure
