"""Command lines whose flags depend on the kind of the cell that they name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import tyro

from armtempo.commands.console._options import flag_of, options_from, with_flags
from armtempo.errors import UnknownNameError

if TYPE_CHECKING:
    from armtempo.agents import Kind

RENAMED = {"cell": (), "json_file": ("--json",), "figures": ("--figures", "--no-figures")}
"""Flags of fields that are not called as these are."""


def read_kind_line(line: Sequence[str], flags: type[Any], program: str) -> tuple[Any, Kind[Any, Any, Any, Any], Any]:
    """Read a line that names a cell, with flags of its own and one for each option of the cell's kind.

    Args:
        line: What follows the command.
        flags: A dataclass with ``cell`` and the flags of all kinds; its docstring says first what the command does.
        program: What the command is called.

    Returns:
        The flags, the kind, and the record of its options.

    Raises:
        SystemExit: The line asks for help, or names no cell: it has been answered.
        UnknownNameError: No such cell, or a flag that this kind does not have.
        ArmtempoError: A value that the record of options refuses.
    """
    cell = _cell_word(line)
    if cell is None:
        tyro.cli(flags, prog=program, args=line)  # ends with help or a complaint
        raise SystemExit(2)
    return _read(line, flags, program, cell)


def _read(line: Sequence[str], flags: type[Any], program: str, cell: str) -> tuple[Any, Kind[Any, Any, Any, Any], Any]:
    """With the flags of the kind of ``cell``; of another cell's kind, if that turns out to be the line's."""
    from armtempo.agents import kind_named, option_names  # late, as the next: --help is to be quick
    from armtempo.configs import load_cell_config

    kind = kind_named(load_cell_config(cell).built_as)
    names = option_names(kind)
    made = with_flags(flags, kind.options_type, names)
    does = (flags.__doc__ or "").partition("\n\n")[0]
    description = f"{does}\n\nPolicies of {kind.name} cells: {', '.join(kind.policies)}, and learned agents."
    asked = ["--help"] if {"-h", "--help"} & set(line) else line  # tyro's help hides a cell that it has read
    given, left = tyro.cli(made, prog=program, args=asked, description=description, return_unknown_args=True)
    if given.cell != cell:  # what stood for the cell was a flag's value
        return _read(line, flags, program, given.cell)
    if left:
        known = [flag for one in fields(made) for flag in RENAMED.get(one.name, (flag_of(one.name),))]
        raise UnknownNameError(f"option of {program} in {kind.name} cells", left[0], known)
    return given, kind, options_from(given, kind.options_type, names)


def _cell_word(line: Sequence[str]) -> str | None:
    """The word of the line that is the cell: the first one, or behind flags a bundled name or a YAML file."""
    words = [word for word in line if not word.startswith("-")]
    if not words or words[0] == line[0]:
        return next(iter(words), None)
    from armtempo.configs import bundled_cells  # late: it imports pydantic

    known = bundled_cells()
    return next((word for word in words if word in known or Path(word).suffix in (".yaml", ".yml")), None)
