"""Read training files, with errors like those of cell files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from armtempo.configs.files._load import _DATA, _closest, _config_error, _parse_yaml, _shown
from armtempo.configs.training import TrainConfig
from armtempo.errors import ConfigError, UnknownNameError


def bundled_trainings() -> tuple[str, ...]:
    """Names of the trainings that come with armtempo, sorted."""
    return tuple(sorted(path.stem for path in (_DATA / "train").glob("*.yaml")))


def load_train_config(name_or_path: str | Path) -> TrainConfig:
    """Read a training file.

    Args:
        name_or_path: A bundled training's name (see :func:`bundled_trainings`) or the path of a YAML file.

    Raises:
        UnknownNameError: Neither a bundled training nor a file.
        ConfigError: The file cannot be read, is not YAML, or says something that a training cannot have.
    """
    path = Path(name_or_path).expanduser()
    if isinstance(name_or_path, str) and name_or_path in bundled_trainings():
        path = _DATA / "train" / f"{name_or_path}.yaml"
    elif not path.is_file():
        known = bundled_trainings()
        remedy = f"{_closest(str(name_or_path), known)}known: {', '.join(known)}; or give the path of a YAML file"
        raise UnknownNameError("training", str(name_or_path), known, remedy=remedy)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"{path}: cannot be read: {error}", remedy="save it as UTF-8, readable", file=path, key="", value=None
        ) from error
    return parse_train_config(text, path.resolve())


def parse_train_config(text: str, source: Path) -> TrainConfig:
    """Check the text of a training file; messages name ``source``, and cell files are relative to its folder.

    Raises:
        ConfigError: It is not YAML, or says something that a training cannot have.
    """
    data = _parse_yaml(text, source)
    if not isinstance(data, Mapping):
        what = "is empty" if data is None else f"is no mapping of keys to values but {_shown(data)}"
        remedy = "start from a bundled training such as configs/train/lee1991.yaml"
        raise ConfigError(f"{source}: {what}", remedy=remedy, file=source, key="", value=data)
    try:
        return TrainConfig.model_validate(data).read_from(source, text)
    except ValidationError as error:
        raise _config_error(source, error, TrainConfig) from None
