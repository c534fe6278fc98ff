"""What tries to get past the shield: judged by the chart's cells between the ticks, not by the shield's own limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Floats, Ints
from armtempo.envs import (
    CoordinationEnv,
    CoordinationOptions,
    CoordinationSimulation,
    Shield,
    YieldingEnv,
    shield_trial,
)
from armtempo.envs.coordination.shield._kernels import stops_before
from armtempo.envs.coordination.world._world import World, steps_of
from armtempo.planners import CoordinationCell, CoordinationChart, benchmark_instances, build_cell, load_cell
from armtempo.planners.topp import kernels as phase_kernels

PARTS = 64  # of a tick, in each of which the arms sweep a box of the chart
FULL = np.ones(1, dtype=np.float32)


def instance(name: str) -> CoordinationCell:
    return next(instance for instance in benchmark_instances() if instance.name == name).build()


@pytest.fixture(scope="module")
def mixed() -> CoordinationCell:
    return load_cell("mixed-priority")


@pytest.fixture(scope="module")
def pulled_on() -> CoordinationCell:
    """Too fast there, an arm that brakes is pulled on for a third of its path: a little speed makes all of that."""
    return instance("planar-1991-0064")


def touches(chart: CoordinationChart, a: Floats, b: Floats) -> bool:
    """Whether one of the boxes between neighbours of two motions touches the inside of a cell that is not free."""

    def cells(places: Floats, step: float) -> tuple[Ints, Ints]:
        first = np.floor(places[:-1] / step + 1e-9).astype(np.int64)
        last = np.maximum(np.ceil(places[1:] / step - 1e-9).astype(np.int64) - 1, first)
        return np.minimum(first, chart.resolution - 1), np.minimum(last, chart.resolution - 1)

    (a_first, a_last), (b_first, b_last) = cells(a, chart.step_a), cells(b, chart.step_b)
    boxes = np.unique(np.stack([a_first, a_last, b_first, b_last], axis=1), axis=0)
    return any(bool(chart.states[p : q + 1, r : s + 1].any()) for p, q, r, s in boxes)


def swept(world: World, i: int, lam: float, mu: float, command: float, ticks: int) -> Floats:
    """Places of one period, so many to a tick that the arms hardly move from one to the next."""
    out, speeds = np.empty(PARTS * ticks), np.empty(PARTS * ticks)
    tick = world.tick / PARTS
    steps = steps_of(world, i)
    phase_kernels.advance(steps, lam, mu, command, world.by_speed, tick, PARTS * ticks, out, speeds)
    return np.concatenate([[lam], out])


@pytest.mark.parametrize("name", ["mixed", "pulled_on"])
def test_braking_stops_where_it_is_said_to(name: str, request: pytest.FixtureRequest) -> None:
    cell: CoordinationCell = request.getfixturevalue(name)
    simulation = CoordinationSimulation(cell, CoordinationOptions(physics="ideal"))
    world, tables = simulation.world, Shield(cell, simulation.world).tables
    rng = np.random.default_rng(0)
    out, speeds = np.empty(4), np.empty(4)
    said = 0
    for i, (plane, path) in enumerate(zip(cell.planes, cell.paths, strict=True)):
        steps, holdable, braked, before = steps_of(world, i), tables.holdable[i], tables.braked[i], tables.before[i]
        for _ in range(1500):
            lam = rng.uniform(0.0, 0.9) * path.length
            mu = rng.uniform(0.2, 1.0) * phase_kernels.edge_speed(plane.edges.steps, lam)
            limit = rng.uniform(lam, path.length)
            if not stops_before(steps, holdable, braked, before, lam, mu, limit, world.tick):
                continue
            said += 1
            while mu > 0.0 and lam < path.length:
                lam, mu, _ = phase_kernels.advance(steps, lam, mu, 0.0, world.by_speed, world.tick, 4, out, speeds)
            assert lam <= limit
    assert said > 500


@pytest.mark.parametrize("mode", ["speed", "acceleration"])
def test_an_arm_that_is_pulled_on_is_stopped_in_time(pulled_on: CoordinationCell, mode: Any) -> None:
    for requests in ("full", "mixed"):
        trial = shield_trial(pulled_on, requests, 4_000, mode=mode)
        assert trial.violations == trial.stuck == 0
        assert trial.makespan > 0.0


@pytest.mark.parametrize("name", ["planar-1991-0051", "planar-1991-0142"])
def test_arms_that_cannot_hold_still_and_may_be_late(name: str) -> None:
    cell = instance(name)
    assert not any(cell.holdable)
    for uncertain in ((), (0,), (1,), (0, 1)):
        trial = shield_trial(cell, "mixed", 2_000, uncertain=uncertain)
        assert trial.violations == trial.stuck == 0


@pytest.mark.parametrize(
    ("ticks", "options"),
    [
        (4, {}),
        (1, {}),
        (12, {}),
        (4, {"mode": "acceleration"}),
        (4, {"start_phase": (0.0, 0.6)}),
        (12, {"start_phase": (0.0, 0.6), "mode": "acceleration"}),
    ],
)
def test_nothing_blocked_is_touched_between_ticks(mixed: CoordinationCell, ticks: int, options: dict[str, Any]) -> None:
    cell = mixed if ticks == 4 else build_cell(mixed.config.model_copy(update={"control_period_s": 0.001 * ticks}))
    env = CoordinationEnv(cell, physics="ideal", shield=True, **options)
    simulation, chart = env.simulation, cell.chart_between(0, 1)
    rng = np.random.default_rng(ticks)
    cut = 0
    for episode in range(4):
        env.reset(seed=episode)
        level = np.ones(2)
        while env.agents:
            if episode:  # the first at full speed
                level = np.where(rng.random(2) < 0.1, rng.choice([-1.0, 0.0, 1.0], 2), level)
            before, speeds = simulation.lam.copy(), simulation.mu.copy()
            asked = dict(zip(env.possible_agents, level.astype(np.float32), strict=True))
            _, _, _, _, infos = env.step({agent: np.array([asked[agent]]) for agent in env.agents})
            motions = []
            for i, agent in enumerate(env.possible_agents):
                change = infos[agent]["shield"]["change"] if agent in infos else 0.0
                command = 0.5 * (float(asked[agent]) + 1.0) - change
                motions.append(swept(simulation.world, i, before[i], speeds[i], command, ticks))
                assert motions[-1][-1] == simulation.lam[i]  # the same bits as what was run
                cut += change > 0.0
            assert not touches(chart, *motions)
        level[:] = 1.0
    assert cut > 0


@pytest.mark.parametrize("disturbance", ["late", "slow", "stop-and-go", "any"])
def test_disturbed_learners(mixed: CoordinationCell, disturbance: str) -> None:
    env = CoordinationEnv(
        mixed, physics="ideal", shield=True, disturbance=disturbance, start_phase=(0.0, 0.3), max_episode_s=8.0
    )
    chart = mixed.chart_between(0, 1)
    for seed in range(4):
        env.reset(seed=seed)
        while env.agents:
            _, _, _, _, infos = env.step(dict.fromkeys(env.agents, FULL))
            a, b = (np.repeat(place, 2) for place in env.simulation.lam)
            assert not touches(chart, a, b)
        assert all(info["is_success"] for info in infos.values())


def test_a_disturbed_learner_behind_a_plan(mixed: CoordinationCell) -> None:
    env = YieldingEnv(mixed, physics="ideal", shield=True, others="optimal", disturbance="any", max_episode_s=8.0)
    for seed in range(6):
        env.reset(seed=seed)
        over = False
        while not over:
            _, _, terminated, truncated, info = env.step(FULL)
            over = terminated or truncated
        assert info["is_success"]


@pytest.mark.parametrize("uncertain", [(), (1, 2)])
def test_four_arms(uncertain: tuple[int, ...]) -> None:
    cell = load_cell("planar-four")
    trial = shield_trial(cell, "mixed", 4_000, uncertain=uncertain)
    assert trial.violations == trial.stuck == 0
    assert trial.changed > 0.0
