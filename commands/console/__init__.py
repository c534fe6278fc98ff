"""What commands share: output, tables, options."""

from __future__ import annotations

from armtempo.commands.console._flags import (
    AllNames,
    CellName,
    DisturbanceName,
    JsonFile,
    Names,
    OutFolder,
    PhysicsName,
    Seed,
    check_count,
    check_period,
    check_seed,
)
from armtempo.commands.console._kind_line import read_kind_line
from armtempo.commands.console._options import field_docs, flag_of, options_from, with_flags
from armtempo.commands.console._output import (
    Output,
    default_folder,
    new_table,
    number,
    open_cell,
    shown,
    silent_stdout,
)
from armtempo.commands.console._table import LIMIT_RESOLVED, significant, table_of

__all__ = [
    "AllNames",
    "CellName",
    "DisturbanceName",
    "JsonFile",
    "LIMIT_RESOLVED",
    "Names",
    "OutFolder",
    "Output",
    "PhysicsName",
    "Seed",
    "check_count",
    "check_period",
    "check_seed",
    "default_folder",
    "field_docs",
    "flag_of",
    "new_table",
    "number",
    "open_cell",
    "options_from",
    "read_kind_line",
    "shown",
    "significant",
    "silent_stdout",
    "table_of",
    "with_flags",
]
