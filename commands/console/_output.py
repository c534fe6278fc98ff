"""What commands share: console, progress bars, and files that are written whole or not at all."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armtempo.errors import printable
from armtempo.files import check_output, check_output_folder, whole_file

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID
    from rich.table import Table

    from armtempo.commands.console._kept import Kept
    from armtempo.planners import BlendCell, CoordinationCell, IKCell

LOADING_MESSAGE = "Loading {} (compiles once after installation, about a minute)"
TABLE_WIDTH = 118  # of tables that go to a file or a pipe


def plain(value: Any) -> Any:
    """``value`` as JSON can hold it: numpy scalars and tuples unpacked, what is not finite as null."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _as_json(value: Any, encoding: str | None) -> str:
    """JSON in characters of this encoding, others as escapes: nothing is lost."""
    numbers = plain(value)
    text = json.dumps(numbers, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    try:
        text.encode(encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        text = json.dumps(numbers, indent=2, allow_nan=False) + "\n"
    return text


class Output:
    """Where a command's words go: tables to stdout, progress to stderr, figures as JSON to a file or ``-`` (stdout).

    Args:
        json_file: ``--json`` of the command; with ``-`` nothing but JSON goes to stdout.

    Raises:
        InputError: That file cannot be written.
    """

    def __init__(self, json_file: str | None) -> None:
        from rich.console import Console  # late, as the rest of rich here: --help is to be quick

        self._json_file = json_file
        self._quiet = json_file == "-"
        if json_file is not None and not self._quiet:
            check_output(json_file)
        self.console: Console = Console(file=sys.stdout, quiet=self._quiet, highlight=False)
        if not self.console.is_terminal:
            self.console.width = TABLE_WIDTH
        self._errors = Console(file=sys.stderr)

    @contextmanager
    def progress(self, what: str, total: float | None = None) -> Iterator[tuple[Progress, TaskID]]:
        """A progress bar on stderr, or a spinner without ``total``; silent where nobody looks."""
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        counting = () if total is None else (BarColumn(), MofNCompleteColumn())
        columns = (SpinnerColumn(), TextColumn("{task.description}"), *counting, TimeElapsedColumn())
        disable = self._quiet or not self._errors.is_terminal
        with Progress(*columns, console=self._errors, transient=True, disable=disable) as progress:
            yield progress, progress.add_task(what, total=total)

    def say(self, text: str = "") -> None:
        """One paragraph to stdout (rich markup)."""
        self.console.print(text)

    def table(self, table: Table) -> None:
        """A table to stdout."""
        self.console.print(table)

    def json(self, value: Any) -> None:
        """Write ``value`` where ``--json`` said, if it did."""
        if self._json_file is None:
            return
        text = _as_json(value, sys.stdout.encoding if self._quiet else "utf-8")
        if self._quiet:
            sys.stdout.write(text)
            return
        with whole_file(Path(self._json_file)) as temporary:
            temporary.write_text(text, encoding="utf-8")
        self.say(f"Figures as JSON: {shown(self._json_file)}")

    def taken_over(self, kept: Kept) -> None:
        """Say on stderr that results of an interrupted run are there already."""
        if kept.found:
            self._errors.print(f"Going on behind {kept.found} results of {shown(kept.file)}", highlight=False)

    def pictures(self, folder: Path, names: Sequence[str]) -> None:
        """Say where pictures are."""
        self.say(f"Pictures in {shown(folder)}{os.sep}: {', '.join(names)}")


@contextmanager
def silent_stdout() -> Iterator[None]:
    """Keep what compiled libraries print (PyBullet's renderer) out of the standard output.

    stderr is left alone: it shows the progress bar.
    """
    sys.stdout.flush()
    kept = os.dup(1)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def shown(path: str | Path) -> str:
    """A path, or a name of the user's, as rich markup takes it literally and a terminal may show it."""
    from rich.markup import escape

    return escape(printable(str(path)))


def new_table(title: str, caption: str = "") -> Table:
    """An empty table in the style of all commands."""
    from rich import box
    from rich.table import Table

    return Table(
        title=title,
        caption=caption or None,
        box=box.SIMPLE_HEAD,
        title_justify="left",
        caption_justify="left",
        title_style="bold",
        caption_style="dim",
        pad_edge=False,
        padding=(0, 1),
        collapse_padding=True,
    )


def number(value: float | None, digits: int, scale: float = 1.0) -> str:
    """A table's cell: ``value * scale`` with so many digits, a dash for what does not exist."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{round(value * scale, digits) + 0.0:.{digits}f}"  # adding 0.0 takes the sign off a zero


def open_cell(name: str, output: Output) -> CoordinationCell | BlendCell | IKCell:
    """Load and certify a cell of any kind, with a spinner."""
    with output.progress(LOADING_MESSAGE.format(shown(name))):
        from armtempo.planners import load_cell  # late: --help is to be quick

        return load_cell(name, None)


def find_bound(cell: CoordinationCell, tell: Callable[[str], object]) -> None:
    """Find the bound of a cell, and ``tell`` how far its search has come: of many arms it may take a minute."""
    tell("Bounding the makespan")
    cell.timing.find_joint(
        lambda bound, nodes: tell(f"Bounding the makespan: at least {bound:.4f} s, {nodes} ways to pass are open")
    )


def output_folder(cell: str, out: Path | None, within: str = "") -> Path:
    """Where a cell's pictures go: ``--out``, or ``results/<cell>`` and a folder in it under the working directory.

    Raises:
        InputError: Nothing can be written there: better known before the cell is opened.
        ArmtempoError: There is no such cell.
    """
    if out is None:
        from armtempo.configs import load_cell_config  # late: --help is to be quick

        out = Path("results") / load_cell_config(cell).name / within
    check_output_folder(out)
    return out
