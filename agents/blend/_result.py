"""What a policy did in blend cells, and what of a trace is inside blends."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from armtempo.agents.evaluation import figure, numbers_of
from armtempo.arrays import Bools, Floats
from armtempo.envs import BlendTrace
from armtempo.planners.blends import Blend
from armtempo.planners.cells import MotionDemand, motion_demand


@dataclass(frozen=True, kw_only=True, eq=False)
class BlendResult:
    """What a policy did; means over the episodes that finished, worst cases over all. None where there is no number.

    Speed errors are those of the tip against its reference, tick by tick, in the blends alone.

    Attributes:
        plan_duration_s: Mean duration of its plan [s], over the episodes that finished like ``duration_s``; None for
            policies without one.
        duration_s: Mean instant of arrival [s].
        blend_speed_min_m_s: Lowest line speed of the reference in a blend [m/s].
        arc_speed_error_max_m_s: Largest error of the speed along the path [m/s]; rms likewise.
        chord_speed_error_max_m_s: Largest error of the speed from point to point [m/s]; rms likewise.
        contour_error_max_m: Largest distance of the tip from the path [m]; rms likewise.
        normal_acceleration_ratio_max: Largest normal acceleration of the reference / limit.
        jerk_ratio_max: Largest jerk of the reference, as a vector, / limit; between jumps of the curvature.
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        reward: Mean reward.
        finished: Episodes in which the arm arrived.
        left: Episodes in which the tip left the tube around the path.
        planning_time_s: Time to blend the given path, to find the joints along it and to plan the profile [s].
        other_engine_rad: How far another physics engine puts the arms after a tick of the first episode, at most
            [rad, m]; None where it was not asked.
        trace: Of the first episode.
    """

    plan_duration_s: float | None = figure("plan\n[s]")
    duration_s: float | None = figure("simul.\n[s]")
    blend_speed_min_m_s: float | None = figure("slowest\n[mm/s]", digits=0, scale=1e3)
    arc_speed_error_max_m_s: float | None = figure("arc err.\n[mm/s]", scale=1e3, form="small")
    arc_speed_error_rms_m_s: float | None = figure()
    chord_speed_error_max_m_s: float | None = figure("chord err.\n[mm/s]", scale=1e3, form="small")
    chord_speed_error_rms_m_s: float | None = figure()
    contour_error_max_m: float = figure("contour\n[mm]", scale=1e3, form="small")
    contour_error_rms_m: float = figure()
    normal_acceleration_ratio_max: float = figure("normal\n[x]", limit=1.0)
    jerk_ratio_max: float = figure("jerk\n[x]", limit=1.0)
    torque_ratio_max: float = figure()
    torque_demand_ratio_max: float = figure("torque\n[x]", limit=1.0)
    reward: float = figure("reward")
    finished: int = figure("done", form="episodes")
    left: int = figure("left", form="mishaps")
    planning_time_s: float = figure()
    other_engine_rad: float | None = figure("other\nengine [rad]", form="significant", default=None, known=True)
    trace: BlendTrace = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return numbers_of(self)


def in_blends(trace: BlendTrace) -> Bools:
    """(T+1,) ticks that the reference spends inside blends, from their beginning to their end."""
    path = trace.cell.blended
    inside = np.zeros(len(trace.s), dtype=bool)
    before = np.concatenate([trace.s[:1], trace.s[:-1]])
    for piece, low, high in zip(path.pieces, path.breakpoints[:-1], path.breakpoints[1:], strict=True):
        if isinstance(piece, Blend):
            inside |= (before >= low) & (trace.s <= high) & (trace.s > before)
    return inside


def speed_errors(trace: BlendTrace) -> tuple[Floats, Floats]:
    """Speed of the tip minus that of its reference, in the ticks inside blends: along the path, and point to point."""
    tick = float(trace.time[1] - trace.time[0])
    inside = in_blends(trace)
    wanted = np.diff(trace.s, prepend=trace.s[0])[inside] / tick
    return trace.arc_speed[inside] - wanted, trace.line_speed[inside] - wanted


def reference_demand(trace: BlendTrace) -> MotionDemand:
    """What the reference asks for at the ticks."""
    return motion_demand(trace.cell, trace.s, trace.v, trace.a, trace.j)
