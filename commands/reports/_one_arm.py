"""``armtempo evaluate`` of cells with one arm: run, tabulate, draw; what is told of each kind is its ``Report``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armtempo.commands.console import Output, default_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armtempo.planners import BlendCell, IKCell


@dataclass(frozen=True, kw_only=True)
class Report:
    """What is told of an evaluation."""

    policies: Callable[[], Sequence[str]]
    """All that there are."""
    tabulate: Callable[[Any, Output], None]
    figures: Callable[[Any], dict[str, Figure]]
    """By file name."""


def evaluate_one_arm(
    cell: BlendCell | IKCell,
    policies: tuple[str, ...],
    output: Output,
    report: Report,
    *,
    out: Path | None,
    figures: bool,
    **options: Any,
) -> None:
    """Run, tabulate and draw; ``options`` as of ``agents.evaluate``."""
    from armtempo import agents

    chosen = policies or report.policies()
    with output.progress("Simulating", len(chosen) * options["episodes"]) as (progress, task):

        def on_episode(policy: str, episode: int) -> None:
            progress.update(task, description=f"Simulating {policy}, episode {episode + 1}", advance=1)

        run: Any = agents.evaluate
        result = run(cell, chosen, on_episode=on_episode, **options)
    report.tabulate(result, output)
    output.json(result.to_dict())
    if figures:
        from armtempo.commands.figures._write import draw

        folder = default_folder(cell, out)
        with output.progress("Drawing"):
            drawn = report.figures(result)
        output.pictures(folder, draw(drawn, folder, output))


def circumstances(family: str, episodes: int, model_error: float, what: str) -> str:
    """For a title: random ``what``, heavier bodies."""
    said = "" if family == "given" else f"; {episodes} random {what} ({family})"
    return said + (f"; bodies {100.0 * model_error:+g} % in mass" if model_error else "")
