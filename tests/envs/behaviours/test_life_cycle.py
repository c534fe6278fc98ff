"""Environments of every kind are made, reset, stepped, drawn and closed alike, and say the same of what is wrong."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import fields
from inspect import cleandoc
from typing import Any, NamedTuple, get_type_hints

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box

from armtempo.envs import (
    BLEND_ENTRIES,
    COORDINATION_ENTRIES,
    PHYSICS,
    BlendOptions,
    BlendTrackingEnv,
    CoordinationEnv,
    CoordinationOptions,
    Entry,
    FeedbackIKEnv,
    IKOptions,
    Physics,
    YieldingEnv,
    ik_entries,
    observation_table,
)
from armtempo.envs.blend import BlendKeywords
from armtempo.envs.common import options_of
from armtempo.envs.coordination import CoordinationKeywords
from armtempo.envs.ik import IKKeywords
from armtempo.errors import ActionError, ArmtempoError, ConfigError, InputError, RenderError, UnknownNameError
from armtempo.planners import BlendCell, CoordinationCell, IKCell


class Kind(NamedTuple):
    """A kind of environment."""

    make: Callable[..., Any]
    cell: str
    """That it is for."""
    other: str
    """One of another kind."""
    said: str
    """Of that other one."""
    options: type[Any]
    keywords: type[Any]
    entries: tuple[Entry, ...]
    reset_option: str
    """One of those that it knows, with its last letter missing."""


SEVERAL = (CoordinationOptions, CoordinationKeywords, COORDINATION_ENTRIES, "master_late_")
NOT_SEVERAL = "this is a blend cell, and a coordination cell is needed here"
KINDS = {
    "yielding": Kind(YieldingEnv, "lee1991", "lee2006", NOT_SEVERAL, *SEVERAL),
    "coordination": Kind(CoordinationEnv, "lee1991", "lee2006", NOT_SEVERAL, *SEVERAL),
    "blend": Kind(
        BlendTrackingEnv, "lee2006", "chung", "this is an ik cell, and a blend cell is needed here", BlendOptions,
        BlendKeywords, BLEND_ENTRIES, "curv",
    ),
    "ik": Kind(
        FeedbackIKEnv, "chung", "lee1991", "this is a coordination cell, and an ik cell is needed here", IKOptions,
        IKKeywords, ik_entries(6), "famil",
    ),
}  # fmt: skip
Make = Callable[..., Any]


@pytest.fixture(params=list(KINDS))
def kind(request: pytest.FixtureRequest) -> Kind:
    return KINDS[request.param]


@pytest.fixture
def make(kind: Kind, lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell) -> Make:
    """Makes an environment of the kind, without physics unless told otherwise."""
    cells = {"lee1991": lee1991, "lee2006": lee2006, "chung": chung}
    return lambda **options: kind.make(**{"cell": cells[kind.cell], "physics": "ideal", **options})


def act(env: Any, size: float = 1.0) -> Any:
    """An action for whatever has one."""
    if isinstance(env, CoordinationEnv):
        return {agent: np.full(1, size, dtype=np.float32) for agent in env.possible_agents}
    return np.full(env.action_space.shape, size, dtype=np.float32)


def reset_options(make: Any) -> tuple[str, ...]:
    """That an environment knows."""
    return tuple(getattr(make, "reset_options", ("master_late_s",)))


def says(error: pytest.ExceptionInfo[ArmtempoError], *parts: str) -> None:
    text = str(error.value)
    assert "\n" not in text
    assert error.value.remedy
    for part in parts:
        assert part in text


# ---- options


def test_options_and_keywords_have_the_same_names_and_types(kind: Kind) -> None:
    assert get_type_hints(kind.options) == get_type_hints(kind.keywords)
    assert [field.name for field in fields(kind.options)] == list(get_type_hints(kind.keywords))
    assert not kind.keywords.__required_keys__


def test_the_environment_keeps_its_options(kind: Kind, make: Make) -> None:
    env = make(max_episode_s=0.5)
    assert env.options == kind.options(physics="ideal", max_episode_s=0.5)
    env.close()


def test_every_option_is_named_in_the_docstring(kind: Kind) -> None:
    text = kind.make.__doc__ or ""
    for name in (*(field.name for field in fields(kind.options)), *reset_options(kind.make)):
        assert f"``{name}``" in text


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [("physic", "physics"), ("max_episodes", "max_episode_s"), ("rendermode", "render_mode"), ("records", "record")],
)
def test_a_misspelt_keyword_is_told_the_nearest_name(make: Make, wrong: str, meant: str) -> None:
    with pytest.raises(UnknownNameError) as error:
        make(**{wrong: None})
    says(error, f"unknown option {wrong!r}", f"did you mean {meant!r}?")


def test_type_checkers_refuse_what_is_refused(lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell) -> None:
    """What is ignored here would be reported as not needed if the checkers did not see it."""
    with pytest.raises(UnknownNameError, match="did you mean 'shield'"):
        YieldingEnv(lee1991, sheild=True)  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match="did you mean 'shield'"):
        CoordinationEnv(lee1991, sheild=True)  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match="did you mean 'profile'"):
        BlendTrackingEnv(lee2006, profil="line-speed")  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match="did you mean 'action_mode'"):
        FeedbackIKEnv(chung, action_mod="gains")  # type: ignore[call-arg]
    with pytest.raises(UnknownNameError, match="did you mean 'ideal'"):
        FeedbackIKEnv(chung, physics="idea")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "error_class", "parts"),
    [
        ({"physics": "idea"}, UnknownNameError, ("physics 'idea'", "did you mean 'ideal'")),
        ({"max_episode_s": True}, InputError, ("max_episode_s must be positive, got True",)),
        ({"max_episode_s": "3"}, InputError, ("max_episode_s must be positive, got '3'",)),
        ({"max_episode_s": 0.0}, InputError, ("max_episode_s must be positive, got 0.0",)),
        ({"max_episode_s": np.nan}, InputError, ("max_episode_s must be positive",)),
        ({"model_error": "x", "physics": "bullet"}, InputError, ("model_error must be a share above -1, got 'x'",)),
        ({"model_error": True, "physics": "bullet"}, InputError, ("model_error must be a share above -1, got True",)),
        ({"model_error": -1.0, "physics": "bullet"}, InputError, ("model_error must be a share above -1, got -1.0",)),
        ({"model_error": 0.1}, InputError, ("model_error is 0.1 and physics 'ideal', which has no bodies",)),
        ({"render_mode": "ansi"}, RenderError, ("unknown render_mode 'ansi'", "rgb_array")),
        ({"cell": "lee19"}, UnknownNameError, ("'lee19'",)),
        ({"cell": None}, InputError, ("a cell is a name or a file, got NoneType",)),
    ],
)
def test_a_wrong_argument_is_told_the_same_by_every_kind(
    make: Make, options: dict[str, Any], error_class: type[ArmtempoError], parts: tuple[str, ...]
) -> None:
    with pytest.raises(error_class) as error:
        make(**options)
    says(error, *parts)


def test_options_are_checked_where_they_are_made_and_do_not_change(kind: Kind) -> None:
    with pytest.raises(InputError, match="model_error must be a share"):
        options_of(kind.options, {"model_error": "x"})
    with pytest.raises(AttributeError):
        kind.options().physics = "ideal"  # frozen


@pytest.mark.parametrize("built", [False, True])
def test_a_cell_of_another_kind_is_refused_with_the_kind_that_is_needed(
    kind: Kind, lee1991: CoordinationCell, lee2006: BlendCell, chung: IKCell, built: bool
) -> None:
    cells: dict[str, object] = {"lee1991": lee1991, "lee2006": lee2006, "chung": chung}
    with pytest.raises(InputError if built else ConfigError) as error:
        kind.make(cells[kind.other] if built else kind.other)
    says(error, kind.said.removeprefix("this "), "give a cell")


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("armtempo/Yielding-v0", {"cell": "lee1991", "shield": True}),
        ("armtempo/BlendTracking-v0", {"profile": "limit-aware"}),
        ("armtempo/FeedbackIK-v0", {"action_mode": "gains"}),
    ],
)
def test_gymnasium_makes_it_with_options_and_remembers_them(name: str, options: dict[str, Any]) -> None:
    env = gymnasium.make(name, physics="ideal", **options)
    assert env.spec is not None
    assert env.spec.kwargs["physics"] == "ideal"
    again = gymnasium.make(copy.deepcopy(env.spec))
    for one in (env, again):
        kept: Any = one.unwrapped
        for option, value in options.items():
            assert option == "cell" or getattr(kept.options, option) == value
        one.close()
    with pytest.raises(UnknownNameError, match="unknown option 'physic'"):
        gymnasium.make(name, physic="ideal")


# ---- resets


def test_an_unknown_reset_option_is_told_the_nearest_name(kind: Kind, make: Make) -> None:
    env = make()
    known = reset_options(kind.make)[0]
    for wrong in ("typo", kind.reset_option):
        with pytest.raises(UnknownNameError) as error:
            env.reset(options={wrong: 1})
        says(error, f"unknown reset option {wrong!r}", known)
    says(error, "did you mean")
    env.close()


@pytest.mark.parametrize("options", [[1], "x", 1])
def test_reset_options_that_are_no_mapping(make: Make, options: Any) -> None:
    env = make()
    with pytest.raises(InputError) as error:
        env.reset(options=options)
    says(error, f"options must map names to values, got {options!r}", "known: ")
    env.close()


def test_after_a_reset_that_failed_no_episode_is_on(make: Make) -> None:
    env = make()
    env.reset(seed=0)
    with pytest.raises(UnknownNameError):
        env.reset(options={"typo": 1})
    with pytest.raises(ActionError, match="call reset before step"):
        env.step(act(env))
    env.reset(options={})
    env.step(act(env))
    env.close()


def test_pettingzoos_checkers_may_reset_with_their_own_option(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset(options={"options": 1})
    with pytest.raises(UnknownNameError, match=r"'option' \(known: master_late_s\)"):
        env.reset(options={"option": 1})
    env.close()


# ---- out of turn


def test_steps_out_of_turn(make: Make) -> None:
    env = make(max_episode_s=1e-3)  # less than a period
    with pytest.raises(ActionError) as error:
        env.step(act(env))
    says(error, "the episode is over", "call reset before step")
    env.reset(seed=0)
    env.step(act(env))
    with pytest.raises(ActionError) as error:
        env.step(act(env))
    says(error, "the episode is over", "call reset before step")
    env.reset()
    env.close()
    with pytest.raises(ActionError) as error:
        env.step(act(env))
    says(error, "the environment is closed", "make a new one")


def test_a_wrong_action_moves_nothing_and_may_be_given_again(make: Make) -> None:
    traces = []
    for wrong in (False, True):
        env = make(record=True)
        env.reset(seed=0)
        for _ in range(3):
            if wrong:
                with pytest.raises(ActionError, match=r"finite number.* in an array of shape"):
                    env.step(act(env, np.nan))
            env.step(act(env, 0.5))
        traces.append(env.trace.q)
        env.close()
    np.testing.assert_array_equal(traces[0], traces[1])


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_closed_environment_draws_and_resets_no_more(make: Make, physics: Physics) -> None:
    env = make(render_mode="rgb_array", physics=physics)
    env.reset(seed=0)
    assert env.render().shape == (480, 640, 3)
    env.close()
    env.close()
    with pytest.raises(RenderError) as error:
        env.render()
    says(error, "the environment is closed", "make a new one")
    with pytest.raises(InputError) as closed:
        env.reset()
    says(closed, "the environment is closed", "make a new one")


def test_without_a_render_mode_nothing_is_drawn_closed_or_not(make: Make) -> None:
    env = make()
    env.reset(seed=0)
    assert env.render() is None
    env.close()
    assert env.render() is None


# ---- traces


@pytest.mark.parametrize("physics", PHYSICS)
def test_a_trace_has_one_row_right_after_reset(make: Make, physics: Physics) -> None:
    env = make(record=True, physics=physics)
    env.reset(seed=0)
    assert env.trace.time.tolist() == [0.0]
    rows = {len(array) for array in _arrays(env.trace, but=("torque_max", "arrival"))}
    assert rows == {1}
    env.step(act(env))
    assert len(env.trace.time) == 1 + env.cell.ticks_per_period
    env.reset()
    assert len(env.trace.time) == 1
    env.close()


@pytest.mark.parametrize("physics", PHYSICS)
def test_arrays_of_a_trace_are_read_only(make: Make, physics: Physics) -> None:
    env = make(record=True, physics=physics)
    env.reset(seed=0)
    for _ in range(2):
        arrays = _arrays(env.trace)
        assert len(arrays) > 5
        assert not any(array.flags.writeable for array in arrays)
        env.step(act(env))
    env.close()


def _arrays(trace: Any, but: tuple[str, ...] = ()) -> list[Any]:
    """All arrays in a trace, also those in tuples."""
    found: list[Any] = []
    for field in fields(trace):
        value = getattr(trace, field.name)
        if field.name not in but:
            found += [one for one in (value if isinstance(value, tuple) else (value,)) if isinstance(one, np.ndarray)]
    return found


def test_a_trace_that_was_not_recorded(make: Make) -> None:
    env = make()
    env.reset(seed=0)
    with pytest.raises(InputError) as error:
        _ = env.trace
    says(error, "keeps no trace", "record=True")
    env.close()


# ---- what is seen


def test_the_docstring_has_the_table_of_entries_and_the_space_is_made_of_it(kind: Kind, make: Make) -> None:
    assert observation_table(kind.entries) in cleandoc(kind.make.__doc__ or "")
    env = make()
    space = env.observation_space("arm_0") if isinstance(env, CoordinationEnv) else env.observation_space
    assert isinstance(space, Box)
    np.testing.assert_array_equal(space.low, [entry.low for entry in kind.entries])
    np.testing.assert_array_equal(space.high, [entry.high for entry in kind.entries])
    assert len({entry.name for entry in kind.entries}) == len(kind.entries)
    env.close()
