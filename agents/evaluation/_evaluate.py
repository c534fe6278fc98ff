"""The loop of every evaluation: policies one after the other, episodes with seeds that count up, figures of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, is_dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from armtempo.agents.evaluation._figures import numbers_of, result_of, with_numbers
from armtempo.agents.evaluation._kind import CellT, Kind, OptionsT, ResultT, Runner, RunT, asked_options
from armtempo.agents.policies import Policy, chosen_policies
from armtempo.envs.bodies import OTHER_ENGINE, engine_difference, engine_name
from armtempo.errors import InfeasibleError, InputError, brief

TraceT_co = TypeVar("TraceT_co", covariant=True)
OnEpisode = Callable[[str, int], None]
"""Called with policy and episode number after each, for progress bars."""


class Results(Protocol):
    """Where the outcomes of policies are kept as they come."""

    def get(self, unit: str, /) -> Any:
        """What is kept under a name; None: nothing is."""

    def put(self, unit: str, value: Any, /) -> Any:
        """Keep something that JSON can hold; returns what ``get`` will."""


@dataclass(frozen=True, kw_only=True)
class Continuation:
    """An evaluation that goes on where it was interrupted, policy by policy.

    Attributes:
        kept: Outcomes of before, and of now.
        traces: Whether results that are taken over get their traces and plans: these policies then plan, and run their
            first episode, once more. Otherwise such results have None there.
    """

    kept: Results
    traces: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation(Generic[CellT, OptionsT, ResultT]):
    """Policies compared in one cell.

    Attributes:
        kind: Name of the cell's kind.
        cell: The cell.
        options: What was asked of the episodes.
        episodes: Episodes per policy.
        seed: Seed of the first episode.
        results: By policy.
        refused: Policies that have no plan in this cell, and why; None where policies need none.
        facts: What holds for all policies: options as told, limits and bounds, units in the keys.
    """

    kind: str
    cell: CellT
    options: OptionsT
    episodes: int
    seed: int
    results: Mapping[str, ResultT]
    refused: Mapping[str, str] | None
    facts: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Everything but traces and plans, units in the keys."""
        return {
            "cell": self.cell.name,
            "episodes": self.episodes,
            "seed": self.seed,
            **self.facts,
            "policies": {name: numbers_of(result) for name, result in self.results.items()},
            **({} if self.refused is None else {"refused": dict(self.refused)}),
        }


def evaluate_kind(
    kind: Kind[CellT, OptionsT, RunT, ResultT],
    cell: CellT,
    policies: Sequence[str] | str | None,
    options: OptionsT,
    *,
    episodes: int,
    seed: int,
    on_episode: OnEpisode | None,
    continuation: Continuation | None = None,
) -> Evaluation[CellT, OptionsT, ResultT]:
    """Run every policy for some episodes; see ``armtempo.agents.evaluate``."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InputError(f"seed must be a whole number, 0 or more, got {brief(seed)}")
    results: dict[str, ResultT] = {}
    refused: dict[str, str] = {}
    runner: Runner[RunT] | None = None
    try:
        asked = kind.usual_policies(options) if policies is None else policies
        for name in chosen_policies(asked, kind.policies, episodes):
            known = _known(continuation, name)
            if "refused" in known:
                refused[name] = known["refused"]
                continue
            if continuation is not None and known and not continuation.traces:
                results[name] = result_of(kind.result_type, known["numbers"])
                continue
            try:
                opened = kind.open(cell, name, options, before=runner)
            except InfeasibleError as error:
                if policies is not None or not kind.may_refuse:
                    raise
                refused[name] = str(error)
                _keep(continuation, name, "refused", refused[name])
                continue
            if runner is not None and runner.env is not opened.env:
                runner.close()
            runner = opened
            runs = run_episodes(runner, name, 1 if known else episodes, seed, on_episode)
            results[name] = kind.measure(cell, runs, seed)
            if known:
                results[name] = with_numbers(results[name], known["numbers"])
            else:
                _keep(continuation, name, "numbers", numbers_of(results[name]))
    finally:
        if runner is not None:
            runner.close()
    compared, more = kind.compare(cell, options, results, episodes=episodes, seed=seed)
    return Evaluation(
        kind=kind.name,
        cell=cell,
        options=options,
        episodes=episodes,
        seed=seed,
        results=compared,
        refused=refused if kind.may_refuse else None,
        facts={**_told(kind, options), **_engine(options), **kind.head(cell), **more},
    )


def check_audit(options: Any) -> None:
    """Raise InputError where physics is ``ideal``: there is no engine to hold another one against."""
    if options.physics not in OTHER_ENGINE:
        raise InputError(f"audit: physics is {options.physics!r}, of no engine", remedy="take bullet or mujoco")


def audited(evaluation: Evaluation[CellT, OptionsT, ResultT]) -> Evaluation[CellT, OptionsT, ResultT]:
    """The same with what the other physics engine makes of every tick of each policy's first episode [rad, m].

    Raises:
        InputError: As ``check_audit``, or the other engine is not installed.
    """
    options: Any = evaluation.options
    cell: Any = evaluation.cell
    check_audit(options)
    errors = {name: getattr(options, name, 0.0) for name in ("model_error", "friction_error")}

    def with_difference(result: Any) -> Any:
        off = engine_difference(cell, result.trace, OTHER_ENGINE[options.physics], **errors)
        return replace(result, other_engine_rad=off)

    return replace(evaluation, results={name: with_difference(one) for name, one in evaluation.results.items()})


def _known(continuation: Continuation | None, name: str) -> dict[str, Any]:
    """What is kept of a policy: its ``numbers``, or why it was ``refused``; empty: nothing."""
    return {} if continuation is None else continuation.kept.get(name) or {}


def _keep(continuation: Continuation | None, name: str, what: str, value: Any) -> None:
    if continuation is not None:
        continuation.kept.put(name, {what: value})


def _told(kind: Kind[Any, OptionsT, Any, Any], options: OptionsT) -> dict[str, Any]:
    """The options that JSON tells: those that always are, and those that were asked for."""
    always = {name: getattr(options, name) for name in kind.always_told}
    told = always | {name: value for name, value in asked_options(options).items() if name not in always}
    return {
        name: asdict(value) if is_dataclass(value) and not isinstance(value, type) else value
        for name, value in told.items()
    }


def _engine(options: Any) -> dict[str, str]:
    """The physics engine and its version, where there is one: versions differ in the last bits."""
    name = engine_name(options.physics)
    return {} if name is None else {"engine": name}


def run_episodes(
    runner: Runner[RunT], name: str, episodes: int, seed: int, on_episode: OnEpisode | None = None
) -> list[RunT]:
    """Episodes with seeds that count up from ``seed``."""
    runs = []
    for episode in range(episodes):
        runs.append(runner.run(seed + episode))
        if on_episode is not None:
            on_episode(name, episode)
    return runs


class Recorded(Protocol[TraceT_co]):
    """An environment that keeps a trace."""

    @property
    def trace(self) -> TraceT_co:
        """What happened since the reset."""


def run_episode(
    env: Recorded[TraceT_co],
    policy: Policy[Any, Any],
    seed: int | None = None,
    options: dict[str, Any] | None = None,
) -> tuple[TraceT_co, float]:
    """One episode to its end, in an ``env`` made with ``record``; returns its trace and the sum of all rewards."""
    total, _ = play(env, policy, seed, options)
    return env.trace, total


def play(
    env: Any,
    policy: Policy[Any, Any],
    seed: int | None = None,
    options: dict[str, Any] | None = None,
    on_step: Callable[[], None] | None = None,
) -> tuple[float, dict[str, Any]]:
    """One episode to its end, of Gymnasium or PettingZoo; ``on_step`` is called after the reset and after every step.

    Returns:
        The sum of all rewards, and the last info; of several agents, the last one of each by name.
    """
    observation, _ = env.reset(seed=seed, options=options)
    policy.reset(seed)
    look = on_step or (lambda: None)
    look()
    run = _play_all if hasattr(env, "possible_agents") else _play_one
    return run(env, policy, observation, look)


def _play_one(
    env: Any, policy: Policy[Any, Any], observation: Any, on_step: Callable[[], None]
) -> tuple[float, dict[str, Any]]:
    total, over, info = 0.0, False, {}
    while not over:
        observation, reward, terminated, truncated, info = env.step(policy.act(observation, env))
        on_step()
        total += reward
        over = terminated or truncated
    return total, info


def _play_all(
    env: Any, policy: Policy[Any, Any], observations: Any, on_step: Callable[[], None]
) -> tuple[float, dict[str, Any]]:
    total = 0.0
    last: dict[str, Any] = {}
    while env.agents:
        seen = {agent: observations[agent] for agent in env.agents}
        observations, rewards, _, _, infos = env.step(policy.act(seen, env))
        on_step()
        total += sum(rewards.values())
        last |= infos
    return total, last
