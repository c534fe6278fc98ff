"""What the phase plane knew of one arm: where it could go, what was forbidden, which limit was active where."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from armtempo.arrays import Floats, Ints
from armtempo.commands.figures._style import FORBIDDEN, FORBIDDEN_EDGE, INK, MUTED, new_figure, note, styled
from armtempo.planners import CoordinationCell, diagnose

CONTROLLABLE = "#DCE9DF"
LIMIT_COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A4B9E")
SPEED_LIMIT, NO_LIMIT = "#7A7A7A", "#BDBDBD"
HEADROOM = 1.35  # above the fastest speed of the motion


@styled
def solve(cell: CoordinationCell, i: int) -> Figure:
    """Controllable set, limit curve, islands and the minimum-time motion of arm ``i``, coloured by its active limit."""
    plane, motion = cell.planes[i], cell.fastest[i]
    found = diagnose(plane, motion)
    grid = found.grid
    figure = new_figure(7.6, 4.9)
    axes = figure.add_subplot(title=f"{cell.arms[i].name}: where the end can be met, and which limit is active")
    top = HEADROOM * float(motion.mu.max())

    for k in range(found.controllable.shape[1]):
        low, high = found.controllable[:, k, 0], found.controllable[:, k, 1]
        label = "the end can be met" if k == 0 else None
        axes.fill_between(grid, low, np.minimum(high, top), color=CONTROLLABLE, linewidth=0.0, zorder=1.0, label=label)
    limit = np.nanmax(np.nan_to_num(found.admissible[..., 1], nan=0.0), axis=1)
    axes.fill_between(grid, np.minimum(limit, top), top, color=FORBIDDEN, linewidth=0.0, zorder=1.2)
    axes.plot(grid, limit, color=INK, linewidth=1.2, linestyle=(0, (5, 2)), zorder=3.0, label="limit curve")
    for k in range(found.admissible.shape[1] - 1):
        below, above = found.admissible[:, k, 1], found.admissible[:, k + 1, 0]
        axes.fill_between(
            grid, below, above, where=above > below, facecolor=FORBIDDEN, edgecolor=FORBIDDEN_EDGE,
            hatch="////", linewidth=0.6, zorder=1.3, label="island" if k == 0 and found.islands else None,
        )  # fmt: skip
    _motion(figure, grid, np.sqrt(np.interp(grid, motion.lam, motion.mu**2)), found.active, found.limits)
    if len(found.islands):
        note(axes, 0.02, 0.95, f"{len(found.islands)} island{'s' if len(found.islands) > 1 else ''}", color=MUTED)
    unit = cell.paths[i].unit
    axes.set(xlabel=f"position on the path λ [{unit}]", ylabel=f"speed on the path μ [{unit}/s]")
    axes.set(xlim=(0.0, float(grid[-1])), ylim=(0.0, top))
    figure.legend(loc="outside lower center", ncols=3, fontsize=8.5)
    return figure


def _motion(figure: Figure, grid: Floats, mu: Floats, active: Ints, limits: tuple[str, ...]) -> None:
    """The motion in one colour per active limit."""
    axes = figure.axes[0]
    pieces = np.stack([np.column_stack([grid[:-1], mu[:-1]]), np.column_stack([grid[1:], mu[1:]])], axis=1)
    for k, row in enumerate(np.unique(active)[::-1]):
        color = LIMIT_COLORS[k % len(LIMIT_COLORS)] if row >= 0 else SPEED_LIMIT if row == -1 else NO_LIMIT
        name = (
            limits[row].split(" of arm ")[0].removeprefix("the ")
            if row >= 0
            else "speed limit"
            if row == -1
            else "edge alone"
        )
        axes.add_collection(LineCollection(list(pieces[active == row]), colors=color, linewidths=2.6, zorder=5.0))
        axes.plot([], [], color=color, linewidth=2.6, label=name)
