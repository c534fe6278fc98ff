"""``armtempo bench coordination``: planning methods on the benchmark set, audited."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro

from armtempo.commands.console import JsonFile, Names, Output, kept_results, new_table, number, shown
from armtempo.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from armtempo.planners.instances import BenchmarkInstance, BenchResult, Claim
    from armtempo.planners.schedules import Engine

Family = Literal["planar", "shaped", "panda", "iiwa", "ur5e", "ring", "rows", "fixture"]  # of the benchmark set
DEFAULT_METHODS = ("sequential", "delay", "offset", "vci", "interval", "optimal")


def bench_coordination(
    *,
    split: Literal["train", "validation", "test", "all"] = "test",
    families: Annotated[tuple[Family, ...], tyro.conf.arg(help_behavior_hint="(default: all)")] = (),
    arms: Annotated[tuple[int, ...], tyro.conf.arg(metavar="K", help_behavior_hint="(default: any)")] = (),
    methods: Names = DEFAULT_METHODS,
    limit: Annotated[int | None, tyro.conf.arg(metavar="K", help_behavior_hint="(default: all)")] = None,
    audit: Literal["auto", "coal", "pybullet", "none"] = "auto",
    json_file: JsonFile = None,
) -> None:
    """Plan the benchmark set by several methods, audit the plans by another engine, and compare them.

    Args:
        split: Which part of the set.
        families: Only these.
        arms: Only cells of so many arms.
        methods: Planning methods; "armtempo plan --help" lists them. Those that go by priority get the best order of
            the arms.
        limit: At most so many cells, spread over the split.
        audit: Engine that measures all plans at ten times the control rate, none of which the planners use; auto: coal
            if it is installed (extra dev), else PyBullet, whose distances of hulls may be 2 mm short.
        json_file: Write every result and the claims there as JSON, units in the keys; "-" for nothing but JSON on
            stdout.
    """
    from armtempo.planners import METHODS  # late, as the others here: --help is to be quick
    from armtempo.planners.instances import BenchResult, bench_claims
    from armtempo.planners.schedules import default_engine

    for method in methods:
        if method not in METHODS:
            raise UnknownNameError("method", method, METHODS)
    if limit is not None and limit < 1:
        raise InputError(f"--limit must be at least 1, got {limit}")
    chosen = _chosen(split, families, arms, limit)
    engine = None if audit == "none" else default_engine() if audit == "auto" else audit
    output = Output(json_file)
    arguments = {"cells": [one.name for one in chosen], "methods": methods, "engine": engine}
    with kept_results("bench coordination", arguments) as kept:
        output.taken_over(kept)
        results: list[BenchResult] = []
        changed = []
        with output.progress("Planning", len(chosen)) as (progress, task):
            for k, instance in enumerate(chosen):
                progress.update(task, description=f"Planning {instance.name}")

                def plan(instance: BenchmarkInstance = instance) -> dict[str, Any]:
                    return _planned(instance, methods, engine)

                found = kept.result(f"{k} {instance.name}", plan)
                results += [BenchResult.from_record(record, instance.labels) for record in found["results"]]
                if not found["same_bound"]:
                    changed.append(instance.name)
                progress.advance(task)
        claims = bench_claims(results)
        _show(results, methods, split, engine, output)
        _tell(claims, changed, output)
        output.json(
            {
                "split": split,
                "cells": len(chosen),
                "audit": engine,
                "methods": {method: _summary(results, method) for method in methods},
                "claims": [_claim(claim) for claim in claims],
                "other_bounds": changed,
                "results": [result.record() for result in results],
            }
        )


def _chosen(
    split: str, families: Sequence[str], arms: Sequence[int], limit: int | None
) -> tuple[BenchmarkInstance, ...]:
    """The cells to plan, if there are such."""
    from armtempo.planners import benchmark_instances

    chosen = tuple(
        one
        for one in benchmark_instances(None if split == "all" else split, arms=arms or None)
        if not families or one.family in families
    )
    if not chosen:
        raise InputError(f"the {split} split has no such cells of {', '.join(map(str, arms))} arms")
    if limit is not None and limit < len(chosen):
        chosen = tuple(chosen[k * len(chosen) // limit] for k in range(limit))
    return chosen


def _planned(instance: BenchmarkInstance, methods: Sequence[str], engine: Engine | None) -> dict[str, Any]:
    """Records of all methods in a cell, and whether its bound is what it was when the set was made."""
    from armtempo.planners.instances import bench_cell

    cell = instance.build()
    results = bench_cell(cell, instance.labels, methods, engine=engine, family=instance.family)
    return {
        "results": [result.record() for result in results],
        "same_bound": math.isclose(cell.lower_bound, instance.labels.lower_bound, rel_tol=1e-6),
    }


def _tell(claims: Sequence[Claim], changed: Sequence[str], output: Output) -> None:
    """What must hold, and where it does not."""
    for claim in claims:
        state = "[green]holds[/]" if not claim.broken else f"[red]broken in {len(claim.broken)}[/]"
        output.say(f"{state} ({claim.checked} checked): {claim.text}")
        for line in claim.broken:
            output.say(f"    {shown(line)}")
    if changed:
        output.say(f"[red]Other bounds than when the set was made:[/] {', '.join(changed)}")


def _claim(claim: Claim) -> dict[str, Any]:
    return {"claim": claim.text, "checked": claim.checked, "broken": list(claim.broken)}


def _groups(results: Sequence[BenchResult]) -> dict[str, list[BenchResult]]:
    """What is shown together: two arms by priority class, more by their number, and what nobody has a plan for."""
    groups: dict[str, list[BenchResult]] = {}
    for result in sorted(results, key=lambda r: r.arms):  # stable
        if result.labels.status != "feasible":
            continue
        names = [f"feasible, {result.arms} arms"]
        if result.arms == 2:
            names += [f"feasible, 2 arms, {result.labels.priority_class}"]
        for name in names:
            groups.setdefault(name, []).append(result)
    groups["certified infeasible or undecided"] = [r for r in results if r.labels.status != "feasible"]
    return {name: group for name, group in groups.items() if group}


def _summary(results: Sequence[BenchResult], method: str) -> dict[str, Any]:
    """One method's figures, all together and per group."""
    groups = {"all": results, **_groups(results)}
    return {name: _figures([r for r in group if r.method == method]) for name, group in groups.items()}


def _figures(results: Sequence[BenchResult]) -> dict[str, Any]:

    gaps = [r.gap_percent for r in results if r.solved]
    seconds = [r.seconds for r in results]
    return {
        "cells": len(results),
        "solved": len(gaps),
        "refused": dict(Counter(r.reason for r in results if not r.solved)),
        "fallbacks": sum(r.fallback is not None for r in results),
        "violations": sum(bool(r.violations) for r in results),
        "gap_median_percent": float(np.median(gaps)) if gaps else None,
        "gap_p90_percent": float(np.percentile(gaps, 90)) if gaps else None,
        "gap_max_percent": max(gaps, default=None),
        "planning_time_median_s": float(np.median(seconds)) if seconds else None,
        "planning_time_max_s": max(seconds, default=None),
    }


def _show(
    results: Sequence[BenchResult], methods: Sequence[str], what: str, engine: str | None, output: Output
) -> None:
    audited = f"audited by {engine} at 10 x the control rate" if engine else "clearances not audited"
    for name, group in _groups(results).items():
        cells = f"{len({result.cell for result in group})} cells"
        table = new_table(
            f"{name[0].upper()}{name[1:]}: {cells} ({what})",
            f"gap to the certified bound; best order of arms; {audited}",
        )
        table.add_column("method", no_wrap=True)
        for head in ("solved", "violations", "gap [%]\nmedian", "\np90", "\nmax", "planned in [s]\nmedian", "\nmax"):
            table.add_column(head.replace("[", "\\["), justify="right")
        table.add_column("refused, fallbacks")
        for method in methods:
            figures = _figures([result for result in group if result.method == method])
            words = [f"{count} {reason}" for reason, count in figures["refused"].items()]
            words += [f"{figures['fallbacks']} by interval"] if figures["fallbacks"] else []
            table.add_row(
                method,
                f"{figures['solved']}/{figures['cells']}",
                f"[red]{figures['violations']}[/]" if figures["violations"] else "0",
                number(figures["gap_median_percent"], 2),
                number(figures["gap_p90_percent"], 2),
                number(figures["gap_max_percent"], 2),
                number(figures["planning_time_median_s"], 3),
                number(figures["planning_time_max_s"], 2),
                shown("; ".join(words)) or "–",
            )
        output.table(table)
