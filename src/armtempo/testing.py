"""Checks for kinds of cells, environments and policies that others write: the promises that our own tests hold ours to.

Each check raises ``AssertionError`` with what was promised, or lets the error through that came instead. They are made
for a test runner, run whole episodes and change nothing that they are given but random states.
"""

from __future__ import annotations

import copy
import json
import pickle
from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np

from armtempo.agents.kinds import KINDS, evaluate
from armtempo.errors import ActionError, ArmtempoError, InputError, RenderError, UnknownNameError
from armtempo.planners.cells import CELLS, CellBase

__all__ = ["check_cell", "check_environment", "check_kind", "check_policy"]


STEPS_BEFORE_A_COPY = 3


def check_cell(cell: CellBase[Any]) -> None:
    """Check what holds of every cell: it is known by its kind, certified, never copied, and the same after pickling.

    Args:
        cell: A built cell of any kind.
    """
    kind = cell.kind
    assert CELLS.get(kind) is type(cell), f"CELLS[{kind!r}] is not {type(cell).__name__}"
    cell.certify()
    assert copy.deepcopy(cell) is cell, "a deep copy of a cell is the cell: nothing in it changes"
    assert cell.ticks_per_period >= 1
    assert abs(cell.ticks_per_period * cell.physics_tick - cell.control_period) <= 1e-9 * cell.control_period
    again = pickle.loads(pickle.dumps(cell))  # noqa: S301 (our own bytes)
    assert type(again) is type(cell)
    assert again.config == cell.config
    assert type(cell).from_config(cell.config).name == cell.name


def check_environment(make: Callable[..., gymnasium.Env[Any, Any]], steps: int = 50) -> None:
    """Check the life of an environment of one agent: seeds, spaces, states, calls out of turn, traces, closing.

    Args:
        make: Makes a new environment; called with ``render_mode=`` and ``record=True``.
        steps: Steps of each episode that is compared, at most.
    """
    one, other = make(record=True), make(record=True)
    _refuses(ActionError, lambda: one.step(one.action_space.sample()), "a step before the first reset")
    assert _episode(one, 3, steps) == _episode(other, 3, steps), "the same seed gives the same episode"
    _check_state(one, other, steps)
    first, _ = one.reset(seed=1)
    second, _ = one.reset(seed=1)
    assert first is not second, "observations are new arrays"
    np.testing.assert_array_equal(first, second)
    _check_trace(getattr(one, "trace"))  # noqa: B009 (gymnasium.Env has none)
    _refuses(UnknownNameError, lambda: one.reset(options={"no such option": 1}), "an unknown reset option")
    _refuses(InputError, lambda: one.reset(options=[1]), "reset options that are no mapping")  # type: ignore[arg-type]
    one.reset(seed=1)
    _refuses(ActionError, lambda: one.step(np.full_like(one.action_space.sample(), np.nan)), "an action that is nan")
    for env in (one, other):
        env.close()
        env.close()
    _refuses(ActionError, lambda: one.step(one.action_space.sample()), "a step after close")
    _refuses(InputError, one.reset, "a reset after close")
    pictured = make(render_mode="rgb_array")
    pictured.reset(seed=0)
    picture: Any = pictured.render()
    assert picture.ndim == 3
    assert picture.dtype == np.uint8
    pictured.close()
    _refuses(RenderError, pictured.render, "a picture after close")


def check_policy(policy: Any, env: Any, seed: int = 0, steps: int = 50) -> None:
    """Check a policy: it acts within the action space, the same for the same seed, and leaves what it sees as it is.

    Args:
        policy: Has ``reset(seed)`` and ``act(observation, env)``.
        env: An environment that it is made for: Gymnasium's, or PettingZoo's parallel one with its dicts.
        seed: Of the episodes.
        steps: Steps of each, at most.
    """
    runs = []
    for _ in range(2):
        policy.reset(seed)
        observation, _ = env.reset(seed=seed)
        taken = []
        for _ in range(steps):
            before = copy.deepcopy(observation)
            action = policy.act(observation, env)
            assert _bits(before) == _bits(observation), "act changes nothing that it is shown"
            if isinstance(action, Mapping):
                assert set(action) == set(env.agents), "one action for every agent"
                inside = all(env.action_space(agent).contains(value) for agent, value in action.items())
            else:
                inside = env.action_space.contains(action)
            assert inside, f"{action!r} is not in the action space"
            taken.append(_bits(action))
            observation, _, terminated, truncated, _ = env.step(action)
            if _over(terminated, truncated):
                break
        runs.append(taken)
    assert runs[0] == runs[1], "the same seed gives the same actions"


def check_kind(name: str, cell: CellBase[Any], *, seed: int = 0) -> None:
    """Check a kind of cell from end to end: the cell, and its policies in an evaluation that goes to JSON and back.

    Args:
        name: The kind: a key of ``CELLS`` and of ``KINDS``.
        cell: A built cell of that kind.
        seed: Of the episodes.
    """
    assert cell.kind == name
    check_cell(cell)
    kind = KINDS[name]
    assert kind.policies
    run: Any = evaluate  # its overloads are the kinds that come with armtempo
    once, again = (run(cell, episodes=1, seed=seed, physics="ideal") for _ in range(2))
    said = json.loads(json.dumps(once.to_dict(), default=_plain))
    assert set(said["policies"]) == set(kind.usual_policies(once.options)) - set(said.get("refused", ()))
    assert once.results.keys() == again.results.keys()
    for policy, result in said["policies"].items():
        other = json.loads(json.dumps(again.to_dict(), default=_plain))["policies"][policy]
        for figure, value in result.items():
            if not figure.startswith("planning_time"):
                assert other[figure] == value, f"{figure} of {policy} differs between two runs"
    _refuses(UnknownNameError, lambda: run(cell, ["no such policy"]), "an unknown policy")
    _refuses(UnknownNameError, lambda: run(cell, no_such_option=1), "an unknown option")


def _episode(env: gymnasium.Env[Any, Any], seed: int, steps: int) -> list[bytes]:
    observation, _ = env.reset(seed=seed)
    return [_bits(observation), *_steps(env, seed, steps)]


def _steps(env: gymnasium.Env[Any, Any], seed: int, steps: int) -> list[bytes]:
    """So many under random actions, or until the episode is over."""
    env.action_space.seed(seed)
    seen = []
    for _ in range(steps):
        observation, reward, terminated, truncated, _ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation), f"{observation!r} is not in the observation space"
        assert type(terminated) is type(truncated) is bool, "terminated and truncated are Python's own bools"
        seen.append(_bits(observation) + np.float64(reward).tobytes())
        if terminated or truncated:
            break
    return seen


def _check_state(one: Any, other: Any, steps: int) -> None:
    """In the middle of an episode."""
    _episode(one, 5, STEPS_BEFORE_A_COPY)
    state, copied = one.get_state(), copy.deepcopy(one)
    went_on = _steps(one, 7, steps)
    assert _steps(copied, 7, steps) == went_on, "a deep copy goes on as the original does"
    for env in (one, other):
        env.set_state(pickle.loads(pickle.dumps(state)))  # noqa: S301 (our own bytes)
        assert _steps(env, 7, steps) == went_on, "an environment goes on from the state of one made alike"
    copied.close()


def _check_trace(trace: Any) -> None:
    assert len(trace.time) == 1, "right after a reset a trace has one row"
    for field in trace.__dataclass_fields__:
        value = getattr(trace, field)
        for array in value if isinstance(value, tuple) else (value,):
            if isinstance(array, np.ndarray):
                assert not array.flags.writeable, f"{field} of a trace can be written to"


def _refuses(error: type[ArmtempoError], what: Callable[[], object], name: str) -> None:
    try:
        what()
    except error:
        return
    raise AssertionError(f"{name} is no {error.__name__}")


def _over(terminated: object, truncated: object) -> bool:
    if isinstance(terminated, Mapping) and isinstance(truncated, Mapping):
        return all(terminated[agent] or truncated[agent] for agent in terminated)
    return bool(terminated) or bool(truncated)


def _bits(value: Any) -> bytes:
    if isinstance(value, Mapping):
        return b"".join(str(key).encode() + _bits(inner) for key, inner in sorted(value.items()))
    return np.asarray(value).tobytes()


def _plain(value: Any) -> Any:
    return value.tolist()
