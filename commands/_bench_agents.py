"""``armtempo bench agents``: learned agents against classical on-line policies over a split of the benchmark set."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from armtempo.commands.console import JsonFile, Output, new_table, number

if TYPE_CHECKING:
    from armtempo.agents import SplitComparison

DEFAULT_POLICIES = ("delay", "vci", "full-speed", "optimal", "ppo:generalist")


def bench_agents(
    *,
    split: Literal["train", "validation", "test"] = "test",
    priority_class: Annotated[Literal["mixed", "uniform", "all"], tyro.conf.arg(name="class")] = "all",
    family: Literal["planar", "panda", "iiwa", "all"] = "planar",
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = DEFAULT_POLICIES,
    disturbance: Annotated[
        Literal["none", "late", "slow", "stop-and-go", "any"], tyro.conf.arg(metavar="NAME")
    ] = "none",
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1,
    seed: Annotated[int, tyro.conf.arg(metavar="K")] = 0,
    physics: Literal["bullet", "ideal"] = "ideal",
    json_file: JsonFile = None,
) -> None:
    """Run policies in the feasible cells of a split, all under the shield, and compare their makespans.

    A ratio is of mean makespans over the same episodes, with its 95 % bootstrap interval: to the best classical on-line
    policy of each cell (delay or vci, in the order of the arms that plans better), to full speed under the shield, and
    to who knows beforehand what happens to the first arm.

    Args:
        split: Which part of the set.
        priority_class: Cells in which the same arm goes first everywhere in the optimum (uniform), or not (mixed).
        family: Kind of arms.
        policies: delay, vci, full-speed, optimal (the plan of the undisturbed cell, executed by precedence), and
            learned agents as ppo:NAME or ppo:FILE.npz.
        disturbance: What happens to the first arm: it starts late, is slow, stops and goes.
        episodes: Per cell and policy; they differ if there is a disturbance.
        seed: Seed of the first episode; the next ones count on from it.
        physics: "ideal" moves the arms exactly as commanded, "bullet" simulates torque control.
        json_file: Write the figures and every makespan there as JSON; "-" for nothing but JSON on stdout.
    """
    from armtempo.agents import compare_on
    from armtempo.errors import InputError
    from armtempo.planners import benchmark_instances

    chosen = [
        one
        for one in benchmark_instances(split, family=None if family == "all" else family)
        if one.labels.status == "feasible" and priority_class in ("all", one.labels.priority_class)
    ]
    if not chosen:
        raise InputError(f"the {split} split has no feasible {priority_class} cell of {family} arms")
    output = Output(json_file)
    with output.progress("Simulating", len(chosen)) as (progress, task):

        def on_cell(name: str) -> None:
            progress.update(task, description=f"Simulating {name}", advance=1)

        compared = compare_on(
            (one.build() for one in chosen), policies, episodes=episodes, seed=seed, physics=physics,
            disturbance=None if disturbance == "none" else disturbance, on_cell=on_cell,
        )  # fmt: skip
    figures = {name: compared.figures(name) for name in policies}
    _show(compared, figures, f"{split}, {priority_class}, {family}, {physics}, disturbance {disturbance}", output)
    output.json(
        {
            "split": split, "class": priority_class, "family": family, "physics": physics, "disturbance": disturbance,
            "episodes": episodes, "seed": seed, "policies": figures,
            "cells": [
                {
                    "cell": one.cell, "class": one.priority_class, "best_online": one.best_online,
                    "makespans_s": one.makespans_s, "violations": one.violations, "clairvoyant_s": one.clairvoyant_s,
                }
                for one in compared.cells
            ],
        }
    )  # fmt: skip


def _show(compared: SplitComparison, figures: dict[str, dict[str, Any]], what: str, output: Output) -> None:
    """One row per policy."""
    table = new_table(
        f"{len(compared.cells)} cells ({what})",
        "ratios of mean makespans over the episodes that both finished, with 95 % bootstrap intervals",
    )
    for head in ("policy", "cells\nwith a plan", "finished", "too close\n\\[ticks]", "makespan\n\\[s]"):
        table.add_column(head, justify="left" if head == "policy" else "right", no_wrap=head == "policy")
    for head in ("to the best\nof delay, vci", "to full\nspeed", "to who\nknows"):
        table.add_column(head, justify="right")
    for name, one in figures.items():
        ratios = [one[f"ratio_to_{key}"] for key in ("best_online", "full-speed", "clairvoyant")]
        table.add_row(
            name, str(one["cells"]), f"{one['finished']} of {one['episodes']}", str(one["violations"]),
            number(one["makespan_s"], 4),
            *("–" if r is None else f"{r[0]:.4f}\n({r[1][0]:.3f}–{r[1][1]:.3f})" for r in ratios),
        )  # fmt: skip
    output.table(table)
