"""What the environments of one agent share: Gymnasium's reset, step, render and close; a kind says what is in them."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Generic, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats32
from armtempo.envs.bodies import Renderer, Simulation, Trace
from armtempo.envs.common._lifecycle import Lifecycle
from armtempo.envs.common._options import read_seed
from armtempo.envs.common._saved import SavedEnv
from armtempo.planners import Cell

SimulationT = TypeVar("SimulationT", bound=Simulation[Cell, Trace[Any]])


class SingleAgentEnv(SavedEnv, gymnasium.Env[Floats32, Floats32], Generic[SimulationT]):
    """The part of an environment of one agent that does not depend on its task; a subclass makes ``simulation``."""

    changing: ClassVar[tuple[str, ...]] = ("np_random", "_np_random_seed", "simulation", "_life")
    reset_options: ClassVar[tuple[str, ...]]
    """Names of what ``reset`` may be given for one episode."""

    simulation: SimulationT
    """The world below: positions, speeds, time."""

    def __init__(self, render_mode: str | None) -> None:
        self._life = Lifecycle(render_mode)
        self.render_mode = render_mode

    @abstractmethod
    def _begin(self, options: Mapping[str, Any], seeded: bool) -> tuple[Floats32, dict[str, Any]]:
        """Start an episode with these options; ``seeded``: ``np_random`` is new. Returns observation and info."""

    @abstractmethod
    def _run(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """One control period; what ``step`` returns."""

    def _draw_extras(self, renderer: Renderer) -> None:
        """What a task shows beside arms and paths."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Floats32, dict[str, Any]]:
        """Begin an episode; the one before is over, also if this raises.

        Args:
            seed: Of all draws from now on.
            options: For this episode; the environment's docstring names its reset options.

        Raises:
            UnknownNameError: No such option, or a name as a value that does not exist.
            InputError: The seed is none, ``options`` no mapping, a value cannot be used, or the environment is closed.
            ArmtempoError: What the cell's kind has to say of an option.
        """
        given = self._life.begin(options, self.reset_options)
        super().reset(seed=read_seed(seed))
        observation, info = self._begin(given, seed is not None)
        self._life.start()
        if self.render_mode == "human":
            self.render()
        return observation, info

    def step(self, action: Floats32) -> tuple[Floats32, float, bool, bool, dict[str, Any]]:
        """Run one control period.

        Raises:
            ActionError: The action is not as many finite numbers as the space has (nothing has moved then), the episode
                is over, or the environment is closed.
        """
        self._life.check_running()
        observation, reward, terminated, truncated, info = self._run(action)
        self._life.running = not (terminated or truncated)
        if self.render_mode == "human":
            self.render()
        return observation, reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode.

        Raises:
            RenderError: The environment is closed, or ``human`` without a display.
        """
        return self._life.render(self.simulation, self._draw_extras)

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._life.close()
        self.simulation.close()
