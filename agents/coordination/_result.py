"""What a policy did in cells of several arms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from armtempo.agents.evaluation import Interval, figure, numbers_of
from armtempo.envs import CoordinationTrace
from armtempo.planners import Schedule


@dataclass(frozen=True, kw_only=True, eq=False)
class CoordinationResult:
    """What a policy did; means and worst cases over all episodes. None where there is no number.

    An episode that was not finished counts as its time limit, unless none was: then there is no mean.

    Attributes:
        plan_makespan_s: Makespan of its plan [s].
        makespan_s: Mean instant at which the last arm arrived [s].
        makespans_s: That instant in each episode [s]; None where an arm did not arrive or two came too close.
        makespan_interval_s: 95 % bootstrap interval of the mean [s].
        ratio_to_best_online: Mean makespan over that of the best classical on-line policy.
        ratio_interval: 95 % bootstrap interval of that ratio.
        saving_percent: Share of the sequential time (minimum times added) that it saves. None where episodes start on
            the way, and so is
        gap_percent: How far the simulated makespan is above the certified bound.
        regret_percent: How far the mean makespan is above that of who knows beforehand what happens to the first arm.
        plan_gap_percent: How far that of the plan is.
        min_clearance_m: Smallest distance of two arms at any tick [m].
        torque_ratio_max: Largest |applied torque| / limit.
        torque_demand_ratio_max: Largest |demanded torque| / limit, before clipping.
        torque_clipped_fraction: Share of joint torques that were clipped by more than 0.1 % of their limit.
        path_error_max_m: Largest distance of a tip from its reference on the path [m].
        violations: Ticks with a clearance below d_min, or with a broken rule, all episodes together (an episode ends on
            its first).
        interventions: Share of the decisions that the shield changed; None without a shield.
        finished: Episodes in which all arms arrived and none came too close.
        reward: Mean reward, all arms together.
        planning_time_s: Time to plan [s]; on-line policies plan while they act.
        other_engine_rad: How far another physics engine puts the arms after a tick of the first episode, at most
            [rad, m]; None where it was not asked.
        trace: Of the first episode.
        schedule: Its plan.
    """

    plan_makespan_s: float | None = figure("plan\n[s]", digits=4)
    makespan_s: float | None = figure("simul.\n[s]", digits=4)
    makespans_s: tuple[float | None, ...] = figure()
    makespan_interval_s: Interval | None = figure("95 %\nof mean", digits=4, form="interval", several=True)
    ratio_to_best_online: float | None = figure(
        "ratio to\n{best_online}", interval="ratio_interval", several=True, known=True
    )
    ratio_interval: Interval | None = figure()
    saving_percent: float | None = figure("saving\n[%]", digits=1, known=True)
    gap_percent: float | None = figure("gap\n[%]", digits=2, known=True)
    regret_percent: float | None = figure("regret\n[%]", digits=2, known=True)
    plan_gap_percent: float | None = figure()
    min_clearance_m: float | None = figure("clear.\n[mm]", digits=2, scale=1e3, least="d_min_m")
    torque_ratio_max: float = figure("torque\n[x limit]")
    torque_demand_ratio_max: float = figure("demand\n[x limit]", several=False, roomy=True)
    torque_clipped_fraction: float = figure("clipped\n[%]", digits=1, scale=100.0, several=False, roomy=True)
    path_error_max_m: float = figure("path\nerr. [mm]", scale=1e3)
    violations: int = figure("too close\n[ticks]", form="mishaps")
    interventions: float | None = figure("shield\n[% changed]", digits=2, scale=100.0, known=True)
    finished: int = figure()
    reward: float = figure()
    planning_time_s: float | None = figure()
    other_engine_rad: float | None = figure("other\nengine [rad]", form="significant", default=None, known=True)
    trace: CoordinationTrace = field(repr=False)
    schedule: Schedule | None = field(repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The numbers, by name."""
        return numbers_of(self)


def counted(makespans: Sequence[float | None], time_limit_s: float) -> list[float]:
    """Makespans [s] as means take them: what was not finished took as long as it may; none, if nothing was finished."""
    if all(makespan is None for makespan in makespans):
        return []
    return [time_limit_s if makespan is None else makespan for makespan in makespans]


def safe_makespan(trace: CoordinationTrace) -> float | None:
    """Instant at which the last arm arrived [s]; None where one did not arrive or two came too close."""
    return trace.makespan if math.isfinite(trace.makespan) and not trace.violations else None
