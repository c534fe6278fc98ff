"""What episodes of a vector take their tasks from."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.envs.common import DrawnCells, Slots, families_of
from armtempo.errors import InputError


def make(families: tuple[str, ...], number: int | None, seed: int = 0) -> tuple[DrawnCells[str], dict[int, str]]:
    """Cells are texts: what was drawn, and by which number."""
    kept: dict[int, str] = {}

    def draw(cell: str, family: str, random: np.random.Generator) -> str:
        return f"{cell} {family} {random.integers(1000)}"

    return DrawnCells("cell", families, draw, kept.__setitem__, 4, number, seed, "targets"), kept


def test_beforehand_families_take_turns_and_episodes_take_any() -> None:
    cells, kept = make(("smooth", "hard"), 5)
    cells.draw_beforehand()
    assert [kept[slot].split()[1] for slot in range(5)] == ["smooth", "hard", "smooth", "hard", "smooth"]
    before, random = dict(kept), np.random.default_rng(1)
    assert {cells.slot_for(0, random) for _ in range(100)} == set(range(5))
    assert kept == before
    other, same = make(("smooth", "hard"), 5)
    other.draw_beforehand()
    assert same == kept


def test_one_for_every_episode_is_drawn_by_its_own_generator() -> None:
    cells, kept = make(("smooth", "hard"), None)
    cells.draw_beforehand()
    assert not kept
    assert not cells.beforehand
    assert cells.slot_for(3, np.random.default_rng(7)) == 3
    assert kept == {3: f"cell hard {np.random.default_rng(7).integers(1000)}"}


def test_a_given_task_has_one_slot() -> None:
    cells, kept = make(("given",), None)
    cells.draw_beforehand()
    assert cells.beforehand
    assert (cells.slots, list(kept), cells.slot_for(3, np.random.default_rng(0))) == (1, [0], 0)


def test_numbers_and_families_are_checked() -> None:
    with pytest.raises(InputError, match="no family"):
        families_of(())
    assert families_of("smooth") == ("smooth",)
    for number, seed, text in ((0, 0, "targets"), (1, 0, "1 targets for 2 families"), (2, -1, "target_seed")):
        with pytest.raises(InputError, match=text):
            make(("smooth", "hard"), number, seed)


def test_slots_grow_as_the_longest_needs_it() -> None:
    slots = Slots(2)
    slots.put(0, {"x": np.array([1.0, 2.0])})
    slots.put(1, {"x": np.array([3.0, 4.0, 5.0])})
    slots.put(0, {"x": np.array([6.0])})
    np.testing.assert_array_equal(slots["x"], [[6.0, 2.0, 0.0], [3.0, 4.0, 5.0]])
