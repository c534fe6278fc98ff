"""``armtempo bench arms``: planning time over the number of arms."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from armtempo.commands.console import JsonFile, Kept, Names, Output, kept_results, new_table, number, shown
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.files import check_output

if TYPE_CHECKING:
    from rich.table import Table

    from armtempo.planners.instances import GeneratedCell

DEFAULT_METHODS = ("delay", "interval", "optimal")


def bench_arms(
    *,
    arms: Annotated[tuple[int, ...], tyro.conf.arg(metavar="K")] = (2, 3, 4, 5, 6),
    count: int = 5,
    seed: int = 1,
    methods: Names = DEFAULT_METHODS,
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("results/bench-arms.png"),
    json_file: JsonFile = None,
) -> None:
    """Plan rings of 2, 3, ... planar arms whose paths cross in the middle; plot planning time and gap over the arms.

    Args:
        arms: How many arms, each of 2 to 16.
        count: Rings of each size: the first ones of the generator that are feasible.
        seed: The generator's.
        methods: Of delay, offset, vci, interval, optimal; those that go by priority take the arms as they stand.
        out: The plot, a PNG.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    from armtempo.commands.figures._bench import arms_figure  # late, as the others here: --help is to be quick
    from armtempo.commands.figures._style import write_png
    from armtempo.planners.instances import ARMS_OF, PLANNED_METHODS

    for method in methods:
        if method not in PLANNED_METHODS:
            raise UnknownNameError("method", method, PLANNED_METHODS)
    sizes = sorted(set(arms))
    if not sizes or not set(sizes) <= set(ARMS_OF["ring"]) or count < 1:
        raise InputError(
            f"--arms must be 2 to 16 each and --count positive, got {', '.join(map(str, arms))} and {count}"
        )
    output = Output(json_file)
    check_output(out)
    with kept_results("bench arms", {"arms": sizes, "count": count, "seed": seed, "methods": methods}) as kept:
        output.taken_over(kept)
        entries: list[dict[str, Any]] = []
        with output.progress("Planning", len(sizes) * count) as (progress, task):
            for size in sizes:
                progress.update(task, description=f"Planning {size} arms")
                for entry in _feasible_rings(size, count, seed, methods, kept):
                    entries.append(entry)
                    progress.advance(task)
        output.table(_tabulate(entries, methods, count))
        write_png(arms_figure(entries, methods), out)
        output.say(f"Picture: {shown(out)}")
        output.json({"seed": seed, "count": count, "rings": entries})


def _feasible_rings(arms: int, count: int, seed: int, methods: Sequence[str], kept: Kept) -> Iterator[dict[str, Any]]:
    """What every method makes of the first rings of so many arms that are feasible."""
    found = 0
    for index in itertools.count():
        if found == count:
            return

        def plan(index: int = index) -> dict[str, Any] | None:
            from armtempo.planners import generate_cell

            ring = generate_cell("ring", seed, index, arms=arms)
            return _entry(ring, arms, methods) if ring.labels.status == "feasible" else None

        entry = kept.result(f"ring {index} of {arms} arms", plan)
        if entry is not None:
            found += 1
            yield entry


def _entry(ring: GeneratedCell, arms: int, methods: Sequence[str]) -> dict[str, Any]:
    """What every method makes of a ring."""
    from armtempo.planners.instances import Instance

    planning_time_s: dict[str, float] = {}
    makespan_s: dict[str, float] = {}
    refused: dict[str, str] = {}
    for method in methods:
        fresh = Instance.of(ring.cell, ring.labels)  # nothing that another method found helps
        _ = fresh.timing.bound, fresh.timing.fastest
        start = time.perf_counter()
        try:
            motions = fresh.plan(method)
            makespan_s[method] = max(motion.duration for motion in motions)
        except InfeasibleError as refusal:
            refused[method] = str(refusal.data.get("reason") or refusal.message)
        planning_time_s[method] = time.perf_counter() - start
    return {
        "arms": arms,
        "cell": ring.cell.name,
        "class": ring.labels.priority_class,
        "lower_bound_s": ring.labels.lower_bound,
        "sequential_s": ring.cell.sequential_makespan,
        "planning_time_s": planning_time_s,
        "makespan_s": makespan_s,
        "refused": refused,
    }


def _tabulate(entries: Sequence[dict[str, Any]], methods: Sequence[str], count: int) -> Table:
    table = new_table(f"Rings of planar arms ({count} feasible ones per size)", "median; phase planes and charts ready")
    table.add_column("arms", justify="right")
    for method in methods:
        table.add_column(f"{method}\nplanned in \\[s]", justify="right")
        table.add_column("solved", justify="right")
        table.add_column("gap \\[%]", justify="right")
    for arms in sorted({entry["arms"] for entry in entries}):
        own = [entry for entry in entries if entry["arms"] == arms]
        row = [str(arms)]
        for method in methods:
            gaps = [
                100.0 * (e["makespan_s"][method] / e["lower_bound_s"] - 1.0) for e in own if method in e["makespan_s"]
            ]
            row += [
                number(median(e["planning_time_s"][method] for e in own), 3),
                f"{len(gaps)}/{len(own)}",
                number(median(gaps) if gaps else None, 1),
            ]
        table.add_row(*row)
    return table
