"""What simulations of every kind of cell have in common: traces from row 0 on that nobody can change, ends, figures."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.envs import (
    PHYSICS,
    BlendOptions,
    BlendSimulation,
    CoordinationOptions,
    CoordinationSimulation,
    IKOptions,
    IKSimulation,
    Physics,
)
from armtempo.envs.bodies import Simulation, Trace
from armtempo.errors import InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell, load_cell

AnySimulation = Simulation[Any, Trace[Any]]
Make = Callable[..., AnySimulation]
COMMANDS: dict[str, Floats] = {"coordination": np.ones(2), "blend": np.ones(1), "ik": np.full(6, 0.1)}
ROWS = {"time", "lam", "mu", "clearance", "path_error", "s", "v", "a", "j", "override", "tip", "station"}
ROWS |= {"contour_error", "line_speed", "arc_speed", "reference", "target", "error", "capped", "singular_value"}
"""Fields that have a row per tick, besides those per arm."""
PER_ARM = ("q", "torque", "demand")


def _make(kind: str, physics: Physics, record: bool) -> AnySimulation:
    if kind == "coordination":
        cell = load_cell("lee1991", CoordinationCell)
        return CoordinationSimulation(cell, CoordinationOptions(physics=physics), record=record)
    if kind == "blend":
        return BlendSimulation(load_cell("lee2006", BlendCell), BlendOptions(physics=physics), record=record)
    return IKSimulation(load_cell("chung", IKCell), IKOptions(physics=physics), record=record)


@pytest.fixture
def make() -> Iterator[Make]:
    """Makes a simulation of a kind, and closes it afterwards."""
    made = []

    def of(kind: str, physics: Physics = "ideal", record: bool = True) -> AnySimulation:
        made.append(_make(kind, physics, record))
        return made[-1]

    yield of
    for simulation in made:
        simulation.close()


def _per_arm(values: Floats | tuple[Floats, ...]) -> tuple[Floats, ...]:
    return values if isinstance(values, tuple) else (values,)


def _arrays(trace: Trace[Any]) -> dict[str, list[np.ndarray[Any, Any]]]:
    fields = {field.name: getattr(trace, field.name) for field in dataclasses.fields(trace)}
    return {name: list(_per_arm(value)) for name, value in fields.items() if isinstance(_per_arm(value)[0], np.ndarray)}


EVERY = pytest.mark.parametrize(("kind", "physics"), list(itertools.product(COMMANDS, PHYSICS)))


@EVERY
def test_a_trace_has_one_row_right_after_a_reset(make: Make, kind: str, physics: Physics) -> None:
    simulation = make(kind, physics)
    trace = simulation.trace()
    np.testing.assert_array_equal(trace.time, [0.0])
    for name, arrays in _arrays(trace).items():
        if name in ROWS or name in PER_ARM:
            assert {len(array) for array in arrays} == {1}, name
    for row, q, torque, demand in zip(
        simulation.joint_positions(), *(_per_arm(getattr(trace, name)) for name in PER_ARM), strict=True
    ):
        np.testing.assert_array_equal(q, row[None, : q.shape[1]])
        assert torque.shape == demand.shape == q.shape
        assert not torque.any()
        assert not demand.any()
    assert trace.torque_ratio_max == trace.torque_demand_ratio_max == trace.torque_clipped_fraction == 0.0
    assert math.isnan(trace.arrived)
    assert math.isnan(simulation.end.arrived)
    assert not simulation.end.violated


@EVERY
def test_a_trace_has_a_row_per_tick_and_ends_where_the_arms_are(make: Make, kind: str, physics: Physics) -> None:
    simulation = make(kind, physics)
    for _ in range(3):
        simulation.step(COMMANDS[kind])
    trace, ticks = simulation.trace(), 3 * simulation.cell.ticks_per_period
    np.testing.assert_array_equal(trace.time, simulation.cell.physics_tick * np.arange(ticks + 1))
    assert trace.time[-1] == simulation.time
    for name, arrays in _arrays(trace).items():
        if name in ROWS or name in PER_ARM:
            assert {len(array) for array in arrays} == {ticks + 1}, name
            assert all(np.isfinite(array).all() for array in arrays), name
    for arm, row, *arrays in zip(
        simulation.cell.arms,
        simulation.joint_positions(),
        *(_per_arm(getattr(trace, name)) for name in (*PER_ARM, "torque_max")),
        strict=True,
    ):
        assert [array.shape[-1] for array in arrays] == [arm.dof] * 4
        np.testing.assert_array_equal(arrays[0][-1], row[: arm.dof])
        assert arrays[1].any()


@EVERY
def test_nobody_can_change_a_trace(make: Make, kind: str, physics: Physics) -> None:
    simulation = make(kind, physics)
    simulation.step(COMMANDS[kind])
    trace = simulation.trace()
    before = {name: [array.copy() for array in arrays] for name, arrays in _arrays(trace).items()}
    for name, arrays in _arrays(trace).items():
        for array in arrays:
            assert not array.flags.writeable, name
            with pytest.raises(ValueError, match="read-only"):
                array[...] = 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        trace.time = np.zeros(1)  # type: ignore[misc]
    simulation.step(COMMANDS[kind])
    for name, arrays in _arrays(trace).items():
        for array, kept in zip(arrays, before[name], strict=True):
            np.testing.assert_array_equal(array, kept, err_msg=name)


@pytest.mark.parametrize("kind", COMMANDS)
def test_what_is_not_recorded_is_refused_with_the_remedy(make: Make, kind: str) -> None:
    simulation = make(kind, record=False)
    simulation.step(COMMANDS[kind])
    with pytest.raises(InputError, match=r"keeps no trace \(make it with record=True\)"):
        simulation.trace()


@pytest.mark.parametrize("kind", COMMANDS)
def test_an_episode_ends_when_its_trace_says(make: Make, kind: str) -> None:
    simulation = make(kind)
    for _ in range(4000):
        simulation.step(COMMANDS[kind])
        if math.isfinite(simulation.end.arrived) or simulation.end.violated:
            break
    end, trace = simulation.end, simulation.trace()
    if kind == "coordination":  # at full speed the two of the paper meet
        assert end.violated
        assert isinstance(trace.q, tuple)
    elif kind == "blend":
        assert not end.violated
        assert simulation.time - simulation.cell.control_period < end.arrived == trace.arrived <= simulation.time
    else:
        assert not end.violated
        assert end.arrived == trace.time[-1] == simulation.time


@EVERY
def test_torques_as_shares_of_their_limits(make: Make, kind: str, physics: Physics) -> None:
    simulation = make(kind, physics)
    for _ in range(20):
        simulation.step(COMMANDS[kind])
    trace = simulation.trace()
    limits = _per_arm(trace.torque_max)
    applied, asked = (
        [np.abs(torque) / limit for torque, limit in zip(_per_arm(torques), limits, strict=True)]
        for torques in (trace.torque, trace.demand)
    )
    assert trace.torque_ratio_max == max(share.max() for share in applied) > 0.0
    assert trace.torque_demand_ratio_max == max(share.max() for share in asked)
    clipped = np.concatenate([(share > 1.001).ravel() for share in asked])
    assert trace.torque_clipped_fraction == pytest.approx(clipped.mean(), abs=1e-3)
