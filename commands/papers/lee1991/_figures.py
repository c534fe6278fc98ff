"""The figures of Lee, Chong, Suh, Choi, Lyou (1991), from our data."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure

from armtempo.commands.figures import _phase, _space, _time
from armtempo.commands.figures._workspace import workspace
from armtempo.planners import CoordinationCell, Schedule

CORRECTIONS: Mapping[_phase.Case, str] = {3: "last step adjusted", 4: "earlier step adjusted"}


def lee1991_figures(cell: CoordinationCell, plans: Mapping[str, Schedule]) -> dict[str, Figure]:
    """Figs. 1 to 8 of the paper from our data, then torque and clearance over time, by file name."""
    vci = plans["vci"]
    figures = {
        "fig1_collision_interval": _space.collision_interval(
            cell, title="Fig. 1  Collision interval in the common workspace"
        ),
        "fig2_coordination_chart": _space.coordination_chart(cell, title="Fig. 2  Coordination chart"),
    }
    for case, name in CORRECTIONS.items():
        correction = _phase.find_correction(cell, case)
        if correction is not None:
            figures[f"fig{case}_vci_{name.split()[0]}_step"] = _phase.velocity_control(
                cell, correction, f"Fig. {case}  Modified trajectory of the slave: {name}"
            )
    figures |= {
        "fig5_workspace": workspace(cell, "Fig. 5  Two robots in a common workspace"),
        "fig6_phase_plane": _phase.phase_plane(vci, "Fig. 6  Trajectories of the two robots in the phase plane"),
        "fig7_relative_trajectory": _space.relative_trajectories(
            cell, plans, "vci", "Fig. 7  Relative trajectory in the coordination chart"
        ),
        "fig8_running_time": _phase.running_time(vci, "Fig. 8  Running time: the area under 1/μ"),
        "torque": _time.torques(vci, title="Torques over time: vci"),
        "clearance": _time.clearances(cell, plans, emphasised="vci"),
    }
    return figures
