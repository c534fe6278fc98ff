"""An arm follows a path with blended corners; the agent overrides its feed rate."""

from __future__ import annotations

from pathlib import Path
from typing import Any, final

import numpy as np
from gymnasium.spaces import Box

from armtempo.arrays import Floats32
from armtempo.envs.blend._observation import BLEND_ENTRIES, observe_blend
from armtempo.envs.blend._options import MAPPINGS, BlendOptions, MappingName
from armtempo.envs.blend._simulation import BlendSimulation, BlendTrace
from armtempo.envs.bodies import Physics, render_modes
from armtempo.envs.common import (
    TIME_LIMIT,
    SingleArmEnv,
    action_space,
    check_names,
    deviation_reward,
    leaving_reward,
    observation_space,
    progress_reward,
    read_action,
    time_reward,
)
from armtempo.planners import BlendCell
from armtempo.planners.cells import PATH_FAMILIES, PROFILES, FamilyName, ProfileName, as_cell, draw_path

RESET_OPTIONS = ("family", "curve", "shape_factor", "remaining_distance_m")


@final
class BlendTrackingEnv(SingleArmEnv[BlendSimulation]):
    """An arm follows a path of lines and arcs with blended corners (``armtempo/BlendTracking-v0``; Lee2006).

    **Action**, Box(-1, 1, (1,), float32), for one control period: the feed-rate override, ``f = (a + 1) / 2``.
    1 runs the line-speed profile as planned, 0 stops on the path. What is asked for is followed smoothly, as quickly as
    the profile's limits allow, so that no action breaks them. They are those of the tip along its path (and across it
    for ``limit-aware``); what this asks of the joints is for the agent to see.

    **Observation**, Box, (15,) float32, the same for every cell:

    {table}

    **Reward**: share of the path that the reference has covered; minus time in units of the profile's duration (on
    arrival charged to its exact instant); minus, over the same time, how far the tip's speed is from what the profile
    has at this place at full rate, in line speeds; minus the contour error as a share of what is allowed (both at most
    1). Leaving the tube costs 1 + 3 x the time limit (and one period) in units of the profile's duration. No episode
    inside can lose more than three per duration, so every one of them, crawling or standing still to the end, returns
    more than any that leaves. The terms are in ``info["reward_terms"]``.

    **Start**: at rest at the start of the path. With a ``family`` other than ``given`` every reset draws a new path.

    **End**: *terminated* on arrival (in ``ideal`` the exact instant; in ``bullet`` the later of the reference's end and
    the first tick from which the tip stays within 1 mm of the goal below 10 mm/s for 20 ms), and when the tip is
    farther from the path than the cell's ``contour_error_max_m`` at any tick. *Truncated* at five durations of the
    profile.

    **Reset options**, for this episode: ``family``, ``curve``, ``shape_factor``, ``remaining_distance_m``.

    Args:
        cell: Name of a bundled cell of kind blend, a cell file, or a built ``BlendCell``.
        profile: ``line-speed``: the paper's, limits along the path only; ``limit-aware``: also across it.
        mapping: From travelled length to the path: ``exact``, or the ``paper``'s predictor-corrector.
        family: ``given`` path, or random ones: ``polyline``, ``zigzag``, ``line-arc`` (two-link arms and SCARAs).
        physics: ``bullet`` or ``ideal`` (always on the reference).
        model_error: The simulated bodies are heavier by this share than the controller believes (``bullet`` only).
            0: it knows the arm exactly, and errors are those of the reference and of torques at their limits.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        max_episode_s: Time limit [s] instead of five durations.
        record: Keep a ``BlendTrace``.

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self,
        cell: BlendCell | str | Path = "lee2006",
        *,
        profile: ProfileName = "line-speed",
        mapping: MappingName = "exact",
        family: FamilyName = "given",
        physics: Physics = "bullet",
        model_error: float = 0.0,
        render_mode: str | None = None,
        max_episode_s: float | None = None,
        record: bool = False,
    ) -> None:
        super().__init__(render_mode, max_episode_s)
        check_names(
            ("profile", profile, PROFILES), ("mapping", mapping, MAPPINGS), ("family of paths", family, PATH_FAMILIES)
        )
        self.cell = as_cell(cell, BlendCell)
        self.profile: ProfileName = profile
        self.mapping: MappingName = mapping
        self.family: FamilyName = family
        options = BlendOptions(
            physics=physics, profile=profile, mapping=mapping, family=family, model_error=model_error,
            max_episode_s=max_episode_s,
        )  # fmt: skip
        self.simulation = BlendSimulation(self.cell, options, record=record)
        self.observation_space: Box = observation_space(BLEND_ENTRIES)  # type: ignore[assignment]
        self.action_space: Box = action_space()  # type: ignore[assignment]

    @property
    def trace(self) -> BlendTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    @property
    def reference_time(self) -> float:
        """Duration of the episode's profile at full rate [s]."""
        return self.simulation.profile.duration

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Put the arm at the start of its path, a new one unless ``family`` is ``given``.

        Args:
            seed: Of the draws.
            options: For this episode: ``family``, ``curve``, ``shape_factor``, ``remaining_distance_m``.

        Raises:
            UnknownNameError: No such option, or family.
            ConfigError: An option that a cell file could not have.
            PathError: The corners cannot be blended so, or no path of the family can be followed.
            InputError: ``options`` is no mapping, or the environment is closed.
        """
        given = self._begin(options, RESET_OPTIONS)
        super().reset(seed=seed)
        cell = draw_path(
            self.cell,
            given.get("family", self.family),
            self.np_random,
            remaining_distance=given.get("remaining_distance_m"),
            shape_factor=given.get("shape_factor"),
            curve=given.get("curve"),
        )
        self.simulation.reset(cell)
        self._limit = TIME_LIMIT * self.reference_time if self._max_episode is None else self._max_episode
        self._charged = self._before = 0.0
        self._running = True
        if self.render_mode == "human":
            self.render()
        info = {
            "length_m": cell.blended.length,
            "duration_s": self.reference_time,
            "corners": len(cell.segments) - 1,
        }
        return observe_blend(self.simulation), info

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Run one control period.

        Raises:
            ActionError: The action is not one finite number, the episode is over, or the environment is closed.
        """
        self._check_running()
        simulation = self.simulation
        simulation.step(np.array([read_action(action, self.cell.arm.name)]))
        arrived = simulation.arrival == simulation.arrival  # not nan
        until = simulation.arrival if arrived else simulation.time
        reference, length = self.reference_time, simulation.cell.blended.length
        elapsed, limits = until - self._charged, simulation.cell.limits
        longest = self._limit + self.cell.control_period  # it ends with the period in which it runs out
        terms = {
            "progress": progress_reward(simulation.s - self._before, length),
            "time": time_reward(elapsed, reference),
            "line_speed": deviation_reward(simulation.speed_deviation / limits.speed, elapsed, reference),
            "contour_error": deviation_reward(
                simulation.mean_contour_error / simulation.cell.contour_error_max, elapsed, reference
            ),
            "left": leaving_reward(longest, reference) if simulation.left else 0.0,
        }
        self._before, self._charged = simulation.s, until
        terminated = arrived or simulation.left
        truncated = not terminated and simulation.time >= self._limit - 1e-9
        info: dict[str, Any] = {
            "s_m": simulation.s,
            "time_s": simulation.time,
            "override": simulation.feed.override,
            "tip_speed_m_s": simulation.tip_speed,
            "contour_error_m": simulation.contour_error,
            "lag_m": simulation.lag,
            "reward_terms": terms,
        }
        if terminated or truncated:
            info["is_success"] = arrived and not simulation.left
            info["left"] = simulation.left
            if arrived:
                info["arrival_s"] = simulation.arrival
            self._running = False
        if self.render_mode == "human":
            self.render()
        return observe_blend(simulation), float(sum(terms.values())), terminated, truncated, info
