"""YAML as we take it: safe, no key twice, ``1e-3`` is a number; errors with line, column and remedy."""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import yaml

from armtempo.configs.files._find import DataFolder
from armtempo.configs.files._messages import shown
from armtempo.errors import ConfigError


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


def parse_yaml(text: str, path: Path) -> object:
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


def parse_mapping(text: str, path: Path, folder: DataFolder) -> Mapping[str, Any]:
    """What a file of that kind says at its top: a mapping of keys to values.

    Raises:
        ConfigError: It is not YAML, or no mapping.
    """
    return as_mapping(parse_yaml(text, path), path, folder)


def as_mapping(data: object, path: Path, folder: DataFolder) -> Mapping[str, Any]:
    """``data``, if it is a mapping of keys to values.

    Raises:
        ConfigError: It is not.
    """
    if not isinstance(data, Mapping):
        what = "is empty" if data is None else f"is no mapping of keys to values but {shown(data)}"
        remedy = f"start from a bundled {folder.what} such as configs/{folder.name}/lee1991.yaml"
        raise ConfigError(f"{path}: {what}", remedy=remedy, file=path, key="", value=data)
    return data
