"""One table of entries: the space has its ends, and the docstring's table its words, within its columns."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armtempo.envs.common._entries import (
    MEANING_COLUMN,
    Entry,
    action_space,
    observation_space,
    observation_table,
    share,
)

words = st.text("abcdefghij ,", min_size=1, max_size=300).map(lambda text: " ".join(text.split())).filter(bool)
entries = st.lists(
    st.builds(Entry, st.text("abcdef_", min_size=1, max_size=30), st.just(-1.0), st.sampled_from([0.0, 1.0]), words),
    min_size=1,
    max_size=12,
)


def test_the_space_has_the_ends_of_its_entries() -> None:
    space = observation_space([Entry("a", -1.0, 1.0, ""), Entry("b", 0.0, 2.0, "")])
    assert space.dtype == np.float32
    np.testing.assert_array_equal(space.low, [-1.0, 0.0])
    np.testing.assert_array_equal(space.high, [1.0, 2.0])


def test_actions_are_between_minus_one_and_one() -> None:
    space = action_space(3)
    assert space.shape == (3,)
    assert space.dtype == np.float32
    np.testing.assert_array_equal([space.low, space.high], [[-1.0] * 3, [1.0] * 3])


@given(st.floats(0.0, 1.0))
def test_an_entry_of_a_share_is_that_share_again(value: float) -> None:
    assert abs(share(2.0 * value - 1.0) - value) < 1e-15


@given(entries)
def test_the_table_says_everything_within_its_width(own: list[Entry]) -> None:
    lines = observation_table(own).splitlines()
    assert lines[0] == lines[2] == lines[-1]
    assert all(len(line) <= len(lines[0]) == 116 for line in lines)
    starts = [k for k, line in enumerate(lines[3:-1]) if not line.startswith(" ")]
    assert len(starts) == len(own)
    for entry, first, after in zip(own, starts, [*starts[1:], len(lines) - 4], strict=True):
        block = lines[3:-1][first:after]
        assert block[0].split()[1] == entry.name
        assert " ".join(" ".join(line[MEANING_COLUMN:] for line in block).split()) == entry.meaning
