"""What the environments of one arm share: arguments, resets and steps out of turn, pictures, the end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from armtempo.arrays import Floats, Floats32
from armtempo.envs.bodies import Renderer, check_render_mode
from armtempo.envs.common._options import check_names, check_time_limit
from armtempo.errors import ActionError, InputError, RenderError
from armtempo.planners import BlendCell, IKCell


class _Simulation(Protocol):
    """What is asked of a simulation here."""

    @property
    def cell(self) -> BlendCell | IKCell: ...

    def joint_positions(self) -> Floats: ...

    def close(self) -> None: ...


Simulated = TypeVar("Simulated", bound=_Simulation)


class SingleArmEnv(gymnasium.Env[Floats32, Floats32], Generic[Simulated]):
    """The part of an environment of one arm that does not depend on its task; subclasses make ``simulation``."""

    simulation: Simulated

    def __init__(self, render_mode: str | None, max_episode_s: float | None) -> None:
        check_render_mode(render_mode)
        check_time_limit(max_episode_s)
        self.render_mode = render_mode
        self._max_episode = max_episode_s
        self._renderer: Renderer | None = None
        self._drawn: BlendCell | IKCell | None = None  # by the renderer
        self._running = self._closed = False

    def _begin(self, options: dict[str, Any] | None, known: Sequence[str]) -> Mapping[str, Any]:
        """The options of a reset; the episode before is over, whatever comes."""
        self._running = False  # until all has gone well
        if self._closed:
            raise InputError("the environment is closed", remedy="make a new one")
        given = {} if options is None else options
        if not isinstance(given, Mapping):
            raise InputError(f"options must map names to values, got {given!r}", remedy=f"known: {', '.join(known)}")
        check_names(*(("reset option", name, known) for name in given))
        return given

    def _check_running(self) -> None:
        if self._closed:
            raise ActionError("the environment is closed", remedy="make a new one")
        if not self._running:
            raise ActionError("the episode is over", remedy="call reset before step")

    def _draw_extras(self, renderer: Renderer) -> None:
        """What a task shows beside the arm and its path."""

    def render(self) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode."""
        if self.render_mode is None:
            return None
        if self._closed:
            raise RenderError("the environment is closed", remedy="make a new one", mode=self.render_mode)
        cell = self.simulation.cell
        if self._renderer is None:
            self._renderer = Renderer(cell, self.render_mode)
        elif self._drawn is not cell:  # the same arm on another path
            self._renderer.show(cell)
        self._drawn = cell
        self._draw_extras(self._renderer)
        return self._renderer.render(self.simulation.joint_positions())

    def close(self) -> None:
        """Leave PyBullet; may be called twice."""
        self._closed = True
        self.simulation.close()
        if self._renderer is not None:
            self._renderer.close()
