"""An arm follows a path with blended corners; the agent overrides its feed rate."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Unpack, final

import numpy as np
from gymnasium.spaces import Box

from armtempo.arrays import Floats32
from armtempo.envs.blend._observation import BLEND_ENTRIES, observe_blend
from armtempo.envs.blend._options import BlendKeywords, BlendOptions
from armtempo.envs.blend._simulation import BlendSimulation, BlendTrace
from armtempo.envs.bodies import render_modes
from armtempo.envs.common import (
    TIME_LIMIT,
    SingleAgentEnv,
    action_space,
    deviation_reward,
    leaving_reward,
    observation_space,
    options_of,
    progress_reward,
    read_action,
    time_reward,
)
from armtempo.planners import BlendCell
from armtempo.planners.cells import as_cell, draw_path


@final
class BlendTrackingEnv(SingleAgentEnv[BlendSimulation]):
    """An arm follows a path of lines and arcs with blended corners (``armtempo/BlendTracking-v0``; Lee2006).

    **Action**, Box(-1, 1, (1,), float32), for one control period: the feed-rate override, ``f = (a + 1) / 2``.
    1 runs the line-speed profile as planned, 0 stops on the path. What is asked for is followed smoothly, as quickly as
    the profile's limits allow, so that no action breaks them. They are those of the tip along its path (and across it
    for ``limit-aware``); what this asks of the joints is for the agent to see.

    **Observation**, Box, (15,) float32, the same for every cell:

    =====  ==============================  =======  ====================================================================
    index  name                            range    meaning
    =====  ==============================  =======  ====================================================================
    0      progress                        [-1, 1]  length that the reference has travelled, start -1, end 1
    1      speed                           [-1, 1]  speed of the reference as a share of the line speed, 0 is -1
    2      tip_speed                       [-1, 1]  speed of the tip as a share of the line speed, 0 is -1
    3      acceleration                    [-1, 1]  acceleration of the reference as a share of its limit
    4      override                        [-1, 1]  feed-rate override now, 0 is -1
    5      curvature_0                     [-1, 1]  x / (1 + x), 0 is -1, x: normal acceleration at line speed 0 braking
                                                    distances ahead / limit
    6      curvature_1                     [-1, 1]  x / (1 + x), 0 is -1, x: normal acceleration at line speed 0.5
                                                    braking distances ahead / limit
    7      curvature_2                     [-1, 1]  x / (1 + x), 0 is -1, x: normal acceleration at line speed 1 braking
                                                    distances ahead / limit
    8      curvature_3                     [-1, 1]  x / (1 + x), 0 is -1, x: normal acceleration at line speed 2 braking
                                                    distances ahead / limit
    9      contour_error                   [-1, 1]  distance of the tip from the path as a share of what is allowed, 0
                                                    is -1
    10     lag                             [-1, 1]  how far the tip is behind its reference along the path, in units of
                                                    the same
    11     torque_use                      [-1, 1]  largest torque asked for as a share of its limit, 0 is -1
    12     joint_speed_use                 [-1, 1]  largest joint speed as a share of its limit, 0 is -1
    13     normal_use                      [-1, 1]  normal acceleration of the reference as a share of its limit, 0 is
                                                    -1
    14     time_to_go                      [-1, 1]  what the profile still takes at full rate, as a share of its
                                                    duration; none is -1
    =====  ==============================  =======  ====================================================================

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
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        record: Keep a ``BlendTrace``.
        options: ``BlendOptions`` by keyword: ``physics``, ``profile``, ``mapping``, ``family``, ``model_error``,
            ``max_episode_s``.

    Attributes:
        options: The ``BlendOptions``.

    Raises:
        UnknownNameError: No such cell, option, or name as an option's value.
        InputError: An option's value that an episode cannot have, or a cell of another kind.
        RenderError: No such render mode.

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)
    reset_options: ClassVar[tuple[str, ...]] = ("family", "curve", "shape_factor", "remaining_distance_m")

    changing: ClassVar[tuple[str, ...]] = (*SingleAgentEnv.changing, "_limit", "_charged", "_before")

    def __init__(
        self,
        cell: BlendCell | str | Path = "lee2006",
        *,
        render_mode: str | None = None,
        record: bool = False,
        **options: Unpack[BlendKeywords],
    ) -> None:
        super().__init__(render_mode)
        self.options = options_of(BlendOptions, options, BlendTrackingEnv)
        self.cell = as_cell(cell, BlendCell)
        self.simulation = BlendSimulation(self.cell, self.options, record=record)
        self._limit, self._charged, self._before = np.inf, 0.0, 0.0
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

    def _begin(self, options: Mapping[str, Any], seeded: bool) -> tuple[Floats32, dict[str, Any]]:
        """At the start of the path, a new one unless ``family`` is ``given``.

        Raises:
            UnknownNameError: No such family.
            ConfigError: An option that a cell file could not have.
            PathError: The corners cannot be blended so, or no path of the family can be followed.
        """
        cell = draw_path(
            self.cell,
            options.get("family", self.options.family),
            self.np_random,
            remaining_distance=options.get("remaining_distance_m"),
            shape_factor=options.get("shape_factor"),
            curve=options.get("curve"),
        )
        self.simulation.reset(cell)
        longest = self.options.max_episode_s
        self._limit = TIME_LIMIT * self.reference_time if longest is None else longest
        self._charged = self._before = 0.0
        info = {
            "length_m": cell.blended.length,
            "duration_s": self.reference_time,
            "corners": len(cell.segments) - 1,
        }
        return observe_blend(self.simulation), info

    def _run(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
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
        return observe_blend(simulation), float(sum(terms.values())), terminated, truncated, info
