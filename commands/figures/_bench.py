"""The figure of ``armtempo bench arms``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator

from armtempo.commands.figures._style import new_figure, policy_color, styled

LINES = ("-", "--", ":")  # of families
DOTS = ("o", "s", "^")
LEAST_GAP = 0.01  # percent that is drawn: smaller ones are that


@styled
def arms_figure(cells: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Figure:
    """Planning time (left) and gap to the certified bound (right) over the number of arms: dots, and their medians.

    Methods by colour, families by line.
    """
    figure = new_figure(9.6, 4.4)
    left, right = figure.subplots(1, 2)
    families = list(dict.fromkeys(cell["family"] for cell in cells))
    curves = [(family, method) for family in families for method in methods]
    for k, (family, method) in enumerate(curves):
        aside = 0.3 * (k / max(len(curves) - 1, 1) - 0.5)
        look = families.index(family) % len(LINES)
        label = method if len(families) == 1 else f"{method}, {family}"
        own = [cell for cell in cells if cell["family"] == family]
        for axes, value in ((left, _seconds), (right, _gap)):
            found = [(cell["arms"], value(cell, method)) for cell in own]
            points = np.array([pair for pair in found if pair[1] is not None], dtype=float).reshape(-1, 2)
            color = policy_color(method)
            axes.plot(
                points[:, 0] + aside, points[:, 1], DOTS[look], color=color, alpha=0.35, markersize=4, markeredgewidth=0
            )
            sizes = sorted({cell["arms"] for cell in own})
            solved = [points[points[:, 0] == n, 1] for n in sizes]
            middle = [np.median(values) if len(values) else np.nan for values in solved]  # no line over gaps
            axes.plot(sizes, middle, LINES[look], color=color, label=label)
    left.set_yscale("log")
    left.set_title("Planning time")
    left.set_ylabel("seconds")
    right.set_yscale("log")
    right.set_title("Makespan above the certified bound")
    right.set_ylabel("percent")
    right.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    every = sorted({cell["arms"] for cell in cells})
    for axes in (left, right):
        axes.set_xlabel("arms")
        axes.set_xlim(every[0] - 0.3, every[-1] + 0.3)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=max(len(methods), 3))
    left.set_xlabel(f"arms (solved ones of {len(cells)} feasible random cells; lines: medians)")
    return figure


def _seconds(cell: Mapping[str, Any], method: str) -> float | None:
    return float(cell["planning_time_s"][method]) if method in cell["makespan_s"] else None


def _gap(cell: Mapping[str, Any], method: str) -> float | None:
    makespan = cell["makespan_s"].get(method)
    return None if makespan is None else max(100.0 * (makespan / cell["lower_bound_s"] - 1.0), LEAST_GAP)
