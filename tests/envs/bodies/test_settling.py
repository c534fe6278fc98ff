"""When an arm has arrived."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.envs.bodies import Settling

TICK = 1e-3


def _watch(settling: Settling, ticks: range, ended: float, distance: float, speed: float = 0.0) -> float:
    for k in ticks:
        settling.watch(k * TICK, np.array([ended]), np.array([distance]), np.array([speed]))
    return float(settling.arrival[0])


def test_an_arm_that_is_there_when_its_reference_ends_arrived_then() -> None:
    settling = Settling(1, time=0.020)
    assert np.isnan(_watch(settling, range(100, 120), 0.0995, 0.0))  # 19 ms after the first tick
    assert _watch(settling, range(120, 121), 0.0995, 0.0) == pytest.approx(0.1)
    assert _watch(settling, range(121, 150), 0.0995, 1.0) == pytest.approx(0.1)  # where it goes later does not matter


def test_an_arm_does_not_arrive_before_its_reference() -> None:
    settling = Settling(1)
    assert np.isnan(_watch(settling, range(100), 0.2, 0.0))
    assert np.isnan(_watch(settling, range(100), np.nan, 0.0))
    assert _watch(settling, range(200, 221), 0.2, 0.0) == 0.2


@pytest.mark.parametrize(("distance", "speed"), [(2e-3, 0.0), (0.0, 2e-2)])
def test_an_arm_that_leaves_or_swings_begins_anew(distance: float, speed: float) -> None:
    settling = Settling(1, distance=1e-3, speed=1e-2, time=0.020)
    _watch(settling, range(100, 115), 0.1, 0.0)
    _watch(settling, range(115, 116), 0.1, distance, speed)
    assert np.isnan(_watch(settling, range(116, 136), 0.1, 0.0))
    assert _watch(settling, range(136, 137), 0.1, 0.0) == pytest.approx(0.116)


def test_arms_arrive_one_by_one_and_a_reset_forgets_it() -> None:
    settling = Settling(2)
    for k in range(100, 121):
        settling.watch(k * TICK, np.array([0.1, np.nan]), np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(settling.arrival, [0.1, np.nan])
    kept = settling.arrival
    settling.reset()
    assert np.isnan(settling.arrival).all()
    assert kept[0] == pytest.approx(0.1)  # whoever has asked keeps what it got
