"""Pages of cells of several arms: coordination charts, clearance, a phase plane for each arm."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from armtempo.arrays import Bools, Floats
from armtempo.commands.figures._space import meeting
from armtempo.commands.viewer._kind_view import KindView, Told
from armtempo.commands.viewer._panels import Across, Band, Curve, Line, Panel
from armtempo.planners import AbstractJointPath, CoordinationCell, CoordinationChart

if TYPE_CHECKING:
    from armtempo.agents import CoordinationResult
    from armtempo.envs import CoordinationTrace

__all__ = ["COORDINATION_VIEW", "forbidden_regions"]

CHART_COLUMNS = 400
LIMIT_POINTS = 400
WIDE = 10.0  # times d_min: arms that are farther apart leave the picture of the clearance


def forbidden_regions(chart: CoordinationChart) -> Floats:
    """(K, 4) rectangles x0, x1, y0, y1 in which arms are too close, or not certified to be far enough apart."""
    resolution = chart.resolution
    edges = np.unique(np.linspace(0, resolution, min(resolution, CHART_COLUMNS) + 1).round().astype(int))
    blocked = np.logical_or.reduceat(chart.states != 0, edges[:-1], axis=0)
    steps = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    column, low = np.nonzero(steps == 1)
    _, high = np.nonzero(steps == -1)
    step_a, step_b = chart.length_a / resolution, chart.length_b / resolution
    return np.stack([edges[column] * step_a, edges[column + 1] * step_a, low * step_b, high * step_b], axis=1)


def panels(cell: CoordinationCell, traces: Sequence[CoordinationTrace]) -> list[Panel]:
    """A chart for each pair of arms that meets, the clearance, a phase plane for each arm."""
    pairs = meeting(cell) if len(cell.arms) > 1 else []
    charts, clearance = [_chart(cell, pair) for pair in pairs], [_clearance(cell, traces)] if pairs else []
    return [
        *(charts[:1] + clearance + charts[1:]),  # the pair with the most to avoid, and the clearance, are seen at once
        *(_phase_plane(cell, i, traces) for i in range(len(cell.arms))),
    ]


def _chart(cell: CoordinationCell, pair: tuple[int, int]) -> Panel:
    i, j = pair
    chart = cell.chart_between(i, j)
    one, other = cell.arms[i].name, cell.arms[j].name
    return Panel(
        title="Coordination chart" if len(cell.arms) == 2 else f"{one}, {other}",
        label=f"{other} on its path [{cell.paths[j].unit}]",
        lines=(Line(column="lam", index=j),),
        low=0.0,
        high=chart.length_b,
        across=Across(
            column="lam", index=i, label=f"{one} on its path [{cell.paths[i].unit}]", low=0.0, high=chart.length_a
        ),
        regions=forbidden_regions(chart),
        others=True,
        equal=cell.paths[i].unit == cell.paths[j].unit,
    )


def _clearance(cell: CoordinationCell, traces: Sequence[CoordinationTrace]) -> Panel:
    """The narrow places count: arms that are far apart for a while may leave the picture."""
    known = [trace.clearance[np.isfinite(trace.clearance)] for trace in traces]
    peaks = [float(values.max(initial=0.0)) for values in known]
    least = min((float(values.min()) for values in known if len(values)), default=0.0)
    low = 1e3 * cell.d_min
    return Panel(
        title="Clearance",
        label="between the arms [mm]",
        unit="mm",
        digits=2,
        lines=(Line(column="clearance", scale=1e3),),
        low=0.0,
        high=max(1.2e3 * min(float(np.median(peaks)), max(WIDE * cell.d_min, 2.0 * least) or np.inf), 2.0 * low)
        or None,
        bands=(Band(low=0.0, high=low, label=f"too close: below {low:g} mm"),),
        others=True,
    )


def _phase_plane(cell: CoordinationCell, i: int, traces: Sequence[CoordinationTrace]) -> Panel:
    """The arm's speed over its position, below the speed from which no torque keeps it on its path."""
    plane, motion, unit = cell.planes[i], cell.fastest[i], cell.paths[i].unit
    station, limit = plane.rows.station, plane.speed_limit()
    going = [(motion.lam, motion.mu), *((trace.lam[:, i], trace.mu[:, i]) for trace in traces)]
    fastest = max(float(mu[~_stands(cell.paths[i], lam)].max(initial=0.0)) for lam, mu in going)
    finite = limit[np.isfinite(limit)]
    lowest = float(finite.min()) if len(finite) else fastest
    top = 1.08 * max(min(1.5 * lowest, 1.25 * fastest), fastest)
    rows = np.unique(np.linspace(0, len(station) - 1, LIMIT_POINTS).round().astype(int))
    points = np.stack([station[rows], np.minimum(limit[rows], 10.0 * top)], axis=1)
    fast = np.unique(np.linspace(0, len(motion.lam) - 1, LIMIT_POINTS).round().astype(int))
    return Panel(
        title="Phase plane" if len(cell.arms) == 1 else f"Phase plane, {cell.arms[i].name}",
        label=f"speed [{unit}/s]",
        lines=(Line(column="mu", index=i, arm=i),),
        low=0.0,
        high=top,
        across=Across(column="lam", index=i, label=f"position on the path [{unit}]", low=0.0, high=plane.length),
        curves=(
            Curve(points=points, label="limit", limit=True),
            Curve(points=np.stack([motion.lam[fast], motion.mu[fast]], axis=1), label="minimum time"),
        ),
    )


def columns(cell: CoordinationCell, trace: CoordinationTrace) -> Mapping[str, Floats]:
    """Positions, speeds and clearance."""
    clearance = np.where(np.isfinite(trace.clearance), trace.clearance, np.nan)  # of an arm alone there is none
    return {"lam": trace.lam, "mu": trace.mu, "clearance": clearance, "path_error": trace.path_error}


def _stands(path: AbstractJointPath, lam: Floats) -> Bools:
    """Where lambda (K,) is on a part on which the arm stands: speeds there are of no picture's scale."""
    inside = np.zeros(len(lam), dtype=np.bool_)
    for part in path.standing:
        inside |= (lam >= part.start) & (lam <= part.stop)
    return inside


def told(cell: CoordinationCell, result: CoordinationResult) -> Told:
    """Makespan of the first episode, how far it is above the bound, who came too close or broke a rule."""
    trace, makespan = result.trace, result.trace.makespan
    end = float(trace.time[-1])
    if trace.violations:
        why = "too close" if trace.clearance.min() < cell.d_min else "rule broken"
        return Told(why, "", f"{why} at {end:.3f} s")
    if not math.isfinite(makespan):
        return Told("not there", "", f"not finished after {end:.3f} s")
    gap = "" if result.gap_percent is None else f", {result.gap_percent:.2f} % above the bound"
    return Told(f"{makespan:.3f} s", f"{makespan:.4f} s{gap if result.makespans_s == (makespan,) else ''}")


def _progress(cell: CoordinationCell, trace: CoordinationTrace) -> Floats:
    return np.asarray(trace.lam / np.array([path.length for path in cell.paths]))


COORDINATION_VIEW: KindView[CoordinationCell, CoordinationTrace, CoordinationResult] = KindView(
    panels=panels, columns=columns, told=told, progress=_progress, usual="vci"
)
