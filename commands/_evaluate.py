"""``armtempo evaluate``: every policy in the simulation, in one table and a few pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from armtempo.commands.console import (
    CellName,
    JsonFile,
    OutFolder,
    Output,
    default_folder,
    flag_of,
    open_any_cell,
    options_from,
    table_of,
    with_flags,
)
from armtempo.errors import ArmtempoError, UnknownNameError

if TYPE_CHECKING:
    from armtempo.agents import Kind

PROGRAM = "armtempo evaluate"
DESCRIPTION = (
    "Run policies in the simulated cell, compare them with each other and with the certified optimum, draw pictures."
)


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Run policies in the simulated cell, compare them with each other and with the certified optimum, draw pictures.

    Each kind of cell has options of its own besides these: "armtempo evaluate CELL --help" lists them.
    """

    cell: CellName
    """A bundled cell's name (see "armtempo cells"), or your own YAML file."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(default: all)")] = ()
    """Policies to run: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci, offset, interval,
    optimal, random; in blend cells line-speed, limit-aware, limit-aware-smooth, constant, random; in ik cells feedback,
    feedback-ff, feedback-damped, newton, law, law-scheduled, random. A learned agent is ppo:NAME (one that comes with
    armtempo) or ppo:FILE.npz, with sac: or tqc: if these made it."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes per policy; the table shows the worst clearance, torque and path error of all."""
    seed: Annotated[int, tyro.conf.arg(metavar="K")] = 0
    """Seed of the first episode; the next ones count on from it."""
    json_file: JsonFile = None
    """Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout."""
    out: OutFolder = None
    """Folder for the PNG files."""
    figures: bool = True
    """Draw pictures."""


def evaluate(line: Sequence[str]) -> None:
    """Run ``armtempo evaluate`` with what follows on the line; its flags are those of the cell's kind."""
    cell = _cell_word(line)
    if cell is None:  # --help, or a line without a cell
        tyro.cli(Evaluate, prog=PROGRAM, args=line)
        return
    from armtempo.agents import kind_named, option_names
    from armtempo.configs import load_cell_config

    kind = kind_named(load_cell_config(cell).kind)
    names = option_names(kind)
    given = _read(line, kind, names)
    if given.episodes < 1:
        raise ArmtempoError(f"--episodes must be at least 1, got {given.episodes}", remedy="try --episodes 1")
    if given.seed < 0:
        raise ArmtempoError(f"--seed must not be negative, got {given.seed}", remedy="try --seed 0")
    _run(given, kind, options_from(given, kind.options_type, names))


def _cell_word(line: Sequence[str]) -> str | None:
    """The word of the line that is the cell: the first one, or behind flags a bundled name or a YAML file."""
    from armtempo.configs import bundled_cells

    if line and not line[0].startswith("-"):
        return line[0]
    known = bundled_cells()
    return next((word for word in line if word in known or Path(word).suffix in (".yaml", ".yml")), None)


def _read(line: Sequence[str], kind: Kind[Any, Any, Any, Any], names: Sequence[str]) -> Any:
    """The line as ``Evaluate`` and the options of a kind.

    Raises:
        UnknownNameError: A flag that evaluations in this kind of cell do not have.
    """
    flags = with_flags(Evaluate, kind.options_type, names)
    description = f"{DESCRIPTION}\n\nPolicies of {kind.name} cells: {', '.join(kind.policies)}, and learned agents."
    asked = ["--help"] if {"-h", "--help"} & set(line) else line  # tyro's help hides a cell that it has read
    given, left = tyro.cli(flags, prog=PROGRAM, args=asked, description=description, return_unknown_args=True)
    if left:
        known = [flag_of(one.name) for one in fields(flags) if one.name not in ("cell", "json_file")]
        raise UnknownNameError(f"option of {PROGRAM} in {kind.name} cells", left[0], [*known, "--json", "--no-figures"])
    return given


def _run(given: Evaluate, kind: Kind[Any, Any, Any, Any], options: Any) -> None:
    """Run, tabulate, draw."""
    from armtempo import agents
    from armtempo.commands.reports import REPORTS, title_of

    output = Output(given.json_file)
    cell = open_any_cell(given.cell, output)
    chosen = tuple(dict.fromkeys(given.policies)) or None
    with output.progress("Simulating", len(chosen or kind.policies) * given.episodes) as (progress, task):

        def on_episode(policy: str, episode: int) -> None:
            progress.update(task, description=f"Simulating {policy}, episode {episode + 1}", advance=1)

        run: Any = agents.evaluate  # of any kind of cell
        result: agents.Evaluation[Any, Any, Any] = run(
            cell, chosen, episodes=given.episodes, seed=given.seed, options=options, on_episode=on_episode
        )
    report = REPORTS[kind.name]
    title, caption = title_of(result, report.title_suffix(result)), report.caption(result)
    output.table(table_of(result, title=title, caption=caption, width=output.console.width, bold=report.best(result)))
    output.say(report.summary_sentence(result))
    for name, why in (result.refused or {}).items():
        output.say(f"{name} has no plan: {why}")
    output.json(result.to_dict())
    if given.figures:
        from armtempo.commands._plot import draw

        folder = default_folder(cell, given.out)
        with output.progress("Drawing"):
            drawn = report.figures(result)
        output.pictures(folder, draw(drawn, folder, output))
