"""Fuzzers of environments: what they are made with, how they are reset, and what they are told to do."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pettingzoo

import armtempo
from armtempo.errors import ArmtempoError
from armtempo.planners import load_cell
from armtempo.planners.cells import BlendCell, IKCell
from tests.fuzz._finite import NotFiniteError, check_finite
from tests.fuzz._mutations import VALUES, WORDS, Random, pick

assert armtempo.__version__  # importing armtempo is what registers the environments

ODD: tuple[Any, ...] = (
    *VALUES, *WORDS, np.nan, np.array(np.nan), np.array([]), np.zeros((2, 2)), np.array([None]), np.array(["x"]),
    np.array([1 + 2j]), np.array([1e400]), np.ones(1, dtype=np.bool_), np.ma.masked_array([1.0], [True]), (1,), {1},
    b"\x00",
    [[1], [1, 2]], np.float16(6e4), np.int8(-128), "1", "bullet", "ideal", (0.1, 0.2), (0.2, 0.1), (0.1,), [0.0,
    0.3], range(3),
    np.array([0.1, np.nan]), slice(1), Ellipsis, object, print, lambda: 1,
)  # fmt: skip
PERIODS = 6
"""Steps of an input."""


def _options_of(env_id: str) -> dict[str, tuple[Any, ...]]:
    """Good values of an environment's keywords, by which odd ones stand among good ones."""
    common: dict[str, tuple[Any, ...]] = {
        "physics": ("ideal", "bullet"),
        "max_episode_s": (None, 0.05, 1.0),
        "model_error": (0.0, 0.1),
    }
    if "Blend" in env_id:
        return common | {"profile": ("limit-aware",), "mapping": ("exact", "paper"), "family": ("given", "zigzag")}
    if "IK" in env_id:
        return common | {"action_mode": ("speeds", "gains"), "family": ("given", "smooth")}
    return common | {
        "mode": ("speed", "acceleration"), "disturbance": (None, "any", "late"), "observation_noise": (0.0, 0.01),
        "start_phase": (0.0, 0.3, (0.0, 0.3)), "master_late_s": (0.0, (0.0, 0.1)), "friction_error": (0.0, 0.5),
        "shield": (False, True), "action": ("speed", "speed+priority"), "shield_tube_m": (0.0, 0.001),
    }  # fmt: skip


RESET_OPTIONS = ("master_late_s", "family", "curve", "shape_factor", "remaining_distance_m", "reset_mask", "typo")


class EnvironmentFuzzer:
    """Makes an environment with odd options, resets it with odd seeds and options, and steps it with odd actions.

    Args:
        env_id: As registered.
        many: Whether it is the vector environment, by Gymnasium.
        parallel: Whether it is PettingZoo's.
    """

    spent = False

    def __init__(self, env_id: str, *, many: bool = False, parallel: bool = False) -> None:
        self._id, self._many, self._parallel = env_id, many, parallel
        kind = {"armtempo/BlendTracking-v0": BlendCell, "armtempo/FeedbackIK-v0": IKCell}.get(env_id)
        name = {BlendCell: "lee2006", IKCell: "chung"}.get(kind) if kind else "lee1991"
        self._cell = load_cell(name, kind) if kind and name else load_cell("lee1991")
        self._good = _options_of(env_id)
        if many:
            self._good |= {"num_envs": (1, 3), "threads": (None, 1), "autoreset_mode": ("NextStep", "SameStep")}
        for name, values in self._good.items():  # compiles what an input may need
            for value in values:
                if not (many and value == "bullet"):
                    options = {"physics": "bullet" if name.endswith("error") and not many else "ideal", name: value}
                    with contextlib.suppress(ArmtempoError):
                        self.run((options, [("reset", {}), *[("step", None)] * 3]))

    def make(self, random: Random) -> tuple[dict[str, Any], list[tuple[str, Any]]]:
        options = {name: pick(random, good) for name, good in self._good.items() if random.random() < 0.3}
        if random.random() < 0.5:
            options["physics"] = "ideal"
        if random.random() < 0.4:
            options[pick(random, [*self._good, "typo", "cell", "render_mode", "record"])] = pick(random, ODD)
        acts: list[tuple[str, Any]] = [("reset", self._reset(random))]
        for _ in range(PERIODS):
            if random.random() < 0.15:
                acts.append(("reset", self._reset(random)))
            acts.append(("step", self._action(random)))
        if random.random() < 0.2:
            acts.insert(int(random.integers(len(acts))), ("close", None))
        return options, acts

    def _reset(self, random: Random) -> dict[str, Any]:
        if random.random() < 0.6:
            return {}
        given: dict[str, Any] = {}
        if random.random() < 0.5:
            given["seed"] = pick(
                random, (0, 1, 2**31, 2**40, 10**60, -1, 1.5, "1", True, None, [1, 2, 3], [1], np.int64(3), np.nan)
            )
        if random.random() < 0.7:
            odd = {name: pick(random, ODD) for name in RESET_OPTIONS if random.random() < 0.3}
            given["options"] = odd if random.random() < 0.9 else pick(random, ODD)
        return given

    def _action(self, random: Random) -> Any:
        """None stands for a good one."""
        if random.random() < 0.5:
            return None
        if self._parallel and random.random() < 0.8:
            return {pick(random, ("arm_0", "arm_1", "arm_2", 0)): pick(random, ODD) for _ in range(2)} | (
                {"arm_0": np.zeros(1, dtype=np.float32)} if random.random() < 0.5 else {}
            )
        if random.random() < 0.3:
            return ("spoilt", pick(random, (np.nan, np.inf, -np.inf, 1e308, -1e39)))
        return pick(random, ODD)

    def run(self, given: tuple[dict[str, Any], list[tuple[str, Any]]]) -> bool:
        options, acts = given
        if self._many and isinstance(options.get("num_envs"), int) and options["num_envs"] > 10**4:
            options = options | {"num_envs": 10**60}  # what somebody asks for in earnest may take time and room
        env = self._made(options)
        taken = False
        try:
            for what, detail in acts:
                with contextlib.suppress(ArmtempoError):  # and go on: nothing has moved
                    taken |= self._do(env, what, detail)
        finally:
            env.close()
        if not taken:
            raise ArmtempoError("nothing was taken")
        return True

    def _made(self, options: dict[str, Any]) -> Any:
        keywords = {"cell": self._cell, **options}
        if self._parallel:
            return pettingzoo.make("parallel", self._id, **keywords)
        if self._many:
            count = keywords.pop("num_envs", 2)
            made: Any = gymnasium.spec(self._id).vector_entry_point
            return _imported(made)(num_envs=count, **keywords)
        made = gymnasium.spec(self._id).entry_point
        return _imported(made)(**keywords)

    def _do(self, env: Any, what: str, detail: Any) -> bool:
        if what == "close":
            env.close()
            return False
        if what == "reset":
            observations, infos = env.reset(**detail)
        else:
            observations, *outcome = env.step(self._meant(env, detail))
            infos = outcome.pop()
            check_finite(outcome)
        self._check(env, observations)
        assert isinstance(infos, dict)
        return what == "step"

    def _meant(self, env: Any, action: Any) -> Any:
        spoilt = isinstance(action, tuple) and len(action) == 2 and action[0] == "spoilt"
        if action is not None and not spoilt:
            return action
        last = 0.5 if action is None else action[1]
        if self._parallel:
            return {agent: np.full(1, last) for agent in env.agents}
        good = np.zeros(env.action_space.shape)
        if spoilt:
            good.reshape(-1)[-1] = last
        return good

    def _check(self, env: Any, observations: Any) -> None:
        rows = observations if self._parallel else {"": observations}
        for agent, row in rows.items():
            space = env.observation_space(agent) if self._parallel else env.observation_space
            noisy = getattr(getattr(env, "options", None), "observation_noise", 0.0)
            if not np.isfinite(row).all() or (not noisy and not space.contains(row)):
                raise NotFiniteError(f"an observation outside its space: {row}")

    def shown(self, given: tuple[dict[str, Any], list[tuple[str, Any]]]) -> bytes:
        return f"{self._id} many={self._many}\n{given!r}\n".encode("utf-8", "backslashreplace")


def _imported(place: Any) -> Callable[..., Any]:
    module, _, name = str(place).partition(":")
    made: Callable[..., Any] = getattr(__import__(module, fromlist=[name]), name)
    return made


def environment(env_id: str, **kind: bool) -> Callable[[Path], EnvironmentFuzzer]:
    """Starts a fuzzer of one registered environment."""
    return lambda _folder: EnvironmentFuzzer(env_id, **kind)
