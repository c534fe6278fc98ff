"""A clearance or an error that is no number is a violation, never "too far apart"."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo import load_cell
from armtempo.envs import BlendTrackingEnv, CoordinationEnv
from armtempo.envs.coordination.world import CoordinationSimulation
from armtempo.envs.coordination.world._kernels import moved_closer
from armtempo.errors import RobotError
from armtempo.planners import BlendCell, CoordinationCell


@pytest.fixture(scope="module")
def lee1991() -> CoordinationCell:
    return load_cell("lee1991")


def test_a_clearance_table_with_nan_ends_the_episode(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset(seed=0)
    world = env.simulation.world
    begin = int(world.clearance[0, 2])
    kept = world.buffer[begin : begin + world.nodes**2].copy()
    try:
        world.buffer[begin : begin + world.nodes**2] = np.nan
        _, _, terminated, _, _ = env.step({agent: np.ones(1, np.float32) for agent in env.agents})
    finally:
        world.buffer[begin : begin + world.nodes**2] = kept
    assert all(terminated.values())
    assert env.simulation.violated
    env.close()


def test_a_clearance_that_is_nan_in_physics_is_a_violation(
    lee1991: CoordinationCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = CoordinationEnv(lee1991, physics="bullet")
    env.reset(seed=0)
    monkeypatch.setattr(CoordinationSimulation, "_nearest", lambda _self, _cutoff: np.nan)
    _, _, terminated, _, infos = env.step({agent: np.ones(1, np.float32) for agent in env.agents})
    assert all(terminated.values())
    assert all(info["violation"] for info in infos.values())
    env.close()


def test_joints_that_are_nan_in_physics_are_an_error(
    lee1991: CoordinationCell, monkeypatch: pytest.MonkeyPatch
) -> None:
    env = CoordinationEnv(lee1991, physics="bullet")
    env.reset(seed=0)
    simulation: Any = env.simulation
    act = simulation._controller.act

    def lost() -> None:
        act()
        simulation._q[:] = np.nan

    monkeypatch.setattr(simulation._controller, "act", lost)
    with pytest.raises(RobotError, match="joint positions are not finite"):
        env.step({agent: np.ones(1, np.float32) for agent in env.agents})
    env.close()


@pytest.mark.parametrize("physics", ["ideal", "bullet"])
def test_joints_that_are_nan_leave_the_tube_of_a_blend(physics: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    env = BlendTrackingEnv(load_cell("lee2006", BlendCell), physics=physics)
    env.reset(seed=0)
    simulation: Any = env.simulation
    track, joints = simulation._controller.track, simulation._joints

    def lost(wanted: Any) -> None:
        track(wanted)
        simulation._q[:] = np.nan

    monkeypatch.setattr(simulation._controller, "track", lost)
    if physics == "ideal":
        monkeypatch.setattr(simulation, "_joints", lambda lengths: np.nan * joints(lengths))
    _, _, terminated, _, info = env.step(np.ones(1, np.float32))
    assert terminated
    assert not info["is_success"]
    env.close()


def test_arms_that_are_nowhere_have_not_stayed_apart() -> None:
    before, lever = np.zeros((4, 2)), np.ones((4, 2))
    assert moved_closer(before, np.array([[0.1, 0.0], [0.3, 0.0], [0.0, 0.2], [0.0, 0.0]]), lever) == 0.3 + 0.2
    for i in range(4):
        now = np.full((4, 2), 0.1)
        now[i, 1] = np.nan
        assert np.isnan(moved_closer(before, now, lever))
