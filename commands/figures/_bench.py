"""The figure of ``armtempo bench arms``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from armtempo.commands.figures._style import new_figure, policy_color, styled


@styled
def arms_figure(rings: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Figure:
    """Planning time (left) and gap to the certified bound (right) over the number of arms: dots, and their medians."""
    figure = new_figure(9.6, 3.8)
    left, right = figure.subplots(1, 2)
    sizes = sorted({ring["arms"] for ring in rings})
    for k, method in enumerate(methods):
        color = policy_color(method)
        aside = 0.07 * (k - 0.5 * (len(methods) - 1))
        for axes, value in ((left, _seconds), (right, _gap)):
            found = [(int(ring["arms"]), value(ring, method)) for ring in rings]
            points = [(m, v) for m, v in found if v is not None]
            arms, values = (
                (np.array(column, dtype=float) for column in zip(*points, strict=True)) if points else ([], [])
            )
            axes.plot(np.asarray(arms) + aside, values, "o", color=color, alpha=0.35, markersize=4, markeredgewidth=0)
            own = [[v for m, v in points if m == n] for n in sizes]
            middle = [(n, np.median(v) if v else np.nan) for n, v in zip(sizes, own, strict=True)]  # no line over gaps
            axes.plot(*np.array(middle).reshape(-1, 2).T, color=color, label=method)
    left.set_yscale("log")
    left.set_title("Planning time")
    left.set_ylabel("seconds")
    right.set_title("Makespan above the certified bound")
    right.set_ylabel("percent")
    right.set_ylim(bottom=0.0)
    for axes in (left, right):
        axes.set_xlabel("arms")
        axes.set_xlim(sizes[0] - 0.3, sizes[-1] + 0.3)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.legend(loc="upper left")
    count = max(sum(ring["arms"] == n for ring in rings) for n in sizes)
    left.set_xlabel(f"arms (solved ones of {count} random rings per size; lines: medians)")
    return figure


def _seconds(ring: Mapping[str, Any], method: str) -> float | None:
    return float(ring["planning_time_s"][method]) if method in ring["makespan_s"] else None


def _gap(ring: Mapping[str, Any], method: str) -> float | None:
    makespan = ring["makespan_s"].get(method)
    return None if makespan is None else 100.0 * (makespan / ring["lower_bound_s"] - 1.0)
