"""``armtempo train``: learns an agent as a training file says, and goes on where it was interrupted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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

if TYPE_CHECKING:
    from armtempo.agents import Training

TABLE_ROWS = 12  # of the curve in the table: the last ones
COLUMNS = {  # heads and digits of what rows of a curve have, if they have it: that depends on the environment
    "steps": ("steps", 0),
    "seconds": ("time [s]", 0),
    "reward": ("reward", 3),
    "finished": ("finished", 0),
    "violations": ("violations", 0),
    "makespan_s": ("makespan [s]", 4),
    "gap_percent": ("to bound [%]", 2),
    "optimum_percent": ("to optimum [%]", 2),
    "undisturbed_ratio": ("undisturbed", 4),
    "disturbed_ratio": ("disturbed", 4),
    "mixed_ratio": ("mixed", 4),
}


def train(
    config: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="CONFIG")],
    *,
    seed: Annotated[int | None, tyro.conf.arg(metavar="K", help_behavior_hint="(default: the file's)")] = None,
    output: Annotated[
        Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="(default: results/train/<name>-<seed>)")
    ] = None,
    resume: bool = False,
    steps: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="(default: the file's)")] = None,
    json_file: JsonFile = None,
) -> None:
    """Train an agent; its folder gets checkpoints, the learning curve, logs for TensorBoard and the agent's file.

    Args:
        config: Name of a bundled training, or your own YAML file.
        seed: Of everything that is drawn.
        output: Folder for its files.
        resume: Go on from the checkpoint there: the outcome is that of a training that was never interrupted. With more
            --steps, also behind its end: that of one that had so many from the start, unless something is scheduled
            over its length (learning_rate_end, undisturbed_until). Ctrl-C and SIGTERM save before they end.
        steps: Agent steps in all: decisions of one learning arm.
        json_file: Write the learning curve there as JSON; "-" for nothing but JSON on stdout.
    """
    check_seed(seed, TRAINING_SEED_MAX)
    check_count("--steps", steps, 100000)
    from armtempo import agents  # late: torch; --help is to be quick
    from armtempo.configs import load_train_config

    out = Output(json_file)
    chosen = load_train_config(config).changed(seed=seed, total_steps=steps)
    folder = output or Path("results") / "train" / f"{chosen.name}-{chosen.seed}"
    with out.progress(f"Training {chosen.name}", chosen.total_steps) as (progress, task):

        def on_progress(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        def on_row(row: dict[str, Any]) -> None:
            progress.update(task, description=f"Training {chosen.name}: {_in_words(row)}")

        training = agents.train(chosen, folder, resume=resume, on_progress=on_progress, on_row=on_row)
    _tabulate(training, out)
    out.json({"name": chosen.name, "seed": chosen.seed, "curve": training.curve, "agent": str(folder / "agent.npz")})
    out.say(f"Agent: {shown(str(folder / 'agent.npz'))}; evaluate it as {chosen.algorithm}:{folder / 'agent.npz'}")


def _in_words(row: dict[str, Any]) -> str:
    if row.get("optimum_percent") is not None:
        return f"{row['optimum_percent']:+.1f} % to the optimum, {row['violations']} violations"
    if row.get("mixed_ratio") is not None:
        return f"{row['mixed_ratio']:.4f} of full speed's makespan"
    return f"reward {number(row['reward'], 3)}"


def _tabulate(training: Training, out: Output) -> None:
    rows = training.curve[-TABLE_ROWS:]
    heads = {name: column for name, column in COLUMNS.items() if any(name in row for row in rows)}
    table = new_table(
        f"{training.config.name}: {training.config.algorithm}, seed {training.config.seed}",
        "steps are decisions of a learning arm; figures are of episodes as in training"
        + (", to bound and optimum: undisturbed" if "optimum_percent" in heads else "")
        + ("; makespans are over those of full speed in the same orders" if "mixed_ratio" in heads else ""),
    )
    for head, _ in heads.values():
        table.add_column(head.replace("[", "\\["), justify="right")
    for row in rows:
        table.add_row(*[number(row.get(name), digits) for name, (_, digits) in heads.items()])
    out.table(table)
