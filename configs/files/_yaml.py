"""YAML as we take it: plain values as in YAML 1.2, no key twice, nothing that grows; errors say line, column, remedy.

Numbers, yes and no are those of YAML 1.2's core schema: ``025`` is 25, ``1e-3`` a number, ``yes`` and ``16:40`` are
texts. Tags say no more than that: ``!!binary`` or ``!!python/name`` are refused. A text of a thousand characters can
hold aliases of aliases that stand for 1e9 values; so what a file stands for is counted while it is read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Final, NoReturn

import yaml

from armtempo.configs.files._find import DataFolder
from armtempo.errors import ConfigError, brief, printable

MOST_VALUES: Final = 100_000  # of a file, those that aliases stand for included
MOST_LEVELS: Final = 50  # of lists and mappings in each other
PER_VALUE: Final = 16  # characters of a text that count as one value more
LONGEST_INTEGER: Final = 20  # characters: more do not fit into 64 bits
LONGEST_COMPLAINT: Final = 200  # characters, of the YAML library's own words

TAG: Final = "tag:yaml.org,2002:"
INTEGERS: Final = {  # of the core schema: pattern and base
    10: re.compile(r"[-+]?[0-9]+"),
    8: re.compile(r"0o[0-7]+"),
    16: re.compile(r"0x[0-9a-fA-F]+"),
}
FLOAT: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
NOT_FINITE: Final = re.compile(r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
BOOLS: Final = {"true": True, "True": True, "TRUE": True, "false": False, "False": False, "FALSE": False}
NULLS: Final = ("", "~", "null", "Null", "NULL")


class _Loader(yaml.SafeLoader):
    """Reads one text; refuses keys given twice, and more than the bounds above while it still reads."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012 (as the library declares it); filled below
    yaml_constructors: ClassVar[dict[Any, Any]] = {}

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._values = self._level = 0
        self._sizes: dict[yaml.Node, int] = {}  # of what an alias may name

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """The next value; counted with all that is in it."""
        event: yaml.Event = self.peek_event()  # type: ignore[no-untyped-call]
        mark = event.start_mark
        if self._level >= MOST_LEVELS:
            _fail(f"more than {MOST_LEVELS} lists and mappings in each other", mark)
        alias = isinstance(event, yaml.AliasEvent)
        before, self._level = self._values, self._level + 1
        node = super().compose_node(parent, index)
        self._level -= 1
        if alias:
            if node not in self._sizes:
                _fail("this alias is inside of what it names", mark)
            self._values += self._sizes[node]
        elif node is not None:
            self._values += 1 + (len(node.value) // PER_VALUE if isinstance(node, yaml.ScalarNode) else 0)
            self._sizes[node] = self._values - before
        if self._values > MOST_VALUES:
            _fail(f"more than {MOST_VALUES} values, those that aliases stand for included", mark)
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """A mapping whose keys differ."""
        node = super().compose_mapping_node(anchor)
        seen: set[str] = set()
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode) and key.tag != f"{TAG}merge":
                if key.value in seen:
                    _fail(f"the key {brief(key.value)} is given twice", key.start_mark)
                seen.add(key.value)
        return node


def _fail(problem: str, mark: Any) -> NoReturn:
    raise yaml.constructor.ConstructorError(None, None, problem, mark)


def _null(loader: _Loader, node: yaml.ScalarNode) -> None:
    if loader.construct_scalar(node) not in NULLS:
        _fail(f"{brief(node.value)} is not null", node.start_mark)


def _bool(loader: _Loader, node: yaml.ScalarNode) -> bool:
    if (text := loader.construct_scalar(node)) not in BOOLS:
        _fail(f"{brief(text)} is neither true nor false", node.start_mark)
    return BOOLS[text]


def _int(loader: _Loader, node: yaml.ScalarNode) -> int:
    text = loader.construct_scalar(node)
    base = next((base for base, form in INTEGERS.items() if form.fullmatch(text)), None)
    if base is None:
        _fail(f"{brief(text)} is no whole number", node.start_mark)
    if len(text) > LONGEST_INTEGER:
        _fail(f"a whole number of {len(text)} characters", node.start_mark)
    return int(text, base)


def _float(loader: _Loader, node: yaml.ScalarNode) -> float:
    text = loader.construct_scalar(node)
    if NOT_FINITE.fullmatch(text):
        return float(text.replace(".", ""))
    if not FLOAT.fullmatch(text):
        _fail(f"{brief(text)} is no number", node.start_mark)
    return float(text)


def _other(_: _Loader, node: yaml.Node) -> NoReturn:
    _fail(f"the tag {brief(node.tag)} is none of a cell's or a training's", node.start_mark)


RESOLVERS: Final = (  # tag, pattern, first characters; ``<<`` takes in another mapping
    ("bool", "|".join(BOOLS), "tTfF"),
    ("int", "|".join(form.pattern for form in INTEGERS.values()), "-+0123456789"),
    ("float", f"{FLOAT.pattern}|{NOT_FINITE.pattern}", "-+.0123456789"),
    ("merge", "<<", "<"),
    ("null", "~|null|Null|NULL|", ["~", "n", "N", ""]),
)
for _name, _pattern, _first in RESOLVERS:
    _Loader.add_implicit_resolver(TAG + _name, re.compile(rf"^(?:{_pattern})$"), list(_first))
_Loader.yaml_constructors.update(
    {
        f"{TAG}null": _null,
        f"{TAG}bool": _bool,
        f"{TAG}int": _int,
        f"{TAG}float": _float,
        f"{TAG}str": yaml.SafeLoader.construct_yaml_str,
        f"{TAG}seq": yaml.SafeLoader.construct_yaml_seq,
        f"{TAG}map": yaml.SafeLoader.construct_yaml_map,
        None: _other,
    }
)


class _Dumper(yaml.SafeDumper):
    """Writes texts that ``_Loader`` reads back as they were: quoted is what would be a number there."""

    yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers


def parse_yaml(text: str, path: Path) -> object:
    """What a text says, as plain Python values.

    Args:
        text: Of the file.
        path: It came from; messages name it.

    Raises:
        ConfigError: It is not YAML, says a key twice or has a tag of another kind, or stands for too much.
    """
    try:
        loader = _Loader(text)
        return loader.get_single_data()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        what = _complaint(" ".join(filter(None, (error.problem, error.context))))
        remedy = "mend the YAML there; keys of one mapping differ and share one indentation of spaces"
        raise ConfigError(f"{path}: {where}{what}", remedy=remedy, file=path, key="", value=None) from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        what = _complaint(str(error))
        raise ConfigError(f"{path}: not YAML: {what}", remedy="mend the file", file=path, key="", value=None) from error


def dump_yaml(data: object) -> str:
    """Plain values as a text that ``parse_yaml`` reads back as they are."""
    return str(yaml.dump(data, Dumper=_Dumper, sort_keys=False))


def _complaint(words: str) -> str:
    """The YAML library's words, which may quote the file at any length."""
    return printable(" ".join(words[: 10 * LONGEST_COMPLAINT].split()))[:LONGEST_COMPLAINT]


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
        what = "is empty" if data is None else f"is no mapping of keys to values but {brief(data)}"
        remedy = f"start from a bundled {folder.what} such as configs/{folder.name}/lee1991.yaml"
        raise ConfigError(f"{path}: {what}", remedy=remedy, file=path, key="", value=data)
    return data
