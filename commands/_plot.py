"""``armtempo plot``: figures of a cell and its plans, without simulation."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from armtempo.commands.console import CellName, OutFolder, Output, default_folder, open_cell, plan_all

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.planners import CoordinationCell, Schedule


def plot(
    cell: CellName,
    *,
    method: Annotated[str, tyro.conf.arg(metavar="NAME")] = "vci",
    out: OutFolder = None,
) -> None:
    """Draw a cell and its plans: arms, coordination chart, phase plane, torques, clearance. Nothing is simulated.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        method: The method shown in detail: sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal.
        out: Folder for the PNG files.
    """
    from armtempo.errors import InfeasibleError, UnknownNameError
    from armtempo.planners import METHODS

    if method not in METHODS:
        raise UnknownNameError("method", method, METHODS)
    output = Output(None)
    built = open_cell(cell, output)
    schedules, refusals, _ = plan_all(built, (), output)
    if method not in schedules:
        raise InfeasibleError(refusals[method])
    folder = default_folder(built, out)
    output.pictures(folder, draw(plan_figures(built, schedules, method), folder, output))


def draw(figures: Mapping[str, Figure], folder: Path, output: Output) -> list[str]:
    """Write figures as ``<name>.png``; returns the file names."""
    from armtempo.commands.figures._style import write_png

    names = [f"{name}.png" for name in figures]
    with output.progress("Writing pictures", len(figures)) as (progress, task):
        for name, figure in zip(names, figures.values(), strict=True):
            write_png(figure, folder / name)
            progress.advance(task)
    return names


def plan_figures(cell: CoordinationCell, schedules: Mapping[str, Schedule], method: str) -> dict[str, Figure]:
    """Figures of a cell and its plans by file name; charts only where there are two arms or more."""
    from armtempo.commands.figures import _phase as _phase_figures
    from armtempo.commands.figures import _solve as _solve_figures
    from armtempo.commands.figures import _space as _space_figures
    from armtempo.commands.figures import _time as _time_figures

    plan = schedules[method]
    figures = {"workspace": _space_figures.workspace(cell)}
    if len(cell.arms) > 1:
        pair = _space_figures.meeting(cell)[0]
        if cell.chart_between(*pair).regions:
            figures["collision_interval"] = _space_figures.collision_interval(cell, pair=pair)
        figures |= {
            "coordination_chart": _space_figures.coordination_chart(cell, pair=pair),
            "relative_motion": _space_figures.relative_trajectories(cell, schedules, method),
        }
    if len(cell.arms) == 2:
        cases: tuple[tuple[Literal[3, 4], str], ...] = ((3, "vci_last_step"), (4, "vci_earlier_step"))
        for case, name in cases:
            correction = _phase_figures.find_correction(cell, case)
            if correction is not None:
                figures[name] = _phase_figures.velocity_control(cell, correction)
    figures |= {
        "phase_plane": _phase_figures.phase_plane(plan, f"Motions in the phase plane: {method}"),
        "running_time": _phase_figures.running_time(plan, f"Running time: the area under 1/μ ({method})"),
        "torque": _time_figures.torques(plan, title=f"Planned torques: {method}"),
        "time_lines": _time_figures.time_lines(
            cell, {name: _time_figures.planned_speeds(own) for name, own in schedules.items()}, cell.lower_bound
        ),
    }
    figures |= {f"solve_{arm.name}": _solve_figures.solve(cell, i) for i, arm in enumerate(cell.arms)}
    if len(cell.arms) > 1:
        figures["clearance"] = _time_figures.clearances(cell, schedules, emphasised=method)
    return figures
