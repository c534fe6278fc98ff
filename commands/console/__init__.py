"""What commands share: output, tables, options."""

from __future__ import annotations

from armtempo.commands.console._options import field_docs, flag_of, options_from, with_flags
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
from armtempo.commands.console._table import LIMIT_RESOLVED, significant, table_of

__all__ = [
    "CellName",
    "LIMIT_RESOLVED",
    "JsonFile",
    "OutFolder",
    "Output",
    "default_folder",
    "field_docs",
    "flag_of",
    "new_table",
    "number",
    "open_any_cell",
    "open_cell",
    "options_from",
    "plan_all",
    "shown",
    "significant",
    "silent_stdout",
    "table_of",
    "with_flags",
]
