"""``armtempo plan``: plans of a cell by every method, with their certificates."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.console import AllNames, CellName, JsonFile, Output, check_period, open_cell, shown
from armtempo.files import check_output_folder

if TYPE_CHECKING:
    from armtempo.commands.plans import CellPlans


def plan(
    cell: CellName,
    *,
    methods: AllNames = (),
    control_period: Annotated[
        float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(default: the cell's)")
    ] = None,
    orders: Literal["best", "file", "all"] = "best",
    smooth: bool = False,
    export: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: none)")] = None,
    period: Annotated[
        float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(default: 0.001, or the tick)")
    ] = None,
    export_format: Literal["csv", "json"] = "csv",
    json_file: JsonFile = None,
) -> None:
    """Plan when every arm of a cell moves, by several methods, and compare them. Nothing is simulated.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        methods: Planning methods: sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal; of a blend cell its profiles line-speed, limit-aware, limit-aware-smooth;
            of an ik cell runs of its law and others: law, feedback, feedback-ff, newton.
        control_period: Step of vci in seconds: the time for which one of its commands holds.
        orders: Of several arms, the first of which never yields: the best order of each method, that of the file, or
            all of them, each with a plan of its own.
        smooth: Plans of motions within the arms' jerk limits (limits.jerk_rad_s3), started so that each plan's passing
            order stays as it is; the table says what that costs.
        export: Write the motion of every arm by every method to this folder, as METHOD-ARM.csv: time_s, q_rad,
            qd_rad_s, qdd_rad_s2 and torque_nm of every joint.
        period: Time between the rows of exported motions in seconds; the last row is exactly at the end. Without it
            that of a blend or ik cell is its physics tick. In an ik cell it is a whole number of ticks.
        export_format: What exported motions are written as: csv or json.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    check_period("--control-period", control_period, "0.004")
    check_period("--period", period, "0.001")
    if export is not None:
        check_output_folder(export)
    built = open_cell(cell, output)
    from armtempo.commands.plans import PLANS  # late: it imports the planners, and --help is to be quick

    plans = PLANS[built.kind](built, methods, output, control_period=control_period, orders=orders, smooth=smooth)
    with output.progress("Certifying"):
        entries = plans.entries()
    for table in plans.tables(entries):
        output.table(table)
    for name, refusal in plans.refusals.items():
        output.say(f"[red]{name} has no plan:[/] {shown(refusal)}")
    files = [] if export is None else _export(plans, export, period, export_format, output)
    refused = {name: {"error": refusal} for name, refusal in plans.refusals.items()}
    output.json({**plans.facts(), "exported": [str(file) for file in files], "methods": {**entries, **refused}})


def _export(plans: CellPlans[Any, Any], folder: Path, period: float | None, suffix: str, output: Output) -> list[Path]:
    """Write one file per method and arm; the files."""
    from armtempo.planners import write_trajectory  # late: see above

    files = []
    with output.progress("Exporting", len(plans.plans) * len(plans.cell.arms)) as (progress, task):
        for name, motion in plans.motions(period):
            files.append(folder / f"{name}.{suffix}")
            write_trajectory(files[-1], motion)
            progress.advance(task)
    every = "" if period is None else f" every {period:g} s"
    output.say(f"Motions{every} in {shown(folder)}{os.sep}: {', '.join(file.name for file in files)}")
    return files
