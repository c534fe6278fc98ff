"""State as a value: what changes in an object, copied out and put back, however deep it is nested.

A class names what changes in it; everything else was given when it was made, and is the same in another one made alike.
So a state is small, goes to another process, and going on from it takes microseconds.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from armtempo.errors import InputError

__all__ = ["STATE_FORMAT", "State", "Stateful"]

STATE_FORMAT = "armtempo-state-1"
"""Of what ``get_state`` of environments returns; another one where names or meanings change."""
State = dict[str, Any]
"""Names, those of what is nested behind dots, to arrays and plain values."""


class Stateful:
    """An object of which some attributes change.

    They are arrays, which are written in place, named tuples of arrays, generators of random numbers, other such
    objects or tuples of them, and plain values or ones that never change themselves.
    """

    changing: ClassVar[tuple[str, ...]] = ()
    """Names of these attributes."""

    def get_state(self) -> State:
        """All that changes, copied."""
        return self._own_state()

    def _own_state(self) -> State:
        return {key: value for name in self.changing for key, value in _taken(name.lstrip("_"), getattr(self, name))}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Go on from ``get_state`` of an object made alike.

        Raises:
            InputError: It is of another one; then nothing changes.
        """
        self.check_state(state)
        self._go_on(state)

    def check_state(self, state: Mapping[str, Any]) -> None:
        """Raise InputError unless ``state`` has the names, kinds and shapes of this object's."""
        own = self._own_state()
        for key in sorted(own.keys() ^ state.keys()) or own:
            if key not in own or key not in state or not _alike(own[key], state[key]):
                what = f"the state's {key!r} does not fit this {type(self).__name__}"
                raise InputError(what, remedy="make it with the same arguments")
        for name in self.changing:  # what is nested may know more
            _check_nested(name.lstrip("_"), getattr(self, name), state)

    def _go_on(self, state: Mapping[str, Any]) -> None:
        """From a state that fits."""
        for name in self.changing:
            value = getattr(self, name)
            put = _put(name.lstrip("_"), value, state)
            if put is not value:
                setattr(self, name, put)


def _check_nested(name: str, value: Any, state: Mapping[str, Any]) -> None:
    if isinstance(value, Stateful):
        value.check_state(_below(name, state))
    elif _nested(value):
        for key, part in _fields(value):
            _check_nested(f"{name}.{key}", part, state)


def _taken(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """The parts of an attribute, copied."""
    if isinstance(value, Stateful):
        yield from ((f"{name}.{key}", part) for key, part in value._own_state().items())
    elif _nested(value):
        for key, part in _fields(value):
            yield from _taken(f"{name}.{key}", part)
    elif isinstance(value, np.random.Generator):
        yield name, copy.deepcopy(value.bit_generator.state)
    else:
        yield name, copy.deepcopy(value)


def _put(name: str, value: Any, state: Mapping[str, Any]) -> Any:
    """The attribute as the state has it: the same object where it can be written to."""
    if isinstance(value, Stateful):
        value._go_on(_below(name, state))
    elif _nested(value):
        for key, part in _fields(value):
            _put(f"{name}.{key}", part, state)
    elif isinstance(value, np.random.Generator):
        value.bit_generator.state = copy.deepcopy(state[name])
    elif isinstance(value, np.ndarray):
        value[...] = state[name]
    else:
        return copy.deepcopy(state[name])
    return value


def _below(name: str, state: Mapping[str, Any]) -> State:
    start = f"{name}."
    return {key.removeprefix(start): value for key, value in state.items() if key.startswith(start)}


def _nested(value: Any) -> bool:
    """Whether it is a named tuple, or a tuple of such objects; plain tuples are values."""
    return isinstance(value, tuple) and (hasattr(value, "_fields") or any(isinstance(part, Stateful) for part in value))


def _fields(value: Any) -> Iterator[tuple[str, Any]]:
    yield from zip(getattr(value, "_fields", map(str, range(len(value)))), value, strict=True)


def _alike(own: Any, other: Any) -> bool:
    """Whether one may stand in the other's place; what is sometimes None may be."""
    if isinstance(own, np.ndarray):
        return isinstance(other, np.ndarray) and own.shape == other.shape and own.dtype == other.dtype
    numbers = isinstance(own, int | float | np.number) and isinstance(other, int | float | np.number)
    return own is None or other is None or numbers or type(own) is type(other)
