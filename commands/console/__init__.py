"""What commands share: output, tables, options."""

from __future__ import annotations

from armtempo.commands.console._options import (
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
from armtempo.commands.console._output import (
    Output,
    default_folder,
    new_table,
    number,
    open_cell,
    shown,
    silent_stdout,
)

__all__ = [
    "AllNames",
    "CellName",
    "DisturbanceName",
    "JsonFile",
    "Names",
    "OutFolder",
    "Output",
    "PhysicsName",
    "Seed",
    "check_count",
    "check_period",
    "check_seed",
    "default_folder",
    "new_table",
    "number",
    "open_cell",
    "shown",
    "silent_stdout",
]
