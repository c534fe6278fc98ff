"""Read cell files: YAML to a checked :class:`CellConfig`, every error with file, key, value and remedy."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any, get_args, overload

import yaml
from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from armtempo.configs.schema import AnyCellConfig, BlendCellConfig, CellConfig, IKCellConfig, RobotConfig
from armtempo.errors import ConfigError, InputError, UnknownNameError

_DATA = Path(__file__).parents[1]
_SUFFIXES = (".yaml", ".yml")
_PYBULLET = "pybullet_data/"
Kind = type[CellConfig] | type[BlendCellConfig] | type[IKCellConfig]
_KINDS: dict[str, Kind] = {"coordination": CellConfig, "blend": BlendCellConfig, "ik": IKCellConfig}
_KIND_OF_KEY = {"blend": "blend", "line_speed": "blend", "target": "ik", "law": "ik", "arm": "blend or ik"}
# pydantic's words and ours, which are those of YAML
_WORDING = (
    (r"Input should be a valid dictionary or instance of \w+", "must be a mapping of keys to values"),
    (r"Input should be a valid (tuple|list)", "must be a list"),
    (r"Input should be", "must be"),
    (r"String should match pattern", "must match"),
    (r"Tuple should have (at \w+ \d+ items?) .*", r"must have \1"),
)
Key = tuple[int | str, ...]


def bundled_cells() -> tuple[str, ...]:
    """Names of the cells that come with armtempo, sorted."""
    return tuple(sorted(path.stem for path in (_DATA / "cells").glob("*.yaml")))


def data_path(name: str) -> Path:
    """Path of a bundled data file.

    Args:
        name: Path from the folder of bundled data, such as ``"robots/planar_two_link.urdf"``.

    Raises:
        UnknownNameError: There is no such file.
    """
    path = _DATA / name
    if not path.is_file():
        known = (p for p in _DATA.rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc"))
        raise UnknownNameError("data file", name, (p.relative_to(_DATA).as_posix() for p in known))
    return path


@overload
def load_cell_config(name_or_path: str | Path, kind: type[CellConfig] | None = None) -> CellConfig: ...
@overload
def load_cell_config(name_or_path: str | Path, kind: type[BlendCellConfig]) -> BlendCellConfig: ...
@overload
def load_cell_config(name_or_path: str | Path, kind: type[IKCellConfig]) -> IKCellConfig: ...
def load_cell_config(name_or_path: str | Path, kind: Kind | None = None) -> AnyCellConfig:
    """Read a cell file.

    Args:
        name_or_path: A bundled cell's name (see :func:`bundled_cells`) or the path of a YAML file.
        kind: ``CellConfig``, ``BlendCellConfig`` or ``IKCellConfig``: refuse files of another kind. None: whatever the
            file says (type checkers take it for a ``CellConfig``).

    Raises:
        UnknownNameError: Neither a bundled cell nor a file.
        ConfigError: The file cannot be read, is not YAML, says something that a cell cannot have, or is of another
            kind.
    """
    path = _cell_path(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        remedy = "save it as UTF-8"
        raise ConfigError(f"{path}: not UTF-8 text", remedy=remedy, file=path, key="", value=None) from error
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot be read: {error.strerror}",
            remedy="check the path and its permissions",
            file=path,
            key="",
            value=None,
        ) from error
    data, source = _parse_yaml(text, path), path.resolve()
    return parse_cell_config(data, source, kind)


@overload
def parse_cell_config(data: object, source: Path, kind: type[CellConfig] | None = None) -> CellConfig: ...
@overload
def parse_cell_config(data: object, source: Path, kind: type[BlendCellConfig]) -> BlendCellConfig: ...
@overload
def parse_cell_config(data: object, source: Path, kind: type[IKCellConfig]) -> IKCellConfig: ...
def parse_cell_config(data: object, source: Path, kind: Kind | None = None) -> AnyCellConfig:
    """Check the contents of a cell file.

    Args:
        data: What the YAML says: a mapping of plain Python values.
        source: The file it came from; messages name it, and file names in the cell are relative to its folder.
        kind: As in :func:`load_cell_config`.

    Raises:
        ConfigError: ``data`` says something that a cell cannot have, or is of another kind.
    """
    if not isinstance(data, Mapping):
        what = "is empty" if data is None else f"is no mapping of keys to values but {_shown(data)}"
        remedy = "start from a bundled cell such as configs/cells/lee1991.yaml"
        raise ConfigError(f"{source}: {what}", remedy=remedy, file=source, key="", value=data)
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
    if "kind" in data and (not isinstance(said, str) or said not in _KINDS):
        raise ConfigError(
            f"{source}: kind: must be {_either(map(repr, _KINDS))}, got {_shown(said)}",
            remedy=f"use kind: {_either(_KINDS)}",
            file=source,
            key="kind",
            value=said,
        )
    model = _KINDS[said] if isinstance(said, str) else CellConfig
    if kind is not None and model is not kind:
        asked = next(name for name, known in _KINDS.items() if known is kind)
        raise ConfigError(
            f"{source}: kind: this is {_a(said)} cell, and {_a(asked)} cell is needed here",
            remedy=f"give a cell file of kind: {asked}",
            file=source,
            key="kind",
            value=said,
        )
    try:
        return model.model_validate(data, context={"source": source})
    except ValidationError as error:
        raise _config_error(source, error, model) from None


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
    if given.get("curve", "cubic") != "cubic":
        kept.pop("shape_factor", None)
    data = config.model_dump(exclude_none=True) | {"blend": {**kept, **given}}
    return parse_cell_config(data, config.source, BlendCellConfig)


def resolve_file(config: AnyCellConfig, name: str) -> Path:
    """Find a file that a cell names: next to the cell file first, else among the bundled robots or PyBullet's data.

    Args:
        config: The cell.
        name: An absolute path, a path from the cell file's folder, a bundled robot's file name, or
            ``pybullet_data/`` and a path in the data that comes with PyBullet.

    Raises:
        ConfigError: It is in none of these places.
    """
    beside = config.source.parent / Path(name).expanduser()
    places = [beside, _DATA / "robots" / name]
    if name.startswith(_PYBULLET):
        import pybullet_data

        places.append(Path(pybullet_data.getDataPath()) / name.removeprefix(_PYBULLET))
    for path in places:
        if path.is_file():
            return path.resolve()
    robots = sorted({path.name for path in (_DATA / "robots").glob("*.urdf")} | set(_datasheets()))
    raise ConfigError(
        f"{config.source}: no file {name!r}: looked for {beside}",
        remedy=f"{_closest(name, robots)}give a path from the cell file, or a bundled robot: {', '.join(robots)}",
        file=config.source,
        key="",
        value=name,
    )


def robot_config(urdf: str) -> RobotConfig | None:
    """What the bundled data sheets say of a robot, None if nothing.

    Args:
        urdf: The name that a cell gives as ``urdf``, such as ``"pybullet_data/franka_panda/panda.urdf"``.
    """
    return _datasheets().get(urdf)


@cache
def _datasheets() -> dict[str, RobotConfig]:
    path = data_path("robots/datasheets.yaml")
    data = _parse_yaml(path.read_text(encoding="utf-8"), path)
    return TypeAdapter(dict[str, RobotConfig]).validate_python(data)


def _cell_path(name_or_path: str | Path) -> Path:
    if not isinstance(name_or_path, str | Path):
        raise InputError(
            f"a cell is a name or a file, got {type(name_or_path).__name__}",
            remedy=f"give a YAML file, or a bundled cell: {', '.join(bundled_cells())}",
        )
    path = Path(name_or_path).expanduser()
    bundled = _DATA / "cells" / f"{name_or_path}.yaml"
    if isinstance(name_or_path, str) and name_or_path in bundled_cells():
        return bundled
    if path.is_file():
        return path
    looks_like_a_file = isinstance(name_or_path, Path) or path.suffix in _SUFFIXES or len(path.parts) != 1
    if looks_like_a_file or path.exists():
        what = "is a folder" if path.is_dir() else "no such file"
        remedy = f"give a YAML file, or a bundled cell: {', '.join(bundled_cells())}"
        raise ConfigError(f"{path}: {what}", remedy=remedy, file=path, key="", value=None)
    close = _closest(str(name_or_path), bundled_cells())
    remedy = f"{close}known: {', '.join(bundled_cells())}; or give the path of a YAML file"
    raise UnknownNameError("cell", str(name_or_path), bundled_cells(), remedy=remedy)


class _Loader(yaml.SafeLoader):
    """Safe YAML that refuses duplicate keys and reads ``1e-3`` as a number (YAML 1.1 takes it for a string)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.value != "<<":
                if key.value in seen:
                    raise yaml.constructor.ConstructorError(
                        None, None, f"the key {key.value!r} is given twice", key.start_mark
                    )
                seen.add(key.value)
        return super().construct_mapping(node, deep)


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+.0123456789")
)


def _parse_yaml(text: str, path: Path) -> object:
    try:
        return yaml.load(text, Loader=_Loader)  # noqa: S506 - a SafeLoader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        what = " ".join(filter(None, (error.problem, error.context)))
        remedy = "mend the YAML there; keys of one mapping differ and share one indentation of spaces"
        raise ConfigError(f"{path}: {where}{what}", remedy=remedy, file=path, key="", value=None) from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        what = " ".join(str(error).split())
        raise ConfigError(f"{path}: not YAML: {what}", remedy="mend the file", file=path, key="", value=None) from error


def _config_error(source: Path, error: ValidationError, model: type[BaseModel]) -> ConfigError:
    """The complaint that explains most: a misspelt key comes before the key that it leaves missing."""
    complaints = error.errors(include_url=False)
    first = min(complaints, key=lambda complaint: complaint["type"] != "extra_forbidden")
    key, value, what, remedy = _explain(first, model)
    return ConfigError(f"{source}: {key}: {what}", remedy=remedy, file=source, key=key, value=value)


def _explain(complaint: ErrorDetails, model: type[BaseModel]) -> tuple[str, Any, str, str]:
    """Dotted key, value, what is wrong, what to do."""
    kind, loc, value = complaint["type"], complaint["loc"], complaint["input"]
    what = complaint["msg"].removeprefix("Value error, ")
    for theirs, ours in _WORDING:
        what = re.sub(theirs, ours, what)
    if match := re.match(r"([a-z_\d.]+): ", what):  # a check over several keys says which one to change
        what = what[match.end() :]
        for part in match[1].split("."):
            step = int(part) if part.isdigit() else part
            loc, value = (*loc, step), _inside(value, step)
    if kind == "missing" and isinstance(loc[-1], int):
        kind, loc, what = "too_short", loc[:-1], "has too few items"
    meaning = _description(loc, model)
    match kind:
        case "extra_forbidden":
            known = _known_keys(loc[:-1], model)
            return _dotted(loc), value, "unknown key", f"{_closest(str(loc[-1]), known)}known: {', '.join(known)}"
        case "missing":
            return _dotted(loc), None, "missing", f"add it: {meaning}" if meaning else "add it"
        case "value_error":
            return _dotted(loc), value, what, meaning or "change it"
        case _:
            return _dotted(loc), value, f"{what}, got {_shown(value)}", meaning or "change it"


def _inside(value: Any, key: int | str) -> Any:
    """What ``value`` has at ``key``, None if nothing: it is the user's."""
    try:
        return value[key]
    except (LookupError, TypeError):
        return None


def _either(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} or {last}"


def _a(kind: object) -> str:
    return f"an {kind}" if kind == "ik" else f"a {kind}"


def _dotted(loc: Key) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in loc).removeprefix(".")


def _shown(value: object) -> str:
    text = "null" if value is None else " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def _closest(name: str, known: tuple[str, ...] | list[str]) -> str:
    close = get_close_matches(name, known, n=1)
    return f"did you mean {close[0]!r}? " if close else ""


def _known_keys(loc: Key, root: type[BaseModel]) -> list[str]:
    model = _model_at(loc, root)
    return list(model.model_fields) if model else []


def _description(loc: Key, root: type[BaseModel]) -> str:
    """What the schema says about the innermost named key of ``loc``."""
    names = [part for part in loc if isinstance(part, str)]
    model = _model_at(tuple(names[:-1]), root)
    field = model.model_fields.get(names[-1]) if model and names else None
    text = (field.description if field else None) or ""
    return " ".join(text.replace("``", "").split()).removesuffix(".")


def _model_at(loc: Key, root: type[BaseModel]) -> type[BaseModel] | None:
    """The schema of the mapping at ``loc`` of a file described by ``root``."""
    model: type[BaseModel] | None = root
    for part in loc:
        if isinstance(part, str) and model:
            field = model.model_fields.get(part)
            model = _model_in(field.annotation) if field else None
    return model


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model inside ``Model``, ``Model | None`` or ``tuple[Model, ...]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((model for inner in get_args(annotation) if (model := _model_in(inner))), None)
