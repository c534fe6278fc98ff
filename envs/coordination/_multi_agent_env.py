"""Several arms move along given paths; each agent decides how fast its own arm goes."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from armtempo.arrays import Floats32
from armtempo.envs.bodies import Physics, Renderer, check_render_mode, render_modes
from armtempo.envs.common import action_space, observation_space, read_action
from armtempo.envs.coordination._episode import Episode, agent_names
from armtempo.envs.coordination.shield import EpisodeShield
from armtempo.envs.coordination.world import (
    COORDINATION_ENTRIES,
    CoordinationSimulation,
    CoordinationTrace,
    Disturbance,
    Range,
)
from armtempo.errors import ActionError, InputError
from armtempo.planners import CoordinationCell
from armtempo.planners.cells import as_cell
from armtempo.planners.topp import Mode


@final
class CoordinationEnv(ParallelEnv[str, Floats32, Floats32]):  # type: ignore[misc]  # untyped library
    """Arms on given paths in one workspace, one agent per arm (``arm_0``, ``arm_1``, ... in priority order).

    **Action**, Box(-1, 1, (1,), float32), for one control period. It can neither break a torque limit nor make the
    end of the path unreachable. With ``f = (a + 1) / 2``:

    - ``speed`` (default): head for ``f mu*`` as fast as the torque limits allow, where ``mu*`` is the highest path
      speed from which the end can still be met. 1 is the minimum-time motion, -1 maximum braking.
    - ``acceleration``: ``mu_dot = low + f (high - low)``, the admissible accelerations.

    **Observation**, Box, (21,) float32, the same for every cell:

    {table}

    **Clearance** is watched between the arms: by FCL at every tick in ``bullet``, in ``ideal`` from a table of such
    distances over both paths. Obstacles count when the cell is loaded: the paths are certified against them.

    **Reward**: share of the path covered, minus time in units of the sequential time (on arrival charged to its exact
    instant), minus (2 + share not covered) on a collision. The terms are in ``info["reward_terms"]``.

    **Start**: all arms at rest at the start of their paths (or at ``start_phase``); ``master_late_s`` holds the
    first one there for that time.

    **End**: an arm *terminates* when it has arrived: in ``ideal`` at (length, 0) exactly, its instant inside the
    tick; in ``bullet`` at the later of its reference's end and the first tick from which its tip stays within 1 mm of
    the goal below 10 mm/s for 20 ms. All terminate when two arms are closer than ``d_min`` at any tick. The episode
    is *truncated* at five times the sequential time.

    Args:
        cell: Name of a bundled cell, a cell file, or a built ``CoordinationCell``.
        physics: ``bullet`` or ``ideal``.
        mode: ``speed`` or ``acceleration``.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        master_late_s: How long the first arm stands before it obeys its agent [s]: a number, or (lowest, highest).
        max_episode_s: Time limit [s] instead of five sequential times.
        record: Keep a ``CoordinationTrace``.
        disturbance: What goes wrong with arms, drawn for every episode: ``late``, ``slow``, ``stop-and-go`` or ``any``
            (of the first arm), or a ``Disturbance``; none: None.
        observation_noise: Standard deviation of normal noise on the entries, but for ``present`` and padding.
        start_phase: Share of the path where each arm starts, at rest: a number, or (lowest, highest) to draw from.
        model_error: In ``bullet``: by what share the simulated bodies are heavier than the plans'.
        friction_error: In ``bullet``: by what share damping and dry friction of the joints are larger.
        shield: Let through only commands that can neither collide nor end in a deadlock; what it changed is in
            ``info["shield"]``.
        shield_tube_m: How far arms may be off their references beyond what plans keep in reserve [m].

    Version history:
        v0: first release.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "coordination_v0",
        "render_modes": render_modes(),
        "render_fps": 25,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        physics: Physics = "bullet",
        mode: Mode = "speed",
        render_mode: str | None = None,
        master_late_s: float | Range = 0.0,
        max_episode_s: float | None = None,
        record: bool = False,
        disturbance: str | Disturbance | None = None,
        observation_noise: float = 0.0,
        start_phase: float | Range = 0.0,
        model_error: float = 0.0,
        friction_error: float = 0.0,
        shield: bool = False,
        shield_tube_m: float = 0.0,
    ) -> None:
        check_render_mode(render_mode)
        self.cell = as_cell(cell, CoordinationCell)
        self.physics: Physics = physics
        self.mode: Mode = mode
        self.render_mode = render_mode
        self._episode = Episode(
            self.cell, physics=physics, mode=mode, record=record, max_episode_s=max_episode_s,
            disturbance=disturbance, observation_noise=observation_noise, start_phase=start_phase,
            master_late_s=master_late_s, model_error=model_error, friction_error=friction_error,
        )  # fmt: skip
        self._shield = EpisodeShield(self.simulation, tube_m=shield_tube_m) if shield else None
        self.possible_agents = agent_names(self.cell.arms)
        self.agents: list[str] = []
        self._full_speed = np.ones(len(self.possible_agents))
        self.observation_spaces = {agent: observation_space(COORDINATION_ENTRIES) for agent in self.possible_agents}
        self.action_spaces = {agent: action_space() for agent in self.possible_agents}
        self._renderer: Renderer | None = None
        self._closed = False
        self.np_random, self.np_random_seed = seeding.np_random(None)

    @property
    def simulation(self) -> CoordinationSimulation:
        """The world below: positions, speeds, time."""
        return self._episode.simulation

    @property
    def trace(self) -> CoordinationTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def observation_space(self, agent: str) -> Box:
        """Box (21,) float32."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Box(-1, 1, (1,)) float32."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Floats32], dict[str, dict[str, Any]]]:
        """Put all arms at the start of their paths; ``options`` may give ``master_late_s`` for this episode."""
        if self._closed:
            raise InputError("the environment is closed", remedy="make a new one")
        if seed is not None:
            self.np_random, self.np_random_seed = seeding.np_random(seed)
        drawn = self._episode.reset(self.np_random, seed is not None, options, self._shield)
        self.agents = self.possible_agents[:]
        if self.render_mode == "human":
            self.render()
        rows = self.simulation.observe()
        return {agent: rows[i] for i, agent in enumerate(self.agents)}, {
            agent: {"disturbance": copy.deepcopy(drawn)} for agent in self.agents
        }

    def step(
        self, actions: dict[str, Floats32]
    ) -> tuple[dict[str, Floats32], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Run one control period. Arms that have arrived need no action.

        Raises:
            ActionError: An action is missing, of the wrong shape or not finite, the episode is over, or the
                environment is closed.
        """
        if self._closed:
            raise ActionError("the environment is closed", remedy="make a new one")
        if not self.agents:
            raise ActionError("the episode is over", remedy="call reset before step")
        commands = self._full_speed.copy()  # an arm at its goal stays there
        for agent in self.agents:
            if agent not in actions:
                raise ActionError(
                    f"no action for {agent}", remedy=f"give one for each of {', '.join(self.agents)}", agent=agent
                )
            commands[self.possible_agents.index(agent)] = read_action(actions[agent], agent)
        if self._shield is not None:
            commands = self._shield.commands(commands)
        self._episode.step(commands)
        rows = self.simulation.observe()
        observations, rewards, terminations, truncations, infos = {}, {}, {}, {}, {}
        for agent in self.agents:
            i = self.possible_agents.index(agent)
            observations[agent] = rows[i].copy()
            rewards[agent], terminations[agent], truncations[agent], infos[agent] = self._episode.outcome(i)
            if self._shield is not None:
                self._shield.report(i, infos[agent], terminations[agent] or truncations[agent])
        self.agents = [agent for agent in self.agents if not (terminations[agent] or truncations[agent])]
        if self.render_mode == "human":
            self.render()
        return observations, rewards, terminations, truncations, infos

    def render(self) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = Renderer(self.cell, self.render_mode)
        return self._renderer.render(self.simulation.joint_positions())

    def state(self) -> Floats32:
        """All observations in one vector."""
        return self.simulation.observe().ravel()

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._closed = True
        self.simulation.close()
        if self._renderer is not None:
            self._renderer.close()
