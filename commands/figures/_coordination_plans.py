"""Figures of a coordination cell and its schedules: arms, charts, phase plane, torques, clearance."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from armtempo.commands.figures import _phase, _solve, _space, _time
from armtempo.commands.figures._workspace import workspace
from armtempo.planners import CoordinationCell, Schedule

CORRECTIONS: Mapping[str, _phase.Case] = {
    "vci_last_step": 3,
    "vci_earlier_step": 4,
}  # of velocity control, by the paper's figures


def coordination_plan_figures(
    cell: CoordinationCell, schedules: Mapping[str, Schedule], method: str
) -> dict[str, Figure]:
    """Figures by file name, ``method`` in detail; charts only where there are two arms or more."""
    plan = schedules[method]
    figures = {"workspace": workspace(cell)}
    if len(cell.arms) > 1:
        pair = _space.meeting(cell)[0]
        if cell.chart_between(*pair).regions:
            figures["collision_interval"] = _space.collision_interval(cell, pair=pair)
        figures |= {
            "coordination_chart": _space.coordination_chart(cell, pair=pair),
            "relative_motion": _space.relative_trajectories(cell, schedules, method),
        }
    if len(cell.arms) == 2:
        for name, case in CORRECTIONS.items():
            correction = _phase.find_correction(cell, case)
            if correction is not None:
                figures[name] = _phase.velocity_control(cell, correction)
    figures |= {
        "phase_plane": _phase.phase_plane(plan, f"Motions in the phase plane: {method}"),
        "running_time": _phase.running_time(plan, f"Running time: the area under 1/μ ({method})"),
        "torque": _time.torques(plan, title=f"Planned torques: {method}"),
        "time_lines": _time.time_lines(
            cell, {name: _time.planned_speeds(own) for name, own in schedules.items()}, cell.lower_bound
        ),
    }
    figures |= {f"solve_{arm.name}": _solve.solve(cell, i) for i, arm in enumerate(cell.arms)}
    if len(cell.arms) > 1:
        figures["clearance"] = _time.clearances(cell, schedules, emphasised=method)
    return figures
