"""One tick of references whose time goes as fast as torques allow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.envs import CoordinationOptions, CoordinationSimulation
from armtempo.envs.coordination.world._pace import hardest_tick, pace
from armtempo.planners import CoordinationCell


@pytest.fixture
def running(lee1991: CoordinationCell) -> Iterator[CoordinationSimulation]:
    """In mid acceleration, both arms; on their references."""
    simulation = CoordinationSimulation(lee1991, CoordinationOptions(physics="bullet"))
    for _ in range(5):
        simulation.step(np.ones(2))
    yield simulation
    simulation.close()


def paced(simulation: CoordinationSimulation, limit: float, commands: Floats) -> tuple[float, Floats, Floats]:
    """Rate, demand and motion of the next tick with so much of the torque limits; nothing is simulated."""
    controller, world = simulation._controller, simulation.world
    episodes = simulation._episodes._replace(clock=np.array([simulation.clock]), ticks=np.array([simulation._ticks]))
    reference, motion = controller.reference.copy(), np.zeros((3, 2))
    reference[:2] = reference[1:]
    demand, torque = np.zeros_like(simulation._q), np.zeros_like(simulation._q)
    weaker = world._replace(torque_max=limit * world.torque_max)
    rate = pace(weaker, episodes, commands, controller.gain, controller.measured, reference, demand, torque, motion)
    assert (np.abs(torque) <= weaker.torque_max).all()
    assert episodes.clock[0] == min(simulation.clock, rate)
    return rate, demand / weaker.torque_max, motion


def test_torques_that_suffice_change_nothing(running: CoordinationSimulation) -> None:
    rate, share, motion = paced(running, 1.01, np.ones(2))
    assert rate == running.clock
    assert np.abs(share).max() <= 1.0
    assert (motion[0] > running.lam).all()


def test_what_is_too_heavy_to_speed_up_is_slowed_for_all_with_a_share_to_spare(
    running: CoordinationSimulation,
) -> None:
    one, _, planned = paced(running, 1.01, np.ones(2))
    rate, share, motion = paced(running, 0.95, np.ones(2))
    assert 0.98 < rate < one
    assert np.abs(share).max() == pytest.approx(0.99, abs=1e-4)
    # both arms by the same share of the tick
    gone, wanted = motion[0] - running.lam, planned[0] - running.lam
    np.testing.assert_allclose(gone / wanted, rate / one, rtol=1e-3)


def test_what_is_too_heavy_to_brake_does_not_run_away(running: CoordinationSimulation) -> None:
    """Time goes faster again, but never faster than planned: torques are clipped then, and the clock stays."""
    running.step(np.zeros(2))
    _, share, _ = paced(running, 1.01, np.zeros(2))
    less, share, _ = paced(running, 1.01 * 0.995 * float(np.abs(share).max()), np.zeros(2))
    assert running.clock < less < 1.0
    assert np.abs(share).max() <= 1.0
    rate, share, _ = paced(running, 0.5, np.zeros(2))
    assert rate == 1.0
    assert np.abs(share).max() > 1.5


def test_the_hardest_tick_grows_with_the_rate(lee1991: CoordinationCell) -> None:
    simulation = CoordinationSimulation(lee1991, CoordinationOptions(physics="bullet"))
    shares = [hardest_tick(simulation.world, 0, rate) for rate in (0.5, 0.9, 1.0)]
    simulation.close()
    assert shares[0] == pytest.approx(0.25 * shares[2], rel=0.05)  # torques without gravity go with its square
    assert shares[1] == pytest.approx(0.81 * shares[2], rel=0.02)
    assert 1.0 < shares[2] < 1.02
