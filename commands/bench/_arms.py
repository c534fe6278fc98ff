"""``armtempo bench arms``: planning time over the number of arms."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.console import JsonFile, Kept, Names, Output, kept_results, new_table, number, shown
from armtempo.errors import InfeasibleError, InputError, UnknownNameError
from armtempo.files import check_output

if TYPE_CHECKING:
    from rich.table import Table

    from armtempo.planners.instances import GeneratedCell

DEFAULT_METHODS = ("delay", "interval", "optimal")
Family = Literal["ring", "rows", "fixture"]  # of planar arms, any number of them


def bench_arms(
    *,
    arms: Annotated[tuple[int, ...], tyro.conf.arg(metavar="K")] = (2, 3, 4, 5, 6),
    families: tuple[Family, ...] = ("ring",),
    count: int = 5,
    tries: int = 40,
    seed: int = 1,
    methods: Names = DEFAULT_METHODS,
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")] = Path("results/bench-arms.png"),
    json_file: JsonFile = None,
) -> None:
    """Plan cells of 2, 3, ... planar arms in each other's way; plot planning time and gap over the arms.

    Args:
        arms: How many arms, each of 2 to 16. Few rings of 12 are feasible (1 of the first 12), of 16 hardly any; rows
            mostly are.
        families: On rings, their paths crossing in the middle; in rows that face each other (even numbers from 4 on);
            around a fixture (3 to 6). Each of those numbers of arms that it has.
        count: Cells of each size: the first ones of the generator that are feasible.
        tries: At most so many are drawn for them; sizes with fewer feasible ones stand with those.
        seed: The generator's.
        methods: Of delay, offset, vci, interval, optimal; those that go by priority take the arms as they stand.
        out: The plot, a PNG.
        json_file: Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout.
    """
    from armtempo.commands.figures._bench import arms_figure  # late, as the others here: --help is to be quick
    from armtempo.commands.figures._style import write_png
    from armtempo.planners.instances import PLANNED_METHODS

    for method in methods:
        if method not in PLANNED_METHODS:
            raise UnknownNameError("method", method, PLANNED_METHODS)
    if count < 1 or tries < 1:
        raise InputError(f"--count and --tries must be positive, got {count} and {tries}")
    sizes = _sizes(arms, families)
    output = Output(json_file)
    check_output(out)
    arguments = {"sizes": sizes, "count": count, "tries": tries, "seed": seed, "methods": methods}
    with kept_results("bench arms", arguments) as kept:
        output.taken_over(kept)
        drawn: list[dict[str, Any]] = []
        with output.progress("Planning", len(sizes) * count) as (progress, task):
            _compile(methods)
            for k, (family, size) in enumerate(sizes):
                progress.update(task, description=f"Planning {size} arms, {family}", completed=k * count)
                for one in _drawn(family, size, count, tries, seed, methods, kept):
                    drawn.append(one)
                    progress.advance(task, one["status"] == "feasible")
        entries = [one["entry"] for one in drawn if one["status"] == "feasible"]
        if not entries:
            raise InfeasibleError(
                f"none of {len(drawn)} cells is feasible", remedy="raise --tries, or try --families rows"
            )
        output.table(_tabulate(drawn, methods))
        write_png(arms_figure(entries, methods), out)
        output.say(f"Picture: {shown(out)}")
        output.json({"seed": seed, "count": count, "drawn": _counted(drawn), "cells": entries})


def _compile(methods: Sequence[str]) -> None:
    """Plan a small cell, so that times are those of compiled methods."""
    from armtempo.planners import generate_cell

    small = generate_cell("ring", 1, 0)
    _entry(small, 2, methods)


def _sizes(arms: Sequence[int], families: Sequence[Family]) -> list[tuple[Family, int]]:
    """Families and numbers of arms to plan: of those asked for, those that there are."""
    from armtempo.planners.instances import ARMS_OF

    sizes = [
        (family, size) for family in dict.fromkeys(families) for size in sorted(set(arms)) if size in ARMS_OF[family]
    ]
    missing = sorted(set(arms) - {size for _, size in sizes})
    if missing or not sizes:
        raise InputError(
            f"no family of {', '.join(families)} has {', '.join(map(str, missing)) or 'no'} arms",
            remedy="; ".join(f"{family} has {', '.join(map(str, ARMS_OF[family]))}" for family in families),
        )
    return sizes


def _drawn(
    family: Family, arms: int, count: int, tries: int, seed: int, methods: Sequence[str], kept: Kept
) -> Iterator[dict[str, Any]]:
    """Cells of so many arms, until enough of them are feasible: what they are, what every method makes of those."""
    found = 0
    for index in range(tries):
        if found == count:
            return

        def plan(index: int = index) -> dict[str, Any]:
            from armtempo.planners import generate_cell

            one = generate_cell(family, seed, index, arms=arms)
            status = one.labels.status
            entry = _entry(one, arms, methods) if status == "feasible" else None
            return {"family": family, "arms": arms, "index": index, "status": status, "entry": entry}

        result = kept.result(f"{family} {index} of {arms} arms", plan)
        found += result["status"] == "feasible"
        yield result


def _counted(drawn: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Of every family and number of arms, how many were drawn, and how many of them are what."""
    counts: dict[tuple[str, int], Counter[str]] = {}
    for one in drawn:
        counts.setdefault((one["family"], one["arms"]), Counter())[one["status"]] += 1
    return [
        {
            "family": family,
            "arms": arms,
            "drawn": count.total(),
            "feasible": count["feasible"],
            "certified_infeasible": count["certified infeasible"],
            "undecided": count["undecided"],
        }
        for (family, arms), count in counts.items()
    ]


def _entry(one: GeneratedCell, arms: int, methods: Sequence[str]) -> dict[str, Any]:
    """What every method makes of a cell."""
    from armtempo.planners.instances import Instance

    planning_time_s: dict[str, float] = {}
    makespan_s: dict[str, float] = {}
    refused: dict[str, str] = {}
    for method in methods:
        fresh = Instance.of(one.cell, one.labels)  # nothing that another method found helps
        _ = fresh.timing.bound, fresh.timing.fastest
        start = time.perf_counter()
        try:
            motions = fresh.plan(method)
            makespan_s[method] = max(motion.duration for motion in motions)
        except InfeasibleError as refusal:
            refused[method] = str(refusal.data.get("reason") or refusal.message)
        planning_time_s[method] = time.perf_counter() - start
    return {
        "family": one.family,
        "arms": arms,
        "cell": one.cell.name,
        "class": one.labels.priority_class,
        "lower_bound_s": one.labels.lower_bound,
        "sequential_s": one.cell.sequential_makespan,
        "planning_time_s": planning_time_s,
        "makespan_s": makespan_s,
        "refused": refused,
    }


def _tabulate(drawn: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> Table:
    table = new_table("Cells of planar arms", "medians of the feasible ones; phase planes and charts ready")
    table.add_column("cells")
    table.add_column("arms", justify="right")
    table.add_column("feasible\nof drawn", justify="right")
    table.add_column("certified\ninfeasible", justify="right")
    for method in methods:
        table.add_column(f"{method}\nplanned in \\[s]", justify="right")
        table.add_column("solved", justify="right")
        table.add_column("gap \\[%]", justify="right")
    for size in _counted(drawn):
        family, arms = size["family"], size["arms"]
        own = [one["entry"] for one in drawn if (one["family"], one["arms"]) == (family, arms) and one["entry"]]
        row = [family, str(arms), f"{size['feasible']}/{size['drawn']}", str(size["certified_infeasible"])]
        for method in methods:
            gaps = [
                100.0 * (e["makespan_s"][method] / e["lower_bound_s"] - 1.0) for e in own if method in e["makespan_s"]
            ]
            row += [
                number(median(e["planning_time_s"][method] for e in own) if own else None, 3),
                f"{len(gaps)}/{len(own)}",
                number(median(gaps) if gaps else None, 1),
            ]
        table.add_row(*row)
    return table
