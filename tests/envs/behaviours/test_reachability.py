"""From every state that any actions lead to, the end can still be met at rest inside the torque limits."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armtempo.envs import MODES, PHYSICS, CoordinationOptions, CoordinationSimulation, Physics
from armtempo.planners import CoordinationCell
from armtempo.planners.topp import Mode

FREE = 10.0  # [s] so late is the master that the slave has the place for itself
EXCESS = 1e-3  # of the limits, allowed to the references between stations


@pytest.mark.parametrize("mode", MODES)
def test_ideal_from_every_reachable_state(lee1991: CoordinationCell, mode: Mode) -> None:
    simulation = CoordinationSimulation(lee1991, CoordinationOptions(physics="ideal", mode=mode), record=True)
    plane, slowest = lee1991.planes[1], 0.0

    @settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
    @given(
        st.lists(st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0.0, 1.0)), max_size=60),
        st.integers(1, 4),
    )
    def any_commands_then_full_speed(commands: list[float], held: int) -> None:
        nonlocal slowest
        simulation.reset([FREE, 0.0])
        for command in itertools.chain.from_iterable(itertools.repeat(c, held) for c in commands):
            simulation.step(np.array([0.0, command]))
            lam, mu = simulation.lam[1], simulation.mu[1]
            assert mu <= plane.upper(lam) * (1.0 + 1e-9) + 1e-12
        began = simulation.time
        while np.isnan(simulation.arrival[1]):
            simulation.step(np.array([0.0, 1.0]))
            assert simulation.time - began < 1.0
        assert (simulation.lam[1], simulation.mu[1]) == (plane.length, 0.0)
        slowest = max(slowest, simulation.time - began)
        assert simulation.trace().torque_ratio_max <= 1.0 + EXCESS

    any_commands_then_full_speed()
    # at any time at most the minimum time from rest is left, and the tick in which it ends
    assert slowest <= lee1991.fastest[1].duration + lee1991.control_period


@pytest.mark.parametrize("mode", MODES)
def test_bullet_never_applies_more_than_the_limits(lee1991: CoordinationCell, mode: Mode) -> None:
    simulation = CoordinationSimulation(lee1991, CoordinationOptions(physics="bullet", mode=mode), record=True)
    random = np.random.default_rng(11)
    for episode in range(6):
        simulation.reset([FREE, 0.0])
        for _ in range(int(random.integers(5, 60))):
            command = random.uniform() if episode % 2 else float(random.integers(0, 2))
            simulation.step(np.array([0.0, command]))
        began = simulation.time
        while np.isnan(simulation.arrival[1]):
            simulation.step(np.array([0.0, 1.0]))
            assert simulation.time - began < 0.5
        trace = simulation.trace()
        assert trace.torque_ratio_max <= 1.0
        assert trace.path_error.max() < 2e-4
    simulation.close()


@pytest.mark.parametrize(("physics", "mode"), list(itertools.product(PHYSICS, MODES)))
def test_stop_and_go(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    """Standing still in the middle of the path, for any time, and on again."""
    simulation = CoordinationSimulation(lee1991, CoordinationOptions(physics=physics, mode=mode), record=True)
    simulation.reset([FREE, 0.0])
    for _ in range(25):
        simulation.step(np.array([0.0, 1.0]))
    for _ in range(100):
        simulation.step(np.array([0.0, 0.0]))
    assert simulation.mu[1] == 0.0
    assert 0.0 < simulation.lam[1] < lee1991.paths[1].length
    standing = simulation.lam[1]
    for _ in range(50):
        simulation.step(np.array([0.0, 0.0]))
    assert simulation.lam[1] == standing
    while np.isnan(simulation.arrival[1]):
        simulation.step(np.array([0.0, 1.0]))
    assert simulation.trace().torque_ratio_max <= 1.0 + (0.0 if physics == "bullet" else EXCESS)
    simulation.close()
