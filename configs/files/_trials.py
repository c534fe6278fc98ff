"""Sweep files whose trainings are looked at, too; and what a trial has drawn, put into its training."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from armtempo.configs.files._load import bundled_trainings, load_train_config, parse_train_config, read_sweep_config
from armtempo.configs.files._yaml import dump_yaml, parse_yaml
from armtempo.configs.training import SweepConfig, SweepValue, TrainConfig
from armtempo.reading import user_path


def load_sweep_config(name_or_path: str | Path) -> SweepConfig:
    """Read a sweep file.

    Args:
        name_or_path: A bundled sweep's name (see :func:`bundled_sweeps`) or the path of a YAML file.

    Raises:
        UnknownNameError: Neither a bundled sweep nor a file.
        ConfigError: The file cannot be read, is not YAML, or says something that a sweep cannot have; also where its
            training, or a key of the search space, is not there.
    """
    sweep = read_sweep_config(name_or_path)
    for pick in (0, -1):  # both ends of every range must be something that the training can have
        trial_training(sweep, {key: _end(sweep, key, pick) for key in sweep.space})
    return sweep


def trial_training(sweep: SweepConfig, values: Mapping[str, SweepValue]) -> TrainConfig:
    """The sweep's training with these values, by dotted key, and the length of a trial.

    Raises:
        ConfigError: The training cannot have one of them.
    """
    base = load_train_config(_training_of(sweep))
    data = parse_yaml(base.text, base.source)
    assert isinstance(data, dict)  # it was read before
    data["total_steps"] = sweep.total_steps
    for key, value in values.items():
        _put(data, key, value)
    return parse_train_config(dump_yaml(data), base.source)


def _training_of(sweep: SweepConfig) -> str | Path:
    return sweep.training if sweep.training in bundled_trainings() else sweep.source.parent / user_path(sweep.training)


def _put(data: dict[str, Any], key: str, value: SweepValue) -> None:
    *folders, last = key.split(".")
    for folder in folders:
        inner = data.setdefault(folder, {})
        if not isinstance(inner, dict):
            data[folder] = inner = {}  # the check that follows says what is wrong with it
        data = inner
    data[last] = value


def _end(sweep: SweepConfig, key: str, which: int) -> SweepValue:
    searched = sweep.space[key]
    if searched.choices is not None:
        return plain_number(searched.choices[which])
    value = searched.low if which == 0 else searched.high
    assert value is not None  # a range has both
    return int(value) if searched.integer else value


def plain_number(value: float) -> SweepValue:
    """A whole number as an int, so that keys that want one take it; it makes no difference to those that do not."""
    return int(value) if float(value).is_integer() else value
