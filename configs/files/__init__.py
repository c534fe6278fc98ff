"""Finding and reading files; messages that name file, key, value and remedy."""

from __future__ import annotations

from armtempo.configs.files._load import (
    bundled_cells,
    change_blend,
    data_path,
    load_cell_config,
    parse_cell_config,
    resolve_file,
    robot_config,
)
from armtempo.configs.files._load_sweep import bundled_sweeps, load_sweep_config, plain_number, trial_training
from armtempo.configs.files._load_train import bundled_trainings, load_train_config, parse_train_config

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
