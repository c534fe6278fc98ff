"""``armtempo view``: arms and charts under one clock, as a page in the browser or in a file."""

from __future__ import annotations

import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from armtempo.commands.console import (
    AllNames,
    CellName,
    Output,
    Seed,
    check_seed,
    open_cell,
    read_kind_line,
    shown,
)
from armtempo.errors import InputError
from armtempo.files import check_output

if TYPE_CHECKING:
    from armtempo.agents import Evaluation, Kind

HIGHEST_PORT = 65535


@dataclass(frozen=True, kw_only=True)
class View:
    """Show an episode of some policies in the browser: arms in space, charts, one clock; or write that to a file.

    Without --html the page is served on this machine until Ctrl-C, and runs further policies when they are clicked.
    Each kind of cell has options of its own besides these: "armtempo view CELL --help" lists them.
    """

    cell: CellName
    """A bundled cell's name (see "armtempo cells"), or your own YAML file."""
    policies: Annotated[
        AllNames, tyro.conf.arg(metavar="NAME ...", help_behavior_hint="(default: one, of --html all)")
    ] = ()
    """Policies to run: as of "armtempo evaluate". A learned agent is ppo:FILE.npz, with sac: or tqc: if these made
    it."""
    html: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="(default: a live page)")] = None
    """Write the page there: one file that needs nothing else, no network either."""
    seed: Seed = 0
    """Seed of the episode."""
    port: Annotated[int, tyro.conf.arg(metavar="N", help_behavior_hint="(default: any that is free)")] = 0
    """Port of the live page."""
    browser: bool = True
    """Open the browser, where there is a display."""


def view(line: Sequence[str]) -> None:
    """Run ``armtempo view`` with what follows on the line; its flags are those of the cell's kind."""
    given, kind, options = read_kind_line(line, View, "armtempo view")
    check_seed(given.seed)
    if not 0 <= given.port <= HIGHEST_PORT:
        raise InputError(f"--port must be 0 to {HIGHEST_PORT}, got {given.port}", remedy="try --port 8000")
    if given.html is not None:
        check_output(given.html)
    output = Output(None)
    cell: Any = open_cell(given.cell, output)
    chosen = tuple(dict.fromkeys(given.policies)) or None
    if given.html is not None:
        evaluation = _run(kind, cell, options, chosen, given.seed, output)
        from armtempo.commands.viewer import write_view  # late: --help is to be quick

        with output.progress("Writing the page"):
            write_view(evaluation, given.html)
        output.say(f"Page (open it in a browser): {shown(given.html)}")
    else:
        _serve(given, kind, cell, options, chosen, output)


def _run(
    kind: Kind[Any, Any, Any, Any], cell: Any, options: Any, chosen: Sequence[str] | None, seed: int, output: Output
) -> Evaluation[Any, Any, Any]:
    """One episode of each policy."""
    from armtempo.agents.evaluation import evaluate_kind

    with output.progress("Simulating", len(chosen or kind.usual_policies(options))) as (progress, task):

        def on_episode(policy: str, episode: int) -> None:
            progress.update(task, description=f"Simulating {policy}", advance=1)

        return evaluate_kind(kind, cell, chosen, options, episodes=1, seed=seed, on_episode=on_episode)


def _serve(
    given: View, kind: Kind[Any, Any, Any, Any], cell: Any, options: Any, chosen: Sequence[str] | None, output: Output
) -> None:
    """The page, until Ctrl-C."""
    from armtempo.commands.viewer import LivePage, serve, usual_policy
    from armtempo.envs.bodies import display_available

    first = chosen or (usual_policy(kind),)
    evaluation = _run(kind, cell, options, first, given.seed, output)
    offered = list(dict.fromkeys([*first, *kind.usual_policies(options)]))

    def more(before: Evaluation[Any, Any, Any], policy: str) -> Evaluation[Any, Any, Any]:
        """One more policy, and what is known of all only beside the others."""
        after = _run(kind, cell, options, (policy,), given.seed, output)
        results = {**before.results, **after.results}
        compared, facts = kind.compare(cell, options, results, episodes=1, seed=given.seed)
        return replace(before, results=compared, facts={**before.facts, **facts})

    live = LivePage(evaluation, offered, more)
    with serve(live, given.port) as server:
        address = f"http://127.0.0.1:{server.server_address[1]}/"
        output.say(f"{shown(cell.name)} is shown at {address} until Ctrl-C")
        sys.stdout.flush()
        if given.browser and display_available():
            webbrowser.open(address)
        try:
            server.serve_forever()
        except KeyboardInterrupt as stop:
            if type(stop) is not KeyboardInterrupt:  # told to end from outside
                raise
