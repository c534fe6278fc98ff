"""One episode of a policy, decision by decision, in an environment that renders."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar

from armtempo.agents import (
    LearnedOneArmPolicy,
    SingleArmPolicy,
    action_mode_of,
    blend_baseline,
    find_agent,
    ik_policy,
    learned_policy,
    make_policy,
)
from armtempo.agents.policies import check_fits, is_agent_name
from armtempo.envs import BlendTrackingEnv, CoordinationEnv, FeedbackIKEnv, Physics
from armtempo.errors import InputError
from armtempo.planners import BlendCell, CoordinationCell, IKCell

RENDER_MODE = "rgb_array"


class Film(ABC):
    """An episode of a policy in a cell of its kind; baselines and learned agents alike.

    Args:
        cell: Where.
        policy: The name of who decides; an agent decides in the settings that it was trained in.
        physics: ``bullet`` or ``ideal``.
        several: Options of cells of several arms, where they were given.

    Attributes:
        env: Renders; whoever has seen the episode closes it.

    Raises:
        UnknownNameError: No such policy.
        InputError: An agent that is for something else, or an option that cells of this kind do not have.
        InfeasibleError: The policy's plan does not exist in this cell.
    """

    POLICY: ClassVar[str]
    """Who is filmed where nobody is named."""
    SLOW: ClassVar[float]
    """How many times slower than reality: episodes last about as long on film, whatever the kind."""

    env: Any

    @abstractmethod
    def __init__(self, cell: Any, policy: str, *, physics: Physics, **several: Any) -> None: ...

    @abstractmethod
    def decisions(self, seed: int) -> Iterator[bool]:
        """Begin an episode, and make its decisions one after the other; whether it is over, before and after each."""


class CoordinationFilm(Film):
    POLICY, SLOW = "vci", 20.0

    env: CoordinationEnv

    def __init__(self, cell: CoordinationCell, policy: str, *, physics: Physics, **several: Any) -> None:
        learned = is_agent_name(policy)
        settings = find_agent(policy).header.settings if learned else {}
        several["shield"] = several.get("shield", False) or settings.get("shield", False)
        plan = None if learned else make_policy(policy, cell)
        self.env = CoordinationEnv(
            cell, physics=physics, mode=settings.get("mode", "speed"), render_mode=RENDER_MODE, **several
        )
        self._policy = plan or learned_policy(policy, self.env)

    def decisions(self, seed: int) -> Iterator[bool]:
        env = self.env
        observations, _ = env.reset(seed=seed)
        self._policy.reset(seed)
        yield False
        while env.agents:
            seen = {agent: observations[agent] for agent in env.agents}
            observations, *_ = env.step(self._policy.act(seen, env))
            yield not env.agents


class _OneArmFilm(Film):
    """A film of an environment with one arm; subclasses make it, and choose the policy."""

    env: BlendTrackingEnv | FeedbackIKEnv
    _policy: SingleArmPolicy[Any]
    _reset_options: dict[str, Any] | None = None

    def __init__(self, cell: BlendCell | IKCell, policy: str, *, physics: Physics, **several: Any) -> None:
        given = [name.removesuffix("_s") for name, value in several.items() if value]
        if given:
            options = ", ".join(f"--{name.replace('_', '-')}" for name in given)
            raise InputError(f"{options}: for cells of several arms", remedy="leave them out")
        self._open(cell, policy, physics)

    @abstractmethod
    def _open(self, cell: Any, policy: str, physics: Physics) -> None:
        """Make the environment and the policy."""

    def _learned(self, policy: str, environment: str) -> SingleArmPolicy[Any]:
        check_fits(policy, find_agent(policy), self.env, environment)
        return LearnedOneArmPolicy(find_agent(policy))

    def decisions(self, seed: int) -> Iterator[bool]:
        env: Any = self.env
        observation, _ = env.reset(seed=seed, options=self._reset_options)
        self._policy.reset(seed)
        over = False
        yield over
        while not over:
            observation, _, terminated, truncated, _ = env.step(self._policy.act(observation, env))
            over = terminated or truncated
            yield over


class BlendFilm(_OneArmFilm):
    POLICY, SLOW = "limit-aware", 4.0

    def _open(self, cell: BlendCell, policy: str, physics: Physics) -> None:
        if is_agent_name(policy):
            settings = find_agent(policy).header.settings
            profile, mapping = settings.get("profile", "line-speed"), settings.get("mapping", "exact")
        else:
            baseline = blend_baseline(policy)
            profile, mapping = baseline.profile, baseline.mapping
            self._reset_options = {"curve": baseline.curve}
        self.env = BlendTrackingEnv(cell, profile=profile, mapping=mapping, physics=physics, render_mode=RENDER_MODE)
        self._policy = self._learned(policy, "blend-tracking") if is_agent_name(policy) else baseline.make()


class IKFilm(_OneArmFilm):
    POLICY, SLOW = "law", 1.0

    def _open(self, cell: IKCell, policy: str, physics: Physics) -> None:
        learned = is_agent_name(policy)
        mode = find_agent(policy).header.settings.get("action_mode", "speeds") if learned else action_mode_of(policy)
        decides = None if learned else ik_policy(policy)
        self.env = FeedbackIKEnv(cell, action_mode=mode, physics=physics, render_mode=RENDER_MODE)
        self._policy = decides or self._learned(policy, "feedback-ik")
