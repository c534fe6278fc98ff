"""The table of an evaluation: its columns are the figures of the results, as their fields say."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

from armtempo.commands.console._output import new_table, number

if TYPE_CHECKING:
    from rich.table import Table

    from armtempo.agents import Evaluation, Figure

ROOMY_COLUMNS = 100  # a narrower table leaves figures out and keeps three digits
LIMIT_RESOLVED = 1.0 + 1e-3  # share of a limit from which it is printed red: what ticks can resolve
NAME_WIDTH = 8  # at least, of the policies' column: names are folded before numbers are cut
SMALLEST_SHOWN = 1e-7  # of a column's unit


def table_of(
    evaluation: Evaluation[Any, Any, Any], *, title: str, caption: str, width: int, bold: Collection[str] = ()
) -> Table:
    """Policies in rows, figures in columns; those without a plan last.

    Args:
        evaluation: What is told.
        title: Above the table.
        caption: Below it.
        width: Of the console, in characters.
        bold: Policies whose rows stand out.
    """
    from rich.markup import escape

    roomy = width >= ROOMY_COLUMNS
    columns = _columns(evaluation, roomy)
    table = new_table(title, caption)
    table.add_column("policy", overflow="fold", min_width=NAME_WIDTH)
    for figure in columns.values():
        table.add_column(escape((figure.head or "").format_map(evaluation.facts)), justify="right", no_wrap=True)
    for name, result in evaluation.results.items():
        cells = [_cell(evaluation, result, field, figure, roomy) for field, figure in columns.items()]
        table.add_row(name, *cells, style="bold" if name in bold else None)
    for name in evaluation.refused or ():
        table.add_row(name, "none", *["–"] * (len(columns) - 1))
    return table


def _columns(evaluation: Evaluation[Any, Any, Any], roomy: bool) -> dict[str, Figure]:
    """The figures that get a column here, by field."""
    from armtempo.agents import figures_of, kind_named

    several = evaluation.episodes > 1
    results = evaluation.results.values()
    return {
        field: figure
        for field, figure in figures_of(kind_named(evaluation.kind).result_type).items()
        if figure.head is not None
        and figure.several in (None, several)
        and (roomy or not figure.roomy)
        and not (figure.known and all(getattr(result, field) is None for result in results))
    }


def _cell(evaluation: Evaluation[Any, Any, Any], result: Any, field: str, figure: Figure, roomy: bool) -> str:
    """A figure of a policy, red where it is not as it should be."""
    value = getattr(result, field)
    digits = figure.digits if roomy else min(figure.digits, 3)
    if figure.form == "episodes":
        text, wrong = f"{value}/{evaluation.episodes}", value != evaluation.episodes
        return f"[bold red]{text}[/]" if wrong else text
    if figure.form == "mishaps":
        return f"[bold red]{value}[/]" if value else "0"
    text = _text(value, figure, digits)
    if figure.interval is not None and value is not None:
        text += f"\n({_ends(getattr(result, figure.interval), digits)})"
    return f"[red]{text}[/]" if _beyond(value, figure, evaluation.facts) else text


def _text(value: Any, figure: Figure, digits: int) -> str:
    if figure.form == "interval":
        return _ends(value, digits)
    if figure.form == "significant":
        return significant(figure.scale * value, digits)
    shown = None if value is None else figure.scale * value
    if figure.form == "small" and shown is not None and 0.0 < shown < 0.5 * 10.0**-digits:
        return f"{shown:.0e}" if shown >= SMALLEST_SHOWN else f"<{SMALLEST_SHOWN:.0e}".replace("e-0", "e-")
    return number(value, digits, figure.scale)


def _ends(interval: tuple[float, float] | None, digits: int) -> str:
    return "–" if interval is None else f"{interval[0]:.{digits}f}–\n{interval[1]:.{digits}f}"


def significant(value: float, digits: int = 3) -> str:
    """So many digits that count; no more zeros than a reader can see through."""
    return f"{value:.1e}" if 0.0 < value < 1e-3 else f"{value:.{digits}g}"


def _beyond(value: Any, figure: Figure, facts: Any) -> bool:
    if value is None:
        return False
    if figure.limit is not None and value > LIMIT_RESOLVED * figure.limit:
        return True
    return figure.least is not None and bool(value < facts[figure.least])
