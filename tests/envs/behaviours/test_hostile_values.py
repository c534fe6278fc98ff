"""Whatever stands where a number, a name or an action should be: an error of ours, in one line and at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armtempo.envs import (
    BlendTrackingEnv,
    BlendTrackingVectorEnv,
    CoordinationEnv,
    CoordinationVectorEnv,
    FeedbackIKEnv,
    FeedbackIKVectorEnv,
    ShieldParallelWrapper,
    ShieldWrapper,
    YieldingEnv,
    YieldingVectorEnv,
)
from armtempo.errors import ArmtempoError, InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell

NESTED: Any = [1]
for _ in range(30):
    NESTED = [NESTED] * 10

STRANGE = [  # right nowhere
    np.nan, np.inf, "x", "9" * 100_000, "\ud800\x1b[2J", b"x", [], [1, [2]], (1, "a"), {"a": 1}, NESTED, set(), 1j,
    object(), np.array([0.1, 0.2]), np.array(["x"]), np.array([None]), np.zeros((300, 300)), np.array([1j]),
    np.array([np.nan]), np.datetime64(1, "s"), lambda: 0,
]  # fmt: skip
NUMBERS = [-1, 1e308, 10**60, 10**6000, True]  # of no use as options

Make = Callable[..., Any]
KINDS = ("yielding", "coordination", "blend", "ik", "yielding-many", "coordination-many", "blend-many", "ik-many")
RESET_OPTIONS = {
    "yielding": ("master_late_s",),
    "coordination": ("master_late_s",),
    "blend": ("family", "curve", "shape_factor", "remaining_distance_m"),
    "ik": ("family",),
}
OPTIONS = {
    "yielding": ("disturbance", "observation_noise", "start_phase", "master_late_s", "shield_tube_m", "learner"),
    "coordination": ("mode", "friction_error", "master_late_s"),
    "blend": ("profile", "mapping", "family"),
    "ik": ("action_mode", "family"),
    "yielding-many": ("num_envs", "threads", "autoreset_mode", "others"),
    "coordination-many": ("learners", "reward"),
    "blend-many": ("family", "paths"),
    "ik-many": ("targets", "hold_periods"),
}


@pytest.fixture
def make(kind: str, lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell) -> Make:
    one: dict[str, Any] = {"physics": "ideal"}
    two: dict[str, Any] = {"num_envs": 2}
    makers: dict[str, Make] = {
        "yielding": lambda **k: YieldingEnv(lee1991, **{**one, **k}),
        "coordination": lambda **k: CoordinationEnv(lee1991, **{**one, **k}),
        "blend": lambda **k: BlendTrackingEnv(lee2006, **{**one, **k}),
        "ik": lambda **k: FeedbackIKEnv(chung, **{**one, **k}),
        "yielding-many": lambda **k: YieldingVectorEnv(**{**two, **k}, cell=lee1991),
        "coordination-many": lambda **k: CoordinationVectorEnv(lee1991, 2, **k),
        "blend-many": lambda **k: BlendTrackingVectorEnv(**{**two, **k}, cell=lee2006),
        "ik-many": lambda **k: FeedbackIKVectorEnv(**{**two, **k}, cell=chung),
    }
    return makers[kind]


def refuse(what: Callable[..., object], values: list[Any], **said: Any) -> None:
    """``what`` of each value raises an error of ours, in time."""
    for value in values:
        begin = time.perf_counter()
        with pytest.raises(ArmtempoError) as caught:
            what(value, **said)
        assert time.perf_counter() - begin < 10.0
        assert str(caught.value).isprintable()


@pytest.mark.parametrize("kind", KINDS)
def test_options_of_environments(kind: str, make: Make) -> None:
    make().close()  # plans and compiles what is kept
    for name in (*OPTIONS[kind], "max_episode_s", "model_error", "physics"):
        refuse(lambda value, name: make(**{name: value}), STRANGE + NUMBERS, name=name)
    if kind in ("yielding", "yielding-many"):
        refuse(lambda value: make(shield=value), [*STRANGE, "no", 0, 1, None])
    if kind == "yielding":
        refuse(lambda value: make(others=value), [*STRANGE, 3, True])
    if kind in ("blend-many", "ik-many"):
        name = "path_seed" if kind == "blend-many" else "target_seed"
        refuse(lambda value, name: make(**{name: value}), [*STRANGE, -1, True, 1.5, None], name=name)


@pytest.mark.parametrize("kind", KINDS)
def test_seeds_and_options_of_resets(kind: str, make: Make) -> None:
    env = make()
    refuse(lambda value: env.reset(seed=value), [*STRANGE, -1, True, 1.5, 1e308])
    refuse(lambda value: env.reset(options=value), [*STRANGE, 1, True])
    for name in RESET_OPTIONS.get(kind, ("reset_mask",)):
        refuse(lambda value, name: env.reset(options={name: value}), STRANGE + NUMBERS, name=name)
    env.reset(seed=np.int64(3))
    if kind.endswith("many"):
        refuse(lambda value: env.reset(seed=[0, value]), [*STRANGE, -1, True, 1.5])
        env.reset(seed=np.array([1, 2]))
    env.close()


@pytest.mark.parametrize("kind", KINDS)
def test_actions_that_are_none(kind: str, make: Make) -> None:
    env = make()
    env.reset(seed=0)
    refuse(env.step, [*STRANGE, None, True, {}, np.array([10**400], dtype=object)])
    if kind == "coordination":
        refuse(lambda value: env.step(dict.fromkeys(env.possible_agents, value)), [*STRANGE, None, True, 10**400])
    env.close()


@pytest.mark.parametrize("wrapper", [ShieldWrapper, ShieldParallelWrapper])
def test_shields_in_front_complain_as_environments_do(wrapper: Any, lee1991: CoordinationCell) -> None:
    kind: Any = YieldingEnv if wrapper is ShieldWrapper else CoordinationEnv
    wrapped = wrapper(kind(lee1991, physics="ideal"))
    wrapped.reset(seed=0)
    refuse(wrapped.step, [None, {}, "x", NESTED, np.array([np.nan]), [1, [2]]])
    refuse(lambda value: wrapper(wrapped.env, value), STRANGE + NUMBERS)
    refuse(wrapper, STRANGE + NUMBERS)


@pytest.mark.parametrize("kind", KINDS[4:])
def test_a_state_that_does_not_fit_changes_nothing(kind: str, make: Make, lee1991: CoordinationCell) -> None:
    env: Any = CoordinationVectorEnv([lee1991, lee1991], 4) if kind == "coordination-many" else make()
    env.reset(seed=1)
    env.step(np.full(env.action_space.shape, 0.5))
    state = env.get_state()
    env.step(np.full(env.action_space.shape, -0.5))
    before = env.get_state()
    arrays = {name: value for name, value in state.items() if isinstance(value, np.ndarray)}
    for name, array in arrays.items():
        for wrong in (None, array.tolist(), array[:0], array.astype(np.complex128)):
            with pytest.raises(InputError):
                env.set_state({**state, name: wrong})
    for name in set(state) - set(arrays):
        with pytest.raises(InputError):
            env.set_state({**state, name: [1]})
    for wrong in (None, [], {}, "x", dict(list(state.items())[:-1])):
        with pytest.raises(InputError):
            env.set_state(wrong)
    after = env.get_state()
    for name in arrays:
        np.testing.assert_array_equal(after[name], before[name])
    env.close()
