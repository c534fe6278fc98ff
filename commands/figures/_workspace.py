"""Arms, paths and obstacles in space: from above, and where they reach up from the side and in perspective, too."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from armtempo.arrays import Floats
from armtempo.commands.figures._one_arm import FROM_ABOVE, FROM_THE_SIDE, View, arm_points
from armtempo.commands.figures._style import FAINT, HALO, MUTED, arm_color, new_figure, styled
from armtempo.envs.bodies import outline
from armtempo.planners import Cell
from armtempo.robots import Arm, Shape

POSTURES = 200  # along the path
FLAT = 0.45  # of its width: what is not higher is seen from above alone
ROUND = 48  # points around a circle
STONE = "#9AA2AB"
SUN = np.array([0.35, -0.5, 0.8])
PATH: dict[str, Any] = {"linewidth": 1.6, "linestyle": (0, (1, 1.2)), "zorder": 6.0}


@styled
def workspace(cell: Cell, title: str = "") -> Figure:
    """The arms where they start, faintly where they end, the paths between, the obstacles (Lee1991 Fig. 5)."""
    title = title or ("The arm and its path" if len(cell.arms) == 1 else "Arms and their paths")
    sweeps = cell.sweeps(POSTURES)
    reach = np.concatenate([outline(arm, q[::10]) for arm, (q, _) in zip(cell.arms, sweeps, strict=True)])
    across = np.ptp(reach, axis=0)
    if across[2] < FLAT * np.hypot(across[0], across[1]):
        figure = new_figure(7.2, 4.6)
        flat = [(figure.add_subplot(title=title), FROM_ABOVE)]
    else:
        figure = new_figure(12.6, 4.9)
        figure.get_layout_engine().set(w_pad=0.12)  # type: ignore[union-attr, call-arg] # constrained, which has one
        columns = figure.add_gridspec(1, 3, width_ratios=(1.25, 1.0, 1.0))
        _perspective(figure.add_subplot(columns[0], projection="3d", title=title), cell, reach)
        views = (FROM_ABOVE, FROM_THE_SIDE)
        flat = [(figure.add_subplot(columns[k]), view) for k, view in enumerate(views, 1)]
        for axes, view in flat:
            axes.set_title(view.title.capitalize())
    for axes, view in flat:
        _from(axes, view, cell)
    handles: list[Any] = [
        Patch(facecolor=MUTED, label="at the start"),
        Patch(facecolor=MUTED, alpha=0.25, label="at the end"),
        Line2D([], [], color=MUTED, label="given path", **PATH),
    ]
    if cell.obstacles:
        handles.append(Patch(facecolor=STONE, label="obstacle"))
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure


def _from(axes: Axes, view: View, cell: Cell) -> None:
    """One view along an axis of the world."""
    view.prepare(axes)
    axes.set_aspect("equal", adjustable="box")
    for obstacle in cell.obstacles:
        _fill(axes, view, surface_points(obstacle, np.eye(4)), STONE, 0.8, 1.0)
    for i, (arm, (q, tip)) in enumerate(zip(cell.arms, cell.sweeps(POSTURES), strict=True)):
        color = arm_color(i)
        for posture, alpha, height in ((q[-1], 0.16, 2.0), (q[0], 0.6, 3.0)):
            for points in bodies(arm, posture):
                _fill(axes, view, points, color, alpha, height)
            skeleton = arm_points(arm, posture)[:, view.axes]
            axes.plot(*skeleton.T, color=color, linewidth=1.0, alpha=min(2.0 * alpha, 1.0), zorder=height + 0.5)
        axes.plot(*tip[:, view.axes].T, color=color, **PATH)
        _arrow(axes, tip[:, view.axes], color)
        axes.plot(*arm.T_world_base[list(view.axes), 3], "s", color=color, markersize=8.0, zorder=4.0)
        axes.annotate(
            arm.name, _pair(arm.T_world_base[:3, 3][list(view.axes)]), (0, -11), textcoords="offset points",
            color=color, weight="bold", ha="center", va="top", path_effects=HALO, zorder=9.0,
        )  # fmt: skip
    axes.margins(0.06)
    low, high = axes.get_ylim()
    axes.set_ylim(low - 0.07 * (high - low), high)  # for the names


def _arrow(axes: Axes, path: Floats, color: str) -> None:
    """Which way a path (K, 2) goes."""
    k = int(0.3 * len(path))
    style = {"arrowstyle": "-|>", "color": color, "linewidth": 1.4, "mutation_scale": 14}
    axes.annotate("", _pair(path[k]), _pair(path[k - 5]), arrowprops=style, zorder=6.5)


def _pair(point: Floats) -> tuple[float, float]:
    return float(point[0]), float(point[1])


def _fill(axes: Axes, view: View, points: Floats, color: str, alpha: float, height: float) -> None:
    """The silhouette of a convex body."""
    seen = points[:, view.axes]
    corners = seen[ConvexHull(seen).vertices]
    axes.add_patch(Polygon(corners, facecolor=color, edgecolor=color, linewidth=0.6, alpha=alpha, zorder=height))
    axes.update_datalim(corners)
    axes.autoscale_view()


def _perspective(axes: Any, cell: Cell, reach: Floats) -> None:
    """Everything in perspective, bodies lit from above."""
    axes.computed_zorder = False
    axes.view_init(elev=24.0, azim=-62.0)
    for obstacle in cell.obstacles:
        _solid(axes, [surface_points(obstacle, np.eye(4))], STONE, 1.0)
    for i, (arm, (q, tip)) in enumerate(zip(cell.arms, cell.sweeps(POSTURES), strict=True)):
        color = arm_color(i)
        axes.plot(*arm_points(arm, q[-1]).T, color=color, linewidth=3.0, alpha=0.3, zorder=2.0)
        _solid(axes, bodies(arm, q[0]), color, 1.0)
        axes.plot(*tip.T, color=color, **PATH)
    corners = [reach, *(surface_points(obstacle, np.eye(4)) for obstacle in cell.obstacles)]
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.1)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(MaxNLocator(4))
        axis._axinfo["grid"].update(color=FAINT, linewidth=0.6)  # there is no other way to say it


def _solid(axes: Any, hulls: Sequence[Floats], color: str, alpha: float) -> None:
    """Convex bodies, given by points of their surfaces."""
    triangles, normals = [], []
    for points in hulls:
        hull = ConvexHull(points)
        triangles.append(points[hull.simplices])
        normals.append(hull.equations[:, :3])
    light = np.clip(np.concatenate(normals) @ (SUN / np.linalg.norm(SUN)), -0.4, 1.0)
    shade = (0.55 + 0.45 * light)[:, None]
    faces = np.clip(shade * np.array(to_rgb(color)) + 0.12 * np.maximum(light, 0.0)[:, None], 0.0, 1.0)
    collection = Poly3DCollection(np.concatenate(triangles), facecolors=faces, edgecolors=faces, linewidths=0.3)
    collection.set_alpha(alpha)
    collection.set_zorder(3.0)
    axes.add_collection3d(collection)


def bodies(arm: Arm, q: Floats) -> list[Floats]:
    """Points (m, 3) of the surface of every shape of an arm at q (n,) [m]."""
    frames = np.concatenate([arm.link_poses(q), arm.T_world_base[None]])  # link -1 is the base
    return [surface_points(shape, frames[shape.link]) for shape in arm.shapes]


def surface_points(shape: Shape, T_world_link: Floats) -> Floats:
    """(m, 3) points whose hull is a shape, or nearly so where it is round [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, ROUND, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(ROUND)], axis=1)
    if shape.vertices is not None:
        own = shape.vertices
    elif shape.kind == "box":
        own = (np.array(list(np.ndindex(2, 2, 2))) - 0.5) * shape.size
    elif shape.kind == "cylinder":
        own = np.concatenate([shape.size[0] * circle + [0.0, 0.0, z * shape.size[1]] for z in (-0.5, 0.5)])
    else:  # circles of latitude around both ends of the axis
        radius, half = shape.size[0], 0.5 * shape.size[1] if shape.kind == "capsule" else 0.0
        tilt = np.linspace(0.0, 0.5 * np.pi, ROUND // 6)
        end, upward = np.array([0.0, 0.0, half]), np.array([0.0, 0.0, 1.0])
        ball = radius * np.concatenate([np.cos(t) * circle + np.sin(t) * upward for t in tilt])
        own = np.concatenate([end + ball, -end - ball])
    T = T_world_link @ shape.T_link_shape
    return np.asarray(own @ T[:3, :3].T + T[:3, 3])
