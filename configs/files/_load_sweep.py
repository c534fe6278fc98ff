"""Read sweep files, and put what a trial has drawn into its training."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from armtempo.configs.files._load import _DATA, _closest, _config_error, _parse_yaml, _shown
from armtempo.configs.files._load_train import bundled_trainings, load_train_config, parse_train_config
from armtempo.configs.training import SweepConfig, SweepValue, TrainConfig
from armtempo.errors import ConfigError, UnknownNameError


def bundled_sweeps() -> tuple[str, ...]:
    """Names of the sweeps that come with armtempo, sorted."""
    return tuple(sorted(path.stem for path in (_DATA / "sweep").glob("*.yaml")))


def load_sweep_config(name_or_path: str | Path) -> SweepConfig:
    """Read a sweep file.

    Args:
        name_or_path: A bundled sweep's name (see :func:`bundled_sweeps`) or the path of a YAML file.

    Raises:
        UnknownNameError: Neither a bundled sweep nor a file.
        ConfigError: The file cannot be read, is not YAML, or says something that a sweep cannot have; also where its
            training, or a key of the search space, is not there.
    """
    path = Path(name_or_path).expanduser()
    if isinstance(name_or_path, str) and name_or_path in bundled_sweeps():
        path = _DATA / "sweep" / f"{name_or_path}.yaml"
    elif not path.is_file():
        known = bundled_sweeps()
        remedy = f"{_closest(str(name_or_path), known)}known: {', '.join(known)}; or give the path of a YAML file"
        raise UnknownNameError("sweep", str(name_or_path), known, remedy=remedy)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read: {error}", remedy="save it as UTF-8, readable", file=path, key="", value=None
        ) from error
    source = path.resolve()
    data = _parse_yaml(text, source)
    if not isinstance(data, Mapping):
        what = "is empty" if data is None else f"is no mapping of keys to values but {_shown(data)}"
        remedy = "start from a bundled sweep such as configs/sweep/lee1991.yaml"
        raise ConfigError(f"{source}: {what}", remedy=remedy, file=source, key="", value=data)
    try:
        sweep = SweepConfig.model_validate(data).read_from(source)
    except ValidationError as error:
        raise _config_error(source, error, SweepConfig) from None
    for pick in (0, -1):  # both ends of every range must be something that the training can have
        trial_training(sweep, {key: _end(sweep, key, pick) for key in sweep.space})
    return sweep


def trial_training(sweep: SweepConfig, values: Mapping[str, SweepValue]) -> TrainConfig:
    """The sweep's training with these values, by dotted key, and the length of a trial.

    Raises:
        ConfigError: The training cannot have one of them.
    """
    base = load_train_config(_training_of(sweep))
    data = _parse_yaml(base.text, base.source)
    assert isinstance(data, dict)  # it was read before
    data["total_steps"] = sweep.total_steps
    for key, value in values.items():
        _put(data, key, value)
    return parse_train_config(yaml.safe_dump(data, sort_keys=False), base.source)


def _training_of(sweep: SweepConfig) -> str | Path:
    beside = sweep.source.parent / Path(sweep.training).expanduser()
    return sweep.training if sweep.training in bundled_trainings() else beside


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
