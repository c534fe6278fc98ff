"""Dwells and stops in episodes: to a tick in both physics, whatever is commanded or disturbed; shielded, no harm."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from armtempo.arrays import Floats
from armtempo.envs import CoordinationEnv
from armtempo.envs.bodies import Physics
from armtempo.planners import CoordinationCell
from armtempo.planners.charts import after
from armtempo.planners.topp import Mode

ENGINES: tuple[Physics, ...] = ("bullet", "ideal")


def places(env: CoordinationEnv, seed: int, greedy: bool) -> tuple[Floats, dict[str, object]]:
    """Lambda of every arm (A, ticks) in an episode, under full or random commands; and the last info."""
    generator = np.random.default_rng(seed)
    env.reset(seed=seed)
    infos: dict[str, dict[str, object]] = {}
    while env.agents:
        share = np.ones(1) if greedy else generator.uniform(-1.0, 1.0, 1)
        observations, _, _, _, infos = env.step({agent: share.astype(np.float32) for agent in env.agents})
        assert all(np.isfinite(one).all() and np.abs(one).max() <= 1.0 for one in observations.values())
    return env.trace.lam.T, next(iter(infos.values()))


@pytest.mark.parametrize("physics", ENGINES)
@pytest.mark.parametrize("disturbance", [None, "all-slow", "all-stop-and-go"])
def test_a_dwell_takes_its_time_to_a_tick(
    there_and_back: CoordinationCell, physics: Physics, disturbance: str | None
) -> None:
    env = CoordinationEnv(there_and_back, physics=physics, shield=True, disturbance=disturbance, record=True)
    for seed in (1, 2):
        lam, info = places(env, seed, greedy=physics == "bullet")
        assert info["is_success"]
        for own, path in zip(lam, there_and_back.paths, strict=True):
            for part in path.standing:
                if part.exact:
                    inside = ((part.start < own) & (own < part.stop)).sum() * env.cell.physics_tick
                    assert inside == pytest.approx(part.seconds, abs=1.001 * env.cell.physics_tick)


@pytest.mark.parametrize("mode", get_args(Mode))
@pytest.mark.parametrize("disturbance", [None, "all-any"])
def test_shielded_episodes_do_no_harm(there_and_back: CoordinationCell, mode: Mode, disturbance: str | None) -> None:
    env = CoordinationEnv(there_and_back, physics="ideal", mode=mode, shield=True, disturbance=disturbance, record=True)
    for seed in range(40):
        _, info = places(env, seed, greedy=seed % 2 == 0)
        assert not info["violation"]
        assert info["is_success"] or (mode == "acceleration" and seed % 2)  # random ones may run out of time


@pytest.mark.parametrize("disturbance", [None, "all-stop-and-go"])
def test_the_shield_keeps_to_rules(there_and_back: CoordinationCell, disturbance: str | None) -> None:
    one, other = (path.border for path in there_and_back.paths)  # type: ignore[attr-defined]
    rule = after(1, other[1], 0, one[3], 1.0, "'slave' may not stand before 'master' has stood")
    env = CoordinationEnv(
        replace(there_and_back, exclusions=(rule,)), physics="ideal", shield=True, disturbance=disturbance, record=True
    )
    generator = np.random.default_rng(0)
    for seed in range(20):
        env.reset(seed=seed)
        while env.agents:
            share = [1.0] if seed % 2 else generator.uniform(-1.0, 1.0, 1)
            env.step({agent: np.array(share, dtype=np.float32) for agent in env.agents})
        assert np.isfinite(env.trace.arrival).all()
        first, second = env.trace.lam.T
        assert not ((first < rule.part_a[1]) & (second > rule.part_b[0])).any()
        assert all((np.diff(own) >= 0.0).all() for own in (first, second))


@pytest.mark.parametrize("physics", ENGINES)
def test_without_a_shield_a_broken_rule_ends_the_episode(there_and_back: CoordinationCell, physics: Physics) -> None:
    """It counts as being too close does, so nobody is quicker by it."""
    rule = after(1, 0.03, 0, 0.5, 1.0, "'slave' waits near its start for 'master'")
    ruled = replace(there_and_back, exclusions=(rule,))
    for record in (False, True):
        env = CoordinationEnv(ruled, physics=physics, record=record)
        env.reset(seed=0)
        speeds = (0.3, 1.0)  # the slave is early
        while env.agents:
            _, rewards, terminations, _, infos = env.step(
                {agent: np.array([speed], dtype=np.float32) for agent, speed in zip(env.agents, speeds, strict=True)}
            )
        assert all(terminations.values())
        assert all(info["violation"] and not info["is_success"] for info in infos.values())
        assert max(rewards.values()) < -1.0
        assert 0.0 < infos["arm_1"]["lam"] - rule.part_b[0] < 0.01
        assert infos["arm_1"]["min_clearance_m"] > ruled.d_min
