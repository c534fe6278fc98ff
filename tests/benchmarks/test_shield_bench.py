"""Two million agent steps that mean no good, under the shield: no violation, no deadlock.

The requests are made and run in a compiled loop (``shield_trial``): through ``env.step`` it would take hours. Every
episode turns to full speed at some instant and must then end within five sequential times.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

from armtempo.arrays import Bools
from armtempo.envs import CHANNELS, MODES, REQUESTS, CoordinationEnv, ShieldTrial, YieldingEnv, shield_trial
from armtempo.envs.common import ideal_options
from armtempo.envs.coordination.shield import Shield
from armtempo.envs.coordination.shield._admission import admit
from armtempo.envs.coordination.shield._kernels import Orders, ShieldTables, ShieldWork
from armtempo.envs.coordination.shield._turning import first_orders
from armtempo.envs.coordination.world import (
    CoordinationOptions,
    CoordinationSimulation,
    World,
    length_of,
    steps_of,
)
from armtempo.errors import InfeasibleError
from armtempo.planners import CoordinationCell, benchmark_instances, generate_cell, load_cell, schedule
from armtempo.planners.topp import kernels as phase_kernels
from armtempo.robots import njit

STEPS = 2_000_000
BUNDLED = ("lee1991", "mixed-priority", "planar-four", "iiwa-pair", "panda-pair")


def _report(cell: CoordinationCell, what: str, trial: ShieldTrial, seconds: float) -> None:
    print(  # noqa: T201
        f"{cell.name:>24} {what:<12} {trial.steps:>7} agent steps {1e6 * seconds / trial.steps:6.1f} us, "
        f"changed {100 * trial.changed:5.2f} %, mean change {trial.change:.4f}, "
        f"violations {trial.violations}, deadlocks {trial.stuck}, clearance {1e3 * trial.clearance:.2f} mm "
        f"(planned {1e3 * cell.planned_clearance:.2f})",
        flush=True,
    )


def test_nothing_violates_or_sticks(capsys: pytest.CaptureFixture[str]) -> None:
    feasible = [instance for instance in benchmark_instances() if instance.labels.status == "feasible"]
    names: list[str] = [*BUNDLED, *(instance.name for instance in feasible)]
    builders = [*((lambda n=n: load_cell(n)) for n in BUNDLED), *(instance.build for instance in feasible)]
    share = STEPS // len(builders) + 1
    total: Counter[str] = Counter()
    left_out = []
    with capsys.disabled():
        for place, (name, build) in enumerate(zip(names, builders, strict=True)):
            cell = build()
            pairs = len(cell.arms) == 2
            # Half of the steps random, a quarter at full speed, the rest mixed, with and without disturbances.
            runs = [("random", 0.3, ()), ("persistent", 0.2, ()), ("full", 0.25, ()), ("mixed", 0.15, ())]
            for requests, part, uncertain in [*runs, ("mixed", 0.1, (place % len(cell.arms),))]:
                start = time.perf_counter()
                try:
                    trial = shield_trial(cell, requests, int(part * share) + 1, seed=place, uncertain=uncertain)
                except InfeasibleError:
                    left_out.append(name)
                    break
                _report(cell, requests + (" late" if uncertain else ""), trial, time.perf_counter() - start)
                assert not trial.violations
                assert not trial.stuck
                total["steps"] += trial.steps
                if requests == "full":
                    bare = shield_trial(cell, requests, 100, shielded=False)
                    total["collide without"] += bare.violations > 0
                    try:
                        best = schedule(cell, "optimal").makespan if pairs else np.nan
                    except InfeasibleError:
                        best = np.nan
                    print(f"{cell.name:>24} full speed ends at {trial.makespan / best:.4f} of the optimum")  # noqa: T201
        print(f"{dict(total)}, no passing order found: {left_out or 'none'}")  # noqa: T201
    assert total["collide without"] > len(builders) // 2
    assert total["steps"] >= STEPS * (1.0 - len(left_out) / len(builders))
    assert len(left_out) <= len(builders) // 20


def _rings_and_bundled() -> list[CoordinationCell]:
    rings = [generate_cell("ring", 1, k, arms=arms).cell for arms in (3, 4, 5, 6) for k in range(2)]
    return [*rings, load_cell("mixed-priority"), load_cell("planar-four")]


def _of_every_family() -> list[CoordinationCell]:
    """Of every family and number of arms, up to six, the first feasible test cell of the benchmark set."""
    first: dict[tuple[str, int], CoordinationCell] = {}
    for instance in benchmark_instances("test"):
        kind = (instance.family, len(instance.labels.holdable))
        if instance.labels.status == "feasible" and kind[1] <= 6 and kind not in first:
            first[kind] = instance.build()
    return list(first.values())


@pytest.mark.parametrize("cells_of", [_rings_and_bundled, _of_every_family])
def test_many_arms_whoever_is_to_pass_first(
    cells_of: Callable[[], list[CoordinationCell]], capsys: pytest.CaptureFixture[str]
) -> None:
    """Two million steps each: two to six arms, both modes, every channel, from the start and from anywhere."""
    cells = cells_of()
    variants = list(product(MODES, CHANNELS, (0.0, 0.4), (False, True)))
    share, total, left_out = STEPS // (len(cells) * len(variants)) + 1, 0, []
    with capsys.disabled():
        for cell in cells:
            began, stuck, violations, steps = time.process_time(), 0, 0, 0
            for k, (mode, channel, phase, late) in enumerate(variants):
                uncertain = (k % len(cell.arms), (k + 1) % len(cell.arms)) if late else ()
                options: dict[str, Any] = {"mode": mode, "channel": channel, "start_phase": (0.0, phase)}
                try:
                    trial = shield_trial(cell, "mixed", share, seed=k, uncertain=uncertain, **options)
                except InfeasibleError:
                    left_out.append(cell.name)
                    break
                steps, stuck, violations = steps + trial.steps, stuck + trial.stuck, violations + trial.violations
                if trial.stuck or trial.violations:
                    print(f"{cell.name} {variants[k]} {trial}")  # noqa: T201
            seconds = time.process_time() - began
            print(  # noqa: T201
                f"{cell.name:>24} {len(cell.arms)} arms {steps:>8} steps {1e6 * seconds / max(steps, 1):6.1f} us, "
                f"violations {violations}, deadlocks {stuck}", flush=True,
            )  # fmt: skip
            assert not violations
            assert not stuck
            total += steps
        print(f"{total} agent steps, no passing order found: {left_out or 'none'}")  # noqa: T201


@njit
def _at_full_speed(
    world: World, tables: ShieldTables, orders: Orders, work: ShieldWork, nobody: Bools, ticks: int, shielded: bool,
    episodes: int,
) -> int:  # fmt: skip
    """Episodes in which all arms want full speed, without watching them; how many periods they take."""
    arms, periods = len(nobody), 0
    lam, mu, places, speeds = np.zeros(arms), np.zeros(arms), np.empty(ticks), np.empty(ticks)
    asked, admitted = np.ones(arms), np.ones(arms)
    for _ in range(episodes):
        lam[:], mu[:] = 0.0, 0.0
        first_orders(world, tables, lam, nobody, orders, work)
        running = True
        while running:
            if shielded:
                admit(world, tables, orders, work.wanted, lam, mu, asked, nobody, nobody, ticks, admitted, work)
            running = False
            for i in range(arms):
                path = steps_of(world, i)
                lam[i], mu[i], _ = phase_kernels.advance(
                    path, lam[i], mu[i], admitted[i], world.by_speed, world.tick, ticks, places, speeds
                )  # fmt: skip
                running = running or lam[i] < length_of(world, i)
            periods += 1
    return periods


def test_what_a_step_of_four_arms_costs(capsys: pytest.CaptureFixture[str]) -> None:
    """Processor time of a control period at full speed, the best of some runs: with the shield, and of that motion."""
    cells = [load_cell("planar-four"), *(generate_cell(family, 1, 0, arms=4).cell for family in ("ring", "rows"))]
    with capsys.disabled():
        for cell in cells:
            simulation = CoordinationSimulation(cell, ideal_options(CoordinationOptions, {}, Shield))
            shield, nobody = Shield(cell, simulation.world), np.zeros(4, dtype=np.bool_)
            shield.reset(np.zeros(4))
            best = {True: np.inf, False: np.inf}
            for run, shielded in product(range(8), (True, False)):
                began = time.process_time()
                periods = _at_full_speed(
                    simulation.world, shield.tables, shield.orders, shield.work, nobody, cell.ticks_per_period,
                    shielded, 10 if run else 1,
                )  # fmt: skip
                if run:
                    best[shielded] = min(best[shielded], 1e6 * (time.process_time() - began) / periods)
            print(f"{cell.name:>24} shielded {best[True]:5.1f} us a step of four arms, bare {best[False]:4.1f}")  # noqa: T201
            assert best[True] < 200.0


def test_scripted_arms_that_are_disturbed(capsys: pytest.CaptureFixture[str]) -> None:
    with capsys.disabled():
        for name in ("lee1991", "iiwa-pair", "panda-pair"):
            cell = load_cell(name)
            for requests in REQUESTS:
                start = time.perf_counter()
                trial = shield_trial(cell, requests, 20_000, scripted=(0,), uncertain=(0,))
                _report(cell, f"{requests} slave", trial, time.perf_counter() - start)
                assert not trial.violations
                assert not trial.stuck


@pytest.mark.parametrize("name", ["lee1991", "mixed-priority"])
def test_bullet(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Scripted worst cases in physics: full speed, stop and go, random, with a late master."""
    cell = load_cell(name)
    rng = np.random.default_rng(0)
    steps, episodes, exceeded, smallest = 0, 0, 0, np.inf
    env = CoordinationEnv(cell, physics="bullet", shield=True)
    while steps < 10_000:
        env.reset(options={"master_late_s": 0.1 * (episodes % 2)})
        kind = REQUESTS[episodes % 4]
        asked = {agent: np.ones(1, dtype=np.float32) for agent in env.possible_agents}
        infos: dict[str, dict[str, object]] = {}
        while env.agents:
            for agent in env.agents:
                if kind == "random" or (kind != "full" and rng.random() < 0.1):
                    level = rng.uniform(-1.0, 1.0) if kind != "bang-bang" else rng.choice([-1.0, 1.0])
                    asked[agent] = np.array([level], dtype=np.float32)
            steps += len(env.agents)
            _, _, _, _, infos = env.step({agent: asked[agent] for agent in env.agents})
            exceeded += any(bool(info["shield_tube_exceeded"]) for info in infos.values())
            assert not env.simulation.violated
        smallest = min(smallest, env.simulation.min_clearance)
        episodes += 1
    env.close()
    with capsys.disabled():
        print(  # noqa: T201
            f"\n{name} in bullet: {steps} agent steps, {episodes} episodes, no violation, smallest clearance "
            f"{1e3 * smallest:.3f} mm, off the tube in {exceeded} steps"
        )
    assert exceeded == 0


def test_a_slave_in_bullet_behind_worst_masters(capsys: pytest.CaptureFixture[str]) -> None:
    cell = load_cell("lee1991")
    env = YieldingEnv(cell, physics="bullet", shield=True, master_late_s=(0.0, 0.15))
    steps = 0
    for episode in range(20):
        env.reset(seed=episode)
        over = False
        while not over:
            _, _, terminated, truncated, info = env.step(np.ones(1, dtype=np.float32))
            steps += 1
            over = terminated or truncated
        assert info["is_success"]
    env.close()
    with capsys.disabled():
        print(f"\nlee1991 slave in bullet: {steps} steps at full speed behind late masters, no violation")  # noqa: T201
