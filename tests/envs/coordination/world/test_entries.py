"""Every entry of the observation: in its space, and meaning what the table says."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from armtempo.arrays import Floats32
from armtempo.envs import (
    COORDINATION_ENTRIES,
    MODES,
    OTHER,
    OTHERS,
    OWN,
    PHYSICS,
    CoordinationEnv,
    Physics,
)
from armtempo.envs.common._entries import share
from armtempo.planners import CoordinationCell, schedule
from armtempo.planners.topp import Mode

NAMES = [entry.name for entry in COORDINATION_ENTRIES]
FLOAT32 = 1e-6


def _entry(row: Floats32, name: str) -> float:
    return float(row[NAMES.index(name)])


def test_the_entries_are_the_own_ones_and_those_of_the_others() -> None:
    assert len(NAMES) == len(OWN) + OTHERS * len(OTHER)


@pytest.mark.parametrize(("physics", "mode"), list(itertools.product(PHYSICS, MODES)))
def test_in_the_space_over_whole_random_episodes(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    env = CoordinationEnv(lee1991, physics=physics, mode=mode, master_late_s=0.12)
    random = np.random.default_rng(5)
    for episode in range(4):
        observations, _ = env.reset(seed=episode)
        kept: list[tuple[Floats32, Floats32]] = []
        while env.agents:
            for agent, row in observations.items():
                assert row.dtype == np.float32
                assert env.observation_space(agent).contains(row), row
                kept.append((row, row.copy()))
            # one temper per episode: random, fast, slow, at the corners
            actions = {
                agent: np.array([(random.uniform(-1, 1), 1.0, -0.6, random.choice([-1.0, 1.0]))[episode]], np.float32)
                for agent in env.agents
            }
            observations, *_ = env.step(actions)
        for row, copy in kept:  # nothing handed out is written again
            np.testing.assert_array_equal(row, copy)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_progress_speed_and_time_to_go_decode_to_the_state(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, master_late_s=0.1)
    observations, _ = env.reset(seed=0)
    random = np.random.default_rng(1)
    fastest = [motion.duration for motion in lee1991.fastest]
    for _ in range(90):
        for i, agent in enumerate(env.agents):
            row, plane, other = observations[agent], lee1991.planes[i], lee1991.planes[1 - i]
            lam, mu = env.simulation.lam, env.simulation.mu
            assert share(_entry(row, "progress")) * plane.length == pytest.approx(lam[i], abs=FLOAT32)
            assert share(_entry(row, "speed")) * plane.edge_speed(lam[i]) == pytest.approx(mu[i], abs=5 * FLOAT32)
            assert share(_entry(row, "other_0.progress")) * other.length == pytest.approx(lam[1 - i], abs=FLOAT32)
            decoded = share(_entry(row, "other_0.speed")) * other.edge_speed(lam[1 - i])
            assert decoded == pytest.approx(mu[1 - i], abs=5 * FLOAT32)
            station = plane.rows.station  # between stations it is interpolated: at most 2 ms off, at the very ends
            to_go = np.interp(lam[i], station, fastest[i] - lee1991.fastest[i].time_at(station))
            assert share(_entry(row, "time_to_go")) * fastest[i] == pytest.approx(to_go, abs=FLOAT32)
            scale = 8.0 * plane.length / fastest[i] ** 2
            if lam[i] < plane.length:
                bounds = np.clip(np.array(plane.acceleration_bounds(lam[i], mu[i])) / scale, -1.0, 1.0)
                assert _entry(row, "lowest_acceleration") == pytest.approx(bounds[0], abs=FLOAT32)
                assert _entry(row, "highest_acceleration") == pytest.approx(bounds[1], abs=FLOAT32)
            assert _entry(row, "other_0.present") == 1.0
            assert not row[NAMES.index("other_1.present") :].any()  # the cell has no third arm
        actions = {agent: np.array([random.uniform(-0.2, 1.0)], dtype=np.float32) for agent in env.agents}
        if not env.agents:
            break
        observations, *_ = env.step(actions)
    env.close()


def test_distance_and_release_are_those_of_the_chart(lee1991: CoordinationCell) -> None:
    """Brute force over the chart: the first row ahead that the other has not released, and how far it must still go."""
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset()
    random = np.random.default_rng(2)
    lengths = np.array([path.length for path in lee1991.paths])
    seen = set()
    for _ in range(300):
        lam = random.uniform(0.0, 1.0, 2) * lengths
        env.simulation.lam[:], env.simulation.mu[:] = lam, 0.0
        rows = env.simulation.observe()
        for i, chart in ((1, lee1991.chart), (0, lee1991.chart.swapped)):  # chart: (other, own)
            own, other = lam[i], lam[1 - i]
            released = (chart.last_column + 1) * chart.step_a  # of the other's path; rows are the own places
            here = int(own / lengths[i] * chart.resolution)
            ahead = [k for k in range(here, chart.resolution) if chart.last_column[k] >= 0 and released[k] > other]
            distance = max(ahead[0] * chart.step_b - own, 0.0) / lengths[i] if ahead else 1.0
            release = (released[ahead[0]] - other) / lengths[1 - i] if ahead else 0.0
            assert share(_entry(rows[i], "other_0.distance")) == pytest.approx(distance, abs=FLOAT32)
            assert share(_entry(rows[i], "other_0.release")) == pytest.approx(release, abs=FLOAT32)
            seen.add(bool(ahead))
            if i == 1 and ahead and distance > 0.0:  # never farther than the first blocked place right now
                assert own + distance * lengths[i] <= chart.next_collision(other, own) + 1e-9
    assert seen == {True, False}
    env.close()


def test_wait_and_lead_are_those_of_the_minimum_time_motions(lee1991: CoordinationCell) -> None:
    """Brute force over the chart's rows: when the other leaves each one for good, and when this arm gets there."""
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset()
    random = np.random.default_rng(6)
    lengths = [path.length for path in lee1991.paths]
    stations = [plane.rows.station for plane in lee1991.planes]
    to_go = [m.duration - m.time_at(s) for m, s in zip(lee1991.fastest, stations, strict=True)]
    signs = set()
    for _ in range(200):
        lam = random.uniform(0.0, 1.0, 2) * lengths
        env.simulation.lam[:], env.simulation.mu[:] = lam, 0.0
        rows = env.simulation.observe()
        left = [float(np.interp(lam[k], stations[k], to_go[k])) for k in range(2)]
        waits = []
        for i, chart in ((0, lee1991.chart.swapped), (1, lee1991.chart)):  # chart: (other, own)
            j = 1 - i
            here = int(lam[i] / lengths[i] * chart.resolution)
            worst, ahead = -1.0, False
            for k in range(here, chart.resolution):
                if chart.last_column[k] >= 0:
                    border = (chart.last_column[k] + 1) * chart.step_a
                    ahead |= border > lam[j]
                    leaves = left[j] - np.interp(border, stations[j], to_go[j])
                    reaches = left[i] - np.interp(max(k * chart.step_b, lam[i]), stations[i], to_go[i])
                    worst = max(worst, (leaves - reaches) / lee1991.fastest[i].duration)
            waits.append(worst if ahead else -1.0)
            signs.add((ahead, worst > 0.0))
        for i in range(2):
            assert _entry(rows[i], "other_0.wait") == pytest.approx(min(waits[i], 1.0), abs=FLOAT32)
            assert _entry(rows[i], "other_0.lead") == pytest.approx(min(waits[1 - i], 1.0), abs=FLOAT32)
    assert len(signs) >= 3
    env.close()


def test_waiting_as_long_as_told_passes_behind(lee1991: CoordinationCell) -> None:
    """At the start ``wait`` is the start delay that the planner finds."""
    env = CoordinationEnv(lee1991, physics="ideal")
    observations, _ = env.reset()
    wait = _entry(observations["arm_1"], "other_0.wait") * lee1991.fastest[1].duration
    planned = schedule(lee1991, "delay").trajectories[1].duration - lee1991.fastest[1].duration
    assert wait == pytest.approx(planned, abs=2e-3)
    env.close()


def test_state_is_all_observations(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal")
    observations, _ = env.reset()
    np.testing.assert_array_equal(env.state(), np.concatenate([observations["arm_0"], observations["arm_1"]]))
    env.close()
