"""Vectors of FeedbackIK and BlendTracking as SB3 sees them: Monitor's returns, exact continuation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")

from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from armtempo.agents import VectorVecEnv
from armtempo.envs import BlendTrackingEnv, BlendTrackingVectorEnv, FeedbackIKEnv, FeedbackIKVectorEnv
from armtempo.errors import InputError
from armtempo.planners import BlendCell, IKCell

pytestmark = pytest.mark.rl
OPTIONS: dict[str, Any] = {"action_mode": "gains", "family": "smooth", "max_episode_s": 0.3}


def vector(cell: IKCell, count: int, *, scale: float = 1.0, **options: Any) -> VectorVecEnv:
    made = FeedbackIKVectorEnv(count, cell, autoreset_mode=AutoresetMode.SAME_STEP, **{**OPTIONS, **options})
    return VectorVecEnv(made, scale)


def steps(env: Any, count: int, seed: int = 5, size: int = 4) -> list[Any]:
    random = np.random.default_rng(seed)
    return [env.step(random.uniform(-1.0, 1.0, (env.num_envs, size)).astype(np.float32)) for _ in range(count)]


def test_it_is_stable_baselines_own_vector_of_single_ones(chung: IKCell) -> None:
    ours = vector(chung, 3)
    theirs = DummyVecEnv([lambda: Monitor(FeedbackIKEnv(chung, physics="ideal", **OPTIONS))] * 3)
    for env in (ours, theirs):
        env.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    np.testing.assert_array_equal(ours.reset(), theirs.reset())  # goes on drawing
    ended = 0
    for one, other in zip(steps(ours, 65), steps(theirs, 65), strict=True):
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
        for e in np.flatnonzero(one[2]):
            ended += 1
            mine, yours = one[3][e], other[3][e]
            np.testing.assert_array_equal(mine["terminal_observation"], yours["terminal_observation"])
            assert mine["TimeLimit.truncated"]
            assert yours["TimeLimit.truncated"]
            assert mine["is_success"] == yours["is_success"]
            assert mine["episode"]["r"] == pytest.approx(yours["episode"]["r"], abs=1e-6)
            assert mine["episode"]["l"] == yours["episode"]["l"] == 30
    assert ended == 6


def test_what_is_learnt_from_is_scaled_and_what_is_told_is_not(chung: IKCell) -> None:
    plain, scaled = vector(chung, 2, targets=2), vector(chung, 2, targets=2, scale=16.0)
    for env in (plain, scaled):
        env.seed(2)
        env.reset()
    for one, other in zip(steps(plain, 30), steps(scaled, 30), strict=True):
        np.testing.assert_array_equal(16.0 * np.asarray(one[1]), other[1])
    assert one[2].all()
    assert one[3][0]["episode"]["r"] == other[3][0]["episode"]["r"] < 0.0


def test_it_goes_on_from_its_state_to_the_last_bit(chung: IKCell) -> None:
    env, other = (vector(chung, 4, targets=3, hold_periods=7) for _ in range(2))
    env.seed(1)
    env.reset()
    steps(env, 6)
    state = env.get_state()
    assert state is not None
    after = steps(env, 12, 6)
    other.reset()
    other.set_state(state)
    for one, two in zip(after, steps(other, 12, 6), strict=True):
        for a, b in zip(one[:3], two[:3], strict=True):
            np.testing.assert_array_equal(a, b)
    assert [info["episode"]["r"] for step in after for info in step[3] if "episode" in info]


def test_ppo_learns_on_it_and_the_other_autoreset_is_refused(chung: IKCell) -> None:
    env = vector(chung, 8, targets=2, hold_periods=5)
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=64, n_epochs=1, seed=0, device="cpu")
    model.learn(256)
    assert model.ep_info_buffer
    assert env.env_is_wrapped(Monitor) == [False] * 8
    assert env.get_attr("render_mode") == [None] * 8
    env.close()
    with pytest.raises(InputError, match="SAME_STEP"):
        VectorVecEnv(FeedbackIKVectorEnv(2, chung, **OPTIONS))
    with pytest.raises(InputError, match="no shield"):
        VectorVecEnv(FeedbackIKVectorEnv(2, chung, autoreset_mode="SameStep", **OPTIONS), cut_penalty=0.5)


def test_it_has_no_state_where_tasks_are_drawn_for_every_episode(chung: IKCell) -> None:
    """Checkpoints begin the episodes anew then."""
    env = vector(chung, 2)
    env.reset()
    assert env.get_state() is None


def test_blend_tracking_is_stable_baselines_own_vector_of_single_ones(lee2006: BlendCell) -> None:
    options: dict[str, Any] = {"family": "line-arc", "max_episode_s": 0.2}
    ours = VectorVecEnv(BlendTrackingVectorEnv(2, lee2006, autoreset_mode="SameStep", **options))
    theirs = DummyVecEnv([lambda: Monitor(BlendTrackingEnv(lee2006, physics="ideal", **options))] * 2)
    for env in (ours, theirs):
        env.seed(11)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    for one, other in zip(steps(ours, 45, size=1), steps(theirs, 45, size=1), strict=True):
        for a, b in zip(one[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
        for e in np.flatnonzero(one[2]):
            mine, yours = one[3][e], other[3][e]
            np.testing.assert_array_equal(mine["terminal_observation"], yours["terminal_observation"])
            assert mine["TimeLimit.truncated"] == yours["TimeLimit.truncated"]
            assert mine["episode"]["r"] == pytest.approx(yours["episode"]["r"], abs=1e-6)
