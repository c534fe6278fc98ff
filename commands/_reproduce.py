"""``armtempo reproduce``: a paper's every table value and figure beside ours."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import tyro

from armtempo.commands.console import JsonFile, Output, new_table, number, shown
from armtempo.commands.papers._reproduction import Reproduction
from armtempo.errors import UnknownNameError
from armtempo.files import check_output_folder

# Imports inside the functions are late: the papers need the planners and matplotlib, and --help is to be quick.


def _lee1991(output: Output) -> Reproduction:
    from armtempo.commands.papers.lee1991._figures import lee1991_figures
    from armtempo.commands.papers.lee1991._quantities import compare, run
    from armtempo.planners import load_cell

    with output.progress("Loading lee1991 (compiles once after installation)"):
        cell = load_cell("lee1991")
    found = run(cell, output)
    with output.progress("Comparing"):
        quantities = compare(found)
    with output.progress("Drawing"):
        figures = lee1991_figures(cell, found.plans)
    return Reproduction("Lee, Chong, Suh, Choi, Lyou (1991)", quantities, figures)


def _lee2006(output: Output) -> Reproduction:
    from armtempo.commands.papers.lee2006._figures import lee2006_figures
    from armtempo.commands.papers.lee2006._quantities import compare, run
    from armtempo.planners import BlendCell, load_cell

    with output.progress("Loading lee2006 (compiles once after installation)"):
        cell = load_cell("lee2006", BlendCell)
        sampled = run(cell)
    with output.progress("Comparing"):
        quantities = compare(cell, sampled)
    with output.progress("Drawing"):
        figures = lee2006_figures(cell, sampled)
    return Reproduction("Lee, Ryu, Cheong (2006)", quantities, figures)


def _chung(output: Output) -> Reproduction:
    from armtempo.commands.papers.chung._figures import chung_figures
    from armtempo.commands.papers.chung._quantities import CAPTION, compare
    from armtempo.commands.papers.chung._run import run

    with output.progress("Tracking (compiles once after installation)"):
        found = run()
    with output.progress("Comparing"):
        quantities = compare(found)
    with output.progress("Drawing"):
        figures = chung_figures(found)
    return Reproduction("Chung, Ryu, Park", quantities, figures, "reference", CAPTION)


PAPERS: dict[str, Callable[[Output], Reproduction]] = {"lee1991": _lee1991, "lee2006": _lee2006, "chung": _chung}


def reproduce(
    paper: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="PAPER")],
    *,
    json_file: JsonFile = None,
    out: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: results/<paper>/paper)")
    ] = None,
) -> None:
    """Compute every table value and draw every figure of a paper, ours beside the printed ones.

    Args:
        paper: lee1991: "Near-Minimum Time Trajectory Planning of Two Robots with Collision Avoidance" (Lee, Chong, Suh,
            Choi, Lyou 1991). lee2006: "Smoothly Connected Path Generation and Time-Scheduling Method for
            Industrial Robot Applications" (Lee, Ryu, Cheong 2006). chung: "A New Method for Solving the Inverse
            Kinematics for 6 D.O.F. Manipulator" (Chung, Ryu, Park).
        json_file: Write the same figures there as JSON: a list of quantity, unit, paper (null where the paper has no
            number; for chung, which prints none of its run, what its equations say or an independent computation),
            ours; "-" for nothing but JSON on stdout.
        out: Folder for the PNG files.
    """
    if paper not in PAPERS:
        raise UnknownNameError("paper", paper, tuple(PAPERS))
    from armtempo.commands.figures._write import draw

    output = Output(json_file)
    folder = Path("results") / paper / "paper" if out is None else out
    check_output_folder(folder)
    found = PAPERS[paper](output)
    _tabulate(found, output)
    output.json([quantity.to_dict() for quantity in found.quantities])
    output.pictures(folder, draw(found.figures, folder, output))


def _tabulate(found: Reproduction, output: Output) -> None:
    table = new_table(f"{found.source}: the {found.reference} beside ours", found.caption)
    table.add_column("quantity")
    table.add_column("unit")
    table.add_column(found.reference, justify="right")
    table.add_column("ours", justify="right")
    table.add_column("note", style="dim")
    section = ""
    for quantity in found.quantities:
        if quantity.section != section:
            section = quantity.section
            table.add_section()
            table.add_row(f"[bold]{section}[/]")
        digits = f".{quantity.digits}g" if quantity.significant else "g"
        printed = "–" if quantity.paper is None else f"{quantity.paper:{digits}}"
        table.add_row(
            f"  {quantity.quantity}",
            quantity.unit,
            printed,
            f"{quantity.ours:{digits}}" if quantity.significant else number(quantity.ours, quantity.digits),
            shown(quantity.note),
        )
    output.table(table)
