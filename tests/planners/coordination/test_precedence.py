"""Precedence: limits against brute force, safety and liveness of any execution that obeys them, cycles by name."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from armtempo.errors import InfeasibleError, InputError
from armtempo.planners import CoordinationCell, CoordinationChart, PhaseTrajectory, Precedence

CELLS = 24


def chart(states: NDArray[np.uint8], length_a: float, length_b: float) -> CoordinationChart:
    return CoordinationChart(states=states.astype(np.uint8), length_a=length_a, length_b=length_b, d_min=0.01)


def blocked(*boxes: tuple[float, float, float, float], cells: int = 100) -> NDArray[np.uint8]:
    """Boxes (a from, a to, b from, b to) in shares of the paths."""
    states = np.zeros((cells, cells), dtype=np.uint8)
    for a, a_end, b, b_end in boxes:
        states[round(a * cells) : round(a_end * cells), round(b * cells) : round(b_end * cells)] = 2
    return states


def random_motions(cell: CoordinationCell, random: np.random.Generator, arms: int) -> list[PhaseTrajectory]:
    """Motions of the paper's master that start late, slow down and stop on the way."""
    motions = []
    for _ in range(arms):
        commands = np.append(random.choice([0.0, 0.2, 0.6, 1.0], 12), 1.0)
        times = np.append(random.uniform(0.01, 0.06, 12), 10.0)
        motions.append(cell.planes[0].motion(commands, times).delayed(float(random.uniform(0.0, 0.2))))
    return motions


def random_charts(
    motions: list[PhaseTrajectory], random: np.random.Generator
) -> dict[tuple[int, int], CoordinationChart]:
    """Random blocks, less what the motions pass through."""
    length = motions[0].dynamics.length
    instants = np.linspace(0.0, max(motion.duration for motion in motions), 4000)
    charts = {}
    for i, j in combinations(range(len(motions)), 2):
        states = np.zeros((CELLS, CELLS), dtype=np.uint8)
        for _ in range(random.integers(1, 6)):
            a, b = random.integers(0, CELLS, 2)
            states[a : a + random.integers(1, 7), b : b + random.integers(1, 7)] = 2
        at = [motions[k].at(np.minimum(instants, motions[k].duration))[0] / length * CELLS for k in (i, j)]
        first, last = (
            [np.clip((x + near).astype(int), 0, CELLS - 1) for x in part]
            for near, part in ((-1e-6, [x[:-1] for x in at]), (1e-6, [x[1:] for x in at]))
        )
        for k in range(len(instants) - 1):
            states[first[0][k] : last[0][k] + 1, first[1][k] : last[1][k] + 1] = 0
        charts[i, j] = chart(states, length, length)
    return charts


def last_inside(motion: PhaseTrajectory, cell: int) -> float:
    """Brute force: the last instant at which a motion is before the end of a cell."""
    if cell == CELLS - 1:
        return np.inf
    instants = np.linspace(0.0, motion.duration, 20001)
    lam = motion.at(instants)[0] / motion.dynamics.length * CELLS
    return float(instants[lam < cell + 1 - 1e-9].max())


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), arms=st.integers(2, 4))
def test_any_execution_that_obeys_the_limits_of_a_plan(lee1991: CoordinationCell, seed: int, arms: int) -> None:
    """Never in a cell that is not free, and never stuck, whoever moves when, and how far."""
    random = np.random.default_rng(seed)
    motions = random_motions(lee1991, random, arms)
    charts = random_charts(motions, random)
    order = Precedence.of_motions(motions, charts)
    order.check_deadlock_free()
    length = order.lengths[0]
    for instant in np.linspace(0.0, max(motion.duration for motion in motions), 100):  # the plan obeys
        places = [float(motion.at(min(instant, motion.duration))[0]) for motion in motions]
        for i, j in order.limits:
            assert places[i] <= float(order.farthest(i, j, places[j])) + 1e-6 * length
    lam = np.zeros(arms)
    for _ in range(3000):
        reach = [
            min([length, *(float(order.farthest(i, j, lam[j])) for j in range(arms) if j != i)]) for i in range(arms)
        ]
        able = [i for i in range(arms) if reach[i] > lam[i]]
        if not able:
            break
        i = random.choice(able)
        before = lam.copy()
        lam[i] += (reach[i] - lam[i]) * random.choice([0.3, 1.0])
        for a, b in combinations(range(arms), 2):  # the whole way
            x, y = (sorted((before[k], lam[k])) for k in (a, b))
            for s in np.linspace(0.0, 1.0, 7):
                column = (x[0] + s * (x[1] - x[0])) / length * CELLS
                row = (y[0] + s * (y[1] - y[0])) / length * CELLS
                touched = [
                    charts[a, b].states[min(int(c), CELLS - 1), min(int(r), CELLS - 1)]
                    for c in (max(column - 1e-6, 0.0), column + 1e-6)
                    for r in (max(row - 1e-6, 0.0), row + 1e-6)
                ]
                assert 0 in touched  # on a border the cell on one side is free
    assert (lam >= length * (1.0 - 1e-6)).all()


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_limits_against_brute_force(lee1991: CoordinationCell, seed: int) -> None:
    random = np.random.default_rng(seed)
    motions = random_motions(lee1991, random, 2)
    charts = random_charts(motions, random)
    order = Precedence.of_motions(motions, charts)
    states, step = charts[0, 1].states, order.lengths[0] / CELLS
    leaves = [[last_inside(motion, k) for k in range(CELLS)] for motion in motions]
    limits = np.full((2, CELLS), np.inf)
    for a, b in np.argwhere(states != 0):
        if leaves[1][b] < leaves[0][a]:  # arm 1 is out of the way earlier
            limits[0, : b + 1] = np.minimum(limits[0, : b + 1], a * step)
        else:
            limits[1, : a + 1] = np.minimum(limits[1, : a + 1], b * step)
    np.testing.assert_allclose(order.limit(0, 1), limits[0])
    np.testing.assert_allclose(order.limit(1, 0), limits[1])


def test_two_regions_in_opposite_orders(lee1991: CoordinationCell) -> None:
    """At once and at full speed the first passes one region first, the second the other."""
    motion = lee1991.fastest[0]
    states = blocked((0.2, 0.3, 0.35, 0.5), (0.75, 0.9, 0.6, 0.7))
    length = motion.dynamics.length
    order = Precedence.of_motions([motion, motion], {(0, 1): chart(states, length, length)})
    assert order.limit(1, 0)[0] == pytest.approx(0.35 * length)
    assert order.limit(1, 0)[30] == np.inf
    assert order.limit(0, 1)[0] == pytest.approx(0.75 * length)
    assert order.limit(0, 1)[70] == np.inf
    assert order.waits_for(0, [0.0, 0.0]) == (1,)
    assert order.waits_for(0, [0.0, 0.8 * length]) == ()


def test_a_plan_that_collides(lee1991: CoordinationCell) -> None:
    motion = lee1991.fastest[0]
    length = motion.dynamics.length
    with pytest.raises(InfeasibleError, match=r"'master' at .* and arm 'master' at .* collision region"):
        Precedence.of_motions([motion, motion], {(0, 1): chart(blocked((0.4, 0.6, 0.4, 0.6)), length, length)})


def test_cyclic_priorities_of_three() -> None:
    """Each is to go behind the next: fine where the regions follow each other, for ever where they overlap."""
    once = {(0, 1): blocked((0.6, 0.7, 0.5, 0.65)), (1, 2): blocked((0.6, 0.7, 0.2, 0.3))}
    charts = {pair: chart(states, 1.0, 1.0) for pair, states in once.items()}

    def cyclic(third: NDArray[np.uint8]) -> Precedence:
        """Arm 0 behind 1, 1 behind 2, 2 behind 0."""
        limits = {(i, j): charts[i, j].swapped.closure[:-1].copy() for i, j in charts}
        limits[2, 0] = chart(third, 1.0, 1.0).closure[:-1].copy()
        return Precedence(lengths=(1.0, 1.0, 1.0), limits=limits)

    # Arm 0 gets to 0.6: out of the first third region, so that arm 2 may go on, not out of the second.
    cyclic(blocked((0.3, 0.5, 0.4, 0.5))).check_deadlock_free()
    with pytest.raises(InfeasibleError, match=r"wait for each other for ever: arm \d for arm \d") as caught:
        cyclic(blocked((0.3, 0.8, 0.1, 0.5))).check_deadlock_free()
    cycle = caught.value.data["cycle"]
    assert cycle[0] == cycle[-1]
    assert set(cycle) <= {0, 1, 2}


def test_one_order_for_all_never_waits_in_a_circle() -> None:
    random = np.random.default_rng(0)
    for _ in range(20):
        charts = {}
        for pair in combinations(range(4), 2):
            a, b = random.uniform(0.05, 0.7, 2)  # neither at a start nor at an end
            charts[pair] = chart(blocked((a, a + 0.2, b, b + 0.2)), 1.0, 1.0)
        Precedence.of_order([1.0] * 4, list(random.permutation(4)), charts).check_deadlock_free()


def test_parked_in_the_way() -> None:
    charts = {(0, 1): chart(blocked((0.8, 1.0, 0.4, 0.6)), 1.0, 1.0)}
    with pytest.raises(InfeasibleError, match="arm 0 ends in its way"):
        Precedence.of_order([1.0, 1.0], [0, 1], charts).check_deadlock_free()
    Precedence.of_order([1.0, 1.0], [1, 0], charts).check_deadlock_free()


def test_limits_that_fall_are_refused() -> None:
    with pytest.raises(InputError, match="falls"):
        Precedence(lengths=(1.0, 1.0), limits={(0, 1): np.array([0.5, 0.4])})
    with pytest.raises(InputError, match="no pair"):
        Precedence(lengths=(1.0, 1.0), limits={(0, 2): np.array([0.5])})
