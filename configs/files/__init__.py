"""Finding and reading files; messages that name file, key, value and remedy."""

from __future__ import annotations

from armtempo.configs.files._data_sheets import resolve_file, robot_config
from armtempo.configs.files._find import data_path
from armtempo.configs.files._load import (
    bundled_cells,
    bundled_sweeps,
    bundled_trainings,
    change_blend,
    load_cell_config,
    load_train_config,
    parse_cell_config,
    parse_train_config,
)
from armtempo.configs.files._trials import load_sweep_config, plain_number, trial_training

__all__ = [
    "bundled_cells",
    "bundled_sweeps",
    "bundled_trainings",
    "change_blend",
    "data_path",
    "load_cell_config",
    "load_sweep_config",
    "load_train_config",
    "parse_cell_config",
    "parse_train_config",
    "plain_number",
    "resolve_file",
    "robot_config",
    "trial_training",
]
