"""What commands share: output, tables, options."""

from __future__ import annotations

from armtempo.commands.console._flags import (
    TRAINING_SEED_MAX,
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
from armtempo.commands.console._kept import Kept, file_digests, kept_results
from armtempo.commands.console._kind_line import read_kind_line
from armtempo.commands.console._labels import policy_label, policy_labels
from armtempo.commands.console._options import field_docs, flag_of, options_from, with_flags
from armtempo.commands.console._output import (
    Output,
    find_bound,
    new_table,
    number,
    open_cell,
    output_folder,
    shown,
    silent_stdout,
)
from armtempo.commands.console._table import LIMIT_RESOLVED, significant, table_of

__all__ = [
    "AllNames",
    "CellName",
    "DisturbanceName",
    "JsonFile",
    "Kept",
    "LIMIT_RESOLVED",
    "Names",
    "OutFolder",
    "Output",
    "PhysicsName",
    "Seed",
    "TRAINING_SEED_MAX",
    "check_count",
    "check_period",
    "check_seed",
    "field_docs",
    "file_digests",
    "find_bound",
    "flag_of",
    "kept_results",
    "new_table",
    "number",
    "open_cell",
    "options_from",
    "output_folder",
    "policy_label",
    "policy_labels",
    "read_kind_line",
    "shown",
    "significant",
    "silent_stdout",
    "table_of",
    "with_flags",
]
