"""One arm learns to yield: the same world with one learning arm and scripted others, as a Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Unpack, final

import numpy as np
from gymnasium.spaces import Box, Space

from armtempo.arrays import Floats32
from armtempo.envs.bodies import render_modes
from armtempo.envs.common import SingleAgentEnv, action_space, observation_space, options_of, read_command
from armtempo.envs.coordination._episode import RESET_OPTIONS, Episode, times_of
from armtempo.envs.coordination.graph import GraphView, graph_space
from armtempo.envs.coordination.shield import EpisodeShield, plan_of
from armtempo.envs.coordination.world import (
    COORDINATION_ENTRIES,
    CoordinationKeywords,
    CoordinationOptions,
    CoordinationSimulation,
    CoordinationTrace,
    with_auto_reserve,
)
from armtempo.errors import InputError, UnknownNameError, brief
from armtempo.planners import METHODS, CoordinationCell, Execution, execution_of, schedule
from armtempo.planners.cells import as_cell
from armtempo.planners.topp import Mode
from armtempo.state import State


@final
class YieldingEnv(SingleAgentEnv[CoordinationSimulation]):
    """One arm learns when to yield to the others, which follow a baseline (``armtempo/Yielding-v0``).

    **Action**, Box(-1, 1, (1,), float32), for one control period. It can neither break a torque limit nor make the
    end of the path unreachable. With ``f = (a + 1) / 2``:

    - ``speed`` (default): head for ``f mu*`` as fast as the torque limits allow, where ``mu*`` is the highest path
      speed from which the end can still be met. 1 is the minimum-time motion, -1 maximum braking.
    - ``acceleration``: ``mu_dot = low + f (high - low)``, the admissible accelerations.

    With ``action="speed+priority"`` (under the shield) an action is (2,), as in ``CoordinationEnv``: so that agents for
    all arms run here, too. The others are not changed by the shield, they pass first where they want to: here the
    second number has no effect.

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

    **Start**: all arms at rest at the start of their paths (or at ``start_phase``); the first is late by
    ``master_late_s``, if a range is given drawn anew for every episode.

    **End**: *terminated* on arrival of the learning arm, and on a violation of ``d_min``; *truncated* at five times the
    sequential time. Arrival and violation as in ``CoordinationEnv``.

    **Reset options**, for this episode: ``master_late_s``, a number.

    Args:
        cell: Name of a bundled cell, a cell file, or a built ``CoordinationCell``.
        learner: Name of the learning arm; None: the last one.
        others: What the other arms do: ``phase-plane`` (minimum time, whatever the rest does), ``vci`` or another
            planning method, executed by precedence, or an ``Execution`` of your own. None: ``phase-plane`` for one
            other arm, ``vci`` for more, which would run into each other. The learner has its part in these plans; it is
            free to keep to it or not. Under the shield arms at full speed pass first everywhere: where that does not
            lead on, give ``optimal``.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        record: Keep a ``CoordinationTrace``.
        options: ``CoordinationOptions`` by keyword: ``physics``, ``mode``, ``action``, ``observation``, ``orders``,
            ``disturbance``, ``observation_noise``, ``start_phase``, ``master_late_s``, ``model_error``,
            ``friction_error``, ``shield``, ``shield_tube_m``, ``max_episode_s``.

    Attributes:
        options: The ``CoordinationOptions``.
        shield: The ``EpisodeShield``; None without.

    Raises:
        UnknownNameError: No such cell, arm, option, or name as an option's value.
        InputError: An option's value that an episode cannot have, or a cell of another kind.
        RenderError: No such render mode.
        InfeasibleError: Under the shield, the learning arm cannot arrive behind the others.

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)
    reset_options: ClassVar[tuple[str, ...]] = RESET_OPTIONS

    changing = ("np_random", "_np_random_seed", "_episode", "_others", "shield", "_life")

    def __init__(
        self,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        learner: str | None = None,
        others: str | Execution | None = None,
        render_mode: str | None = None,
        record: bool = False,
        **options: Unpack[CoordinationKeywords],
    ) -> None:
        super().__init__(render_mode)
        self.options = options_of(CoordinationOptions, options, YieldingEnv)
        self.cell = with_auto_reserve(as_cell(cell, CoordinationCell), self.options)
        self._own = learner_of(self.cell, learner)
        self._episode = Episode(self.cell, self.options, record=record)
        self.simulation = self._episode.simulation
        self.action_space: Box = action_space(self.options.action_size)  # type: ignore[assignment]
        self._full_speed = np.ones(len(self.cell.arms))
        self._others: Execution | None
        if others is None or isinstance(others, str):
            self._others = next(iter(others_of(self.cell, others, self.options.mode, 1)), None)
        elif callable(getattr(others, "reset", None)) and callable(getattr(others, "commands", None)):
            self._others = others
        else:
            raise InputError(f"others is {brief(others)}", remedy="give a name, or an Execution")
        self.shield = self.make_shield(self.options.shield_tube_m) if self.options.shield else None
        self._graph = None
        self.observation_space: Space[Any] = observation_space(COORDINATION_ENTRIES)
        if self.shield is not None and self.options.observation == "graph":
            self._graph, self.observation_space = GraphView(self.cell, self.shield.keeper), graph_space()

    @property
    def learner(self) -> int:
        """Number of the learning arm."""
        return self._own

    def make_shield(self, tube_m: float = 0.0) -> EpisodeShield:
        """A shield for the learning arm among these others; raises as ``Shield.reset`` and ``plan_of``."""
        scripted = [i for i in range(len(self.cell.arms)) if i != self._own]
        return EpisodeShield(self.simulation, scripted=scripted, plan=plan_of(self._others), tube_m=tube_m)

    def made_of(self) -> State:
        """The cell's name and times, the options, who learns and what the others do."""
        others = type(self._others).__name__
        return {**super().made_of(), **times_of(self.cell), "learner": self._own, "others_by": others}

    @property
    def trace(self) -> CoordinationTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def _begin(self, options: Mapping[str, Any], seeded: bool) -> tuple[Any, dict[str, Any]]:
        """All arms at the start of their paths, or where they are drawn.

        Raises:
            InfeasibleError: As ``Episode.reset``.
        """
        drawn = self._episode.reset(self.np_random, seeded, options, self.shield)
        if self._others is not None:
            self._others.reset()
        return self._observe(), {
            "master_late_s": drawn["late_s"][0],
            "disturbance": drawn,
        }

    def _observe(self) -> Any:
        """What the learning arm sees now; new arrays."""
        if self._graph is None or self.shield is None:
            return self.simulation.observe()[self._own]
        self._graph.show(self.shield)
        return self._graph.seen_by(self._own)

    def _run(self, action: Floats32) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        command, _ = read_command(action, self.options.action_size, self.cell.arms[self._own].name)
        if self._others is None:
            commands = self._full_speed.copy()
        else:
            commands = self._others.commands(self.simulation.lam, self.simulation.mu)
        commands[self._own] = command
        if self.shield is not None:
            commands = self.shield.commands(commands)
        self._episode.step(commands)
        if self.shield is not None:
            self.shield.look()
        reward, terminated, truncated, info = self._episode.outcome(self._own)
        if self.shield is not None:
            self.shield.report(self._own, info, terminated or truncated)
        return self._observe(), reward, terminated, truncated, info


def learner_of(cell: CoordinationCell, learner: str | None) -> int:
    """The number of the learning arm; None: the last one.

    Raises:
        UnknownNameError: The cell has no such arm.
    """
    names = [arm.name for arm in cell.arms]
    if learner is not None and not (isinstance(learner, str) and learner in names):
        raise UnknownNameError("arm", learner, names)
    return len(names) - 1 if learner is None else names.index(learner)


def others_of(cell: CoordinationCell, others: str | None, mode: Mode, count: int) -> list[Execution]:
    """What the other arms do in so many episodes, each its own; none: full speed.

    Raises:
        UnknownNameError: There is no such baseline.
    """
    name = others or ("phase-plane" if len(cell.arms) < 3 else "vci")
    if name == "phase-plane":
        return []
    if name in METHODS:
        plan = schedule(cell, name, order="file")
        return [execution_of(plan, mode) for _ in range(count)]
    raise UnknownNameError("baseline for the other arms", name, ("phase-plane", *METHODS))
