"""``armtempo plan``: plans of a cell by every method, with their certificates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro

from armtempo.commands.console import AllNames, CellName, JsonFile, Output, check_period, check_rate, open_cell, shown
from armtempo.files import check_output_folder


def plan(
    cell: CellName,
    *,
    methods: AllNames = (),
    control_period: Annotated[
        float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(default: the cell's)")
    ] = None,
    orders: Literal["best", "file", "all"] = "best",
    smooth: bool = False,
    export: Annotated[Path | None, tyro.conf.arg(metavar="FILE|DIR", help_behavior_hint="(default: none)")] = None,
    rate_hz: Annotated[
        float | None, tyro.conf.arg(metavar="HZ", help_behavior_hint="(default: 500; csv, json: 1000, or every tick)")
    ] = None,
    export_format: Annotated[
        Literal["csv", "json", "joint-trajectory", "robot-trajectory", "mcap", "urscript"] | None,
        tyro.conf.arg(name="format", help_behavior_hint="(default: by the ending; in a folder csv)"),
    ] = None,
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
        export: Write the motion by one method to this file (.json, .yaml, .mcap, .script, .csv), or those by every
            method to this folder.
        rate_hz: Rows of exported motions per second. In an ik cell one row stands for a whole number of ticks.
        export_format: csv and json: time_s, q_rad, qd_rad_s, qdd_rad_s2 and torque_nm of every joint, a file per arm.
            The others have all arms on one time base, and a table says what interpolating controllers make of them:
            joint-trajectory and robot-trajectory (the ROS messages as JSON or YAML), mcap (a ROS 2 bag), urscript.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    check_period("--control-period", control_period, "0.004")
    check_rate("--rate-hz", rate_hz)
    if export is not None:
        check_output_folder(export.parent if export.suffix else export)
    built = open_cell(cell, output)
    # late: it imports the planners, and --help is to be quick
    from armtempo.commands.plans import PLANS, export_form, export_plans

    if export is not None:
        export_form(export, export_format, methods)  # before anything is computed
    plans = PLANS[built.kind](built, methods, output, control_period=control_period, orders=orders, smooth=smooth)
    with output.progress("Certifying"):
        entries = plans.entries()
    for table in plans.tables(entries):
        output.table(table)
    for name, refusal in plans.refusals.items():
        output.say(f"[red]{name} has no plan:[/] {shown(refusal)}")
    exported: dict[str, object] = {"exported": []}
    if export is not None:
        exported = export_plans(plans, export, export_format, rate_hz, output)
    refused = {name: {"error": refusal} for name, refusal in plans.refusals.items()}
    output.json({**plans.facts(), **exported, "methods": {**entries, **refused}})
