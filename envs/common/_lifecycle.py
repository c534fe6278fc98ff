"""The life of an environment: made, reset, stepped, drawn, closed; the same for Gymnasium's and for PettingZoo's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from armtempo.envs.bodies import Renderer, Simulation, Trace, check_render_mode
from armtempo.envs.common._options import check_names
from armtempo.errors import ActionError, InputError, RenderError, brief
from armtempo.planners import Cell
from armtempo.state import Stateful


@final
class Lifecycle(Stateful):
    """Whether an environment is open, whether an episode is on, and its pictures.

    Args:
        render_mode: ``rgb_array``, ``human`` or None.

    Attributes:
        render_mode: As given.
        running: Whether an episode is on. The environment clears it when one ends.
        begun: Whether there was a reset that went well.
        closed: Whether ``close`` was called.

    Raises:
        RenderError: There is no such mode.
    """

    changing = ("running", "begun")

    def __init__(self, render_mode: str | None) -> None:
        check_render_mode(render_mode)
        self.render_mode = render_mode
        self.running = self.begun = self.closed = False
        self._renderer: Renderer | None = None
        self._drawn: Cell | None = None  # by the renderer

    def begin(self, options: object, known: Sequence[str], ignored: Sequence[str] = ()) -> Mapping[str, Any]:
        """The options of a reset; the episode before is over, whatever comes.

        Args:
            options: What ``reset`` was given; None: nothing.
            known: Names of options that the environment has.
            ignored: Names that it does not have and lets pass.

        Raises:
            InputError: The environment is closed, or ``options`` is no mapping.
            UnknownNameError: There is no such option.
        """
        self.running = False
        self.check_open()
        given = {} if options is None else options
        if not isinstance(given, Mapping):
            raise InputError(
                f"options must map names to values, got {brief(given)}", remedy=f"known: {', '.join(known)}"
            )
        check_names(*(("reset option", name, known) for name in given if name not in ignored))
        return given

    def start(self) -> None:
        """A reset has gone well."""
        self.running = self.begun = True

    def check_open(self) -> None:
        """Raise InputError if it is closed."""
        if self.closed:
            raise InputError("the environment is closed", remedy="make a new one")

    def check_running(self) -> None:
        """Raise ActionError for a step out of turn."""
        if self.closed:
            raise ActionError("the environment is closed", remedy="make a new one")
        if not self.running:
            raise ActionError("the episode is over", remedy="call reset before step")

    def render(
        self, simulation: Simulation[Cell, Trace[Any]], extras: Callable[[Renderer], None] | None = None
    ) -> NDArray[np.uint8] | None:
        """An image (480, 640, 3) uint8 in ``rgb_array``; draws the window in ``human``; nothing without a mode.

        Args:
            simulation: Where the arms are.
            extras: Puts what a task shows beside arms and paths into place.

        Raises:
            RenderError: The environment is closed, or ``human`` without a display.
        """
        if self.render_mode is None:
            return None
        if self.closed:
            raise RenderError("the environment is closed", remedy="make a new one", mode=self.render_mode)
        if self._renderer is None:
            self._renderer = Renderer(simulation.cell, self.render_mode)
        elif self._drawn is not simulation.cell:  # the same arms on other paths
            self._renderer.show(simulation.cell)
        self._drawn = simulation.cell
        if extras is not None:
            extras(self._renderer)
        return self._renderer.render(simulation.joint_positions())

    def __getstate__(self) -> dict[str, Any]:
        """Without pictures: a copy draws its own when it is asked to, and opens no window of itself."""
        mode = None if self.render_mode == "human" else self.render_mode
        return {**self.__dict__, "render_mode": mode, "_renderer": None, "_drawn": None}

    def close(self) -> None:
        """Close window and renderer; may be called twice."""
        self.closed = True
        if self._renderer is not None:
            self._renderer.close()
