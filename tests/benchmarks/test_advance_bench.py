"""Every arm of the bundled cells, of rings and of the benchmark set, moved by commands: each motion ends at the end."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import get_args

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, PhasePlane, benchmark_instances, generate_cell, load_cell
from armtempo.planners.topp import LIMIT_EXCESS_MAX, Mode
from armtempo.planners.topp._advance import advance
from armtempo.robots import njit

BUNDLED = ("lee1991", "mixed-priority", "planar-four", "iiwa-pair", "panda-pair")
MOTIONS = 100  # per arm and mode
LONGEST = 400.0  # minimum times
LAST_SHARE = 0.02  # of the path, in which limits hold as for plans; before, pieces inside intervals are less exact
SLOWEST = 0.01  # of the commands that are the same all the time


@njit
def freezes(steps: Floats, lam: float, mu: float, commands: Floats, by_speed: bool, tick: float, ticks: int,
            share: float, most: int) -> int:  # fmt: skip
    """0: arrived; 1: a period was not used up; 2: nothing moved that should; 3: not there after ``most`` periods.

    ``commands`` (K,), a period each, then the highest.
    """
    places, speeds, end = np.empty(ticks), np.empty(ticks), steps[steps.shape[0] - 1, 0]
    for k in range(most):
        command, before, fast = (commands[k] if k < commands.shape[0] else 1.0), lam, mu
        lam, mu, used = advance(steps, lam, mu, command, by_speed, tick, ticks, places, speeds, share)
        if lam >= end:
            return 0
        if abs(used - tick * ticks) > 1e-12 * tick:
            return 1
        if lam == before and mu == fast and (fast > 0.0 or command == 1.0 or (by_speed and command > 0.0)):
            return 2
    return 3


def _ring(arms: int, k: int) -> CoordinationCell:
    return generate_cell("ring", 1, k, arms=arms).cell


def _cells() -> Iterator[CoordinationCell]:
    makers: list[Callable[[], CoordinationCell]] = [partial(load_cell, name) for name in BUNDLED]
    makers += [partial(_ring, arms, k) for arms in (3, 4, 6) for k in range(3)]
    makers += [one.build for one in benchmark_instances()]
    for make in makers:
        try:
            yield make()
        except InfeasibleError:
            continue


def _start(plane: PhasePlane, rng: np.random.Generator, part: float) -> tuple[float, float]:
    """At rest at the start; or near the end, as fast as commanded but for rounding, or anything else."""
    if rng.random() < 0.4:
        return 0.0, 0.0
    station = plane.rows.station
    i, w = int(rng.integers(-6, -1)), float(rng.choice([0.0, rng.random(), 1.0 - 10.0 ** rng.uniform(-9, -1)]))
    lam = float(station[i] + w * (station[i + 1] - station[i]))
    edge = plane.edge_speed(lam)
    share = float(rng.choice([0.0, rng.random(), part])) * (1.0 + int(rng.integers(-4, 5)) * 2.0**-52)
    return lam, min(share * edge, edge)


def test_no_motion_freezes(capsys: pytest.CaptureFixture[str]) -> None:
    rng, found, arms, worst = np.random.default_rng(0), Counter[int](), 0, 0.0
    for cell in _cells():
        for plane in cell.planes:
            arms += 1
            for mode in get_args(Mode):
                for trial in range(MOTIONS):
                    tick = cell.physics_tick * float(rng.choice([1.0, rng.uniform(0.05, 1.0)]))
                    ticks, share = int(rng.choice([1, cell.ticks_per_period])), float(rng.choice([1.0, rng.random()]))
                    share = max(share, SLOWEST)
                    most = int(LONGEST * plane.fastest().duration / (share * tick * ticks)) + 1
                    commands = rng.uniform(0.0, 1.0, int(rng.integers(1, 200)))
                    if trial % 3 == 0:  # one command all the time
                        commands = np.full(most if mode == "speed" else len(commands), max(rng.random(), SLOWEST))
                    lam, mu = _start(plane, rng, float(commands[0]) * share if mode == "speed" else share)
                    by_speed = mode == "speed"
                    found[freezes(plane.edges.steps, lam, mu, commands, by_speed, tick, ticks, share, most)] += 1
                for _ in range(3):
                    commands, times = np.append(rng.uniform(0.0, 1.0, 60), 1.0), np.append(np.full(60, 0.016), np.inf)
                    lam, mu = _start(plane, rng, float(commands[0]))
                    motion = plane.motion(commands, times, lam, mu, mode=mode, share=float(rng.uniform(0.1, 1.0)))
                    assert motion.lam[-1] == plane.length
                    above = motion.stations_above(LIMIT_EXCESS_MAX)
                    if plane.length - lam > 1e-6 * plane.length:  # a shorter way is rounding
                        worst = max(worst, motion.certificate.excess)
                        assert not (above > plane.length - LAST_SHARE * plane.length).any()
    with capsys.disabled():
        said = f"{sum(found.values())} motions of {arms} arms, by outcome {dict(found)}"
        print(f"\n{said}; limits exceeded by {worst:.2e} on the way")  # noqa: T201
    assert set(found) == {0}
