"""What episodes are worth."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from armtempo.envs import MODES, PHYSICS, CoordinationEnv, Physics, YieldingEnv
from armtempo.envs.common._rewards import collision_reward, progress_reward, time_reward
from armtempo.planners import CoordinationCell
from armtempo.planners.topp import Mode

LATE = 0.15  # at full speed of both, no violation


@pytest.mark.parametrize(("physics", "mode"), list(itertools.product(PHYSICS, MODES)))
def test_an_episode_is_worth_one_path_minus_its_time(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    env = CoordinationEnv(lee1991, physics=physics, mode=mode, master_late_s=LATE)
    env.reset(seed=0)
    totals, arrivals = dict.fromkeys(env.agents, 0.0), {}
    while env.agents:
        actions = {agent: np.array([0.9], dtype=np.float32) for agent in env.agents}
        _, rewards, _, _, infos = env.step(actions)
        for agent, info in infos.items():
            assert rewards[agent] == pytest.approx(sum(info["reward_terms"].values()), abs=1e-15)
            assert set(info["reward_terms"]) == {"progress", "time", "collision"}
            totals[agent] += rewards[agent]
            if "arrival_s" in info:
                arrivals[agent] = info["arrival_s"]
                assert info["is_success"] is True
    assert set(arrivals) == set(totals)
    for agent, total in totals.items():
        assert total == pytest.approx(1.0 - arrivals[agent] / lee1991.sequential_makespan, abs=1e-12)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_collision_costs_two_and_the_rest_of_the_path(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics)
    env.reset()
    while env.agents:
        _, rewards, terminations, _, infos = env.step({agent: np.ones(1, dtype=np.float32) for agent in env.agents})
    assert terminations == {"arm_0": True, "arm_1": True}
    for i, agent in enumerate(("arm_0", "arm_1")):
        covered = infos[agent]["lam"] / lee1991.paths[i].length
        assert infos[agent]["reward_terms"]["collision"] == pytest.approx(-(3.0 - covered), abs=1e-12)
        assert rewards[agent] < -2.0
        assert infos[agent]["violation"] is True
        assert infos[agent]["is_success"] is False
    env.close()


def test_colliding_is_worse_than_stopping_and_letting_the_other_pass() -> None:
    """From any instant: what is left after a collision against going on and arriving two sequential times later."""
    reference, length = 0.57, 0.47
    for position in np.linspace(0.0, length, 11):
        going_on = progress_reward(length - position, length) + time_reward(2.0 * reference, reference)
        assert collision_reward(position, length) <= going_on


def test_a_time_out_has_no_collision_term(lee1991: CoordinationCell) -> None:
    env = YieldingEnv(lee1991, physics="ideal")
    env.reset()
    total, truncated = 0.0, False
    while not truncated:
        _, reward, terminated, truncated, info = env.step(np.array([-1.0], dtype=np.float32))
        assert not terminated
        assert info["reward_terms"]["collision"] == 0.0
        total += reward
    assert total == pytest.approx(-info["time_s"] / lee1991.sequential_makespan, abs=1e-9)
    assert info["is_success"] is False
    env.close()
