"""Pages of blend cells: speed along the path and over time, accelerations and jerk, distance from the path."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from armtempo.arrays import Floats
from armtempo.commands.figures._blend import SMALLEST_ERROR, acceleration_shares
from armtempo.commands.viewer._kind_view import KindView, Told
from armtempo.commands.viewer._panels import Across, Curve, Line, Mark, Panel
from armtempo.planners import BlendCell

if TYPE_CHECKING:
    from armtempo.agents import BlendResult
    from armtempo.envs import BlendTrace

__all__ = ["BLEND_VIEW"]

LIMIT_POINTS = 800
ALONG = "Line speed along the path"


def panels(cell: BlendCell, traces: Sequence[BlendTrace]) -> list[Panel]:
    """Speeds, shares of limits, contour error."""
    limit = 1e3 * cell.limits.speed
    length = max(trace.cell.blended.length for trace in traces)
    shares = ("along the path", "normal", "jerk")
    return [
        Panel(
            title=ALONG,
            label="speed [mm/s]",
            digits=1,
            lines=(Line(column="v", scale=1e3),),
            low=0.0,
            high=1.15 * limit,
            across=Across(column="s", index=0, label="length along the path [m]", low=0.0, high=length),
            others=True,
        ),
        Panel(
            title="Line speed of the tip",
            label="point to point [mm/s]",
            unit="mm/s",
            digits=1,
            lines=(Line(column="line_speed", scale=1e3),),
            low=0.0,
            high=1.15 * limit,
            marks=(Mark(at=limit),),
            others=True,
        ),
        Panel(
            title="Accelerations and jerk",
            label="share of the limit",
            unit="x",
            digits=2,
            lines=tuple(Line(column="shares", index=k, label=name, joint=k) for k, name in enumerate(shares)),
            low=0.0,
            marks=(Mark(at=1.0, label="limit"),),
            largest=True,
        ),
        Panel(
            title="Distance from the path",
            label="contour error [mm]",
            unit="mm",
            lines=(Line(column="contour_error", scale=1e3),),
            marks=(Mark(at=1e3 * cell.contour_error_max, label="allowed"),),
            others=True,
            log=True,
            floor=SMALLEST_ERROR,
        ),
    ]


def columns(cell: BlendCell, trace: BlendTrace) -> Mapping[str, Floats]:
    """Length, speeds, error, shares of limits."""
    return {
        "s": trace.s,
        "v": trace.v,
        "line_speed": trace.line_speed,
        "contour_error": trace.contour_error,
        "shares": acceleration_shares(trace),
    }


def curves(cell: BlendCell, trace: BlendTrace) -> Mapping[str, Sequence[Curve]]:
    """The speed from which the path's curvature asks for more than the limit of the normal acceleration."""
    s, limits = np.linspace(0.0, cell.blended.length, LIMIT_POINTS), cell.limits
    speed = np.sqrt(limits.normal / np.maximum(cell.blended.curvature(s), limits.normal / limits.speed**2))
    return {ALONG: [Curve(points=np.stack([s, 1e3 * speed], axis=1), label="limit", limit=True)]}


def _progress(cell: BlendCell, trace: BlendTrace) -> Floats:
    return np.asarray(trace.s[:, None] / cell.blended.length)


def told(cell: BlendCell, result: BlendResult) -> Told:
    """When the arm arrived, and by how much limits are exceeded."""
    trace = result.trace
    shares = {"normal acceleration": result.normal_acceleration_ratio_max, "jerk": result.jerk_ratio_max}
    headline = ", ".join(f"{name} {share:.2f} x" for name, share in shares.items())
    if trace.left:
        return Told("left the path", headline, f"left the path by {1e3 * trace.contour_error[-1]:.3g} mm")
    if not math.isfinite(trace.arrival):
        return Told("not there", headline, f"not finished after {trace.time[-1]:.3f} s")
    return Told(f"{trace.arrival:.3f} s", f"{trace.arrival:.4f} s; {headline}")


BLEND_VIEW: KindView[BlendCell, BlendTrace, BlendResult] = KindView(
    panels=panels, columns=columns, curves=curves, progress=_progress, told=told, usual="limit-aware"
)
