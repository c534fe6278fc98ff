"""The earliest arrival among moving arms: closed forms, a brute-force search, and what is never broken."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armtempo.arrays import Bools, Ints
from armtempo.errors import InfeasibleError
from armtempo.planners import PathDynamics, PhasePlane, PhaseTrajectory
from armtempo.planners.coordination import TimingProblem
from armtempo.planners.coordination._best_responses import prioritised
from armtempo.planners.coordination._start_delays import offset, start_offset
from armtempo.planners.coordination._time_windows import pair_is_free
from armtempo.robots import njit

Problems = Callable[..., TimingProblem]


def respond(problem: TimingProblem, master: PhaseTrajectory) -> PhaseTrajectory:
    return problem.searches[1].respond({0: master})


def certified(problem: TimingProblem, master: PhaseTrajectory, slave: PhaseTrajectory) -> bool:
    certificate = slave.certificate
    return (
        pair_is_free(problem.chart_between(0, 1), master, slave)
        and certificate.excess < 1e-3
        and certificate.end_error == 0.0
        and certificate.end_speed_error < 1e-9
        and bool((np.diff(slave.time) >= 0.0).all())
    )


def double_integrator(stations: int = 400, limit: float = 1.0) -> PhasePlane:
    """A path of length 1 with |mu_dot| <= limit."""
    grid, one, zero = np.linspace(0.0, 1.0, stations + 1), np.ones((stations + 1, 1)), np.zeros((stations + 1, 1))
    return PhasePlane(PathDynamics(grid, one, zero, zero, zero, [-limit], [limit]))


# -- closed forms -----------------------------------------------------------------------------------------------------


def test_nothing_in_the_way_is_the_minimum_time_motion(make_problem: Problems) -> None:
    problem = make_problem({})
    motion = respond(problem, problem.fastest[0])
    np.testing.assert_allclose(motion.time, problem.fastest[1].time, atol=1e-12)
    np.testing.assert_array_equal(motion.lam, problem.fastest[1].lam)


def test_so_it_is_with_real_arms(lee1991: Any) -> None:
    motion = lee1991.timing.searches[1].respond({})
    assert motion.duration == pytest.approx(lee1991.fastest[1].duration, rel=1e-9)
    assert motion.certificate.excess < 1e-3


def test_one_block_is_a_start_delay(make_problem: Problems) -> None:
    """Uniform priority: nothing beats the minimum-time motion, started late."""
    problem = make_problem({(0, 1): [(0.25, 0.75, 0.375, 0.5)]})
    master = problem.fastest[0]
    released, reached = float(master.time_at(0.75)), float(problem.fastest[1].time_at(0.375))
    best = 2.0 + released - reached
    motion = respond(problem, master)
    assert best <= motion.duration <= 1.002 * best
    assert certified(problem, master, motion)


@pytest.mark.parametrize(("place", "gate"), [(0.125, 0.5), (0.0625, 0.375), (0.1875, 0.3125)])
def test_out_of_the_start_and_not_yet_into_the_gate(make_problem: Problems, place: float, gate: float) -> None:
    """The slave must be out of ``place`` early and may pass ``gate`` late: no delay does that.

    Best is to stand just behind ``place`` and pass the gate, when it opens at t, with all the speed there is:
    t - sqrt(2 (gate - place)) + 2 sqrt(1 - place).
    """
    opens, closes = 0.8125, 0.3125  # of the master's way
    problem = make_problem(
        {(0, 1): [(closes, 1.0, 0.0, place), (0.0, opens, gate, 1.0)]},
        planes=(double_integrator(400, 0.25), double_integrator()),
    )
    master = problem.fastest[0]
    with pytest.raises(InfeasibleError):
        start_offset(problem, 1, {0: master})
    assert float(master.time_at(closes)) > 2.0 * math.sqrt(place)  # there is time to stop behind ``place``
    t = float(master.time_at(opens))
    best = t - math.sqrt(2.0 * (gate - place)) + 2.0 * math.sqrt(1.0 - place)
    motion = respond(problem, master)
    assert certified(problem, master, motion)
    assert best <= motion.duration <= 1.003 * best


def test_stations_that_are_far_apart_cost_little(make_problem: Problems) -> None:
    blocks = {(0, 1): [(0.3125, 1.0, 0.0, 0.125), (0.0, 0.8125, 0.5, 1.0)]}
    made = [make_problem(blocks, planes=(double_integrator(n), double_integrator(n))) for n in (100, 400, 3000)]
    times = [respond(problem, problem.fastest[0]).duration for problem in made]
    assert times[2] * 0.999 <= times[1] <= times[0] * 1.001 <= 1.015 * times[2]


# -- a brute-force search ---------------------------------------------------------------------------------------------


@njit
def _brute(shut: Bools, column_low: Ints, column_high: Ints, units: int) -> int:
    """Steps to arrive with u in -1, 0, 1 per step, or -1; places in dt^2/2, speeds in dt; boxes of a step are free."""
    fastest = int(np.sqrt(units)) + 2
    now = np.zeros((units + 1, fastest), np.bool_)
    now[0, 0] = True
    rows = shut.shape[1]
    for step in range(column_low.shape[0]):
        after = np.zeros_like(now)
        for place in range(units + 1):
            for speed in range(fastest):
                if not now[place, speed]:
                    continue
                for u in (-1, 0, 1):
                    v, to = speed + u, place + 2 * speed + u
                    if v < 0 or v >= fastest or to > units:
                        continue
                    low = min(place * rows // units, rows - 1)
                    high = min(-(-to * rows // units) - 1, rows - 1)
                    free = True
                    for column in range(column_low[step], column_high[step] + 1):
                        for row in range(low, max(high, low) + 1):
                            free = free and not shut[column, row]
                    if free:
                        after[to, v] = True
        now = after
        if now[units, 0]:
            return step + 1
    return -1


def brute_force(problem: TimingProblem, master: PhaseTrajectory, steps_per_second: int = 32) -> float:
    """An arrival that some motion in steps attains [s]; infinite if none does."""
    chart, dt = problem.chart_between(0, 1), 1.0 / steps_per_second
    instants = np.arange(0.0, 6.0, dt)
    place = master.at(np.minimum(np.append(instants, 6.0), master.duration))[0] * chart.resolution
    low = np.clip(np.floor(place[:-1]).astype(np.int64), 0, chart.resolution - 1)
    high = np.clip(np.ceil(place[1:]).astype(np.int64) - 1, low, chart.resolution - 1)
    steps = int(_brute(chart.states != 0, low, high, 2 * steps_per_second**2))
    # parked for good: the end must stay free for as long as the master moves
    return steps * dt if steps > 0 else math.inf


@pytest.mark.parametrize("seed", range(12))
def test_never_behind_a_brute_force_search(make_problem: Problems, seed: int) -> None:
    random = np.random.default_rng(seed)
    blocks = []
    for _ in range(random.integers(1, 4)):
        a, b = np.sort(random.integers(2, 62, 2)) / 64, np.sort(random.integers(2, 58, 2)) / 64
        blocks.append((a[0], a[1] + 1 / 64, b[0], b[1] + 1 / 64))
    problem = make_problem({(0, 1): blocks}, resolution=64)
    master = problem.fastest[0].delayed(0.5 * random.random())
    best = brute_force(problem, master)
    try:
        motion = respond(problem, master)
    except InfeasibleError:
        assert math.isinf(best)
        return
    assert certified(problem, master, motion)
    assert motion.duration <= 1.002 * best


# -- what is never broken ---------------------------------------------------------------------------------------------

sixteenths = st.integers(0, 16)
block = st.tuples(sixteenths, sixteenths, sixteenths, sixteenths).map(
    lambda b: tuple(v / 16 for v in (min(b[:2]), max(b[:2]), min(b[2:]), max(b[2:])))
)


@settings(max_examples=40, deadline=None)
@given(blocks=st.lists(block, max_size=4), late=st.floats(0.0, 1.0), limit=st.sampled_from([0.5, 1.0, 3.0]))
def test_what_it_returns_is_certified_and_no_later_than_an_offset(
    make_problem: Problems, blocks: list[tuple[float, ...]], late: float, limit: float
) -> None:
    planes = (double_integrator(200), double_integrator(200, limit))
    problem = make_problem({(0, 1): blocks}, resolution=64, planes=planes)
    master = problem.fastest[0].delayed(late)
    try:
        shifted = problem.fastest[1].delayed(start_offset(problem, 1, {0: master}))
    except InfeasibleError:
        shifted = None
    if shifted is not None:
        assert certified(problem, master, shifted)
    try:
        motion = respond(problem, master)
    except InfeasibleError:
        assert shifted is None
        return
    assert certified(problem, master, motion)
    assert motion.duration >= problem.fastest[1].duration * (1.0 - 1e-9)
    if shifted is not None:
        assert motion.duration <= 1.005 * shifted.duration


def test_the_same_bits_twice(make_problem: Problems) -> None:
    blocks = {(0, 1): [(0.3125, 1.0, 0.0, 0.125), (0.0, 0.8125, 0.5, 1.0)]}
    motions = [respond(problem, problem.fastest[0]) for problem in (make_problem(blocks), make_problem(blocks))]
    for name in ("lam", "mu", "time"):
        np.testing.assert_array_equal(getattr(motions[0], name), getattr(motions[1], name))


def test_d_a_master_that_parks_on_the_path(make_problem: Problems) -> None:
    """The slave passes before it; if it cannot, that is said."""
    before = make_problem({(0, 1): [(0.875, 1.0, 0.25, 0.5)]})
    motion = respond(before, before.fastest[0])
    assert motion.duration == pytest.approx(2.0, rel=1e-4)
    on_the_end = make_problem({(0, 1): [(0.875, 1.0, 0.25, 1.0)]})
    with pytest.raises(InfeasibleError) as refusal:
        respond(on_the_end, on_the_end.fastest[0])
    assert refusal.value.data["reason"] == "parked in the way"
    too_late = make_problem({(0, 1): [(0.125, 1.0, 0.75, 0.875)]})
    with pytest.raises(InfeasibleError) as refusal:
        respond(too_late, too_late.fastest[0])
    assert refusal.value.data["reason"] == "no gap"


def test_c_a_start_inside_the_closure(make_problem: Problems) -> None:
    """The slave cannot stay where it starts: it goes before, and is told so if it must not."""
    problem = make_problem({(0, 1): [(0.25, 0.75, 0.0, 0.1875)]})
    motion = respond(problem, problem.fastest[0])
    assert motion.duration == pytest.approx(2.0, rel=1e-4)
    assert offset(problem, (0, 1))[1].duration == pytest.approx(2.0, rel=1e-4)
    at_once = make_problem({(0, 1): [(0.0, 0.75, 0.0, 0.25)]})
    with pytest.raises(InfeasibleError) as refusal:
        respond(at_once, at_once.fastest[0])
    assert refusal.value.data["reason"] == "unsafe start"


def test_behind_two_others_at_once(make_problem: Problems) -> None:
    """Windows of all others count together: between the first and the second there is no room."""
    problem = make_problem({(0, 2): [(0.25, 0.5, 0.5, 0.75)], (1, 2): [(0.5, 0.75, 0.375, 0.625)]}, arms=3)
    others = {0: problem.fastest[0], 1: problem.fastest[1]}
    motion = problem.searches[2].respond(others)
    for other, its_motion in others.items():
        assert pair_is_free(problem.chart_between(other, 2), its_motion, motion)
        alone = problem.searches[2].respond({other: its_motion})
        assert alone.duration <= motion.duration * (1.0 + 1e-3)


def test_who_cannot_stand_still_does_not_wait(make_problem: Problems) -> None:
    """A load that the arm can only carry in motion for a part of its way: the answer never dwells there."""
    grid = np.linspace(0.0, 1.0, 401)
    load = np.where((grid > 0.25) & (grid < 0.5), 1.2, 0.0)[:, None]  # |u + load| <= 1: it is braked
    one, zero = np.ones((401, 1)), np.zeros((401, 1))
    heavy = PhasePlane(PathDynamics(grid, one, zero, zero, load, [-1.0], [1.0]))
    problem = make_problem(
        {(0, 1): [(0.3125, 1.0, 0.0, 0.125), (0.0, 0.8125, 0.5, 1.0)]}, planes=(double_integrator(), heavy)
    )
    assert problem.holdable == (True, False)
    motion = respond(problem, problem.fastest[0])
    assert certified(problem, problem.fastest[0], motion)
    assert prioritised(problem, (0, 1))[1].duration == motion.duration
    rests = motion.lam[1:][(np.diff(motion.lam) == 0.0) & (np.diff(motion.time) > 0.0)]
    assert not ((rests > 0.25) & (rests < 0.5)).any()
