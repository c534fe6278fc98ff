"""What a user gets wrong, and what is said about it: one line, with the remedy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from armtempo.envs import CoordinationEnv, YieldingEnv
from armtempo.errors import ActionError, ArmtempoError, InputError, UnknownNameError
from armtempo.planners import CoordinationCell

NAN = np.array([np.nan], dtype=np.float32)
GOOD = np.zeros(1, dtype=np.float32)


def _says(error: pytest.ExceptionInfo[ArmtempoError], *parts: str) -> None:
    text = str(error.value)
    assert "\n" not in text
    assert error.value.remedy
    for part in parts:
        assert part in text


@pytest.mark.parametrize(
    "bad", [NAN, np.array([np.inf]), np.zeros(2), np.zeros((1, 1)), np.zeros(0), None, "full speed", {"a": 1}]
)
def test_an_action_that_is_no_finite_number(lee1991: CoordinationCell, bad: Any) -> None:
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset()
    with pytest.raises(ActionError) as error:
        env.step({"arm_0": GOOD, "arm_1": bad})
    _says(error, "arm_1", "one finite number", "shape (1,)", "replace NaN")
    np.testing.assert_array_equal(env.simulation.lam, 0.0)  # nothing moved: the step can be repeated
    env.step({"arm_0": GOOD, "arm_1": GOOD})
    env.close()
    single = YieldingEnv(lee1991, physics="ideal")
    single.reset()
    with pytest.raises(ActionError) as error:
        single.step(bad)
    _says(error, "slave")
    single.close()


def test_actions_outside_the_box_are_clipped(lee1991: CoordinationCell) -> None:
    after = []
    for size in (1.0, 7.0):
        env = CoordinationEnv(lee1991, physics="ideal")
        env.reset()
        env.step({"arm_0": np.array([size]), "arm_1": np.array([-size])})
        after.append(env.state())
        env.close()
    np.testing.assert_array_equal(after[0], after[1])


def test_a_missing_action(lee1991: CoordinationCell) -> None:
    env = CoordinationEnv(lee1991, physics="ideal")
    env.reset()
    with pytest.raises(ActionError) as error:
        env.step({"arm_0": GOOD})
    _says(error, "no action for arm_1", "arm_0, arm_1")
    env.close()


@pytest.mark.parametrize("make", [CoordinationEnv, YieldingEnv])
@pytest.mark.parametrize(
    ("options", "error_class", "parts"),
    [
        ({"mode": "velocity"}, UnknownNameError, ("mode 'velocity'", "acceleration, speed")),
        ({"master_late_s": -0.1}, InputError, ("master_late_s", "-0.1", "0 or more")),
        ({"master_late_s": np.nan}, InputError, ("master_late_s",)),
        ({"master_late_s": True}, InputError, ("master_late_s", "True")),
        ({"start_phase": "0.1"}, InputError, ("start_phase", "'0.1'")),
        ({"start_phase": (0.1, 0.2, 0.3)}, InputError, ("start_phase", "(0.1, 0.2, 0.3)")),
        ({"observation_noise": True}, InputError, ("observation_noise", "True")),
        ({"disturbance": 3}, InputError, ("disturbance must be a name or a Disturbance, got 3", "stop-and-go")),
        ({"action": "priority"}, UnknownNameError, ("action 'priority'", "speed+priority")),
        ({"action": "speed+priority"}, InputError, ("a priority", "shield=True")),
        ({"shield_tube_m": "x"}, InputError, ("shield_tube_m must be a distance", "'x'")),
    ],
)
def test_a_wrong_argument(
    lee1991: CoordinationCell,
    make: Callable[..., Any],
    options: dict[str, Any],
    error_class: type[ArmtempoError],
    parts: tuple[str, ...],
) -> None:
    with pytest.raises(error_class) as error:
        make(**{"cell": lee1991, "physics": "ideal", **options})
    _says(error, *parts)


def test_an_unknown_learner_and_a_backward_range(lee1991: CoordinationCell) -> None:
    with pytest.raises(UnknownNameError) as unknown:
        YieldingEnv(lee1991, learner="slav", physics="ideal")
    _says(unknown, "arm 'slav'", "did you mean 'slave'")
    with pytest.raises(InputError) as backward:
        YieldingEnv(lee1991, master_late_s=(0.2, 0.1), physics="ideal")
    _says(backward, "master_late_s", "(0.2, 0.1)")


@pytest.mark.parametrize("make", [CoordinationEnv, YieldingEnv])
@pytest.mark.parametrize("late", [-1.0, np.nan, np.inf, "1", None, True])
def test_a_wrong_lateness_at_reset(lee1991: CoordinationCell, make: Callable[..., Any], late: object) -> None:
    env = make(lee1991, physics="ideal")
    with pytest.raises(InputError) as error:
        env.reset(options={"master_late_s": late})
    _says(error, "master_late_s")
    env.close()


def test_an_unknown_baseline_for_the_other_arms(lee1991: CoordinationCell) -> None:
    with pytest.raises(UnknownNameError, match=r"'delai'.*did you mean 'delay'"):
        YieldingEnv(lee1991, others="delai", physics="ideal")
