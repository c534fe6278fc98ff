"""``armtempo evaluate``: every policy in the simulation, in one table and a few pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from armtempo.cache import content_key
from armtempo.commands.console import (
    AllNames,
    CellName,
    JsonFile,
    OutFolder,
    Output,
    Seed,
    check_count,
    check_seed,
    file_digests,
    kept_results,
    open_cell,
    output_folder,
    read_kind_line,
    shown,
    table_of,
)
from armtempo.files import check_output

if TYPE_CHECKING:
    from armtempo.agents import Evaluation, Kind


@dataclass(frozen=True, kw_only=True)
class Evaluate:
    """Run policies in the simulated cell, compare them with each other and with the certified optimum, draw pictures.

    Each kind of cell has options of its own besides these: "armtempo evaluate CELL --help" lists them.
    """

    cell: CellName
    """A bundled cell's name (see "armtempo cells"), or your own YAML file."""
    policies: AllNames = ()
    """Policies to run: phase-plane, sequential, constant-speed, constant-acceleration, delay, vci, offset,
    interval, optimal, random; under the shield search, search+stop, search+hold, longest-path, reorder, rollout;
    in blend cells line-speed, limit-aware, limit-aware-smooth, constant, random; in ik cells feedback,
    feedback-ff, feedback-damped, newton, law, law-scheduled, random. A learned agent is ppo:FILE.npz, with sac:
    or tqc: if these made it."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes per policy; the table shows the worst clearance, torque and path error of all."""
    seed: Seed = 0
    """Seed of the first episode; the next ones count on from it."""
    json_file: JsonFile = None
    """Write the same figures there as JSON, units in the keys; "-" for nothing but JSON on stdout."""
    out: OutFolder = None
    """Folder for the PNG files."""
    audit: bool = False
    """Ask the other physics engine what it makes of every tick of the first episode: one more column."""
    figures: bool = True
    """Draw pictures."""
    html: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: none)")] = None
    """Write the episodes there as a page for the browser, see "armtempo view"."""


def evaluate(line: Sequence[str]) -> None:
    """Run ``armtempo evaluate`` with what follows on the line; its flags are those of the cell's kind."""
    given, kind, options = read_kind_line(line, Evaluate, "armtempo evaluate")
    check_count("--episodes", given.episodes, 1)
    check_seed(given.seed)
    _run(given, kind, options)


def _run(given: Evaluate, kind: Kind[Any, Any, Any, Any], options: Any) -> None:
    """Run, tabulate, draw."""
    from armtempo.agents.evaluation import Continuation, audited, check_audit, evaluate_kind

    if given.audit:
        check_audit(options)
    output = Output(given.json_file)
    folder = output_folder(given.cell, given.out) if given.figures else None
    if given.html is not None:
        check_output(given.html)
    cell: Any = open_cell(given.cell, output)
    chosen = tuple(dict.fromkeys(given.policies)) or None
    with kept_results("evaluate", _arguments(given, cell, options)) as kept:
        output.taken_over(kept)
        with_traces = folder is not None or given.audit or given.html is not None
        total = len(chosen or kind.usual_policies(options)) * given.episodes
        with output.progress("Simulating", total) as (progress, task):

            def on_episode(policy: str, episode: int) -> None:
                progress.update(task, description=f"Simulating {policy}, episode {episode + 1}", advance=1)

            result = evaluate_kind(
                kind,
                cell,
                chosen,
                options,
                episodes=given.episodes,
                seed=given.seed,
                on_episode=on_episode,
                continuation=Continuation(kept=kept, traces=with_traces),
            )
        _tell(kind, audited(result) if given.audit else result, output, folder)
        if given.html is not None:
            from armtempo.commands.viewer import write_view

            with output.progress("Writing the page"):
                write_view(result, given.html)
            output.say(f"Page (open it in a browser): {shown(given.html)}")


def _arguments(given: Evaluate, cell: Any, options: Any) -> dict[str, Any]:
    """All that decides what policies come to."""
    return {
        "cell": content_key([repr(cell.config), *(arm.urdf.read_bytes() for arm in cell.arms)]),
        "policies": given.policies,
        "files": file_digests(given.policies),
        "episodes": given.episodes,
        "seed": given.seed,
        "options": repr(options),
    }


def _tell(
    kind: Kind[Any, Any, Any, Any], result: Evaluation[Any, Any, Any], output: Output, folder: Path | None
) -> None:
    """Tabulate, and draw into a folder."""
    from armtempo.commands.reports import REPORTS, labelled, title_of

    report, told = REPORTS[kind.name], result.to_dict()
    result = labelled(result)
    title, caption = title_of(result, report.title_suffix(result)), report.caption(result)
    output.table(table_of(result, title=title, caption=caption, width=output.console.width, bold=report.best(result)))
    output.say(report.summary_sentence(result))
    for name, why in (result.refused or {}).items():
        output.say(f"{name} has no plan: {why}")
    output.json(told)
    if folder is not None:
        from armtempo.commands.figures._write import draw

        with output.progress("Drawing"):
            drawn = report.figures(result)
        output.pictures(folder, draw(drawn, folder, output))
