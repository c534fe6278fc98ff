"""pydantic's complaints in our words: file, key, value and remedy, the most telling one first."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from armtempo.configs.schema import CHOICE
from armtempo.errors import ConfigError, brief, closest, printable

# pydantic's words and ours, which are those of YAML
WORDING = (
    (r"Input should be a valid dictionary or instance of \w+", "must be a mapping of keys to values"),
    (r"Input should be a valid (tuple|list)", "must be a list"),
    (r"Input should be", "must be"),
    (r"String should match pattern", "must match"),
    (r"Tuple should have (at \w+ \d+ items?) .*", r"must have \1"),
)
Key = tuple[int | str, ...]
LONGEST_KEY, LONGEST_COMPLAINT = 60, 300  # characters


def config_error(source: Path, error: ValidationError, model: type[BaseModel]) -> ConfigError:
    """The complaint that explains most: a misspelt key comes before the key that it leaves missing."""
    complaints = error.errors(include_url=False)
    first = min(complaints, key=lambda complaint: complaint["type"] != "extra_forbidden")
    key, value, what, remedy = _explain(first, model)
    return ConfigError(f"{source}: {key}: {what}", remedy=remedy, file=source, key=key, value=value)


def _explain(complaint: ErrorDetails, model: type[BaseModel]) -> tuple[str, Any, str, str]:
    """Dotted key, value, what is wrong, what to do."""
    kind, loc, value = complaint["type"], complaint["loc"], complaint["input"]
    loc = tuple(step for step in loc if not (isinstance(step, str) and step.startswith(CHOICE)))
    what = complaint["msg"].removeprefix("Value error, ")[:LONGEST_COMPLAINT]
    for theirs, ours in WORDING:
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
            return dotted(loc), value, "unknown key", f"{closest(loc[-1], known)}known: {', '.join(known)}"
        case "missing":
            return dotted(loc), None, "missing", f"add it: {meaning}" if meaning else "add it"
        case "value_error":
            return dotted(loc), value, what, meaning or "change it"
        case _:
            return dotted(loc), value, f"{what}, got {shown(value)}", meaning or "change it"


def _inside(value: Any, key: int | str) -> Any:
    """What ``value`` has at ``key``, None if nothing: it is the user's."""
    try:
        return value[key]
    except (LookupError, TypeError):
        return None


def either(names: Iterable[str]) -> str:
    *most, last = names
    return f"{', '.join(most)} or {last}"


def with_article(kind: object) -> str:
    return f"an {kind}" if kind == "ik" else f"a {kind}"


def dotted(loc: Key) -> str:
    parts = (f"[{part}]" if isinstance(part, int) else f".{part[:LONGEST_KEY]}" for part in loc)
    return printable("".join(parts).removeprefix("."))


def shown(value: object) -> str:
    """A value as YAML calls it."""
    return "null" if value is None else brief(value)


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
