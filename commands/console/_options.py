"""Flags made from a record of options: one per field, told in the record's words, checked by the record alone."""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field, field, fields, is_dataclass, make_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from armtempo.errors import ArmtempoError, InputError

UNITS = {"_s": "S", "_m": "M"}  # ends of fields that are quantities: flags leave them out, and are followed by the unit
NUMBER = "X"


def flag_of(name: str) -> str:
    """The flag of a field: ``--master-late`` of ``master_late_s``."""
    stem = next((name.removesuffix(unit) for unit in UNITS if name.endswith(unit)), name)
    return f"--{stem.replace('_', '-')}"


def with_flags(line: type[Any], record: type[Any], names: Sequence[str]) -> type[Any]:
    """A dataclass of flags that tyro reads: those of ``line``, and one for each of these fields of a record."""
    hints, told = get_type_hints(record), field_docs(record)
    made = [_flag(one, hints[one.name], told[one.name]) for one in fields(record) if one.name in names]
    return make_dataclass(line.__name__, made, bases=(line,), frozen=True, kw_only=True)


def _flag(option: Field[Any], hint: Any, told: str) -> tuple[str, Any, Any]:
    """Name, type and default of a flag; but for yes and no, the default says that it was not given."""
    members = _members(hint)
    choices = [name for member in members if get_origin(member) is Literal for name in get_args(member)]
    unit = next((metavar for end, metavar in UNITS.items() if option.name.endswith(end)), NUMBER)
    usual = "none" if option.default is None else option.default
    say: dict[str, Any] = {"name": flag_of(option.name)[2:], "help": told}
    annotated: Any = Annotated
    if bool in members:
        return option.name, annotated[bool, tyro.conf.arg(**say)], field(default=bool(option.default))
    say["help_behavior_hint"] = f"(default: {usual})"
    if any(get_origin(member) is tuple for member in members):
        numbers = annotated[tuple[float, ...], tyro.conf.arg(**say, metavar=f"{unit} [{unit}]")]
        return option.name, numbers, field(default=())
    if float in members:
        return option.name, annotated[float | None, tyro.conf.arg(**say, metavar=unit)], field(default=None)
    metavar = f"{{{','.join(choices)}}}" if choices else "NAME"
    return option.name, annotated[str | None, tyro.conf.arg(**say, metavar=metavar)], field(default=None)


def _members(hint: Any) -> tuple[Any, ...]:
    """What a field may hold, of what a command line can say."""
    members = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    return tuple(member for member in members if member is not NoneType and not is_dataclass(member))


def options_from(line: Any, record: type[Any], names: Sequence[str]) -> Any:
    """The record that flags mean; what was not given is as it stands there.

    Raises:
        ArmtempoError: A value that the record refuses, told in the words of the flags.
    """
    given = {name: getattr(line, name) for name in names}
    with _told_as_flags(names):
        return record(**{name: _value(name, value) for name, value in given.items() if value not in (None, ())})


def _value(name: str, value: Any) -> Any:
    """A value of the record: one number of a range stands for both ends."""
    if not isinstance(value, tuple):
        return value
    if len(value) > 2:
        raise InputError(
            f"{name} must be one number or the ends of a range, got {len(value)} numbers",
            remedy=f"try {flag_of(name)} 0 0.3",
        )
    return value[0] if len(value) == 1 else value


@contextmanager
def _told_as_flags(names: Sequence[str]) -> Iterator[None]:
    """Errors inside call options as the command line does."""

    def said(text: str) -> str:
        for name in names:  # a name of one word is a word of the sentence, too
            text = re.sub(rf"\b{name}\b" if "_" in name else rf"\b{name}(?==)", flag_of(name), text)
        return text

    try:
        yield
    except ArmtempoError as error:
        raise ArmtempoError(said(error.message), remedy=said(error.remedy), **error.data) from error


def field_docs(record: type[Any]) -> Mapping[str, str]:
    """The docstrings below the fields of a dataclass, each as one paragraph."""
    body = ast.parse(textwrap.dedent(inspect.getsource(record))).body[0]
    assert isinstance(body, ast.ClassDef)
    docs = {}
    for one, below in zip(body.body, body.body[1:], strict=False):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name) and isinstance(below, ast.Expr):
            docs[one.target.id] = " ".join(str(ast.literal_eval(below.value)).split())
    return docs
