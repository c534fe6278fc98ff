"""Several arms move along given paths; each agent decides how fast its own arm goes."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Unpack, final

import numpy as np
from gymnasium.spaces import Box, Space
from gymnasium.utils import seeding
from numpy.typing import NDArray
from pettingzoo import ParallelEnv

from armtempo.arrays import Floats32
from armtempo.envs.bodies import render_modes
from armtempo.envs.common import (
    Lifecycle,
    SavedEnv,
    action_space,
    observation_space,
    options_of,
    read_command,
    read_seed,
)
from armtempo.envs.coordination._episode import RESET_OPTIONS, Episode, agent_names, times_of
from armtempo.envs.coordination.graph import GraphView, graph_space
from armtempo.envs.coordination.shield import EpisodeShield
from armtempo.envs.coordination.world import (
    COORDINATION_ENTRIES,
    CoordinationKeywords,
    CoordinationOptions,
    CoordinationSimulation,
    CoordinationTrace,
    with_auto_reserve,
)
from armtempo.errors import ActionError, brief
from armtempo.planners import CoordinationCell
from armtempo.planners.cells import as_cell
from armtempo.state import State

CHECKERS_OPTION = "options"  # PettingZoo's checkers reset every environment with an option of this name


@final
class CoordinationEnv(SavedEnv, ParallelEnv[str, Any, Floats32]):  # type: ignore[misc]  # untyped library
    """Arms on given paths in one workspace, one agent per arm (``arm_0``, ``arm_1``, ... in priority order).

    **Action**, Box(-1, 1, (1,), float32), for one control period. It can neither break a torque limit nor make the
    end of the path unreachable. With ``f = (a + 1) / 2``:

    - ``speed`` (default): head for ``f mu*`` as fast as the torque limits allow, where ``mu*`` is the highest path
      speed from which the end can still be met. 1 is the minimum-time motion, -1 maximum braking.
    - ``acceleration``: ``mu_dot = low + f (high - low)``, the admissible accelerations.

    With ``action="speed+priority"`` (under the shield) an action is (2,): the same number, and a *priority* in [-1, 1],
    held until the next action, at first 0. Wherever two arms may still pass either way (nobody has entered, who would
    wait can stop in time, all arrive in the end) the higher number passes first; of equal ones whoever is first, which
    the speeds decide as they do without priorities. ``info["shield"]["orders"]`` tells who passes first now.

    **Observation**, Box, (21,) float32, the same for every cell:

    =====  ==============================  =======  ====================================================================
    index  name                            range    meaning
    =====  ==============================  =======  ====================================================================
    0      progress                        [-1, 1]  position on the own path, start -1, end 1
    1      speed                           [-1, 1]  mu as a share of mu*, the highest speed from which the end can be
                                                    met; 0 is -1
    2      lowest_acceleration             [-1, 1]  LB as a share of 8 length / T^2 (T: minimum time)
    3      highest_acceleration            [-1, 1]  UB as a share of the same
    4      time_to_go                      [-1, 1]  what the minimum-time motion still takes from here as a share of T;
                                                    none is -1
    5      other_0.present                 [0, 1]   1 if the slot holds an arm
    6      other_0.distance                [-1, 1]  way to the next collision region with it, as a share of the own
                                                    path; none ahead is 1
    7      other_0.release                 [-1, 1]  way it has still to go until that region is released, as a share of
                                                    its path; 0 is -1
    8      other_0.progress                [-1, 1]  its position on its path, start -1, end 1
    9      other_0.speed                   [-1, 1]  its mu as a share of its mu*; 0 is -1
    10     other_0.time_to_go              [-1, 1]  what its minimum-time motion still takes as a share of its T; none
                                                    is -1
    11     other_0.wait                    [-1, 1]  how long to wait so that the minimum-time motion from here passes
                                                    behind its one from where it is, as a share of T; 0 and less: no
                                                    need; no region ahead is -1
    12     other_0.lead                    [-1, 1]  the same of it behind this arm, as a share of its T
    13     other_1.present                 [0, 1]   1 if the slot holds an arm
    14     other_1.distance                [-1, 1]  way to the next collision region with it, as a share of the own
                                                    path; none ahead is 1
    15     other_1.release                 [-1, 1]  way it has still to go until that region is released, as a share of
                                                    its path; 0 is -1
    16     other_1.progress                [-1, 1]  its position on its path, start -1, end 1
    17     other_1.speed                   [-1, 1]  its mu as a share of its mu*; 0 is -1
    18     other_1.time_to_go              [-1, 1]  what its minimum-time motion still takes as a share of its T; none
                                                    is -1
    19     other_1.wait                    [-1, 1]  how long to wait so that the minimum-time motion from here passes
                                                    behind its one from where it is, as a share of T; 0 and less: no
                                                    need; no region ahead is -1
    20     other_1.lead                    [-1, 1]  the same of it behind this arm, as a share of its T
    =====  ==============================  =======  ====================================================================

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

    **Reset options**, for this episode: ``master_late_s``, a number.

    Args:
        cell: Name of a bundled cell, a cell file, or a built ``CoordinationCell``.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        record: Keep a ``CoordinationTrace``.
        options: ``CoordinationOptions`` by keyword: ``physics``, ``mode``, ``action``, ``observation``, ``orders``,
            ``disturbance``, ``observation_noise``, ``start_phase``, ``master_late_s``, ``model_error``,
            ``friction_error``, ``shield``, ``shield_tube_m``, ``max_episode_s``.

    Attributes:
        options: The ``CoordinationOptions``.
        shield: The ``EpisodeShield``, which takes orders of passing (``ask``); None without.

    Raises:
        UnknownNameError: No such cell, option, or name as an option's value.
        InputError: An option's value that an episode cannot have, or a cell of another kind.
        RenderError: No such render mode.
        InfeasibleError: Under the shield, no passing order leads all arms to their ends.

    Version history:
        v0: first release.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "coordination_v0",
        "render_modes": render_modes(),
        "render_fps": 25,
        "is_parallelizable": True,
    }

    changing = ("np_random", "np_random_seed", "_episode", "shield", "_life", "agents")

    def __init__(
        self,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        render_mode: str | None = None,
        record: bool = False,
        **options: Unpack[CoordinationKeywords],
    ) -> None:
        self._life = Lifecycle(render_mode)
        self.render_mode = render_mode
        self.options = options_of(CoordinationOptions, options, CoordinationEnv)
        self.cell = with_auto_reserve(as_cell(cell, CoordinationCell), self.options)
        self._episode = Episode(self.cell, self.options, record=record)
        shield, tube_m = self.options.shield, self.options.shield_tube_m
        self.shield = EpisodeShield(self.simulation, tube_m=tube_m) if shield else None
        self._graph = None
        if self.shield is not None and self.options.observation == "graph":
            self._graph = GraphView(self.cell, self.shield.keeper)
        self.possible_agents = agent_names(self.cell.arms)
        self.agents: list[str] = []
        self._full_speed = np.ones(len(self.possible_agents))
        seen = observation_space(COORDINATION_ENTRIES) if self._graph is None else graph_space()
        self.observation_spaces: dict[str, Space[Any]] = dict.fromkeys(self.possible_agents, seen)
        self.action_spaces = {agent: action_space(self.options.action_size) for agent in self.possible_agents}
        self.np_random, self.np_random_seed = seeding.np_random(None)

    def made_of(self) -> State:
        """The cell's name and times, and the options."""
        return {**super().made_of(), **times_of(self.cell)}

    @property
    def simulation(self) -> CoordinationSimulation:
        """The world below: positions, speeds, time."""
        return self._episode.simulation

    @property
    def trace(self) -> CoordinationTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def observation_space(self, agent: str) -> Space[Any]:
        """Box (21,) float32; a Dict with ``observation="graph"``."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> Box:
        """Box(-1, 1, (1,)) float32; (2,) with a priority."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """Begin an episode; the one before is over, also if this raises.

        Args:
            seed: Of all draws from now on.
            options: For this episode; the environment's docstring names its reset options.

        Raises:
            UnknownNameError: No such option.
            InputError: The seed is none, ``options`` no mapping, a value cannot be used, or the environment is closed.
            InfeasibleError: The shield finds no way on from the starts of the paths.
        """
        self.agents = []
        given = self._life.begin(options, RESET_OPTIONS, ignored=(CHECKERS_OPTION,))
        seed = read_seed(seed)
        if seed is not None:
            self.np_random, self.np_random_seed = seeding.np_random(seed)
        drawn = self._episode.reset(self.np_random, seed is not None, given, self.shield)
        self.agents = self.possible_agents[:]
        self._life.start()
        if self.render_mode == "human":
            self.render()
        rows = self._observe()
        return {agent: rows[i] for i, agent in enumerate(self.agents)}, {
            agent: {"disturbance": copy.deepcopy(drawn)} for agent in self.agents
        }

    def step(
        self, actions: dict[str, Floats32]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Run one control period. Arms that have arrived need no action.

        Raises:
            ActionError: An action is missing, of the wrong shape or not finite, the episode is over, or the
                environment is closed.
        """
        self._life.check_running()
        if not isinstance(actions, Mapping):
            raise ActionError(
                f"actions must map agents to their actions, got {brief(actions)}",
                remedy=f"give one for each of {', '.join(self.agents)}",
            )
        commands = self._full_speed.copy()  # an arm at its goal stays there
        priority = np.full(len(commands), np.nan)
        for agent in self.agents:
            if agent not in actions:
                raise ActionError(
                    f"no action for {agent}", remedy=f"give one for each of {', '.join(self.agents)}", agent=agent
                )
            i = self.possible_agents.index(agent)
            commands[i], priority[i] = read_command(actions[agent], self.options.action_size, agent)
        if self.shield is not None:
            if self.options.action_size > 1:
                self.shield.prefer(priority)
            commands = self.shield.commands(commands)
        self._episode.step(commands)
        if self.shield is not None:
            self.shield.look()
        rows = self._observe()
        observations, rewards, terminations, truncations, infos = {}, {}, {}, {}, {}
        for agent in self.agents:
            i = self.possible_agents.index(agent)
            observations[agent] = rows[i]
            rewards[agent], terminations[agent], truncations[agent], infos[agent] = self._episode.outcome(i)
            if self.shield is not None:
                self.shield.report(i, infos[agent], terminations[agent] or truncations[agent])
        self.agents = [agent for agent in self.agents if not (terminations[agent] or truncations[agent])]
        self._life.running = bool(self.agents)
        if self.render_mode == "human":
            self.render()
        return observations, rewards, terminations, truncations, infos

    def _observe(self) -> list[Any]:
        """What every arm sees now; new arrays."""
        if self._graph is None or self.shield is None:
            return [row.copy() for row in self.simulation.observe()]
        self._graph.show(self.shield)
        return [self._graph.seen_by(i) for i in range(len(self.possible_agents))]

    def render(self) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode.

        Raises:
            RenderError: The environment is closed, or ``human`` without a display.
        """
        return self._life.render(self.simulation)

    def state(self) -> Floats32:
        """All observations in one vector; of a graph what all arms see, once."""
        if self._graph is None or self.shield is None:
            return self.simulation.observe().ravel()
        self._graph.show(self.shield)
        return np.concatenate([part[0].ravel() for part in self._graph.graphs])

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._life.close()
        self.simulation.close()
