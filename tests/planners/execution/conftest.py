"""Cells whose arms are slowed on line, and runs of them in virtual time."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.configs import load_cell_config
from armtempo.execution import ArmState, OnlineExecution, SpeedScaling
from armtempo.planners import CoordinationCell, Schedule, build_cell, schedule
from tests.planners.execution.controller import TICK_S, Channel, Controller, disturbed

MOST_TICKS = 20_000


def plan_of(name: str) -> Schedule:
    """The best plan of a cell at 500 Hz."""
    config = load_cell_config(name)
    cell = build_cell(config.model_copy(update={"control_period_s": TICK_S}))
    assert isinstance(cell, CoordinationCell)
    return schedule(cell, "optimal")


@pytest.fixture(scope="session")
def plans() -> dict[str, Schedule]:
    """One arm always first; each first somewhere."""
    return {name: plan_of(name) for name in ("lee1991", "mixed-priority")}


def fast_rows(cell: CoordinationCell) -> list[Floats]:
    """(K, 3) of every arm: instants, places and rates of its fastest motion."""
    rows = []
    for motion in cell.fastest:
        time = np.append(np.arange(0.0, motion.duration, 2e-4), motion.duration)
        lam, mu, _ = motion.at(time)
        mu[-1] = 0.0
        rows.append(np.column_stack([time, lam, mu]))
    return rows


@dataclass
class Run:
    """What came of a run: places and factors (T, A), times [s]."""

    online: OnlineExecution
    places: Floats
    factors: Floats
    arrived: bool

    @property
    def time(self) -> float:
        return len(self.places) * TICK_S


def run(
    plan: Schedule,
    seed: int,
    *,
    loss: float = 0.0,
    jitter_s: float = 0.0,
    hold_s: float = 0.03,
    calm: bool = False,
    still: tuple[int, ...] | None = None,
) -> Run:
    """Controllers and link in virtual time; ``still``: arms that never start, the others are not disturbed."""
    generator, fast = np.random.default_rng(seed), fast_rows(plan.cell)
    longest, stop_s = max(float(rows[-1, 0]) for rows in fast), 0.1
    paces = [np.ones(1) if calm or still is not None else disturbed(generator, longest) for _ in fast]
    for i in still or ():
        paces[i] = np.zeros(1)
    controllers = [Controller(i, rows, paces[i], hold_s, stop_s) for i, rows in enumerate(fast)]
    online = OnlineExecution(plan, hold_s=hold_s, stop_s=stop_s)
    up, down = Channel(generator, loss, jitter_s), Channel(generator, loss, jitter_s)
    places, factors = [], []
    for tick in range(MOST_TICKS if still is None else 1000):
        if all(one.s >= one.fast[-1, 0] for one in controllers):
            break
        now = tick * TICK_S
        for packet in up.arrived(now):
            assert isinstance(packet, ArmState)
            online.report(packet)
        for answer in online.scalings():
            down.send(now, answer)
        for packet in down.arrived(now):
            assert isinstance(packet, SpeedScaling)
            controllers[packet.arm].take(packet.answers, packet.factor, packet.ramp)
        for one in controllers:
            one.tick()
            arm, sequence, heard, time, lam, rate, factor = one.state()
            up.send(
                now,
                ArmState(arm=arm, sequence=sequence, heard=heard, time=time, lam=lam, rate=rate, factor=factor),
            )
        places.append([one.place for one in controllers])
        factors.append([one.factor for one in controllers])
    arrived = all(one.s >= one.fast[-1, 0] for one in controllers)
    return Run(online=online, places=np.array(places), factors=np.array(factors), arrived=arrived)


def too_close(cell: CoordinationCell, places: Floats) -> int:
    """How many steps of two arms are not certified free, between the ticks too, nor free by FCL at their ends."""
    bad = 0
    for i, j in combinations(range(places.shape[1]), 2):
        chart = cell.chart_between(i, j)
        for before, after in pairwise(places):
            boxes = [
                (min(float(before[k]), length), min(float(after[k]), length))
                for k, length in ((i, chart.length_a), (j, chart.length_b))
            ]
            bad += not chart.is_free(*boxes)
    return bad
