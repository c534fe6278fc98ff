"""``armtempo bench agents``: learned agents against classical on-line policies over a split of the benchmark set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.bench._coordination import Family
from armtempo.commands.console import (
    DisturbanceName,
    JsonFile,
    Names,
    Output,
    PhysicsName,
    Seed,
    file_digests,
    kept_results,
    new_table,
    number,
)
from armtempo.errors import InputError

if TYPE_CHECKING:
    from armtempo.agents import SplitComparison
    from armtempo.planners.instances import BenchmarkInstance

MOST_CELLS_LISTED = 40  # one by one; more are in JSON alone
RECORD_FORMAT = 2  # of what is kept of a cell: raise it with ``CellComparison.record``
DEFAULT_POLICIES = ("delay", "vci", "phase-plane", "search+stop", "search+hold", "optimal")


@dataclass(frozen=True, kw_only=True)
class CellChoice:
    """Which cells of the benchmark set."""

    split: Literal["train", "validation", "test"] = "test"
    """Which part of the set."""

    priority_class: Annotated[Literal["mixed", "uniform", "all"], tyro.conf.arg(name="class")] = "all"
    """Cells in which the same arm goes first everywhere in the optimum (uniform), or not (mixed)."""

    family: Family | Literal["all"] = "planar"
    """Kind of arms."""

    arms: Annotated[tuple[int, ...], tyro.conf.arg(metavar="K", help_behavior_hint="(default: any)")] = ()
    """Only cells of so many arms."""

    def instances(self) -> list[BenchmarkInstance]:
        """The feasible ones; raises InputError if there are none."""
        from armtempo.planners import benchmark_instances

        family = None if self.family == "all" else self.family
        chosen = [
            one
            for one in benchmark_instances(self.split, family=family, arms=self.arms or None)
            if one.labels.status == "feasible" and self.priority_class in ("all", one.labels.priority_class)
        ]
        if not chosen:
            raise InputError(
                f"the {self.split} split has no feasible {self.priority_class} cell of the family {self.family}"
                + (f" of {', '.join(map(str, self.arms))} arms" if self.arms else "")
            )
        return chosen


def bench_agents(
    *,
    choice: Annotated[CellChoice, tyro.conf.arg(name="")] = CellChoice(),
    policies: Names = DEFAULT_POLICIES,
    disturbance: DisturbanceName = "none",
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1,
    seed: Seed = 0,
    physics: PhysicsName = "ideal",
    json_file: JsonFile = None,
) -> None:
    """Run policies in the feasible cells of a split, all under the shield, and compare their makespans.

    A ratio is of mean makespans over the same episodes, with its 95 % bootstrap interval over cells and the episodes of
    each: to the best classical on-line policy of each cell, of those asked for (those that plan by priority in their
    best order of the arms), to full speed under the shield, and to who knows beforehand what happens to the first arm.
    What is not finished counts as the time limit. One table per number of arms, and one of who is best in each cell.

    Args:
        choice: Which cells.
        policies: delay, vci, phase-plane (full speed), search, search+stop, search+hold, longest-path, reorder and
            rollout on line; optimal (the plan of the undisturbed cell, executed by precedence); agents as ppo:FILE.npz.
        disturbance: What happens to the first arm, or to all: it starts late, is slow, stops and goes.
        episodes: Per cell and policy; they differ if there is a disturbance.
        seed: Seed of the first episode; the next ones count on from it.
        physics: "ideal" moves the arms exactly as commanded, "bullet" simulates torque control.
        json_file: Write the figures and every makespan there as JSON; "-" for nothing but JSON on stdout.
    """
    from armtempo.agents import (
        CellComparison,
        SplitComparison,
        compare_on,
    )  # late, as the others here: --help is to be quick

    chosen = choice.instances()
    output = Output(json_file)
    asked: dict[str, Any] = {
        "episodes": episodes, "seed": seed, "physics": physics,
        "disturbance": None if disturbance == "none" else disturbance,
    }  # fmt: skip
    with kept_results(
        "bench agents",
        {**asdict(choice), "policies": policies, "files": file_digests(policies), **asked, "format": RECORD_FORMAT},
    ) as kept:
        output.taken_over(kept)
        cells: list[CellComparison] = []
        with output.progress("Simulating", len(chosen)) as (progress, task):
            for one in chosen:
                progress.update(task, description=f"Simulating {one.name}")

                def compare(one: BenchmarkInstance = one) -> dict[str, Any]:
                    return compare_on([one.build()], policies, **asked).cells[0].record()

                cells.append(CellComparison.from_record(kept.result(one.name, compare)))
                progress.advance(task)
        compared = SplitComparison(cells=tuple(cells), seed=seed)
        what = f"{choice.split}, {choice.priority_class}, {choice.family}, {physics}, disturbance {disturbance}"
        by_arms = _show_by_arms(compared, policies, what, output)
        output.json(
            {
                "split": choice.split, "class": choice.priority_class, "family": choice.family, "physics": physics,
                "disturbance": disturbance, "episodes": episodes, "seed": seed,
                "policies": {name: compared.figures(name) for name in policies},
                "policies_by_arms": {
                    str(arms): {name: own.figures(name) for name in policies} for arms, own in by_arms.items()
                },
                "cells": [one.record() for one in compared.cells],
            }
        )  # fmt: skip


def _show_by_arms(
    compared: SplitComparison, policies: Sequence[str], what: str, output: Output
) -> dict[int, SplitComparison]:
    """A table per number of arms, and one of all cells."""
    by_arms = compared.by_arms()
    for arms, own in by_arms.items():
        _show(own, policies, f"{arms} arms, {what}", output)
    if len(by_arms) > 1:
        _show(compared, policies, what, output)
    _show_best(compared, output)
    return by_arms


def _show_best(compared: SplitComparison, output: Output) -> None:
    """One row per cell: the best classical on-line policy there, and the best of all that ran."""
    if len(compared.cells) > MOST_CELLS_LISTED:
        output.say(f"Who is best in each of the {len(compared.cells)} cells: in JSON, --json FILE.")
        return
    table = new_table("Who is best in each cell", "mean makespans of those that finished every episode")
    for head in ("cell", "arms", "best on line", "\\[s]", "best of all", "\\[s]"):
        table.add_column(head, justify="right" if head in ("arms", "\\[s]") else "left")
    for one in compared.cells:
        row = (one.best_online, one.best)
        shown = [text for name in row for text in (name or "–", number(one.mean_of(name), 4))]
        table.add_row(one.cell, str(one.arms), *shown)
    output.table(table)


def _show(compared: SplitComparison, policies: Sequence[str], what: str, output: Output) -> None:
    """One row per policy."""
    table = new_table(
        f"{len(compared.cells)} cells ({what})",
        "ratios of mean makespans over the same episodes, with 95 % bootstrap intervals over cells and then episodes; "
        "an episode that was not finished counts as its time limit",
    )
    counts = ("policy", "cells\nwith a plan", "best in\n(on line)", "finished", "too close\n\\[ticks]")
    for head in (*counts, "makespan\n\\[s]"):
        table.add_column(head, justify="left" if head == "policy" else "right", no_wrap=head == "policy")
    for head in ("to the best\non-line rule", "to full\nspeed", "to who\nknows"):
        table.add_column(head, justify="right")
    for name in policies:
        one = compared.figures(name)
        ratios = [one[f"ratio_to_{key}"] for key in ("best_online", "full_speed", "clairvoyant")]
        table.add_row(
            name, str(one["cells"]), f"{one['best_in_cells']} ({one['best_online_in_cells']})",
            f"{one['finished']} of {one['episodes']}", str(one["violations"]),
            number(one["makespan_s"], 4),
            *("–" if r is None else f"{r[0]:.4f}\n({r[1][0]:.3f}–{r[1][1]:.3f})" for r in ratios),
        )  # fmt: skip
    output.table(table)
