"""``armtempo plot``: figures of a cell and its plans, without simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from armtempo.commands.console import CellName, Output, open_cell, output_folder
from armtempo.errors import InfeasibleError, UnknownNameError


def plot(
    cell: CellName,
    *,
    method: Annotated[
        str | None, tyro.conf.arg(metavar="NAME", help_behavior_hint="(default: vci; of one arm all)")
    ] = None,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: results/<cell>/plans)")
    ] = None,
) -> None:
    """Draw a cell and its plans: arms, coordination chart, phase plane, torques, clearance. Nothing is simulated.

    Of a blend cell: its path and corners, the speed of its profiles, accelerations, joint speeds and torques against
    their limits. Of an ik cell: target and arm, errors of the law with their bounds, joint speeds, torques.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        method: The method shown in detail: sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal. Of a blend cell the only one shown: line-speed, limit-aware, limit-aware-smooth;
            likewise of an ik cell: law, feedback, feedback-ff, newton.
        out: Folder for the PNG files.
    """
    output = Output(None)
    folder = output_folder(cell, out, "plans")  # evaluate draws pictures of the same names
    built = open_cell(cell, output)
    from armtempo.commands.figures._write import draw  # late, as the next: matplotlib, and the planners
    from armtempo.commands.plans import PLANS

    kind = PLANS[built.kind]
    if method is not None and method not in kind.METHODS:
        raise UnknownNameError("method", method, kind.METHODS)
    if kind.SHOWN is None:  # all alike, or the one that was asked for
        detail, planned = method or "", () if method is None else (method,)
    else:
        detail, planned = method or kind.SHOWN, ()
    plans = kind(built, planned, output)
    if detail in plans.refusals:
        raise InfeasibleError(plans.refusals[detail])
    with output.progress("Drawing"):
        figures = plans.figures(detail)
    output.pictures(folder, draw(figures, folder, output))
