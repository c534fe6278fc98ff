"""What changes in an object is copied out and put back, whole or not at all."""

from __future__ import annotations

import copy
import pickle
from typing import Any, NamedTuple

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InputError
from armtempo.state import Stateful


class Pair(NamedTuple):
    a: Floats
    b: Floats


class Part(Stateful):
    changing = ("clock",)

    def __init__(self) -> None:
        self.clock: list[float] | None = None


class Whole(Stateful):
    """One of each."""

    changing = ("array", "pair", "part", "parts", "random", "_count", "name", "nothing", "row")

    def __init__(self) -> None:
        self.array, self.pair = np.zeros(3), Pair(np.zeros(2), np.ones(1))
        self.part, self.parts = Part(), (Part(), Part())
        self.random = np.random.default_rng(0)
        self._count, self.name, self.nothing, self.row = 0, "x", None, (1, 2)
        self.constant = np.zeros(4)

    def change(self) -> Any:
        self.array += self.random.random(3)
        self.pair.a[0] += 1.0
        self.part.clock = [*(self.part.clock or []), 1.0]
        self.parts[1].clock = [2.0]
        self._count += 1
        return self.array.tolist(), self.pair.a.tolist(), list(self.part.clock), self._count


def test_it_goes_on_from_its_state_again_and_again() -> None:
    one, other = Whole(), Whole()
    one.change()
    arrays = one.array, one.pair.a
    state = one.get_state()
    assert set(state) == {
        "array", "pair.a", "pair.b", "part.clock", "parts.0.clock", "parts.1.clock", "random", "count", "name",
        "nothing", "row",
    }  # fmt: skip
    kept = copy.deepcopy(state)
    wanted = [one.change() for _ in range(3)]
    for again in (one, other):
        for _ in range(2):
            again.set_state(pickle.loads(pickle.dumps(state)))
            assert [again.change() for _ in range(3)] == wanted
    assert one.array is arrays[0], "arrays are written in place: others may hold them"
    assert one.pair.a is arrays[1]
    assert pickle.dumps(state) == pickle.dumps(kept), "a state is not written to"


@pytest.mark.parametrize(
    "wrong",
    [
        {"array": np.zeros(4)},
        {"array": np.zeros(3, dtype=np.float32)},
        {"array": [0.0, 0.0, 0.0]},
        {"pair.a": np.zeros(3)},
        {"count": "1"},
        {"name": 1},
        {"more": 1},
    ],
)
def test_a_state_that_does_not_fit_changes_nothing(wrong: dict[str, Any]) -> None:
    one = Whole()
    state = {**one.get_state(), "count": 7, **wrong}
    before = pickle.dumps(one.get_state())
    with pytest.raises(InputError, match=f"the state's '{next(iter(wrong))}' does not fit this Whole"):
        one.set_state(state)
    assert pickle.dumps(one.get_state()) == before


def test_a_state_that_lacks_something_changes_nothing() -> None:
    one = Whole()
    for name in one.get_state():
        state = one.get_state()
        del state[name]
        with pytest.raises(InputError, match=f"the state's '{name}'"):
            one.set_state(state)
