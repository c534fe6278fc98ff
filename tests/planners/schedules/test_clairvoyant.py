"""What could have been, had a disturbance been known: against closed forms and against what policies may do."""

from __future__ import annotations

import numpy as np
import pytest

from armtempo.errors import InputError
from armtempo.planners import CoordinationCell, PhaseTrajectory, load_cell, schedule
from armtempo.planners.schedules import clairvoyant


@pytest.fixture(scope="module")
def lee1991() -> CoordinationCell:
    return load_cell("lee1991")


def stopped(cell: CoordinationCell, begin: float, time: float) -> PhaseTrajectory:
    """The first arm in minimum time, but braking at ``begin`` and standing for ``time``, both in decisions."""
    period = cell.control_period
    stops = int(time / period)
    commands = [1.0] * int(begin / period) + [0.0] * stops + [1.0]
    return cell.planes[0].motion(commands, [period] * (len(commands) - 1) + [np.inf])


def test_a_late_master_costs_its_delay(lee1991: CoordinationCell) -> None:
    plan = schedule(lee1991, "delay").makespan
    for late in (0.0, 0.02):
        motions = clairvoyant(lee1991, {0: lee1991.fastest[0].delayed(late)})
        assert max(m.duration for m in motions) == pytest.approx(late + plan, rel=1e-3)
        assert lee1991.timing.is_free(motions)


def test_behind_a_very_late_master_the_other_goes_first(lee1991: CoordinationCell) -> None:
    master = lee1991.fastest[0].delayed(0.1)
    assert clairvoyant(lee1991, {0: master})[1].duration == pytest.approx(lee1991.fastest[1].duration, rel=1e-9)


def test_who_knows_of_a_long_stop_passes_before_it(lee1991: CoordinationCell) -> None:
    """Behind a master that stands at its start the slave loses nothing."""
    master = stopped(lee1991, 0.008, 0.4)
    motions = clairvoyant(lee1991, {0: master})
    assert motions[0] is master
    assert lee1991.timing.is_free(motions)
    assert motions[1].duration < master.duration
    assert schedule(lee1991, "delay").makespan < motions[1].duration + 0.4


def test_both_arms_given_are_returned_and_none_is_the_fastest_of_the_orders(lee1991: CoordinationCell) -> None:
    plan = schedule(lee1991, "optimal")
    assert clairvoyant(lee1991, dict(enumerate(plan.trajectories))) == plan.trajectories
    free = clairvoyant(lee1991, {})
    assert max(m.duration for m in free) == pytest.approx(plan.makespan, rel=1e-3)


def test_what_is_refused(lee1991: CoordinationCell) -> None:
    with pytest.raises(InputError, match="no arm 2"):
        clairvoyant(lee1991, {2: lee1991.fastest[0]})
    with pytest.raises(InputError, match="collide"):
        clairvoyant(lee1991, dict(enumerate(lee1991.fastest)))


def test_motions_are_shaped_where_each_must_go_first_somewhere() -> None:
    mixed = load_cell("mixed-priority")
    motions = clairvoyant(mixed, {0: mixed.fastest[0]})
    assert mixed.timing.is_free(motions)
    assert max(m.duration for m in motions) >= mixed.lower_bound
