"""States and answers: in datagrams, in any order, and how far answers that are under way can carry an arm."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from armtempo.errors import InputError
from armtempo.planners.execution import ArmState, SpeedScaling
from armtempo.planners.execution._link import Link

RAMP = 1e6
numbers = st.floats(-1e9, 1e9)


def state(sequence: int, *, heard: int = -1, time: float = 0.0, factor: float = 0.0) -> ArmState:
    return ArmState(arm=0, sequence=sequence, heard=heard, time=time, lam=0.1, rate=0.2, factor=factor)


@given(arm=st.integers(0, 99), sequence=st.integers(0, 2**62), at=numbers, lam=numbers, factor=st.floats(0.0, 1.0))
def test_datagrams_round_trip(arm: int, sequence: int, at: float, lam: float, factor: float) -> None:
    one = ArmState(arm=arm, sequence=sequence, heard=sequence - 1, time=at, lam=lam, rate=-lam, factor=factor)
    assert ArmState.from_bytes(one.to_bytes()) == one
    answer = SpeedScaling(arm=arm, answers=sequence, factor=factor, ramp=abs(lam))
    assert SpeedScaling.from_bytes(answer.to_bytes()) == answer


@given(data=st.binary(max_size=80))
def test_other_bytes_are_refused(data: bytes) -> None:
    for kind in (ArmState, SpeedScaling):
        with pytest.raises(InputError, match="bytes are no"):
            kind.from_bytes(data)


@pytest.mark.parametrize(
    "wrong",
    [{"lam": math.nan}, {"rate": math.inf}, {"factor": 1.5}, {"heard": 3}, {"sequence": -1}, {"arm": -1}],
)
def test_states_that_are_none_are_refused(wrong: dict[str, Any]) -> None:
    values: dict[str, Any] = {"arm": 0, "sequence": 3, "time": 0.0, "lam": 0.0, "rate": 0.0, "factor": 0.0}
    with pytest.raises(InputError, match="is none"):
        ArmState(**{**values, **wrong})


def test_late_and_doubled_states_are_left_alone_and_counted() -> None:
    link = Link(0.05)
    assert [link.hear(state(k)) for k in (0, 3, 2, 3, 5)] == [True, True, False, False, True]
    report = link.report
    assert (report.received, report.missed, report.outdated) == (3, 3, 2)
    assert report.loss_percent == 50.0
    assert math.isnan(report.round_trip_mean)
    link.answer(0.5, RAMP)
    link.hear(state(6, heard=5, time=0.01))
    assert 0.0 <= link.report.round_trip_mean <= link.report.round_trip_max


def test_answers_under_way_carry_an_arm_until_they_expire() -> None:
    link = Link(0.1)
    link.hear(state(0, time=1.0))
    assert link.carried(0.5, RAMP) == pytest.approx(0.05)
    link.answer(1.0, RAMP)
    link.hear(state(1, time=1.02))
    # The answer of before acts until 1.1, this one until 1.12.
    assert link.carried(0.5, RAMP) == pytest.approx(1.0 * 0.08 + 0.5 * 0.02, abs=1e-6)
    assert link.carried(1.0, RAMP) == pytest.approx(0.1)
    link.answer(0.5, RAMP)
    link.hear(state(2, heard=1, time=1.04, factor=0.5))  # the first answer is out of it
    assert link.carried(0.0, RAMP) == pytest.approx(0.5 * 0.08 + 0.0, abs=1e-6)
    # A factor that comes down slowly goes on for half of the time that it takes.
    assert link.carried(0.0, 5.0) == pytest.approx(0.04 + 0.5 * 0.1 * 0.5, abs=1e-6)
    link.hear(state(9, heard=8, time=3.0))
    assert link.carried(0.0, RAMP) == 0.0
