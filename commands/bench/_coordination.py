"""``armtempo bench coordination``: planning methods on the benchmark set, audited."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import tyro

from armtempo.commands.console import JsonFile, Names, Output, kept_results, new_table, number, shown
from armtempo.errors import InputError, UnknownNameError

if TYPE_CHECKING:
    from armtempo.planners.instances import BenchmarkInstance, BenchResult, Claim
    from armtempo.planners.schedules import Engine

Family = Literal["planar", "panda", "iiwa"]  # of the benchmark set
DEFAULT_METHODS = ("sequential", "delay", "offset", "vci", "interval", "optimal")


def bench_coordination(
    *,
    split: Literal["train", "validation", "test", "all"] = "test",
    families: Annotated[tuple[Family, ...], tyro.conf.arg(help_behavior_hint="(default: all)")] = (),
    methods: Names = DEFAULT_METHODS,
    limit: Annotated[int | None, tyro.conf.arg(metavar="K", help_behavior_hint="(default: all)")] = None,
    audit: Literal["auto", "coal", "pybullet", "none"] = "auto",
    json_file: JsonFile = None,
) -> None:
    """Plan the benchmark set by several methods, audit the plans by another engine, and compare them.

    Args:
        split: Which part of the set.
        families: Only these.
        methods: Planning methods; "armtempo plan --help" lists them. Those that go by priority get both orders of two
            arms, and the better plan counts.
        limit: At most so many cells, spread over the split.
        audit: Engine that measures all plans at ten times the control rate, none of which the planners use; auto: coal
            if it is installed (extra dev), else PyBullet, whose distances of hulls may be 2 mm short.
        json_file: Write every result and the claims there as JSON, units in the keys; "-" for nothing but JSON on
            stdout.
    """
    from armtempo.planners import METHODS, benchmark_instances  # late, as the others here: --help is to be quick
    from armtempo.planners.instances import BenchResult, bench_claims
    from armtempo.planners.schedules import default_engine

    for method in methods:
        if method not in METHODS:
            raise UnknownNameError("method", method, METHODS)
    if limit is not None and limit < 1:
        raise InputError(f"--limit must be at least 1, got {limit}")
    chosen = benchmark_instances(None if split == "all" else split)
    if families:
        wanted = {one.name for family in families for one in benchmark_instances(family=family)}
        chosen = tuple(one for one in chosen if one.name in wanted)
    if limit is not None and limit < len(chosen):
        chosen = tuple(chosen[k * len(chosen) // limit] for k in range(limit))
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
        _show(results, methods, f"{split}, {len(chosen)} cells", engine, output)
        _tell(claims, changed, output)
        output.json(
            {
                "split": split,
                "cells": len(chosen),
                "audit": engine,
                "methods": {method: _summary([r for r in results if r.method == method]) for method in methods},
                "claims": [_claim(claim) for claim in claims],
                "other_bounds": changed,
                "results": [result.record() for result in results],
            }
        )


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


Chosen = Callable[["BenchResult"], bool]
GROUPS: tuple[tuple[str, Chosen], ...] = (
    ("feasible", lambda r: r.labels.status == "feasible"),
    ("feasible, uniform", lambda r: r.labels.status == "feasible" and r.labels.priority_class == "uniform"),
    ("feasible, mixed", lambda r: r.labels.status == "feasible" and r.labels.priority_class == "mixed"),
    ("certified infeasible or undecided", lambda r: r.labels.status != "feasible"),
)


def _summary(results: Sequence[BenchResult]) -> dict[str, Any]:
    """One method's figures, all together and per group."""
    return {
        "all": _figures(results),
        **{name: _figures([r for r in results if belongs(r)]) for name, belongs in GROUPS},
    }


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
    for name, belongs in GROUPS:
        group = [result for result in results if belongs(result)]
        if not group:
            continue
        table = new_table(
            f"{name[0].upper()}{name[1:]} ({what})", f"gap to the certified bound; best order of two arms; {audited}"
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
