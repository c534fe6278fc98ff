"""``armtempo cells generate``: random cells, labelled, with their charts."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from armtempo.cache import content_key
from armtempo.commands.console import JsonFile, Output, new_table, shown
from armtempo.errors import InputError
from armtempo.files import check_output_folder, whole_file

LABELS, DIGESTS = ".labels.json", "digests"
SUFFIXES = (".yaml", ".npz", LABELS)


def generate(
    *,
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")],
    family: Literal["planar", "shaped", "ring", "rows", "fixture", "panda", "iiwa", "ur5e"] = "planar",
    count: int = 20,
    seed: int = 1,
    first: int = 0,
    arms: Annotated[int | None, tyro.conf.arg(metavar="K", help_behavior_hint="(default: the fewest)")] = None,
    json_file: JsonFile = None,
) -> None:
    """Draw random cells whose arms conflict at full speed, and label them. Each is the same on every machine and day.

    Writes three files per cell: NAME.yaml goes wherever a cell's name does, NAME.labels.json says whether it is
    feasible, its class (uniform or mixed) and bound, NAME.npz has charts and path coefficients for load_instance.

    Args:
        out: Folder for the files. Cells that are there already are kept: an interrupted run goes on where it was. Those
            that are not as they were drawn are refused.
        family: planar (two-link arms that face each other), shaped (those in which shaping the speed pays), such arms
            in a ring, in rows, or around a fixture; robots: panda, iiwa or ur5e.
        count: How many.
        seed: Of the generator.
        first: Number of the first one; the k-th of a seed is the same whichever are drawn before it.
        arms: How many: ring 2 to 16, rows 4 to 16, fixture 3 to 6, robots 2 to 4.
        json_file: Write labels and rejected draws there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    from armtempo.planners import generate_cell  # late, as the next: --help is to be quick
    from armtempo.planners.instances import ARMS_OF, cell_name

    if count < 1:
        raise InputError(f"--count must be at least 1, got {count}")
    output = Output(json_file)
    arms = ARMS_OF[family][0] if arms is None else arms
    check_output_folder(out)
    entries: list[dict[str, Any]] = []
    rejected: Counter[str] = Counter()
    drawn = 0
    try:
        with output.progress(f"Drawing {family} cells", count) as (progress, task):
            for index in range(first, first + count):
                name = cell_name(family, seed, index, arms=arms)
                progress.update(task, description=f"Drawing {name}")
                entry = _taken_over(out, name)
                if entry is None:
                    entry = _write(out, generate_cell(family, seed, index, arms=arms))
                    drawn += 1
                entries.append(entry)
                rejected.update(entry["rejected"])
                progress.advance(task)
    except KeyboardInterrupt as stop:
        stop.add_note(f"{len(entries)} cells are in {out}; the same line goes on with them")
        raise
    table = new_table(f"{count} {family} cells of seed {seed}")
    table.add_column("status")
    table.add_column("class")
    table.add_column("cells", justify="right")
    for (status, kind), number in sorted(Counter((entry["status"], entry["class"]) for entry in entries).items()):
        table.add_row(status, kind, str(number))
    output.table(table)
    words = ", ".join(f"{number} x {reason}" for reason, number in rejected.most_common())
    output.say(f"{drawn} drawn, {count - drawn} were there already. Rejected draws: {words or 'none'}")
    output.say(f"Cells, labels and charts in {shown(out)}")
    output.json(
        {
            "family": family,
            "seed": seed,
            "arms": arms,
            "drawn": drawn,
            "rejected": dict(rejected),
            "cells": entries,
        }
    )


def _taken_over(out: Path, name: str) -> dict[str, Any] | None:
    """The labels of a cell whose three files are there; None: it is to be drawn.

    Raises:
        InputError: One of them is not as it was written.
    """
    files = {suffix: out / f"{name}{suffix}" for suffix in SUFFIXES}
    if not all(file.is_file() for file in files.values()):
        return None
    labels = files.pop(LABELS)
    entry: dict[str, Any] = {}
    try:
        entry = json.loads(labels.read_text(encoding="utf-8"))
        stated = entry.pop(DIGESTS, None)  # None: of an earlier version, which ended here
        found = {LABELS: content_key([json.dumps(entry)])}
        found |= {suffix: content_key([file.read_bytes()]) for suffix, file in files.items()}
        changed = [suffix for suffix in found if stated is not None and stated.get(suffix) != found[suffix]]
        changed += [LABELS] if list(entry)[-1] != "rejected" else []
    except (ValueError, IndexError, TypeError, AttributeError):
        changed = [LABELS]
    if changed:
        raise InputError(
            f"{out / name}{changed[0]} is not as it was drawn", remedy=f"move {name}.* away, or give another --out"
        )
    return entry


def _write(out: Path, generated: Any) -> dict[str, Any]:
    """The three files of a cell, the labels last: they say that the others are complete, and what is in them."""
    import yaml

    from armtempo.planners.instances import ARMS_OF, save_instance

    name = generated.cell.name
    head = f"# Drawn by: armtempo cells generate --family {generated.family} --seed {generated.seed}"
    head += f" --first {generated.index} --count 1"
    arms = len(generated.cell.arms)
    head += f" --arms {arms}" if arms != ARMS_OF[generated.family][0] else ""
    text = yaml.safe_dump(dict(generated.data), sort_keys=False, default_flow_style=None, width=118)
    yaml_file, npz_file, labels = (out / f"{name}{suffix}" for suffix in SUFFIXES)
    with whole_file(yaml_file) as temporary:
        temporary.write_text(f"{head}\n{text}", encoding="utf-8")
    save_instance(npz_file, generated.cell, generated.labels, family=generated.family)
    entry: dict[str, Any] = {
        "cell": name,
        "family": generated.family,
        "seed": generated.seed,
        "index": generated.index,
        **generated.labels.record(),
        "rejected": dict(generated.rejected),
    }
    digests = {file.suffix: content_key([file.read_bytes()]) for file in (yaml_file, npz_file)}
    digests[LABELS] = content_key([json.dumps(entry)])
    with whole_file(labels) as temporary:
        temporary.write_text(json.dumps({**entry, DIGESTS: digests}, indent=2) + "\n", encoding="utf-8")
    return entry
