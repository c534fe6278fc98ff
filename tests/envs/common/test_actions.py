"""Actions as commands: clipped, read in any array form, refused with who sent them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.envs.common._actions import check_late, read_action, read_actions, read_command
from armtempo.errors import ActionError, InputError


@given(st.floats(-3.0, 3.0), st.sampled_from([np.float32, np.float64]))
def test_minus_one_to_one_is_zero_to_one_and_what_is_beyond_is_clipped(value: float, kind: type) -> None:
    given_value = float(kind(value))
    expected = min(max(0.5 * (given_value + 1.0), 0.0), 1.0)
    actions: list[Any] = [np.array([value], dtype=kind), kind(value), [given_value]]
    for action in actions:
        assert read_action(action, "arm") == pytest.approx(expected, abs=1e-15)


def test_so_many_numbers_are_clipped_one_by_one_and_the_action_is_not_touched() -> None:
    action = np.array([-2.0, 0.5, 7.0])
    np.testing.assert_array_equal(read_actions(action, 3, "arm"), [-1.0, 0.5, 1.0])
    np.testing.assert_array_equal(action, [-2.0, 0.5, 7.0])


@pytest.mark.parametrize(
    "bad",
    [[0.1, 0.2], [[0.1]], [], np.nan, [np.inf], "fast", None, {"arm": 0.1}, ["a"], [[0.1], [0.2, 0.3]]],
    ids=repr,
)
def test_what_is_not_one_finite_number_is_refused_with_its_sender(bad: Any) -> None:
    with pytest.raises(
        ActionError, match=r"action of arm7 must be one finite number in an array of shape \(1,\)"
    ) as error:
        read_action(bad, "arm7")
    assert error.value.data["agent"] == "arm7"
    assert error.value.data["action"] is bad


def test_a_single_number_is_no_action_of_three() -> None:
    with pytest.raises(ActionError, match="must be 3 finite numbers"):
        read_actions(0.5, 3, "arm")


@pytest.mark.parametrize("bad", [-0.1, math.nan, math.inf, True, "1", None])
def test_lateness_is_a_time(bad: object) -> None:
    check_late(0)
    check_late(np.float32(0.5))
    with pytest.raises(InputError, match="master_late_s must be a time in seconds"):
        check_late(bad)


def test_a_second_number_is_a_priority() -> None:
    command, priority = read_command(np.array([0.0, -2.0]), 2, "arm")
    assert (command, priority) == (0.5, -1.0)
    assert np.isnan(read_command(0.0, 1, "arm")[1])
    for bad in (np.zeros(1), np.zeros(3), np.array([0.0, np.nan]), 0.0):
        with pytest.raises(ActionError, match="2 finite numbers"):
            read_command(bad, 2, "arm7")
