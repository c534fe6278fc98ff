"""What commands share: output, tables, options."""

from __future__ import annotations

from armtempo.commands.console._output import (
    CellName,
    JsonFile,
    OutFolder,
    Output,
    default_folder,
    new_table,
    number,
    open_any_cell,
    open_cell,
    plan_all,
    shown,
    silent_stdout,
)

__all__ = [
    "CellName",
    "JsonFile",
    "OutFolder",
    "Output",
    "default_folder",
    "new_table",
    "number",
    "open_any_cell",
    "open_cell",
    "plan_all",
    "shown",
    "silent_stdout",
]
