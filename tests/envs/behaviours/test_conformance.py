"""Gymnasium's, Stable-Baselines3's and PettingZoo's own checks, over physics and mode; warnings are errors here too."""

from __future__ import annotations

import itertools
import json
from typing import Any

import gymnasium
import numpy as np
import pettingzoo
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, render_test, seed_test

import armtempo
from armtempo.envs import (
    MODES,
    PHYSICS,
    BlendTrackingEnv,
    CoordinationEnv,
    FeedbackIKEnv,
    Physics,
    ShieldParallelWrapper,
    ShieldWrapper,
    YieldingEnv,
    coordination_v0,
)
from armtempo.envs.bodies._bullet_scene import BulletScene
from armtempo.planners import BlendCell, CoordinationCell, IKCell
from armtempo.planners.topp import Mode

assert armtempo.__version__  # importing armtempo is what registers the environments
BOTH = list(itertools.product(PHYSICS, MODES))
PRIORITY: dict[str, Any] = {"action": "speed+priority", "shield": True}


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    """The checkers open every declared render mode."""
    monkeypatch.delenv("DISPLAY", raising=False)
    for env in (YieldingEnv, CoordinationEnv, BlendTrackingEnv, FeedbackIKEnv):
        monkeypatch.setitem(env.metadata, "render_modes", ["rgb_array"])


def _checked_yielding(
    cell: CoordinationCell, physics: Physics, mode: Mode, render_mode: str | None = None
) -> YieldingEnv:
    env = gymnasium.make("armtempo/Yielding-v0", cell=cell, physics=physics, mode=mode, render_mode=render_mode)
    inner = env.unwrapped
    assert isinstance(inner, YieldingEnv)
    return inner


@pytest.mark.parametrize(("physics", "mode"), BOTH)
def test_gymnasium_check_env(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    env = _checked_yielding(lee1991, physics, mode)
    assert env.spec is not None
    check_env(env, skip_render_check=(physics, mode) != BOTH[0])
    env.close()


@pytest.mark.parametrize(("physics", "mode"), BOTH)
def test_stable_baselines3_check_env(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    env = _checked_yielding(lee1991, physics, mode)
    sb3_check_env(env, warn=True)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_actions_with_a_priority_pass_all_checkers(lee1991: CoordinationCell, physics: Physics) -> None:
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    env = gymnasium.make("armtempo/Yielding-v0", cell=lee1991, physics=physics, **PRIORITY)
    assert env.spec is not None
    check_env(env.unwrapped, skip_render_check=True)
    sb3_check_env(env.unwrapped, warn=True)
    env.close()
    parallel_api_test(CoordinationEnv(lee1991, physics=physics, **PRIORITY), num_cycles=100)
    api_test(coordination_v0.env(cell=lee1991, physics=physics, **PRIORITY), num_cycles=100)
    wrapped = ShieldParallelWrapper(CoordinationEnv(lee1991, physics=physics), action="speed+priority")
    parallel_api_test(wrapped, num_cycles=100)
    sb3_check_env(ShieldWrapper(YieldingEnv(lee1991, physics=physics), action="speed+priority"), warn=True)


@pytest.mark.parametrize("family", ["given", "line-arc"])
@pytest.mark.parametrize("physics", PHYSICS)
def test_blend_tracking_passes_both_checkers(lee2006: BlendCell, physics: Physics, family: str) -> None:
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    env = gymnasium.make("armtempo/BlendTracking-v0", cell=lee2006, physics=physics, family=family)
    assert env.spec is not None
    check_env(env.unwrapped, skip_render_check=(physics, family) != ("bullet", "line-arc"))
    sb3_check_env(env.unwrapped, warn=True)
    env.close()


@pytest.mark.parametrize(("physics", "action_mode"), [("bullet", "speeds"), ("ideal", "gains")])
def test_feedback_ik_passes_both_checkers(chung: IKCell, physics: Physics, action_mode: str) -> None:
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    env = gymnasium.make(
        "armtempo/FeedbackIK-v0", cell=chung, physics=physics, action_mode=action_mode, family="smooth"
    )
    assert env.spec is not None
    check_env(env.unwrapped, skip_render_check=physics != "bullet")
    sb3_check_env(env.unwrapped, warn=True)
    env.close()


@pytest.mark.parametrize(("physics", "mode"), BOTH)
def test_pettingzoo_parallel_api(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    env = CoordinationEnv(lee1991, physics=physics, mode=mode)
    parallel_api_test(env, num_cycles=200)
    env.close()


@pytest.mark.parametrize(("physics", "mode"), BOTH)
def test_pettingzoo_aec_api(lee1991: CoordinationCell, physics: Physics, mode: Mode) -> None:
    env = coordination_v0.env(cell=lee1991, physics=physics, mode=mode)
    api_test(env, num_cycles=200)
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_pettingzoo_seed(lee1991: CoordinationCell, physics: Physics) -> None:
    seed_test(lambda: coordination_v0.env(cell=lee1991, physics=physics), num_cycles=60)


def test_pettingzoo_render(lee1991: CoordinationCell) -> None:
    def make(render_mode: str) -> object:
        return coordination_v0.env(cell=lee1991, physics="ideal", render_mode=render_mode)

    render_test(make)  # pyright: ignore[reportArgumentType] (it passes the mode, whatever its annotation says)


def test_pettingzoo_make() -> None:
    env = pettingzoo.make("parallel", "armtempo/Coordination-v0", physics="ideal", mode="acceleration")
    observations, _ = env.reset(seed=0)
    assert list(observations) == ["arm_0", "arm_1"]
    env.close()


def test_gymnasium_make_by_name_only() -> None:
    env = gymnasium.make("armtempo/Yielding-v0", physics="ideal", master_late_s=(0.0, 0.1))
    env.reset(seed=0)
    assert env.spec is not None
    assert json.loads(env.spec.to_json())["id"] == "armtempo/Yielding-v0"
    env.close()
    blend = gymnasium.make("armtempo/BlendTracking-v0", physics="ideal", profile="limit-aware")
    assert blend.spec is not None
    assert json.loads(blend.spec.to_json())["id"] == "armtempo/BlendTracking-v0"
    blend.close()
    ik = gymnasium.make("armtempo/FeedbackIK-v0", physics="ideal", action_mode="gains", max_episode_s=0.1)
    assert ik.spec is not None
    assert json.loads(ik.spec.to_json())["id"] == "armtempo/FeedbackIK-v0"
    ik.close()


def test_many_environments_in_one_vector(lee1991: CoordinationCell) -> None:
    envs = gymnasium.make_vec(
        "armtempo/Yielding-v0", num_envs=3, vectorization_mode="sync", cell=lee1991, physics="ideal", master_late_s=0.05
    )
    envs.reset(seed=0)
    for _ in range(150):  # past the end of episodes
        observations, *_ = envs.step(envs.action_space.sample())
        assert observations.shape == (3, 21)
    envs.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_close_twice(lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell, physics: Physics) -> None:
    for env in (
        YieldingEnv(lee1991, physics=physics),
        CoordinationEnv(lee1991, physics=physics),
        BlendTrackingEnv(lee2006, physics=physics),
        FeedbackIKEnv(chung, physics=physics),
    ):
        env.close()
        env.close()
        scene = env.simulation._controller.scene
        assert (scene is None) == (physics == "ideal")
        assert not isinstance(scene, BulletScene) or scene.client < 0


@pytest.mark.parametrize("physics", PHYSICS)
def test_agents_types_and_keys(lee1991: CoordinationCell, physics: Physics) -> None:
    env = CoordinationEnv(lee1991, physics=physics, master_late_s=0.1)
    env.reset(seed=3)
    assert env.observation_space("arm_0") is env.observation_space("arm_0")
    while env.agents:
        before = env.agents[:]
        outcome = env.step({agent: np.ones(1, dtype=np.float32) for agent in before})
        for part in outcome:
            assert list(part) == before
        assert all(type(value) is float for value in outcome[1].values())
        assert all(type(value) is bool for value in [*outcome[2].values(), *outcome[3].values()])
        assert env.agents == [agent for agent in before if not (outcome[2][agent] or outcome[3][agent])]
    env.close()
