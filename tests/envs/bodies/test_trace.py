"""Traces: shares of limits over arms of any size, what counts as clipped, and rows as they were added."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.envs.bodies import Recorder, Trace
from armtempo.errors import InputError

TIME = np.array([0.0, 0.1, 0.2, 0.3])


def trace_of(demand: tuple[Floats, ...], limits: tuple[Floats, ...]) -> Trace[tuple[Floats, ...]]:
    torque = tuple(np.clip(own, -limit, limit) for own, limit in zip(demand, limits, strict=True))
    q = tuple(np.zeros_like(own) for own in demand)
    return Trace(time=TIME.copy(), q=q, torque=torque, demand=demand, torque_max=limits)


def test_the_worst_joint_of_any_arm_gives_the_ratio() -> None:
    small, large = np.zeros((4, 2)), np.zeros((4, 3))
    small[2, 1], large[1, 0] = -9.0, 30.0
    trace = trace_of((small, large), (np.array([5.0, 6.0]), np.array([40.0, 1.0, 1.0])))
    assert trace.torque_demand_ratio_max == 1.5
    assert trace.torque_ratio_max == 1.0


def test_a_thousandth_over_the_limit_is_not_clipped_and_a_little_more_is() -> None:
    limits = np.array([10.0, 10.0])
    demand = np.array([[0.0, 0.0], [10.009, -10.009], [10.011, 0.0], [-20.0, 0.0]])
    assert trace_of((demand,), (limits,)).torque_clipped_fraction == 2 / 8


def test_what_comes_after_the_arrival_does_not_count() -> None:
    class Arrived(Trace[Floats]):
        @property
        def arrived(self) -> float:
            return 0.1

    demand = np.array([[0.0], [2.0], [2.0], [2.0]])
    trace = Arrived(time=TIME.copy(), q=0.0 * demand, torque=demand.clip(-1, 1), demand=demand, torque_max=np.ones(1))
    assert trace.torque_clipped_fraction == 1 / 2
    assert math.isnan(Trace.arrived.fget(trace))  # type: ignore[attr-defined]


def test_nothing_in_a_trace_can_be_written() -> None:
    trace = trace_of((np.zeros((4, 2)),), (np.ones(2),))
    for array in (trace.time, trace.q[0], trace.demand[0], trace.torque_max[0]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_rows_one_by_one_and_many_at_once_are_the_same_columns() -> None:
    q = np.arange(12.0).reshape(4, 3)
    single, block = Recorder(wanted=True, tick=0.1), Recorder(wanted=True, tick=0.1)
    for row in q:
        single.add(q=row, arrived=row.sum() > 10)
    block.add(q=q[0], arrived=False)
    block.extend(q=q[1:], arrived=q[1:].sum(axis=1) > 10)
    for recorder in (single, block):
        columns = recorder.columns()
        np.testing.assert_array_equal(columns["q"], q)
        np.testing.assert_array_equal(columns["arrived"], [False, True, True, True])
        np.testing.assert_allclose(columns["time"], TIME)


def test_a_recorder_keeps_copies_and_begins_anew() -> None:
    recorder, row, rows = Recorder(wanted=True, tick=0.1), np.zeros(2), np.zeros((1, 2))
    recorder.add(q=row)
    recorder.extend(q=rows)
    row += 1.0
    rows += 1.0
    np.testing.assert_array_equal(recorder.columns()["q"], np.zeros((2, 2)))
    recorder.columns()["q"][:] = 5.0  # new arrays each time
    np.testing.assert_array_equal(recorder.columns()["q"], np.zeros((2, 2)))
    recorder.clear()
    recorder.add(q=row)
    np.testing.assert_array_equal(recorder.columns()["q"], [[1.0, 1.0]])


def test_what_was_not_to_be_kept_is_refused_with_the_remedy() -> None:
    with pytest.raises(InputError, match=r"keeps no trace .*record=True"):
        Recorder(wanted=False, tick=0.1).columns()
