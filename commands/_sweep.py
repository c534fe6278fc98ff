"""``armtempo sweep``: searches better numbers for a training, on as many machines as share a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from armtempo.commands.console import (
    TRAINING_SEED_MAX,
    JsonFile,
    Output,
    check_count,
    check_seed,
    new_table,
    number,
    shown,
)

TABLE_ROWS = 10  # of the table: the best


def sweep(
    config: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="CONFIG")],
    *,
    storage: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: results/sweep/<name>)")
    ] = None,
    trials: Annotated[int, tyro.conf.arg(metavar="N")] = 20,
    seed: Annotated[int | None, tyro.conf.arg(metavar="K", help_behavior_hint="(default: from the system)")] = None,
    json_file: JsonFile = None,
) -> None:
    """Search better numbers for a training. Run it again to go on, or on other machines to be done sooner.

    Args:
        config: Name of a bundled sweep, or your own YAML file.
        storage: Folder of the trials. Workers that are given the same one, on a disk that they share, work together.
        trials: How many are to be finished in all, counting those of other workers and of earlier runs.
        seed: Of the draws; give each worker another one, or none.
        json_file: Write all trials there as JSON, the best first; "-" for nothing but JSON on stdout.
    """
    check_count("--trials", trials, 20)
    check_seed(seed, TRAINING_SEED_MAX)
    from armtempo import agents  # late: torch; --help is to be quick
    from armtempo.configs import load_sweep_config

    out = Output(json_file)
    chosen = load_sweep_config(config)
    folder = storage or Path("results") / "sweep" / chosen.name
    with out.progress(f"Searching {chosen.name}", trials) as (progress, task):

        def on_trial(trial: agents.SweepTrial, finished: int) -> None:
            progress.update(task, completed=finished, description=f"Trial {trial.number}: {trial.objective:.4g}")

        try:
            done = agents.sweep(chosen, folder, trials, objective=agents.training_gap, seed=seed, on_trial=on_trial)
        except KeyboardInterrupt as stop:
            stop.add_note(f"finished trials are kept in {folder}; the same line goes on, without the one it was at")
            raise
    table = new_table(
        f"{chosen.name}: the best of {len(done)} trials of {chosen.total_steps} steps",
        "objective: gap to the certified bound [%], or minus 100 x the reward of one arm; lower is better",
    )
    for head in ("trial", "objective", *chosen.space):
        table.add_column(head, justify="right")
    for trial in done[:TABLE_ROWS]:
        table.add_row(
            str(trial.number), number(trial.objective, 3), *[f"{trial.values[key]:.4g}" for key in chosen.space]
        )
    out.table(table)
    out.json(
        {
            "name": chosen.name,
            "training": chosen.training,
            "total_steps": chosen.total_steps,
            "trials": [
                {"trial": one.number, "objective": one.objective, "values": one.values, "folder": str(one.folder)}
                for one in done
            ],
        }
    )
    out.say(f"Trials in {shown(folder / chosen.name)}; another worker, or later: the same --storage")
