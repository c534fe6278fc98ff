"""Plans written for other programs, and what the controllers of robots make of them."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from armtempo.commands.console import Output, new_table, number, shown, significant
from armtempo.commands.plans._plans import CellPlans
from armtempo.errors import InputError
from armtempo.planners import write_trajectory
from armtempo.planners.exports import ENDINGS, FORMS, Form, RobotMotion, export_motion

if TYPE_CHECKING:
    from rich.table import Table

ExportForm = Form | Literal["csv", "json"]

KNOWN: Final[Mapping[ExportForm, tuple[str, ...]]] = {
    "csv": (".csv",),
    **{form: ENDINGS[form] for form in FORMS},
    "json": (".json",),
}
"""Endings of files by form; the first form with an ending is what it says. Anything else is a folder."""
UR_RATE_HZ = 500.0
ROBOT_RATE_HZ = 500.0


def export_plans(
    plans: CellPlans[Any, Any], target: Path, form: ExportForm | None, rate_hz: float | None, output: Output
) -> dict[str, Any]:
    """Write plans to a folder, or the only one to a file; the files, and what interpolating controllers make of them.

    Raises:
        InputError: As ``export_form``, or a motion cannot be exported so.
    """
    form = export_form(target, form, plans.plans)
    if form == "csv" or form == "json":
        return {"exported": _write_samples(plans, target, form, rate_hz, output)}
    return _write_robot_motions(plans, target, form, rate_hz, output)


def _is_file(target: Path) -> bool:
    return any(target.suffix.lower() in endings for endings in KNOWN.values())


def export_form(target: Path, form: ExportForm | None, methods: Collection[str]) -> ExportForm:
    """The form of the files that go to a file or folder.

    Raises:
        InputError: It does not fit the file's ending, or several plans are to go into one file.
    """
    if not _is_file(target):
        return form or "csv"
    if len(methods) != 1:
        raise InputError(
            f"--export {target}: a file holds one plan",
            remedy="name its method, such as --methods NAME, or give a folder",
        )
    ending = target.suffix.lower()
    fits = [name for name, endings in KNOWN.items() if ending in endings]
    if form is not None and form not in fits:
        raise InputError(
            f"--export {target}: {form} is not kept in {ending}",
            remedy=f"give it the ending {' or '.join(KNOWN[form])}, or a folder",
        )
    return form or fits[0]


def _write_samples(
    plans: CellPlans[Any, Any], target: Path, form: str, rate_hz: float | None, output: Output
) -> list[str]:
    """One file per method and arm."""
    files = []
    one, alone = _is_file(target), len(plans.cell.arms) == 1
    with output.progress("Exporting", len(plans.plans) * len(plans.cell.arms)) as (progress, task):
        for name, motion in plans.motions(None if rate_hz is None else 1.0 / rate_hz):
            arm = name.removeprefix(f"{next(iter(plans.plans))}-")
            beside = target if alone else target.with_name(f"{target.stem}-{arm}{target.suffix}")
            files.append(beside if one else target / f"{name}.{form}")
            write_trajectory(files[-1], motion)
            progress.advance(task)
    every = "" if rate_hz is None else f" at {rate_hz:g} Hz"
    _tell(files, every, output)
    return [str(file) for file in files]


def _write_robot_motions(
    plans: CellPlans[Any, Any], target: Path, form: Form, rate_hz: float | None, output: Output
) -> dict[str, Any]:
    """One motion of all arms per method, and a table of what controllers make of it."""
    rate = rate_hz or (UR_RATE_HZ if form == "urscript" else ROBOT_RATE_HZ)
    files: list[Path] = []
    motions: dict[str, RobotMotion] = {}
    with output.progress("Exporting", len(plans.plans)) as (progress, task):
        for name in plans.plans:
            motions[name] = plans.robot_motion(name, rate)
            files += export_motion(
                target if _is_file(target) else target / f"{name}{ENDINGS[form][0]}", motions[name], form
            )
            progress.advance(task)
    output.table(_table(motions, rate))
    _tell(files, f" at {rate:g} Hz", output)
    made = {
        name: {
            arm.name: {kind: asdict(one) for kind, one in own.items()}
            for arm, own in zip(motion.arms, motion.interpolations, strict=True)
        }
        for name, motion in motions.items()
    }
    return {"exported": [str(one) for one in files], "rate_hz": rate, "interpolation": made}


def _table(motions: Mapping[str, RobotMotion], rate: float) -> Table:
    table = new_table(
        "What a controller makes of the points",
        f"points at {rate:g} Hz; cubic: through positions and speeds, quintic: through accelerations, too; excess: "
        "above the limits of speed, acceleration and torque (of a dash, none is known)",
    )
    for head in ("method", "arm", "controller"):
        table.add_column(head, no_wrap=True)
    for head in (
        "off the plan\n\\[µrad, µm]",
        "speed\nexcess \\[%]",
        "acceleration\nexcess \\[%]",
        "torque\nexcess \\[%]",
    ):
        table.add_column(head, justify="right")
    for name, motion in motions.items():
        for arm, own in zip(motion.arms, motion.interpolations, strict=True):
            for kind, made in own.items():
                cells = [
                    number(made.excess[limit] if getattr(made, f"{limit}_ratio_max") > 0.0 else None, 2, 100.0)
                    for limit in ("speed", "acceleration", "torque")
                ]
                table.add_row(shown(name), shown(arm.name), kind, _off(made.position_error), *cells)
    return table


def _off(error: float | None) -> str:
    return "–" if error is None else significant(1e6 * error)


def _tell(files: list[Path], how: str, output: Output) -> None:
    output.say(f"Motions{how} in {shown(files[0].parent)}{os.sep}: {', '.join(shown(file.name) for file in files)}")
