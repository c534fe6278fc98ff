"""One arm learns to yield: the same world with one learning arm and scripted others, as a Gymnasium environment."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, final

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from armtempo.arrays import Floats32
from armtempo.envs.bodies import Physics, Renderer, check_render_mode, render_modes
from armtempo.envs.common import action_space, observation_space, read_action
from armtempo.envs.coordination._episode import Episode
from armtempo.envs.coordination.shield import EpisodeShield, plan_of
from armtempo.envs.coordination.world import (
    COORDINATION_ENTRIES,
    CoordinationSimulation,
    CoordinationTrace,
    Disturbance,
    Range,
    as_range,
)
from armtempo.errors import ActionError, InputError, UnknownNameError
from armtempo.planners import METHODS, CoordinationCell, Execution, execution_of, schedule
from armtempo.planners.cells import as_cell
from armtempo.planners.topp import Mode


@final
class YieldingEnv(gymnasium.Env[Floats32, Floats32]):
    """One arm learns when to yield to the others, which follow a baseline (``armtempo/Yielding-v0``).

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

    **Start**: all arms at rest at the start of their paths (or at ``start_phase``); the first is late by
    ``master_late_s``, if a range is given drawn anew for every episode.

    **End**: *terminated* on arrival of the learning arm, and on a violation of ``d_min``; *truncated* at five times the
    sequential time. Arrival and violation as in ``CoordinationEnv``.

    Args:
        cell: Name of a bundled cell, a cell file, or a built ``CoordinationCell``.
        learner: Name of the learning arm; None: the last one.
        others: What the other arms do: ``phase-plane`` (minimum time, whatever the rest does), ``vci`` or another
            planning method, executed by precedence, or an ``Execution`` of your own. None: ``phase-plane`` for one
            other arm, ``vci`` for more, which would run into each other. The learner has its part in these plans; it is
            free to keep to it or not.
        physics: ``bullet`` or ``ideal``.
        mode: ``speed`` or ``acceleration``.
        render_mode: ``rgb_array`` (works without a display), ``human`` or None.
        master_late_s: How long the first arm stands at its start [s]: a number, or (lowest, highest).
        max_episode_s: Time limit [s] instead of five sequential times.
        record: Keep a ``CoordinationTrace``.
        disturbance: What goes wrong with arms, drawn for every episode: ``late``, ``slow``, ``stop-and-go`` or ``any``
            (of the first arm), or a ``Disturbance``; none: None.
        observation_noise: Standard deviation of normal noise on the entries, but for ``present`` and padding.
        start_phase: Share of the path where each arm starts, at rest: a number, or (lowest, highest) to draw from.
        model_error: In ``bullet``: by what share the simulated bodies are heavier than the plans'.
        friction_error: In ``bullet``: by what share damping and dry friction of the joints are larger.
        shield: Let through only commands that can neither collide nor end in a deadlock; what it changed is in
            ``info["shield"]``. Arms at full speed then pass first everywhere: where that leads on, else make it with
            ``others="optimal"``.
        shield_tube_m: How far arms may be off their references beyond what plans keep in reserve [m].

    Version history:
        v0: first release.
    """

    metadata = {"render_modes": render_modes(), "render_fps": 25}  # noqa: RUF012 (as Gymnasium declares it)

    def __init__(
        self,
        cell: CoordinationCell | str | Path = "lee1991",
        *,
        learner: str | None = None,
        others: str | Execution | None = None,
        physics: Physics = "bullet",
        mode: Mode = "speed",
        render_mode: str | None = None,
        master_late_s: float | tuple[float, float] = 0.0,
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
        as_range(master_late_s, "master_late_s", math.inf)
        self.cell = as_cell(cell, CoordinationCell)
        self._own = learner_of(self.cell, learner)
        self.render_mode = render_mode
        self._episode = Episode(
            self.cell, physics=physics, mode=mode, record=record, max_episode_s=max_episode_s,
            disturbance=disturbance, observation_noise=observation_noise, start_phase=start_phase,
            master_late_s=master_late_s, model_error=model_error, friction_error=friction_error,
        )  # fmt: skip
        self.observation_space: Box = observation_space(COORDINATION_ENTRIES)  # type: ignore[assignment]
        self.action_space: Box = action_space()  # type: ignore[assignment]
        self._renderer: Renderer | None = None
        self._running = self._closed = False
        self._full_speed = np.ones(len(self.cell.arms))
        self._others: Execution | None
        if others is None or isinstance(others, str):
            self._others = next(iter(others_of(self.cell, others, mode, 1)), None)
        else:
            self._others = others
        self._shield = self.make_shield(shield_tube_m) if shield else None

    @property
    def simulation(self) -> CoordinationSimulation:
        """The world below: positions, speeds, time."""
        return self._episode.simulation

    @property
    def learner(self) -> int:
        """Number of the learning arm."""
        return self._own

    def make_shield(self, tube_m: float = 0.0) -> EpisodeShield:
        """A shield for the learning arm among these others; raises as ``Shield.reset`` and ``plan_of``."""
        scripted = [i for i in range(len(self.cell.arms)) if i != self._own]
        return EpisodeShield(self.simulation, scripted=scripted, plan=plan_of(self.cell, self._others), tube_m=tube_m)

    @property
    def trace(self) -> CoordinationTrace:
        """What happened since the reset; needs ``record=True``."""
        return self.simulation.trace()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Put all arms at the start of their paths; ``options`` may give ``master_late_s`` for this episode."""
        if self._closed:
            raise InputError("the environment is closed", remedy="make a new one")
        super().reset(seed=seed)
        drawn = self._episode.reset(self.np_random, seed is not None, options, self._shield)
        if self._others is not None:
            self._others.reset()
        self._running = True
        if self.render_mode == "human":
            self.render()
        return self.simulation.observe()[self._own], {
            "master_late_s": drawn["late_s"][0],
            "disturbance": drawn,
        }

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Run one control period.

        Raises:
            ActionError: The action is not one finite number, the episode is over, or the environment is closed.
        """
        if self._closed:
            raise ActionError("the environment is closed", remedy="make a new one")
        if not self._running:
            raise ActionError("the episode is over", remedy="call reset before step")
        if self._others is None:
            commands = self._full_speed.copy()
        else:
            commands = self._others.commands(self.simulation.lam, self.simulation.mu)
        commands[self._own] = read_action(action, self.cell.arms[self._own].name)
        if self._shield is not None:
            commands = self._shield.commands(commands)
        self._episode.step(commands)
        reward, terminated, truncated, info = self._episode.outcome(self._own)
        self._running = not (terminated or truncated)
        if self._shield is not None:
            self._shield.report(self._own, info, not self._running)
        if self.render_mode == "human":
            self.render()
        return self.simulation.observe()[self._own], reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = Renderer(self.cell, self.render_mode)
        return self._renderer.render(self.simulation.joint_positions())

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._closed = True
        self.simulation.close()
        if self._renderer is not None:
            self._renderer.close()


def learner_of(cell: CoordinationCell, learner: str | None) -> int:
    """The number of the learning arm; None: the last one.

    Raises:
        UnknownNameError: The cell has no such arm.
    """
    names = [arm.name for arm in cell.arms]
    if learner is not None and learner not in names:
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
        plan = schedule(cell, name)
        return [execution_of(plan, mode) for _ in range(count)]
    raise UnknownNameError("baseline for the other arms", name, ("phase-plane", *METHODS))
