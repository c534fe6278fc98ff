"""``armtempo plan``: schedules of a cell by every method, with their certificates."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.console import CellName, JsonFile, Output, new_table, number, open_cell, plan_all, shown

if TYPE_CHECKING:
    from armtempo.planners import CoordinationCell, Schedule


def plan(
    cell: CellName,
    *,
    methods: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(default: all)")] = (),
    control_period: Annotated[
        float | None, tyro.conf.arg(metavar="S", help_behavior_hint="(default: the cell's)")
    ] = None,
    export: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: none)")] = None,
    period: Annotated[float, tyro.conf.arg(metavar="S")] = 0.001,
    export_format: Literal["csv", "json"] = "csv",
    json_file: JsonFile = None,
) -> None:
    """Plan when every arm of a cell moves, by several methods, and compare them. Nothing is simulated.

    Args:
        cell: A bundled cell's name (see "armtempo cells"), or your own YAML file.
        methods: Planning methods: sequential, constant-speed, constant-acceleration, delay, vci,
            offset, interval, optimal.
        control_period: Step of vci in seconds: the time for which one of its commands holds.
        export: Write the motion of every arm by every method to this folder, as METHOD-ARM.csv: time_s, q_rad,
            qd_rad_s, qdd_rad_s2 and torque_nm of every joint.
        period: Time between the rows of exported motions in seconds; the last row is exactly at the end.
        export_format: What exported motions are written as: csv or json.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    output = Output(json_file)
    _check_period("--control-period", control_period, "0.004")
    _check_period("--period", period, "0.001")
    built = open_cell(cell, output)
    schedules, refusals, seconds = plan_all(built, methods, output, period=control_period)
    with output.progress("Certifying", len(schedules)) as (progress, task):
        entries: dict[str, dict[str, Any]] = {}
        for name, schedule in schedules.items():
            entries[name] = _entry(built, schedule, seconds[name])
            progress.advance(task)
    single = len(built.arms) == 1
    table = new_table(
        f"Plans for {built.name}",
        f"certified lower bound {built.lower_bound:.4f} s; one after the other {built.sequential_makespan:.4f} s; "
        f"d_min {1e3 * built.d_min:g} mm + {1e3 * built.config.clearance_reserve_m:g} mm reserve",
    )
    table.add_column("method", no_wrap=True)
    for head in (
        "makespan\n\\[s]",
        "saving\n\\[%]",
        "gap\n\\[%]",
        "clearance\n\\[mm]",
        "peak torque\n\\[x limit]",
        "peak speed\n\\[x limit]",
        "free between\nsamples",
        "planned in\n\\[s]",
    ):
        table.add_column(head, justify="right")
    best = min(entry["makespan_s"] for entry in entries.values())
    for name, entry in entries.items():
        table.add_row(
            name if entry["fallback"] is None else f"{name} (by {entry['fallback']})",
            number(entry["makespan_s"], 4),
            number(entry["saving_percent"], 1),
            number(entry["gap_percent"], 2),
            number(entry["min_clearance_m"], 2, 1e3),
            number(entry["torque_ratio_max"], 4),
            number(entry["speed_ratio_max"], 3),
            "–" if single else "yes" if entry["certified_free"] else "[red]no[/]",
            number(entry["planning_time_s"], 3),
            style="bold" if entry["makespan_s"] < best + 1e-4 else None,
        )
    output.table(table)
    for name, refusal in refusals.items():
        output.say(f"[red]{name} has no plan:[/] {shown(refusal)}")
    files = [] if export is None else _export(built, schedules, export, period, export_format, output)
    output.json(
        {
            "cell": built.name,
            "lower_bound_s": built.lower_bound,
            "sequential_s": built.sequential_makespan,
            "d_min_m": built.d_min,
            "clearance_reserve_m": built.config.clearance_reserve_m,
            "control_period_s": built.control_period if control_period is None else control_period,
            "exported": [str(file) for file in files],
            "methods": {**entries, **{name: {"error": refusal} for name, refusal in refusals.items()}},
        }
    )


def _check_period(option: str, period: float | None, example: str) -> None:
    """Refuse a period that is no step, before anything is computed.

    Raises:
        InputError: It is not a positive number of seconds.
    """
    import math

    from armtempo.errors import InputError

    if period is not None and not (math.isfinite(period) and period > 0.0):
        raise InputError(f"{option} must be a positive number of seconds, got {period}", remedy=f"try {example}")


def _export(
    cell: CoordinationCell, schedules: dict[str, Schedule], folder: Path, period: float, suffix: str, output: Output
) -> list[Path]:
    """Write one file per method and arm; the files."""
    from armtempo.planners import write_trajectory

    files = []
    with output.progress("Exporting", len(schedules) * len(cell.arms)) as (progress, task):
        for name, schedule in schedules.items():
            for arm, motion in zip(cell.arms, schedule.trajectories, strict=True):
                files.append(folder / f"{name}-{arm.name}.{suffix}")
                write_trajectory(files[-1], motion, period)
                progress.advance(task)
    output.say(f"Motions every {period:g} s in {shown(folder)}{os.sep}: {', '.join(file.name for file in files)}")
    return files


def _entry(cell: CoordinationCell, schedule: Schedule, seconds: float) -> dict[str, Any]:
    certificate = schedule.certificate
    entry: dict[str, Any] = {
        "makespan_s": schedule.makespan,
        "saving_percent": 100.0 * (1.0 - schedule.makespan / cell.sequential_makespan),
        "gap_percent": schedule.gap_percent,
        "min_clearance_m": certificate.min_clearance,
        "torque_ratio_max": certificate.torque_ratio_max,
        "speed_ratio_max": certificate.speed_ratio_max,
        "certified_free": certificate.certified_free,
        "end_error_lambda": certificate.end_error,
        "fallback": schedule.fallback,
        "arrival_s": {arm.name: motion.duration for arm, motion in zip(cell.arms, schedule.trajectories, strict=True)},
        "order": [cell.arms[i].name for i in schedule.order],
        "planning_time_s": seconds,
    }
    if schedule.vci is not None:
        entry["corrections"] = schedule.vci.corrections
        entry["longest_vci_s"] = schedule.vci.longest_interval
    return entry
