"""The checks that others may use: ours pass them, and what breaks a promise does not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import gymnasium
import numpy as np
import pytest

from armtempo.agents import PhasePlanePolicy, RandomPolicy
from armtempo.arrays import Floats32
from armtempo.envs import BlendTrackingEnv, CoordinationEnv, FeedbackIKEnv, YieldingEnv
from armtempo.planners import BlendCell, CoordinationCell, IKCell, load_cell
from armtempo.planners.cells import CELLS
from armtempo.testing import check_cell, check_environment, check_kind, check_policy

BUNDLED = {"coordination": "lee1991", "blend": "lee2006", "ik": "chung"}


@pytest.mark.parametrize("kind", CELLS)
def test_every_kind_passes(kind: str) -> None:
    check_kind(kind, load_cell(BUNDLED[kind], CELLS[kind]))


@pytest.mark.parametrize("env", [YieldingEnv, BlendTrackingEnv, FeedbackIKEnv])
def test_every_environment_passes(env: Callable[..., gymnasium.Env[Any, Any]]) -> None:
    check_environment(lambda **options: env(physics="ideal", **options))


def test_policies_pass_in_environments_of_one_agent_and_of_several(
    lee1991: CoordinationCell, lee2006: BlendCell
) -> None:
    check_policy(RandomPolicy(), BlendTrackingEnv(lee2006, physics="ideal"))
    check_policy(PhasePlanePolicy(), CoordinationEnv(lee1991, physics="ideal"))


class Careless:
    """Draws without a seed, and writes to what it is shown."""

    def __init__(self, *, writes: bool, far: bool) -> None:
        self.writes, self.far = writes, far

    def reset(self, seed: int | None = None) -> None:
        """Forgets the seed."""

    def act(self, observation: Floats32, env: object) -> Floats32:
        if self.writes:
            observation[0] = 0.5
        action = np.random.default_rng().uniform(-1.0, 1.0, 1)
        return np.array(action + 5.0 * self.far, np.float32)


@pytest.mark.parametrize(
    ("policy", "said"),
    [
        (Careless(writes=False, far=False), "the same seed gives the same actions"),
        (Careless(writes=True, far=False), "act changes nothing"),
        (Careless(writes=False, far=True), "is not in the action space"),
    ],
)
def test_a_careless_policy_does_not_pass(policy: Careless, said: str, lee2006: BlendCell) -> None:
    with pytest.raises(AssertionError, match=said):
        check_policy(policy, BlendTrackingEnv(lee2006, physics="ideal"))


class Forgetful(BlendTrackingEnv):  # type: ignore[misc]  # final: nobody else should
    """Takes any reset option."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        return super().reset(seed=seed)


def test_an_environment_that_takes_any_option_does_not_pass() -> None:
    with pytest.raises(AssertionError, match="an unknown reset option is no UnknownNameError"):
        check_environment(lambda **options: Forgetful(physics="ideal", **options))


class Absent(BlendTrackingEnv):  # type: ignore[misc]  # final: nobody else should
    """Leaves its clock out of its state."""

    changing = tuple(name for name in BlendTrackingEnv.changing if name != "_before")


def test_an_environment_whose_state_lacks_something_does_not_pass() -> None:
    with pytest.raises(AssertionError, match="goes on from the state of one made alike"):
        check_environment(lambda **options: Absent(physics="ideal", **options))


def test_a_cell_whose_kind_is_not_listed_does_not_pass(chung: IKCell, monkeypatch: pytest.MonkeyPatch) -> None:
    listed: Any = CELLS
    monkeypatch.setitem(listed, "ik", BlendCell)
    with pytest.raises(AssertionError, match=r"CELLS\['ik'\] is not IKCell"):
        check_cell(chung)
