"""Environments of three and four arms: the checks of the libraries, observations and clearance over all pairs."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import armtempo
from armtempo.envs import (
    COORDINATION_ENTRIES,
    PHYSICS,
    CoordinationEnv,
    CoordinationOptions,
    CoordinationSimulation,
    Physics,
    share,
)
from armtempo.planners import CoordinationCell

assert armtempo.__version__
NAMES = [entry.name for entry in COORDINATION_ENTRIES]


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """The checkers open every declared render mode."""
    monkeypatch.delenv("DISPLAY", raising=False)


@pytest.fixture(params=["trio", "four_arms"])
def cell(request: pytest.FixtureRequest) -> CoordinationCell:
    found: CoordinationCell = request.getfixturevalue(request.param)
    return found


@pytest.mark.parametrize("physics", PHYSICS)
def test_pettingzoo_parallel_api(cell: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(cell, physics=physics)
    assert env.possible_agents == [f"arm_{i}" for i in range(len(cell.arms))]
    parallel_api_test(env, num_cycles=100)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_gymnasium_check_env(trio: CoordinationCell, physics: Physics) -> None:
    env = gymnasium.make("armtempo/Yielding-v0", cell=trio, physics=physics, learner="slave")
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_random_episodes_stay_in_the_space(cell: CoordinationCell, physics: Physics) -> None:
    """Clearance is the smallest over all pairs, and an episode ends on the first that is too small."""
    env = CoordinationEnv(cell, physics=physics, record=True)
    random = np.random.default_rng(0)
    violated = 0
    for seed in range(4):
        observations, _ = env.reset(seed=seed)
        while env.agents:
            for agent, row in observations.items():
                assert env.observation_space(agent).contains(row)
            actions = {agent: random.uniform(-0.4, 1.0, 1).astype(np.float32) for agent in env.agents}
            observations, *_ = env.step(actions)
        trace = env.trace
        violated += trace.violations
        pairs = itertools.combinations(range(len(cell.arms)), 2)
        q = [rows[-1] for rows in trace.q]
        nearest = min(cell.clearance.between(i, j, q[i], q[j]).distance for i, j in pairs)
        assert env.simulation.violated == (trace.clearance[-1] < cell.d_min)
        if env.simulation.violated:
            assert trace.clearance[-1] == pytest.approx(nearest, abs=5e-4)
    assert violated > 0
    env.close()


def test_the_two_most_constraining_arms_are_seen(four_arms: CoordinationCell) -> None:
    """Nearest region first, against the charts of all pairs by brute force."""
    env = CoordinationEnv(four_arms, physics="ideal")
    env.reset()
    random = np.random.default_rng(2)
    lengths = np.array([path.length for path in four_arms.paths])
    arms = range(len(lengths))
    for _ in range(100):
        lam = random.uniform(0.0, 1.0, len(lengths)) * lengths
        env.simulation.lam[:], env.simulation.mu[:] = lam, 0.0
        rows = env.simulation.observe()
        for i in arms:
            seen = []
            for j in (j for j in arms if j != i):
                chart = four_arms.chart_between(j, i)
                here = int(lam[i] / lengths[i] * chart.resolution)
                waits = (chart.last_column >= 0) & ((chart.last_column + 1) * chart.step_a > lam[j])
                ahead = np.flatnonzero(waits[here:])
                way = max((here + ahead[0]) * chart.step_b - lam[i], 0.0) / lengths[i] if len(ahead) else 1.0
                seen.append((way, j))
            for slot, (distance, j) in enumerate(sorted(seen, key=lambda entry: entry[0])[:2]):
                entries = {name: rows[i][NAMES.index(f"other_{slot}.{name}")] for name in ("present", "distance")}
                assert entries["present"] == 1.0
                assert share(entries["distance"]) == pytest.approx(distance, abs=2e-6)
                if distance < 1.0:
                    progress = share(rows[i][NAMES.index(f"other_{slot}.progress")])
                    assert any(
                        progress == pytest.approx(lam[k] / lengths[k], abs=2e-6) for d, k in seen if d == distance
                    )
                assert j != i
    env.close()


def test_clearance_may_be_skipped_never_missed(trio: CoordinationCell) -> None:
    """The least clearance of an episode is that of asking FCL at every tick."""
    commands = np.array([1.0, 0.0, 0.0])  # it comes by, and goes away
    recorded = CoordinationSimulation(trio, CoordinationOptions(physics="bullet"), record=True)
    simulation = CoordinationSimulation(trio, CoordinationOptions(physics="bullet"))
    asked_at = []
    for _ in range(90):
        simulation.step(commands)
        recorded.step(commands)
        asked_at.append(simulation._q_asked.copy())
        assert simulation.violated == recorded.violated
        if simulation.violated:
            break
    assert len({q.tobytes() for q in asked_at}) < len(asked_at)  # it was skipped at times
    trace = recorded.trace()
    asked = [trio.clearance.arms([rows[k] for rows in trace.q]).distance for k in range(len(trace.time))]
    assert simulation.min_clearance == recorded.min_clearance == pytest.approx(min(asked), abs=1e-12)
    assert (trace.clearance <= np.array(asked) + 1e-9).all()
    simulation.close()
    recorded.close()


def test_one_arm_alone(lee1991: CoordinationCell) -> None:
    from armtempo.planners import build_cell

    config = lee1991.config
    alone = build_cell(config.model_copy(update={"arms": config.arms[:1]}))
    for physics in PHYSICS:
        env = CoordinationEnv(alone, physics=physics, record=True)
        env.reset()
        while env.agents:
            env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
        assert env.trace.makespan == pytest.approx(alone.fastest[0].duration, abs=2e-3)
        env.close()


_SCRIPT = """
import hashlib, sys
import numpy as np
from armtempo.configs import CellConfig
from functools import partial
from armtempo.agents import ExecutionPolicy
from armtempo.planners.schedules import ScheduleExecution, VciExecution
from armtempo.envs import CoordinationEnv
from armtempo.planners import Schedule, build_cell, load_cell
from armtempo.planners.coordination import plan_vci

sys.path.insert(0, sys.argv[1])
from conftest import ring_of_arms

lines = [((0.35, -0.15), (0.54, 0.07)), ((0.49, -0.23), (0.52, 0.13)), ((0.45, -0.24), (0.31, 0.2))]
cell, digest = build_cell(ring_of_arms(0.5, lines, "-+-")), hashlib.sha256()
motions, _ = plan_vci(cell.planes, cell.chart_between, (0, 1, 2), cell.control_period)
plan = Schedule(method="vci", cell=cell, trajectories=motions, order=(0, 1, 2))
for physics in ("bullet", "ideal"):
    env = CoordinationEnv(cell, physics=physics, master_late_s=0.02)
    for policy in (ExecutionPolicy(partial(VciExecution, cell)), ExecutionPolicy(partial(ScheduleExecution, plan))):
        observations, _ = env.reset(seed=0)
        policy.reset(0)
        while env.agents:
            observations, *rest = env.step(policy.act({agent: observations[agent] for agent in env.agents}, env))
            digest.update(b"".join(row.tobytes() for row in observations.values()) + repr(rest).encode())
    env.close()
sys.stdout.write(digest.hexdigest())
"""


def test_two_processes_run_the_same_episodes() -> None:
    command = [sys.executable, "-c", _SCRIPT, str(Path(__file__).parents[2])]
    runs = [subprocess.run(command, capture_output=True, text=True, check=True).stdout for _ in range(2)]
    assert runs[0] == runs[1]
    assert len(runs[0]) == 64
