"""The certificate of a schedule: right about one that is good, and it can fail in each of its parts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from armtempo.planners import CoordinationCell, CoordinationChart, PhaseTrajectory, schedule
from armtempo.planners.schedules._certificate import _is_covered, certify

Motions = tuple[PhaseTrajectory, ...]


@pytest.fixture(scope="module")
def good(lee1991: CoordinationCell) -> Motions:
    return schedule(lee1991, "delay").trajectories


def squeezed(motion: PhaseTrajectory, factor: float) -> PhaseTrajectory:
    """The same way in less time."""
    return PhaseTrajectory(lam=motion.lam, mu=motion.mu * factor, time=motion.time / factor, dynamics=motion.dynamics)


def test_a_good_schedule_is_within_every_limit(lee1991: CoordinationCell, good: Motions) -> None:
    told = certify(lee1991, good)
    assert told.torque_ratio_max <= 1.0 + 1e-3
    assert told.min_clearance >= lee1991.planned_clearance - 1e-9
    assert told.certified_free
    assert told.end_error == 0.0


def test_too_fast_by_a_tenth_asks_for_a_fifth_more_torque(lee1991: CoordinationCell, good: Motions) -> None:
    """Without gravity in its plane, torques go with the square of the speed."""
    told, before = certify(lee1991, (squeezed(good[0], 1.1), good[1])), certify(lee1991, good)
    assert told.torque_ratio_max == pytest.approx(1.1**2 * before.torque_ratio_max, rel=5e-3)
    assert told.speed_ratio_max >= before.speed_ratio_max


def test_the_worst_arm_gives_its_ratio(lee1991: CoordinationCell, good: Motions) -> None:
    slow = tuple(squeezed(motion, 0.5) for motion in good)
    for arms in ((slow[0], good[1]), (good[0], slow[1])):
        assert certify(lee1991, arms).torque_ratio_max == pytest.approx(1.0, abs=5e-3)
    assert certify(lee1991, slow).torque_ratio_max == pytest.approx(0.25, abs=5e-3)


def test_a_motion_that_stops_short_says_by_how_much(lee1991: CoordinationCell, good: Motions) -> None:
    first, second = good
    cut = PhaseTrajectory(lam=first.lam * 0.99, mu=first.mu, time=first.time, dynamics=first.dynamics)
    assert certify(lee1991, (cut, second)).end_error == pytest.approx(0.01 * first.lam[-1])


def test_the_clearance_is_the_least_over_the_whole_motion(lee1991: CoordinationCell, good: Motions) -> None:
    told = certify(lee1991, good)
    for t in np.linspace(0.0, max(motion.duration for motion in good), 400):
        q = [
            path.evaluate(motion.at(min(t, motion.duration))[0])[0]
            for path, motion in zip(lee1991.paths, good, strict=True)
        ]
        assert lee1991.clearance.arms(q).distance >= told.min_clearance - 1e-4  # half a sample's way
    together = certify(lee1991, lee1991.fastest)
    assert together.min_clearance < lee1991.d_min
    assert not together.certified_free


def test_one_arm_alone_has_nothing_to_keep_clear_of(lee1991: CoordinationCell, good: Motions) -> None:
    told = certify(lee1991, good[:1])
    assert told.min_clearance == math.inf
    assert told.certified_free


def test_one_cell_in_the_way_is_enough_wherever_it_is(good: Motions) -> None:
    """Between the samples of any grid too: boxes cover the curve."""
    first, second = good
    length = first.lam[-1], second.lam[-1]
    makespan = max(motion.duration for motion in good)
    cells = 64
    step = length[0] / cells, length[1] / cells
    for t in np.random.default_rng(0).uniform(0.0, makespan, 20):
        places = [float(motion.at(min(t, motion.duration))[0]) for motion in good]
        on = [min(int(place / one), cells - 1) for place, one in zip(places, step, strict=True)]
        states = np.zeros((cells, cells), dtype=np.uint8)
        states[on[0], on[1]] = 1
        chart = CoordinationChart(states=states, length_a=length[0], length_b=length[1], d_min=0.01)
        assert not _is_covered(chart, first, second, makespan)
    states = np.ones((cells, cells), dtype=np.uint8)
    lam = [motion.at(np.minimum(np.linspace(0.0, makespan, 20001), motion.duration))[0] for motion in good]
    i, j = (np.minimum((own / one).astype(int), cells - 1) for own, one in zip(lam, step, strict=True))
    for di in (-1, 0, 1):
        for dj in (-1, 0, 1):
            states[np.clip(i + di, 0, cells - 1), np.clip(j + dj, 0, cells - 1)] = 0
    chart = CoordinationChart(states=states, length_a=length[0], length_b=length[1], d_min=0.01)
    assert _is_covered(chart, first, second, makespan)  # a corridor is enough
