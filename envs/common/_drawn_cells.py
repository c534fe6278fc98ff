"""The cells that episodes of a vector take: drawn beforehand, or one for every episode; and room for their arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from armtempo.envs.common._options import read_seed
from armtempo.envs.common._vector_parts import count_of
from armtempo.errors import InputError, brief
from armtempo.state import State, Stateful

CellT = TypeVar("CellT")


@final
class Slots:
    """Arrays of different lengths, those of a name in one array (S, R, ...) that grows as the longest needs it."""

    def __init__(self, slots: int) -> None:
        self.count = slots
        self._arrays: dict[str, NDArray[Any]] = {}

    def put(self, slot: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Instead of what is there."""
        for name, values in arrays.items():
            array = self._arrays.get(name)
            if array is None:
                array = np.zeros((self.count, *values.shape), dtype=values.dtype)
            missing = len(values) - array.shape[1]
            if missing > 0:
                array = np.pad(array, [(0, 0), (0, missing), *[(0, 0)] * (array.ndim - 2)])
            array[slot, : len(values)] = values
            self._arrays[name] = array

    def __getitem__(self, name: str) -> NDArray[Any]:
        """The array of a name; what is behind the end of shorter ones means nothing."""
        return self._arrays[name]


def families_of(family: str | Sequence[str]) -> tuple[str, ...]:
    """One family of tasks, or several.

    Raises:
        InputError: There is none.
    """
    if isinstance(family, str):
        return (family,)
    families = tuple(family) if isinstance(family, Sequence) else ()
    if not families:
        raise InputError(f"there is no family in {brief(family)}", remedy="give one name at least")
    return families


@final
class DrawnCells(Stateful, Generic[CellT]):
    """Cells of the same arm with tasks that are drawn: one for every episode, or so many beforehand.

    Args:
        cell: What is drawn from.
        families: Of the tasks; environments, or what is drawn beforehand, take them in turn.
        draw: Draws the cell with a task of a family.
        put: Keeps a cell in a slot.
        episodes: E.
        number: How many are drawn beforehand; None: one for every episode. All are the same if they are ``given``.
        seed: Of these.
        what: What they are called: ``targets``.

    Attributes:
        slots: How many are kept.
        cells: What is in them.
        made_of: What tells them apart from others.
        beforehand: Whether nothing is drawn for an episode.

    Raises:
        InputError: A number that cannot be used.
    """

    changing = ("cells",)

    def __init__(
        self,
        cell: CellT,
        families: Sequence[str],
        draw: Callable[[CellT, str, np.random.Generator], CellT],
        put: Callable[[int, CellT], None],
        episodes: int,
        number: int | None,
        seed: int,
        what: str,
    ) -> None:
        count = episodes if number is None else count_of(number, what)
        first = read_seed(seed, f"{what[:-1]}_seed")
        if first is None:
            raise InputError(f"{what[:-1]}_seed must be a whole number, 0 or more, got None")
        if number is not None and count < len(families):
            raise InputError(f"{count} {what} for {len(families)} families", remedy="draw one of each at least")
        given = set(families) == {"given"}
        self._cell, self._families, self._draw, self._put, self._seed = cell, families, draw, put, first
        self.slots, self.beforehand = 1 if given else count, given or number is not None
        self.cells: list[CellT] = [cell] * self.slots
        self.made_of = {"families": tuple(families), what: number, f"{what[:-1]}_seed": int(seed)}

    def draw_beforehand(self) -> None:
        """Fill the slots, if nothing is drawn for an episode."""
        random = np.random.default_rng(self._seed)
        for slot in range(self.slots) if self.beforehand else ():
            self._fill(slot, slot, random)

    def _fill(self, slot: int, turn: int, random: np.random.Generator) -> None:
        self._keep(slot, self._draw(self._cell, self._families[turn % len(self._families)], random))

    def _keep(self, slot: int, cell: CellT) -> None:
        self.cells[slot] = cell
        self._put(slot, cell)

    def _own_state(self) -> State:
        return {} if self.beforehand else super()._own_state()

    def _go_on(self, state: Mapping[str, Any]) -> None:
        for slot, cell in enumerate(state.get("cells", ())):
            if cell is not self.cells[slot]:
                self._keep(slot, cell)

    def slot_for(self, e: int, random: np.random.Generator) -> int:
        """The slot that a new episode of environment e takes its task from."""
        if self.beforehand:
            return int(random.integers(self.slots))
        self._fill(e, e, random)
        return e
