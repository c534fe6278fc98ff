"""State is a value: copies, other processes and look-ahead go on bit for bit, and leave the original as it was."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from armtempo.envs import (
    PHYSICS,
    BlendTrackingEnv,
    BlendTrackingVectorEnv,
    CoordinationEnv,
    CoordinationVectorEnv,
    FeedbackIKEnv,
    FeedbackIKVectorEnv,
    Physics,
    ShieldParallelWrapper,
    ShieldWrapper,
    YieldingEnv,
    YieldingVectorEnv,
)
from armtempo.errors import ActionError, InputError
from armtempo.planners import CoordinationCell, build_cell, load_cell
from armtempo.state import STATE_FORMAT

DISTURBED: dict[str, Any] = {"disturbance": "any", "observation_noise": 0.02}
WAYS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "yielding": (YieldingEnv, {}),
    "yielding, shield, disturbed": (YieldingEnv, {"shield": True, **DISTURBED}),
    "yielding behind vci": (YieldingEnv, {"others": "vci"}),
    "yielding behind delay, acceleration": (YieldingEnv, {"others": "delay", "mode": "acceleration"}),
    "coordination": (CoordinationEnv, {"cell": "mixed-priority", "mode": "acceleration"}),
    "coordination, shield, disturbed": (CoordinationEnv, {"cell": "mixed-priority", "shield": True, **DISTURBED}),
    "blend": (BlendTrackingEnv, {}),
    "blend, the paper's, paths drawn": (BlendTrackingEnv, {"family": "zigzag", "mapping": "paper"}),
    "blend, limit-aware": (BlendTrackingEnv, {"profile": "limit-aware"}),
    "ik": (FeedbackIKEnv, {"family": "near-singular"}),
    "ik by gains": (FeedbackIKEnv, {"action_mode": "gains"}),
}
STEPS = 12


@pytest.fixture(params=PHYSICS)
def physics(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(params=list(WAYS))
def make(request: pytest.FixtureRequest, physics: str) -> Callable[..., Any]:
    """Makes an environment of a kind with some of its options."""
    kind, options = WAYS[request.param]
    wrong = {"model_error": 0.05} if physics == "bullet" and kind is not FeedbackIKEnv else {}
    given = {**wrong, **options, "physics": physics}
    if kind in (YieldingEnv, CoordinationEnv):
        given["cell"] = _cell(given.get("cell", "lee1991"))
    return lambda **more: kind(**given, **more)


@cache
def _cell(name: str) -> CoordinationCell:
    cell = load_cell(name)
    assert isinstance(cell, CoordinationCell)
    return cell


def run(env: Any, steps: int, seed: int = 5) -> list[bytes]:
    """The bits of so many steps under random actions; begins anew where an episode ends."""
    random, seen = np.random.default_rng(seed), []
    for _ in range(steps):
        if isinstance(env.unwrapped, CoordinationEnv):
            if not env.agents:
                seen.append(_bits(env.reset()[0]))
            names = env.unwrapped.possible_agents
            actions = {agent: random.uniform(-1.0, 1.0, 1).astype(np.float32) for agent in names}
            *outcome, infos = env.step(actions)
        else:
            shape = env.action_space.shape
            *outcome, infos = env.step(random.uniform(-1.0, 1.0, shape).astype(np.float32))
            if outcome[2] or outcome[3]:
                seen.append(_bits(env.reset()[0]))
        seen.append(_bits([*outcome, infos]))
    return seen


def _bits(value: Any) -> bytes:
    """Of all numbers and words in it. Pickles of equal things differ in what they share."""
    if isinstance(value, dict):
        return b"".join(str(key).encode() + _bits(part) for key, part in value.items())
    if isinstance(value, tuple | list):
        return b"".join(map(_bits, value))
    return np.asarray(value).tobytes() if isinstance(value, np.ndarray | np.generic) else repr(value).encode()


def begun(make: Callable[..., Any], **options: Any) -> Any:
    env = make(**options)
    env.reset(seed=11)
    run(env, STEPS // 2, seed=1)
    return env


@pytest.mark.parametrize("way", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_copy_goes_on_as_the_original_and_neither_disturbs_the_other(
    make: Callable[..., Any], way: Callable[[Any], Any]
) -> None:
    untouched = begun(make)
    right = run(untouched, 3 * STEPS)
    env = begun(make)
    copied = way(env)
    assert run(copied, STEPS, seed=9) != right[:STEPS]  # elsewhere, and then
    copied.reset(seed=3)
    copied.close()
    second = way(env)
    assert run(env, 3 * STEPS) == right
    assert run(second, 3 * STEPS) == right
    for one in (untouched, env, second):
        one.close()


def test_look_ahead_leaves_no_trace(make: Callable[..., Any]) -> None:
    env = begun(make, record=True)
    state = env.get_state()
    kept = copy.deepcopy(state)
    first = run(env, 2 * STEPS)
    for _ in range(2):
        env.set_state(state)
        assert run(env, 2 * STEPS) == first
    assert pickle.dumps(state) == pickle.dumps(kept), "a state is not written to"
    env.set_state(state)
    rows = len(env.trace.time)
    env.step(_any_action(env))
    assert len(env.trace.time) > rows
    other = make(record=True)  # never reset
    other.set_state(pickle.loads(pickle.dumps(state)))
    assert run(other, 2 * STEPS) == first
    env.close()
    other.close()


def _any_action(env: Any) -> Any:
    if isinstance(env, CoordinationEnv):
        return {agent: np.zeros(1, dtype=np.float32) for agent in env.possible_agents}
    return np.zeros(env.action_space.shape, dtype=np.float32)


def test_another_process_goes_on_with_the_same_bits() -> None:
    """A pickled environment, and a state for one that is made there; with dry friction, which PyBullet solves for."""
    ways: list[tuple[Any, dict[str, Any]]] = [
        (CoordinationEnv, {"cell": "panda-pair", "shield": True, "friction_error": 0.1}),
        (BlendTrackingEnv, {"family": "zigzag"}),
        (FeedbackIKEnv, {"family": "near-singular", "model_error": 0.02}),
    ]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        for kind, options in ways:
            env = kind(physics="bullet", **options)
            env.reset(seed=2)
            run(env, 4)
            state, packed = env.get_state(), pickle.dumps(env)
            arguments = (kind, {"physics": "bullet", **options}, pickle.dumps(state), packed)
            there = pool.apply(_elsewhere, arguments)
            assert there == (run(env, 6),) * 2
            env.close()


def _elsewhere(kind: Any, options: dict[str, Any], state: bytes, packed: bytes) -> tuple[list[bytes], list[bytes]]:
    copied, other = pickle.loads(packed), kind(**options)
    other.set_state(pickle.loads(state))
    return run(copied, 6), run(other, 6)


@pytest.mark.parametrize("physics", PHYSICS)
def test_shields_in_front_are_saved_with_what_is_behind_them(physics: Physics) -> None:
    for make in (
        lambda: ShieldWrapper(YieldingEnv(_cell("lee1991"), physics=physics)),
        lambda: ShieldParallelWrapper(CoordinationEnv(_cell("mixed-priority"), physics=physics)),
    ):
        env: Any = make()
        env.reset(seed=0)
        run(env, 8, seed=1)
        state, copied = env.get_state(), copy.deepcopy(env)
        first = run(env, STEPS)
        assert run(copied, STEPS) == first
        env.set_state(state)
        assert run(env, STEPS) == first
        env.close()


def test_a_state_says_what_it_is_of_and_fits_nothing_else() -> None:
    lee1991 = _cell("lee1991")
    env = YieldingEnv(lee1991, physics="ideal")
    with pytest.raises(InputError, match="no state before a reset"):
        env.get_state()
    env.reset(seed=0)
    env.step(_any_action(env))
    state = env.get_state()
    assert state["format"] == STATE_FORMAT
    assert (state["environment"], state["cell"]) == ("YieldingEnv", "lee1991")
    for wrong, said in (
        ({"format": "armtempo-state-0"}, "the state's format is 'armtempo-state-0'"),
        ({"environment": "CoordinationEnv"}, "environment"),
        ({"cell": "planar-four"}, "cell is 'planar-four', and here it is 'lee1991'"),
        ({"episode.charged": "x"}, "'episode.charged'"),
        ({"episode.simulation.episodes.lam": np.zeros((1, 3))}, "'episode.simulation.episodes.lam'"),
        ({"surplus": 1}, "'surplus'"),
    ):
        before = pickle.dumps(env.get_state())
        with pytest.raises(InputError, match="the state's") as error:
            env.set_state({**state, **wrong})
        assert said in str(error.value)
        assert pickle.dumps(env.get_state()) == before, "nothing changes"
    for name in state:
        with pytest.raises(InputError):
            env.set_state({key: value for key, value in state.items() if key != name})
    for other in (
        YieldingEnv(lee1991, physics="ideal", shield=True),
        YieldingEnv(lee1991, physics="bullet"),
        YieldingEnv(lee1991, physics="ideal", learner="master"),
        YieldingEnv(lee1991, physics="ideal", others="vci"),
        YieldingEnv(lee1991, physics="ideal", record=True),
        YieldingEnv(build_cell(lee1991.config.model_copy(update={"torque_reserve": 0.3})), physics="ideal"),
    ):
        with pytest.raises(InputError, match="the state's"):
            other.set_state(state)
        other.close()
    narrow, wide = (ShieldWrapper(YieldingEnv(lee1991, physics="ideal"), tube_m=tube) for tube in (0.0, 0.001))
    narrow.reset(seed=0)
    with pytest.raises(InputError, match="the state's tube"):
        wide.set_state(narrow.get_state())
    next_step, same_step = (YieldingVectorEnv(2, lee1991, autoreset_mode=mode) for mode in ("NextStep", "SameStep"))
    next_step.reset(seed=0)
    with pytest.raises(InputError, match="the state's autoreset_mode"):
        same_step.set_state(next_step.get_state())
    env.close()
    with pytest.raises(InputError, match="is closed"):
        env.get_state()
    with pytest.raises(InputError, match="is closed"):
        env.set_state(state)


VECTORS: dict[str, Callable[[], Any]] = {
    "yielding": lambda: YieldingVectorEnv(3, _cell("lee1991"), shield=True, **DISTURBED),
    "yielding behind vci": lambda: YieldingVectorEnv(3, _cell("lee1991"), others="vci"),
    "yielding behind delay": lambda: YieldingVectorEnv(3, _cell("lee1991"), others="delay", autoreset_mode="SameStep"),
    "cells": lambda: CoordinationVectorEnv([_cell("lee1991"), _cell("mixed-priority")], 4, threads=2, **DISTURBED),
    "blend": lambda: BlendTrackingVectorEnv(3, family="zigzag", paths=2, max_episode_s=0.2),
    "blend, a path for each": lambda: BlendTrackingVectorEnv(2, family="line-arc", max_episode_s=0.2, threads=2),
    "ik": lambda: FeedbackIKVectorEnv(4, family="smooth", targets=2, max_episode_s=0.1, threads=2),
    "ik, a target for each": lambda: FeedbackIKVectorEnv(2, family="near-singular", max_episode_s=0.1),
}


@pytest.mark.parametrize("name", list(VECTORS))
def test_many_at_once_are_values_too(name: str) -> None:
    env, other = VECTORS[name](), VECTORS[name]()
    with pytest.raises(InputError, match="no state before a reset"):
        env.get_state()
    env.reset(seed=4)
    _run_many(env, 4, 1)
    state, copied, sent = env.get_state(), copy.deepcopy(env), pickle.loads(pickle.dumps(env))
    first = _run_many(env, 30, 2)
    for _ in range(2):
        env.set_state(state)
        assert _run_many(env, 30, 2) == first
    other.set_state(pickle.loads(pickle.dumps(state)))
    for one in (other, copied, sent):
        assert _run_many(one, 30, 2) == first
        one.close()
    with pytest.raises(InputError, match="the state's environment is 'x'"):
        env.set_state({**state, "environment": "x"})
    env.close()


def _run_many(env: Any, steps: int, seed: int) -> list[bytes]:
    random = np.random.default_rng(seed)
    return [_bits(env.step(random.uniform(-1.0, 1.0, env.action_space.shape))) for _ in range(steps)]


@pytest.mark.parametrize("physics", PHYSICS)
def test_an_episode_that_was_over_is_over_again(physics: Physics) -> None:
    env = CoordinationEnv(_cell("lee1991"), physics=physics, max_episode_s=0.03)
    env.reset(seed=0)
    start = env.get_state()
    while env.agents:
        env.step(_any_action(env))
    end = env.get_state()
    env.set_state(start)
    assert env.agents == ["arm_0", "arm_1"]
    env.step(_any_action(env))
    env.set_state(end)
    assert not env.agents
    with pytest.raises(ActionError, match="the episode is over"):
        env.step(_any_action(env))
    env.close()


def test_a_copy_draws_pictures_of_its_own() -> None:
    env = YieldingEnv(_cell("lee1991"), physics="ideal", render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    copied = copy.deepcopy(env)
    env.close()
    np.testing.assert_array_equal(copied.render(), picture)
    copied.close()


def test_copies_and_states_are_quick() -> None:
    """On the slow side: machines are busy. ``make bench`` measures."""
    env = CoordinationEnv(_cell("mixed-priority"), physics="bullet", shield=True)
    env.reset(seed=0)
    run(env, 4)
    copies, states = [], []
    for _ in range(10):
        began = time.perf_counter()
        copied = copy.deepcopy(env)
        copies.append(time.perf_counter() - began)
        copied.close()
        state = env.get_state()
        began = time.perf_counter()
        env.set_state(state)
        states.append(time.perf_counter() - began)
    assert min(copies) < 0.1
    assert min(states) < 5e-3
    env.close()
