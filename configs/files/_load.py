"""Cell, training and sweep files, checked: every error with file, key, value and remedy."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar, overload

from pydantic import BaseModel, ValidationError

from armtempo.configs.files._find import CELL_FILES, SWEEP_FILES, TRAINING_FILES
from armtempo.configs.files._messages import config_error, either, shown, with_article
from armtempo.configs.files._yaml import as_mapping, parse_mapping, parse_yaml
from armtempo.configs.schema import CELL_CONFIGS, BlendCellConfig, CellConfig, CellFileConfig
from armtempo.configs.training import SweepConfig, TrainConfig
from armtempo.errors import ConfigError

CellFileT = TypeVar("CellFileT", bound=CellFileConfig)
ModelT = TypeVar("ModelT", bound=BaseModel)

_KIND_OF_KEY = {"blend": "blend", "line_speed": "blend", "target": "ik", "law": "ik", "arm": "blend or ik"}


def bundled_cells() -> tuple[str, ...]:
    """Names of the cells that come with armtempo, sorted."""
    return CELL_FILES.bundled()


def bundled_trainings() -> tuple[str, ...]:
    """Names of the trainings that come with armtempo, sorted."""
    return TRAINING_FILES.bundled()


def bundled_sweeps() -> tuple[str, ...]:
    """Names of the sweeps that come with armtempo, sorted."""
    return SWEEP_FILES.bundled()


@overload
def load_cell_config(name_or_path: str | Path, kind: None = None) -> CellConfig: ...
@overload
def load_cell_config(name_or_path: str | Path, kind: type[CellFileT]) -> CellFileT: ...
def load_cell_config(name_or_path: str | Path, kind: type[CellFileConfig] | None = None) -> CellFileConfig:
    """Read a cell file.

    Args:
        name_or_path: A bundled cell's name (see :func:`bundled_cells`) or the path of a YAML file.
        kind: One of ``CELL_CONFIGS``: refuse files of another kind. None: whatever the file says (type checkers take it
            for a ``CellConfig``).

    Raises:
        UnknownNameError: Neither a bundled cell nor a file.
        ConfigError: The file cannot be read, is not YAML, says something that a cell cannot have, or is of another
            kind.
    """
    text, source = CELL_FILES.read(name_or_path)
    return parse_cell_config(parse_yaml(text, source), source, kind)


@overload
def parse_cell_config(data: object, source: Path, kind: None = None) -> CellConfig: ...
@overload
def parse_cell_config(data: object, source: Path, kind: type[CellFileT]) -> CellFileT: ...
def parse_cell_config(data: object, source: Path, kind: type[CellFileConfig] | None = None) -> CellFileConfig:
    """Check the contents of a cell file.

    Args:
        data: What the YAML says: a mapping of plain Python values.
        source: The file it came from; messages name it, and file names in the cell are relative to its folder.
        kind: As in :func:`load_cell_config`.

    Raises:
        ConfigError: ``data`` says something that a cell cannot have, or is of another kind.
    """
    data = as_mapping(data, source, CELL_FILES)
    said = data.get("kind")
    if "kind" not in data and (telling := [key for key in _KIND_OF_KEY if key in data]):
        kinds = _KIND_OF_KEY[telling[0]]
        raise ConfigError(
            f"{source}: kind: missing, and {telling[0]} belongs to cells of kind {kinds}",
            remedy=f"add kind: {kinds}",
            file=source,
            key="kind",
            value=None,
        )
    if "kind" in data and (not isinstance(said, str) or said not in CELL_CONFIGS):
        raise ConfigError(
            f"{source}: kind: must be {either(map(repr, CELL_CONFIGS))}, got {shown(said)}",
            remedy=f"use kind: {either(CELL_CONFIGS)}",
            file=source,
            key="kind",
            value=said,
        )
    model = CELL_CONFIGS[said] if isinstance(said, str) else CellConfig
    if kind is not None and not issubclass(model, kind):
        asked = next(name for name, known in CELL_CONFIGS.items() if issubclass(known, kind))
        raise ConfigError(
            f"{source}: kind: this is {with_article(said)} cell, and {with_article(asked)} cell is needed here",
            remedy=f"give a cell file of kind: {asked}",
            file=source,
            key="kind",
            value=said,
        )
    return checked(model, data, source)


def change_blend(config: BlendCellConfig, **changes: Any) -> BlendCellConfig:
    """The same cell with other corners; ``remaining_distance_m`` and ``tolerance_m`` take each other's place.

    A curve that has no shape factor drops the cell's, not one that is asked for with it.

    Args:
        config: The cell.
        changes: Keys of ``blend`` and their new values; None keeps what there is.

    Raises:
        ConfigError: A value that a file could not have.
    """
    given = {key: value for key, value in changes.items() if value is not None}
    kept = config.blend.model_dump(exclude_none=True)
    if "remaining_distance_m" in given or "tolerance_m" in given:
        kept = {key: value for key, value in kept.items() if key not in ("remaining_distance_m", "tolerance_m")}
    curve = given.get("curve", "cubic")
    if not isinstance(curve, str) or curve != "cubic":
        kept.pop("shape_factor", None)
    data = config.model_dump(exclude_none=True) | {"blend": {**kept, **given}}
    return parse_cell_config(data, config.source, BlendCellConfig)


def load_train_config(name_or_path: str | Path) -> TrainConfig:
    """Read a training file.

    Args:
        name_or_path: A bundled training's name (see :func:`bundled_trainings`) or the path of a YAML file.

    Raises:
        UnknownNameError: Neither a bundled training nor a file.
        ConfigError: The file cannot be read, is not YAML, or says something that a training cannot have.
    """
    return parse_train_config(*TRAINING_FILES.read(name_or_path))


def parse_train_config(text: str, source: Path) -> TrainConfig:
    """Check the text of a training file; messages name ``source``, and cell files are relative to its folder.

    Raises:
        ConfigError: It is not YAML, or says something that a training cannot have.
    """
    return checked(TrainConfig, parse_mapping(text, source, TRAINING_FILES), source).read_from(source, text)


def read_sweep_config(name_or_path: str | Path) -> SweepConfig:
    """Read a sweep file, without a look at its training; see ``load_sweep_config``."""
    text, source = SWEEP_FILES.read(name_or_path)
    return checked(SweepConfig, parse_mapping(text, source, SWEEP_FILES), source).read_from(source)


def checked(model: type[ModelT], data: object, source: Path) -> ModelT:
    """What ``data`` says, as a ``model``.

    Raises:
        ConfigError: It says something that one cannot have; the message names file, key, value and remedy.
    """
    try:
        return model.model_validate(data, context={"source": source})
    except ValidationError as error:
        raise config_error(source, error, model) from None
